// Twin of exponentiate.rs: visibility from accumulated log visibility.

@group(0) @binding(0) var<uniform> view: View;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(1) var<storage, read> log_visibility: array<f32>;
@group(0) @binding(2) var<storage, read_write> visibility: array<f32>;

struct Harmonics {
    //#each LEN| f$: f32,
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count {
        return;
    }
    var f: Harmonics;
    //#each LEN| f.f$ = log_visibility[$u * view.count + place];
    var norm = 0.0;
    //#each 1 LEN| norm += f.f$ * f.f$;
    norm = sqrt(norm);
    if norm == 0.0 && f.f0 == 0.0 {
        // Exactly 1 where nothing was accumulated.
        visibility[place] = ONE;
        //#each 1 OUT_LEN| visibility[$u * view.count + place] = 0.0;
        return;
    }
    let scale = exp(f.f0 / ONE);
    f.f0 = 0.0;
    let g = exponential(f, norm);
    //#each OUT_LEN| visibility[$u * view.count + place] = g.f$ * scale;
}
