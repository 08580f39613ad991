// Twin of splat.rs: log visibility accumulated at every receiver over the proxies in reach of it.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> proxies: array<Proxy>;
@group(0) @binding(3) var<storage, read> clipped: array<vec2f>;
// Two vectors a row: bands 0 to 3, and 4 to 7.
@group(0) @binding(4) var<storage, read> table: array<vec4f>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(5) var<storage, read_write> log_visibility: array<f32>;
// Empty tiles and pairs of tiles and proxies, of this pass from number COUNTED on.
@group(0) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;

const COUNTED: u32 = 0u;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let inside = id.x < view.width && id.y < view.height;
    let place = select(0u, id.y * view.width + id.x, inside);
    let receiver = receivers[place];
    let is_seen = inside && receiver.depth < NOTHING;
    let ball = tile_ball(lane, is_seen, receiver.position);
    //#each LEN| var s$ = 0.0;
    for (var first = 0u; first < view.proxies; first += CHUNK) {
        tile_list(lane, ball, first, view.proxies, view.shadow_expansion);
        if is_seen {
            for (var word = 0u; word < min(WORDS, (view.proxies - first + 31u) / 32u); word++) {
                var bits = atomicLoad(&tile_mask[word]);
                while bits != 0u {
                    let bit = firstTrailingBit(bits);
                    bits &= bits - 1u;
                    let proxy = proxies[first + word * 32u + bit];
                    let seen = see(proxy, receiver.position, receiver.normal, view.shadow_expansion);
                    if seen.weight > 0.0 {
                        let x = seen.u * f32(LOG_INTERVALS);
                        let row = min(u32(x), LOG_INTERVALS - 1u);
                        let low = mix(table[2u * row], table[2u * row + 2u], x - f32(row)) * (seen.weight * proxy.share);
                        let high = mix(table[2u * row + 1u], table[2u * row + 3u], x - f32(row)) * (seen.weight * proxy.share);
                        let bands = array<f32, 6>(low.x, low.y, low.z, low.w, high.x, high.y);
                        //#basis BANDS seen.axis| s$ += y$ * bands[@];
                    }
                }
            }
        }
    }
    tile_count(lane);
    if inside {
        //#each LEN| log_visibility[$u * view.count + place] = s$;
    }
}
