// Twin of splat.rs: log visibility accumulated at every receiver over the proxies in reach of it.

// Two vectors a row: bands 0 to 3, and 4 to 7.
@group(0) @binding(5) var<storage, read> table: array<vec4f>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(6) var<storage, read_write> log_visibility: array<f32>;

const COUNTED: u32 = 0u;

//#each LEN| var<private> s$: f32;

fn expansion() -> f32 {
    return view.shadow_expansion;
}

fn start() {
    //#each LEN| s$ = 0.0;
}

fn add(proxy: Proxy, seen: Seen, normal: vec3f) {
    let x = seen.u * f32(LOG_INTERVALS);
    let row = min(u32(x), LOG_INTERVALS - 1u);
    let low = mix(table[2u * row], table[2u * row + 2u], x - f32(row)) * (seen.weight * proxy.share);
    let high = mix(table[2u * row + 1u], table[2u * row + 3u], x - f32(row)) * (seen.weight * proxy.share);
    let bands = array<f32, 6>(low.x, low.y, low.z, low.w, high.x, high.y);
    //#basis BANDS seen.axis| s$ += y$ * bands[@];
}

fn finish(place: u32) {
    //#each LEN| log_visibility[$u * view.count + place] = s$;
}
