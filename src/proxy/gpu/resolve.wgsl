@group(0) @binding(3) var numbers: texture_2d<u32>;
// Coefficient k of vertex v: v * NEEDED + k.
@group(0) @binding(4) var<storage, read> vertex_transfer: array<f32>;
@group(0) @binding(5) var<storage, read_write> receivers: array<Receiver>;
// Coefficient k of the receiver at a place: k * count + place.
@group(0) @binding(6) var<storage, read_write> transfer: array<f32>;

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= camera.size.x || id.y >= camera.size.y {
        return;
    }
    let place = id.y * camera.size.x + id.x;
    let number = textureLoad(numbers, id.xy, 0).x;
    if number == 0u {
        receivers[place] = Receiver(vec3f(1e18), 3e38, vec3f(0.0, 0.0, 1.0), 0.0, vec3f(0.0), 0.0);
        return;
    }
    let triangle = triangles[number - 1u];
    let a = vertices[2u * triangle.corners.x].xyz;
    let b = vertices[2u * triangle.corners.y].xyz;
    let c = vertices[2u * triangle.corners.z].xyz;
    let middle = (vec2f(id.xy) + 0.5) * f32(camera.size.z);
    let ray = camera.corner.xyz + camera.right.xyz * middle.x + camera.down.xyz * middle.y;
    // From the edges, not from the corners' distances to the eye: small triangles far away keep their digits.
    let area = cross(b - a, c - a);
    let facing = dot(area, a - camera.eye.xyz);
    let depth = facing / dot(area, ray);
    let position = camera.eye.xyz + depth * ray;
    let shares = vec3f(
        dot(area, cross(b - position, c - position)),
        dot(area, cross(c - position, a - position)),
        dot(area, cross(a - position, b - position)),
    );
    let weights = shares / (shares.x + shares.y + shares.z);
    let normal = vertices[2u * triangle.corners.x + 1u].xyz * weights.x
        + vertices[2u * triangle.corners.y + 1u].xyz * weights.y
        + vertices[2u * triangle.corners.z + 1u].xyz * weights.z;
    let length = sqrt(dot(normal, normal));
    var unit = vec3f(0.0, 0.0, 1.0);
    if length > 0.0 {
        unit = normal / length;
    }
    // Seen from behind it is turned.
    if facing > 0.0 {
        unit = -unit;
    }
    receivers[place] = Receiver(position, depth, unit, 0.0, triangle.albedo, 0.0);
    if HAS_TRANSFER {
        let count = camera.size.x * camera.size.y;
        if triangle.has_transfer != 0u {
            let v = triangle.corners * NEEDED;
            //#each NEEDED| transfer[$u * count + place] = dot(weights, vec3f(vertex_transfer[v.x + $u], vertex_transfer[v.y + $u], vertex_transfer[v.z + $u]));
        } else {
            //#basis NEEDED_BANDS unit| transfer[$u * count + place] = y$ * COSINE_@;
        }
    }
}
