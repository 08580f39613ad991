// Twin of tiles.rs: the walk over tiles of 8 x 8 receivers and the proxies that reach them, in lists of bits, 1024 proxies at a time.
// A pass says what is added up, in variables of its own:
//   fn expansion() -> f32                       reach over radius
//   fn start()                                  before the first proxy
//   fn add(proxy: Proxy, seen: Seen, normal: vec3f)  a proxy as a receiver of this normal sees it
//   fn finish(place: u32)                       after the last one, for every receiver
// and from which number on `counts` is its own: COUNTED.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> proxies: array<Proxy>;
@group(0) @binding(3) var<storage, read> clipped: array<vec2f>;
// Empty tiles and pairs of tiles and proxies, of this pass from number COUNTED on.
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

const CHUNK: u32 = 1024u;
const WORDS: u32 = 32u;

var<workgroup> tile_low: array<atomic<u32>, 3>;
var<workgroup> tile_high: array<atomic<u32>, 3>;
// Pairs of the tile and a proxy.
var<workgroup> tile_pairs: atomic<u32>;
var<workgroup> tile_mask: array<atomic<u32>, WORDS>;

// An integer that is ordered like the number.
fn ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

fn number(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, (key >> 31u) == 1u));
}

// A ball around the receivers of the tile: centre and radius, negative if there is none. To be called by all of the tile.
fn tile_ball(lane: u32, seen: bool, position: vec3f) -> vec4f {
    if lane < 3u {
        atomicStore(&tile_low[lane], 0xffffffffu);
        atomicStore(&tile_high[lane], 0u);
    }
    if lane == 0u {
        atomicStore(&tile_pairs, 0u);
    }
    workgroupBarrier();
    if seen {
        for (var axis = 0u; axis < 3u; axis++) {
            let key = ordered(position[axis]);
            atomicMin(&tile_low[axis], key);
            atomicMax(&tile_high[axis], key);
        }
    }
    workgroupBarrier();
    if atomicLoad(&tile_high[0]) == 0u {
        return vec4f(0.0, 0.0, 0.0, -1.0);
    }
    let low = vec3f(number(atomicLoad(&tile_low[0])), number(atomicLoad(&tile_low[1])), number(atomicLoad(&tile_low[2])));
    let high =
        vec3f(number(atomicLoad(&tile_high[0])), number(atomicLoad(&tile_high[1])), number(atomicLoad(&tile_high[2])));
    // A little more than half of the diagonal, so that rounding leaves nobody out.
    return vec4f(0.5 * (low + high), 0.5001 * distance(low, high));
}

// Fills the mask for the proxies from `first` on. To be called by all of the tile.
fn tile_list(lane: u32, ball: vec4f, first: u32) {
    workgroupBarrier();
    if lane < WORDS {
        atomicStore(&tile_mask[lane], 0u);
    }
    workgroupBarrier();
    if ball.w >= 0.0 {
        for (var k = lane; k < min(CHUNK, view.proxies - first); k += 64u) {
            let proxy = proxies[first + k];
            let reach = expansion() * proxy.radius + ball.w;
            let offset = proxy.center - ball.xyz;
            if dot(offset, offset) < reach * reach {
                atomicOr(&tile_mask[k >> 5u], 1u << (k & 31u));
            }
        }
    }
    workgroupBarrier();
    if lane < WORDS {
        atomicAdd(&tile_pairs, countOneBits(atomicLoad(&tile_mask[lane])));
    }
}

// Counts the tile, if it is empty, and its pairs. To be called by all of the tile, at last.
fn tile_count(lane: u32) {
    workgroupBarrier();
    if lane == 0u {
        let pairs = atomicLoad(&tile_pairs);
        atomicAdd(&counts[COUNTED], select(0u, 1u, pairs == 0u));
        atomicAdd(&counts[COUNTED + 1u], pairs);
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let inside = id.x < view.width && id.y < view.height;
    let place = select(0u, id.y * view.width + id.x, inside);
    let receiver = receivers[place];
    let is_seen = inside && receiver.depth < NOTHING;
    let ball = tile_ball(lane, is_seen, receiver.position);
    start();
    for (var first = 0u; first < view.proxies; first += CHUNK) {
        tile_list(lane, ball, first);
        if is_seen {
            for (var word = 0u; word < min(WORDS, (view.proxies - first + 31u) / 32u); word++) {
                var bits = atomicLoad(&tile_mask[word]);
                while bits != 0u {
                    let bit = firstTrailingBit(bits);
                    bits &= bits - 1u;
                    let proxy = proxies[first + word * 32u + bit];
                    let seen = see(proxy, receiver.position, receiver.normal, expansion());
                    if seen.weight > 0.0 {
                        add(proxy, seen, receiver.normal);
                    }
                }
            }
        }
    }
    tile_count(lane);
    if inside {
        finish(place);
    }
}
