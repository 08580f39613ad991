// Twin of direct_product.rs: visibility as the product of what every sphere leaves, direction by direction.

// Directions, each with its weight.
@group(0) @binding(5) var<storage, read> directions: array<vec4f>;
// Weight times harmonic: coefficient k of direction i at k * DIRECTIONS + i.
@group(0) @binding(6) var<storage, read> projection: array<f32>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(7) var<storage, read_write> visibility: array<f32>;

const COUNTED: u32 = 0u;

const TAU: f32 = 6.2831855;

// The share of a direction's surroundings that a cap hides, before its solid angle is made right.
fn share(along: f32, cosine: f32, slope: f32) -> f32 {
    return clamp((along - cosine) * slope + 0.5, 0.0, 1.0);
}

var<private> open: array<f32, DIRECTIONS>;
var<private> touched: bool;

fn expansion() -> f32 {
    return view.shadow_expansion;
}

fn start() {
    for (var i = 0u; i < DIRECTIONS; i++) {
        open[i] = 1.0;
    }
    touched = false;
}

fn add(proxy: Proxy, seen: Seen, normal: vec3f) {
    if seen.u <= 0.0 {
        return;
    }
    touched = true;
    let cosine = 1.0 - seen.u;
    let slope = 0.5 / (RIM * max(sqrt(seen.u * (2.0 - seen.u)), RIM));
    var sum = 0.0;
    for (var i = 0u; i < DIRECTIONS; i++) {
        let direction = directions[i];
        sum += share(dot(direction.xyz, seen.axis), cosine, slope) * direction.w;
    }
    let scale = seen.weight * TAU * seen.u / max(sum, MIN_POSITIVE);
    for (var i = 0u; i < DIRECTIONS; i++) {
        open[i] *= 1.0 - min(share(dot(directions[i].xyz, seen.axis), cosine, slope) * scale, 1.0);
    }
}

fn finish(place: u32) {
    for (var k = 0u; k < OUT_LEN; k++) {
        var sum = select(0.0, ONE, k == 0u);
        if touched {
            sum = 0.0;
            for (var i = 0u; i < DIRECTIONS; i++) {
                sum += projection[k * DIRECTIONS + i] * open[i];
            }
        }
        visibility[k * view.count + place] = sum;
    }
}
