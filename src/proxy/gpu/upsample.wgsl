// Twin of upsample.rs: from the shading of the receivers to the pixels of the display.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> coarse: array<Receiver>;
@group(0) @binding(2) var<storage, read> shading: array<vec4f>;
@group(0) @binding(3) var<storage, read> fine: array<Receiver>;
@group(0) @binding(4) var<storage, read> transfer: array<f32>;
// Before: radiance without proxies.
@group(0) @binding(5) var<storage, read_write> radiance: array<vec4f>;
// The number of pixels for which no receiver is good enough, then their places.
@group(0) @binding(6) var<storage, read_write> unmatched: array<atomic<u32>>;

const INVERSE_PI: f32 = 0.31830987;

struct Neighbours {
    first: u32,
    second: u32,
    t: f32,
}

fn neighbours(pixel: u32, count: u32) -> Neighbours {
    let place = (f32(pixel) + 0.5) / f32(view.scale) - 0.5;
    let low = floor(place);
    let first = min(u32(max(low, 0.0)), count - 1u);
    let second = min(u32(max(low + 1.0, 0.0)), count - 1u);
    return Neighbours(first, second, place - low);
}

// w^N w^z of equation 11.
fn agreement(pixel: Receiver, receiver: Receiver) -> f32 {
    if receiver.depth >= NOTHING {
        return 0.0;
    }
    if !BILATERAL {
        return 1.0;
    }
    let cosine = max(dot(pixel.normal, receiver.normal), 0.0);
    let c2 = cosine * cosine;
    let c4 = c2 * c2;
    let c8 = c4 * c4;
    let c16 = c8 * c8;
    let half_distance = PLANE_DISTANCE * view.pixel * f32(view.scale) * pixel.depth;
    let distance = abs(dot(pixel.normal, receiver.position - pixel.position));
    return c16 * c16 * half_distance / (half_distance + distance);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= view.fine_width || id.y >= view.fine_height {
        return;
    }
    let place = id.y * view.fine_width + id.x;
    let x = neighbours(id.x, view.width);
    let y = neighbours(id.y, view.height);
    let a = y.first * view.width + x.first;
    let b = y.first * view.width + x.second;
    let c = y.second * view.width + x.first;
    let d = y.second * view.width + x.second;
    let ra = shading[a * (ROWS + 1u) + ROWS];
    let rb = shading[b * (ROWS + 1u) + ROWS];
    let rc = shading[c * (ROWS + 1u) + ROWS];
    let rd = shading[d * (ROWS + 1u) + ROWS];
    if ra.w + rb.w + rc.w + rd.w == 0.0 {
        return;
    }
    let pixel = fine[place];
    if pixel.depth >= NOTHING {
        return;
    }
    var w = vec4f((1.0 - x.t) * (1.0 - y.t), x.t * (1.0 - y.t), (1.0 - x.t) * y.t, x.t * y.t);
    if view.scale > 1u {
        w *= vec4f(agreement(pixel, coarse[a]), agreement(pixel, coarse[b]), agreement(pixel, coarse[c]), agreement(pixel, coarse[d]));
    }
    let sum = w.x + w.y + w.z + w.w;
    if sum < LEAST_WEIGHT {
        unmatched_pixel(place);
        return;
    }
    w /= sum;
    var irradiance = ra.rgb * w.x + rb.rgb * w.y + rc.rgb * w.z + rd.rgb * w.w;
    if SHADES {
        irradiance -= mixed(0u, a, b, c, d, w);
    } else {
        let t = transfer_vector(pixel.normal, place, view.fine_width * view.fine_height);
        //#each NEEDED| irradiance -= t.t$ * mixed($u, a, b, c, d, w);
    }
    radiance[place] = vec4f(max(radiance[place].rgb + pixel.albedo * INVERSE_PI * irradiance, vec3f(0.0)), 0.0);
}

fn mixed(row: u32, a: u32, b: u32, c: u32, d: u32, w: vec4f) -> vec3f {
    return shading[a * (ROWS + 1u) + row].rgb * w.x + shading[b * (ROWS + 1u) + row].rgb * w.y
        + shading[c * (ROWS + 1u) + row].rgb * w.z + shading[d * (ROWS + 1u) + row].rgb * w.w;
}

fn unmatched_pixel(place: u32) {
    let index = atomicAdd(&unmatched[0], 1u);
    if index + 1u < arrayLength(&unmatched) {
        atomicStore(&unmatched[index + 1u], place);
    }
}
