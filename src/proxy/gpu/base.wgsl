// Radiance of every pixel of the display without proxies.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> transfer: array<f32>;
// Coefficients of the light, colours side by side.
@group(0) @binding(3) var<storage, read> light: array<vec4f>;
@group(0) @binding(4) var<storage, read> background: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> radiance: array<vec4f>;

const INVERSE_PI: f32 = 0.31830987;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count {
        return;
    }
    let receiver = receivers[place];
    if receiver.depth >= NOTHING {
        radiance[place] = background[place];
        return;
    }
    let t = transfer_vector(receiver.normal, place, view.count);
    var irradiance = vec3f(0.0);
    //#each NEEDED| irradiance += t.t$ * light[$u].rgb;
    radiance[place] = vec4f(receiver.albedo * INVERSE_PI * irradiance, 0.0);
}
