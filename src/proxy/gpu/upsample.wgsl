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

// The rows of one receiver.
struct Rows {
    //#each ROWS| h$: vec3f,
    // What is added, and whether any proxy does anything.
    added: vec4f,
}

fn rows(place: u32) -> Rows {
    let first = place * (ROWS + 1u);
    var out: Rows;
    //#each ROWS| out.h$ = shading[first + $u].rgb;
    out.added = shading[first + ROWS];
    return out;
}

// What a receiver's rows make of a pixel's irradiance.
fn lit(r: Rows, t: Transfer) -> vec3f {
    var irradiance = r.added.rgb;
    if SHADES {
        irradiance -= r.h0;
    } else {
        //#each ROWS| irradiance -= t.t$ * r.h$;
    }
    return irradiance;
}

// One for every four receivers: the pixels between them share what is loaded.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x > view.width || id.y > view.height {
        return;
    }
    let left = max(id.x, 1u) - 1u;
    let right = min(id.x, view.width - 1u);
    let above = (max(id.y, 1u) - 1u) * view.width;
    let below = min(id.y, view.height - 1u) * view.width;
    let a = rows(above + left);
    let b = rows(above + right);
    let c = rows(below + left);
    let d = rows(below + right);
    if a.added.w + b.added.w + c.added.w + d.added.w == 0.0 {
        return;
    }
    let ra = coarse[above + left];
    let rb = coarse[above + right];
    let rc = coarse[below + left];
    let rd = coarse[below + right];
    // The receiver to the upper left, and the first pixel nearer to the lower right than that one.
    let low = vec2i(id.xy) - 1 + vec2i(0, i32(view.first_row));
    let scale = i32(view.scale);
    let start = low * scale + scale / 2;
    for (var k = 0; k < scale * scale; k++) {
        let at = start + vec2i(k % scale, k / scale);
        let line = at.y - i32(view.fine_first_row);
        if at.x < 0 || at.x >= i32(view.fine_width) || line < 0 || line >= i32(view.fine_height) {
            continue;
        }
        let place = u32(line) * view.fine_width + u32(at.x);
        let pixel = fine[place];
        if pixel.depth >= NOTHING {
            continue;
        }
        let t = (vec2f(at) + 0.5) / f32(scale) - 0.5 - vec2f(low);
        var w = vec4f((1.0 - t.x) * (1.0 - t.y), t.x * (1.0 - t.y), (1.0 - t.x) * t.y, t.x * t.y);
        if scale > 1 {
            w *= vec4f(agreement(pixel, ra), agreement(pixel, rb), agreement(pixel, rc), agreement(pixel, rd));
        }
        let sum = w.x + w.y + w.z + w.w;
        if sum < LEAST_WEIGHT {
            unmatched_pixel(place);
            continue;
        }
        w /= sum;
        let transfer = transfer_vector(pixel.normal, place, view.fine_width * view.fine_height);
        let irradiance = lit(a, transfer) * w.x + lit(b, transfer) * w.y + lit(c, transfer) * w.z + lit(d, transfer) * w.w;
        radiance[place] = vec4f(max(radiance[place].rgb + pixel.albedo * INVERSE_PI * irradiance, vec3f(0.0)), 0.0);
    }
}

fn unmatched_pixel(place: u32) {
    let index = atomicAdd(&unmatched[0], 1u);
    if index + 1u < arrayLength(&unmatched) {
        atomicStore(&unmatched[index + 1u], place);
    }
}
