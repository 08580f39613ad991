// Twin of the mode matrix of exponential.rs, in single precision: exp of what has no band 0, the product matrix's Taylor series
// applied to the constant 1 in as many steps as keep the matrix's norm below 1 in each.

fn product(f: Harmonics, g: Harmonics) -> Harmonics {
    var h: Harmonics;
    //#product
    return h;
}

fn exponential(all: Harmonics, norm: f32) -> Harmonics {
    // No eigenvalue is greater than the function's greatest value, which is at most its norm times that of the harmonics.
    let steps = clamp(ceil(norm * sqrt(f32(LEN - 1u)) / ONE), 1.0, 4096.0);
    var f = all;
    //#each 1 LEN| f.f$ /= steps;
    var g: Harmonics;
    g.f0 = ONE;
    for (var step = 0u; step < u32(steps); step++) {
        var term = g;
        // 1 / 12! is below the last bit.
        for (var k = 1u; k < 12u; k++) {
            term = product(f, term);
            //#each LEN| term.f$ /= f32(k); g.f$ += term.f$;
        }
    }
    return g;
}
