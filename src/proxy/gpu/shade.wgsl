// Twin of shade.rs: light that the proxies hide and light that they add, at every receiver.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> transfer: array<f32>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(3) var<storage, read> visibility: array<f32>;
@group(0) @binding(4) var<storage, read> indirect: array<vec4f>;
// Row k, column j of the product matrices, colours side by side.
@group(0) @binding(5) var<uniform> product: array<vec4f, PRODUCT>;
// Rows of every receiver: hidden light, then reflected irradiance, whose last number tells whether any proxy does anything.
@group(0) @binding(6) var<storage, read_write> shading: array<vec4f>;

// 1 - visibility.
struct Blocked {
    //#each OUT_LEN| b$: f32,
}

fn hidden(k: u32, blocked: Blocked) -> vec3f {
    var sum = vec3f(0.0);
    //#each OUT_LEN| sum += product[k * OUT_LEN + $u].rgb * blocked.b$;
    return sum;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let place = id.y * groups.x * 64u + id.x;
    if place >= view.count {
        return;
    }
    var blocked: Blocked;
    //#each OUT_LEN| blocked.b$ = select(0.0, ONE, $u == 0u) - visibility[$u * view.count + place];
    var any = 0.0;
    //#each OUT_LEN| any += abs(blocked.b$);
    var reflected = vec3f(0.0);
    if view.reflects != 0u {
        let sum = indirect[place];
        if sum.w > 0.0 {
            let union_angle = max(blocked.b0 * ONE, 0.0);
            reflected = max(sum.rgb * min(union_angle / max(sum.w, MIN_POSITIVE), 1.0), vec3f(0.0));
        }
    }
    let touched = any > 0.0 || any_above_zero(reflected);
    let first = place * (ROWS + 1u);
    if SHADES {
        var shade = vec3f(0.0);
        if touched {
            let t = transfer_vector(receivers[place].normal, place, view.count);
            //#each NEEDED| shade += t.t$ * hidden($u, blocked);
        }
        shading[first] = vec4f(shade, 0.0);
    } else if touched {
        //#each NEEDED| shading[first + $u] = vec4f(hidden($u, blocked), 0.0);
    } else {
        //#each NEEDED| shading[first + $u] = vec4f(0.0);
    }
    shading[first + ROWS] = vec4f(reflected, select(0.0, 1.0, touched));
}

fn any_above_zero(v: vec3f) -> bool {
    return v.x > 0.0 || v.y > 0.0 || v.z > 0.0;
}
