// Twin of self_shadow.rs and of the fading in coverage.rs.

struct Seen {
    axis: vec3f,
    // 1 - cos theta.
    u: f32,
    weight: f32,
}

fn versine(alpha: f32) -> f32 {
    return alpha * alpha / (1.0 + sqrt(max(1.0 - alpha * alpha, 0.0)));
}

fn clipped_at(alpha: f32, elevation: f32) -> vec2f {
    let x = alpha * f32(CLIPPED_INTERVALS);
    let y = clamp(elevation / alpha * 0.5 + 0.5, 0.0, 1.0) * f32(CLIPPED_INTERVALS);
    let i = min(u32(x), CLIPPED_INTERVALS - 1u);
    let j = min(u32(y), CLIPPED_INTERVALS - 1u);
    let s = x - f32(i);
    let t = y - f32(j);
    let first = i * (CLIPPED_INTERVALS + 1u) + j;
    let second = first + CLIPPED_INTERVALS + 1u;
    let upper = mix(clipped[first], clipped[first + 1u], t);
    let lower = mix(clipped[second], clipped[second + 1u], t);
    let entry = mix(upper, lower, s);
    return vec2f(entry.x, entry.y * alpha);
}

// How a receiver sees a proxy within `expansion` times its radius: weight 0 for none of it. Devices may take sines to within
// 5e-4 only, so that those of tilts, at most pi / 2, come from their series.
fn see(proxy: Proxy, position: vec3f, normal: vec3f, expansion: f32) -> Seen {
    let offset = proxy.center - position;
    let squared = dot(offset, offset);
    let reach = expansion * proxy.radius;
    if squared >= reach * reach {
        return Seen(vec3f(0.0), 0.0, 0.0);
    }
    let distance = sqrt(squared);
    let inverse = 1.0 / max(distance, MIN_POSITIVE);
    let axis = offset * inverse;
    let alpha = min(inverse * proxy.radius, 1.0);
    let elevation = dot(axis, normal);
    var seen = Seen(axis, versine(alpha), 1.0);
    if RULE == CLIPPED {
        if elevation <= -alpha {
            return Seen(axis, 0.0, 0.0);
        }
        if elevation < alpha {
            let entry = clipped_at(alpha, elevation);
            seen.u *= entry.x;
            let x = entry.y;
            let x2 = x * x;
            let sin_x = x * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0 * (1.0 - x2 / 110.0)))));
            let cos_x = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0 * (1.0 - x2 / 56.0 * (1.0 - x2 / 90.0 * (1.0 - x2 / 132.0)))));
            let ratio = sin_x / sqrt(max(1.0 - elevation * elevation, 1e-12));
            seen.axis = axis * (cos_x - elevation * ratio) + normal * ratio;
        }
        if distance < proxy.radius {
            let depth = 1.0 - distance / proxy.radius;
            let width = max(elevation, 0.0) * (INSIDE_ABOVE - INSIDE_BELOW) + INSIDE_BELOW;
            seen.weight = smoothstep(0.0, 1.0, 1.0 - depth / width);
        }
    }
    if RULE == REPLACED && elevation < alpha {
        let height = elevation * distance;
        let r = proxy.radius;
        if height < r {
            if height <= -r || (distance < r && height <= 0.0) {
                return Seen(axis, 0.0, 0.0);
            }
            var radius = 0.5 * (r + height);
            if height <= 0.0 {
                let circle = sqrt(max(r * r - height * height, 0.0));
                let foot = sqrt(max(distance * distance - height * height, 0.0));
                radius *= clamp((foot - circle) / max(circle, MIN_POSITIVE), 0.0, 1.0);
            }
            let moved = offset + 0.5 * (r - height) * normal;
            let length = max(sqrt(dot(moved, moved)), MIN_POSITIVE);
            seen.u = versine(min(radius / length, 1.0));
            seen.axis = moved / length;
        }
    }
    let end = 1.0 / expansion;
    seen.weight *= smoothstep(0.0, 1.0, (alpha - end) / ((FADE - 1.0) * end));
    return seen;
}
