use glam::DVec3;
use rayon::prelude::*;

use super::Receivers;
use crate::reference::first_hit;
use crate::scene::{Camera, FaceTree, Geometry};

/// What a camera sees through the middles of its pixels.
#[derive(Clone, Debug)]
pub struct Pixels {
    /// The points seen, each on one face; normals are the faces' own, turned towards the camera.
    pub receivers: Receivers,
    /// Pixel of every receiver, `y * width + x`, ascending; pixels through which no surface is seen are left out.
    pub indices: Vec<u32>,
    /// Triangle each receiver lies on.
    pub faces: Vec<u32>,
}

impl Pixels {
    /// Casts the primary rays; `faces` is the tree over the triangles of `geometry`.
    pub fn new(geometry: &Geometry, faces: &FaceTree, camera: &Camera) -> Self {
        let [width, height] = camera.resolution();
        let seen: Vec<(u32, DVec3, DVec3, u32)> = (0..height)
            .into_par_iter()
            .flat_map_iter(|y| (0..width).map(move |x| (x, y)))
            .filter_map(|(x, y)| {
                let direction = camera.pixel_direction(x, y);
                let hit = first_hit(faces, camera.position(), direction)?;
                let [a, b, c] = geometry.corners(hit.face);
                let [i, j, k] = hit.barycentric;
                let normal = (b - a).cross(c - a).normalize();
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                Some((y * width + x, a * i + b * j + c * k, normal, hit.face))
            })
            .collect();
        Self {
            receivers: Receivers::on_faces(seen.iter().map(|&(_, position, normal, face)| (position, normal, face))),
            indices: seen.iter().map(|&(pixel, ..)| pixel).collect(),
            faces: seen.iter().map(|&(.., face)| face).collect(),
        }
    }
}
