// Twin of `gather` in upsample.rs: single pixels of the display become receivers of their own.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> pixels: array<u32>;
@group(0) @binding(2) var<storage, read> fine: array<Receiver>;
@group(0) @binding(3) var<storage, read> fine_transfer: array<f32>;
@group(0) @binding(4) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(5) var<storage, read_write> transfer: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count {
        return;
    }
    let pixel = pixels[place];
    if pixel == NO_PIXEL {
        receivers[place] = Receiver(vec3f(1e18), 3e38, vec3f(0.0, 0.0, 1.0), 0.0, vec3f(0.0), 0.0);
        return;
    }
    receivers[place] = fine[pixel];
    if HAS_TRANSFER {
        let all = view.fine_width * view.fine_height;
        //#each NEEDED| transfer[$u * view.count + place] = fine_transfer[$u * all + pixel];
    }
}
