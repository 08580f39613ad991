// Twin of the modes ol, hyb and ps2 of exponential.rs: exp of what has no band 0.

// a and b of the optimal linear form.
@group(0) @binding(3) var<storage, read> linear: array<vec2f>;

fn square(f: Harmonics) -> Harmonics {
    var g: Harmonics;
    //#square
    return g;
}

fn exponential(all: Harmonics, norm: f32) -> Harmonics {
    var f = all;
    var halvings = 0u;
    var rest = norm;
    while rest > BOUND && halvings < 24u {
        rest *= 0.5;
        halvings++;
    }
    let part = ldexp(1.0, -i32(halvings));
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
    return g;
}
