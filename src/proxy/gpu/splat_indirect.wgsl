// Twin of splat_indirect.rs and indirect.rs: irradiance that the proxies in reach reflect, and their solid angle.

// Four vectors a row.
@group(0) @binding(5) var<storage, read> table: array<vec4f>;
@group(0) @binding(6) var<uniform> light: Light;
// R, G, B and the solid angle.
@group(0) @binding(7) var<storage, read_write> indirect: array<vec4f>;

const COUNTED: u32 = 2u;

// The light as proxies reflect it, colour by colour: (linear, constant), (xx, yy, zz, 0), (xy, yz, zx, 0).
struct Light {
    linear: array<vec4f, 3>,
    diagonal: array<vec4f, 3>,
    mixed: array<vec4f, 3>,
}

const TAU: f32 = 6.2831855;

fn apply(colour: u32, v: vec3f) -> vec3f {
    let d = light.diagonal[colour].xyz;
    // xy, yz, zx.
    let m = light.mixed[colour].xyz;
    return vec3f(
        v.x * d.x + v.y * m.x + v.z * m.z,
        v.x * m.x + v.y * d.y + v.z * m.y,
        v.x * m.z + v.y * m.y + v.z * d.z,
    );
}

fn cap_cosine(u: f32, c: f32) -> f32 {
    let two = 2.0 - u;
    let k = 1.0 - u;
    return 0.25 + two * c * 0.25 + k * two * (c * c * 1.5 - 0.5) * 0.15625;
}

// Irradiance from a white proxy over its solid angle.
fn irradiance_per_solid_angle(axis: vec3f, u: f32, normal: vec3f) -> vec3f {
    let c = dot(axis, normal);
    let place = sqrt(u) * f32(INDIRECT_INTERVALS);
    let row = min(u32(place), INDIRECT_INTERVALS - 1u);
    let t = place - f32(row);
    let m0 = mix(table[4u * row], table[4u * row + 4u], t);
    var sum = vec3f(0.0);
    if !EXACT {
        for (var colour = 0u; colour < 3u; colour++) {
            let linear = dot(light.linear[colour].xyz, axis);
            let quadratic = dot(apply(colour, axis), axis);
            sum[colour] = m0.x * light.linear[colour].w + m0.y * linear + m0.z * quadratic;
        }
        return sum * cap_cosine(u, c);
    }
    let m1 = mix(table[4u * row + 1u], table[4u * row + 5u], t);
    let m2 = mix(table[4u * row + 2u], table[4u * row + 6u], t);
    let m3 = mix(table[4u * row + 3u], table[4u * row + 7u], t);
    let s = sqrt(max(1.0 - c * c, 1e-12));
    let x = (normal - axis * c) / s;
    for (var colour = 0u; colour < 3u; colour++) {
        let image = apply(colour, axis);
        let constant = light.linear[colour].w;
        let linear = dot(light.linear[colour].xyz, axis);
        let quadratic = dot(image, axis);
        let across = dot(light.linear[colour].xyz, x);
        let mixed = 2.0 * dot(image, x);
        let twice = 2.0 * dot(apply(colour, x), x) + quadratic;
        sum[colour] = 0.2820948 * (m0.x * constant + m0.y * linear + m0.z * quadratic)
            + 0.4886025 * c * (m0.w * constant + m1.x * linear + m1.y * quadratic)
            + (0.9461747 * c * c - 0.31539157) * (m1.z * constant + m1.w * linear + m2.x * quadratic)
            + 0.4886025 * s * (m2.y * across + m2.z * mixed)
            + 1.0925484 * s * c * (m2.w * across + m3.x * mixed)
            + 0.5462742 * s * s * m3.y * twice;
    }
    return sum;
}

var<private> sum: vec4f;

fn expansion() -> f32 {
    return view.indirect_expansion;
}

fn start() {
    sum = vec4f(0.0);
}

fn add(proxy: Proxy, seen: Seen, normal: vec3f) {
    let solid_angle = seen.u * seen.weight * TAU;
    let colours = irradiance_per_solid_angle(seen.axis, seen.u, normal) * proxy.albedo;
    sum += vec4f(colours, 1.0) * solid_angle;
}

fn finish(place: u32) {
    indirect[place] = sum;
}
