// Twin of receiver_setup.rs. A draw leaves the number of the nearest triangle, from 1, in every pixel; then every pixel's ray
// is intersected with its triangle.

struct Camera {
    // x, y, z; w of the second and the third: one over the square of a pixel's side at depth 1.
    eye: vec4f,
    right: vec4f,
    down: vec4f,
    forward: vec4f,
    // From the eye to the top left corner of the image plane at depth 1.
    corner: vec4f,
    // Receivers across and down, pixels per receiver, whether there are transfer vectors.
    size: vec4u,
    // The view's axis from the band's top left corner, in pixels; the nearest depth.
    half: vec4f,
}

struct Triangle {
    corners: vec3u,
    // Whether its vertices have transfer vectors.
    has_transfer: u32,
    albedo: vec3f,
    padding: f32,
}

// Positions and normals in turn.
@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> vertices: array<vec4f>;
@group(0) @binding(2) var<storage, read> triangles: array<Triangle>;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
}

@vertex
fn project(@builtin(vertex_index) index: u32) -> Corner {
    let triangle = index / 3u;
    let d = vertices[2u * triangles[triangle].corners[index % 3u]].xyz - camera.eye.xyz;
    let depth = dot(d, camera.forward.xyz);
    // Pixels times depth, from the top left corner.
    let x = dot(d, camera.right.xyz) * camera.right.w + camera.half.x * depth;
    let y = dot(d, camera.down.xyz) * camera.down.w + camera.half.y * depth;
    let extent = vec2f(camera.size.xy * camera.size.z);
    // Reversed depth: precision where it is needed.
    let clip = vec4f(2.0 * x / extent.x - depth, depth - 2.0 * y / extent.y, camera.half.z, depth);
    return Corner(clip, triangle + 1u);
}

@fragment
fn number(corner: Corner) -> @location(0) u32 {
    return corner.triangle;
}
