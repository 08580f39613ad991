// Twin of exponentiate.rs and exponential.rs: visibility from accumulated log visibility.

@group(0) @binding(0) var<uniform> view: View;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(1) var<storage, read> log_visibility: array<f32>;
// a and b of the optimal linear form.
@group(0) @binding(2) var<storage, read> linear: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> visibility: array<f32>;

struct Harmonics {
    //#each LEN| f$: f32,
}

fn square(f: Harmonics) -> Harmonics {
    var g: Harmonics;
    //#square
    return g;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count {
        return;
    }
    var f: Harmonics;
    //#each LEN| f.f$ = log_visibility[$u * view.count + place];
    var norm = 0.0;
    //#each 1 LEN| norm += f.f$ * f.f$;
    norm = sqrt(norm);
    if norm == 0.0 && f.f0 == 0.0 {
        // Exactly 1 where nothing was accumulated.
        visibility[place] = ONE;
        //#each 1 OUT_LEN| visibility[$u * view.count + place] = 0.0;
        return;
    }
    let scale = exp(f.f0 / ONE);
    var halvings = 0u;
    var rest = norm;
    while rest > BOUND && halvings < 24u {
        rest *= 0.5;
        halvings++;
    }
    let part = ldexp(1.0, -i32(halvings));
    f.f0 = 0.0;
    //#each 1 LEN| f.f$ *= part;
    var g: Harmonics;
    if QUADRATIC {
        g = square(f);
        //#each LEN| g.f$ = g.f$ * 0.5 + f.f$;
        g.f0 += ONE;
    } else {
        let x = min(norm * part / GREATEST, 1.0) * f32(LINEAR_INTERVALS);
        let k = min(u32(x), LINEAR_INTERVALS - 1u);
        let ab = mix(linear[k], linear[k + 1u], x - f32(k));
        //#each 1 LEN| g.f$ = f.f$ * ab.y;
        g.f0 = ab.x * ONE;
    }
    for (var i = 0u; i < halvings; i++) {
        g = square(g);
    }
    //#each OUT_LEN| visibility[$u * view.count + place] = g.f$ * scale;
}
