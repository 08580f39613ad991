use std::sync::Arc;

use glam::Vec3;

/// Triangles that a camera sees: what the receiver set-up draws.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Positions of the vertices, world space.
    pub positions: Vec<Vec3>,
    /// Unit normals of the vertices, on the outer side of the triangles around them.
    pub normals: Vec<Vec3>,
    /// Corners, counter-clockwise seen from outside.
    pub triangles: Arc<[[u32; 3]]>,
    /// Diffuse reflectance of every triangle.
    pub albedo: Vec<Vec3>,
    /// Transfer vectors of the vertices, integral of V max(0, n.w) y: `transfer_len` numbers each; or none.
    pub transfer: Vec<f32>,
    /// Coefficients in a transfer vector.
    pub transfer_len: usize,
}
