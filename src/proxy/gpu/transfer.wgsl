// Transfer vectors: those of the receivers, or of the clamped cosine about their normals.

struct Transfer {
    //#each NEEDED| t$: f32,
}

// Coefficient k of the receiver at a place stands at k * `count` + place.
fn transfer_vector(normal: vec3f, place: u32, count: u32) -> Transfer {
    var out: Transfer;
    if HAS_TRANSFER {
        //#each NEEDED| out.t$ = transfer[$u * count + place];
    } else {
        //#basis NEEDED_BANDS normal| out.t$ = y$ * COSINE_@;
    }
    return out;
}
