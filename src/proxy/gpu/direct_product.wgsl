// Twin of direct_product.rs: visibility as the product of what every sphere leaves, direction by direction.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> proxies: array<Proxy>;
@group(0) @binding(3) var<storage, read> clipped: array<vec2f>;
// Directions, each with its weight.
@group(0) @binding(4) var<storage, read> directions: array<vec4f>;
// Weight times harmonic: coefficient k of direction i at k * DIRECTIONS + i.
@group(0) @binding(5) var<storage, read> projection: array<f32>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(6) var<storage, read_write> visibility: array<f32>;
// Empty tiles and pairs of tiles and proxies, of this pass from number COUNTED on.
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

const COUNTED: u32 = 0u;

const TAU: f32 = 6.2831855;

// The share of a direction's surroundings that a cap hides, before its solid angle is made right.
fn share(along: f32, cosine: f32, slope: f32) -> f32 {
    return clamp((along - cosine) * slope + 0.5, 0.0, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let inside = id.x < view.width && id.y < view.height;
    let place = select(0u, id.y * view.width + id.x, inside);
    let receiver = receivers[place];
    let is_seen = inside && receiver.depth < NOTHING;
    let ball = tile_ball(lane, is_seen, receiver.position);
    var open: array<f32, DIRECTIONS>;
    for (var i = 0u; i < DIRECTIONS; i++) {
        open[i] = 1.0;
    }
    var touched = false;
    for (var first = 0u; first < view.proxies; first += CHUNK) {
        tile_list(lane, ball, first, view.proxies, view.shadow_expansion);
        if is_seen {
            for (var word = 0u; word < min(WORDS, (view.proxies - first + 31u) / 32u); word++) {
                var bits = atomicLoad(&tile_mask[word]);
                while bits != 0u {
                    let bit = firstTrailingBit(bits);
                    bits &= bits - 1u;
                    let seen = see(proxies[first + word * 32u + bit], receiver.position, receiver.normal, view.shadow_expansion);
                    if seen.weight > 0.0 && seen.u > 0.0 {
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
                }
            }
        }
    }
    tile_count(lane);
    if !inside {
        return;
    }
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
