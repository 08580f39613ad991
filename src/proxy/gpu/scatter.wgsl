// Twin of `scatter` in upsample.rs: puts the shading of gathered pixels where they belong.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> pixels: array<u32>;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> transfer: array<f32>;
@group(0) @binding(4) var<storage, read> shading: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> radiance: array<vec4f>;

const INVERSE_PI: f32 = 0.31830987;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count || pixels[place] == NO_PIXEL {
        return;
    }
    let pixel = receivers[place];
    let first = place * (ROWS + 1u);
    var irradiance = shading[first + ROWS].rgb;
    if SHADES {
        irradiance -= shading[first].rgb;
    } else {
        let t = transfer_vector(pixel.normal, place, view.count);
        //#each NEEDED| irradiance -= t.t$ * shading[first + $u].rgb;
    }
    let target_pixel = pixels[place];
    radiance[target_pixel] = vec4f(max(radiance[target_pixel].rgb + pixel.albedo * INVERSE_PI * irradiance, vec3f(0.0)), 0.0);
}
