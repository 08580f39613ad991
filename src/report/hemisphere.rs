use dual_bvh::{BuildOptions, DualBvh};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::Picture;
use crate::Result;
use crate::reference::RayScene;
use crate::scene::{FaceTree, Geometry};
use crate::sphere::BoundaryArc;
use crate::visibility::{Receiver, Skips, View, Viewer};

/// Pixels along a side.
const SIZE: usize = 768;
const SKY: [u8; 3] = [200, 222, 255];
const BOUNDARY: [u8; 3] = [220, 30, 30];
const OUTSIDE: [u8; 3] = [255; 3];

/// What a receiver sees, as two judges say: the sky where a ray meets nothing and grey, darker with every surface, where it
/// does; over it, in red, the boundary of the visible region as the exact method finds it.
///
/// The hemisphere about the normal (the whole sphere about +z without one) in Lambert's azimuthal projection, which keeps
/// areas: the normal in the middle, the horizon the circle.
///
/// # Errors
/// A geometry too large for the contour search.
pub fn draw_view(geometry: &Geometry, receiver: Receiver) -> Result<Picture> {
    let disc = Disc::new(receiver.normal);
    let rays = RayScene::new(geometry);
    let pixels: Vec<[u8; 3]> = (0..SIZE * SIZE)
        .into_par_iter()
        .map(|i| match disc.direction(i % SIZE, i / SIZE) {
            None => OUTSIDE,
            Some(w) => match rays.count(receiver.position, w, receiver.excluded) {
                0 => SKY,
                depth => [(40.0 + 110.0 / f64::from(depth).sqrt()) as u8; 3],
            },
        })
        .collect();
    let mut picture = Picture::from_pixels(SIZE, SIZE, pixels);
    for arc in boundary(geometry, receiver)? {
        /// Radians: half a pixel and less.
        const STEP: f64 = 1e-3;
        let across = arc.normal.cross(arc.start);
        let angle = arc.angle();
        let steps = (angle / STEP).abs().ceil().max(1.0);
        for k in 0..=steps as u32 {
            let (sine, cosine) = (angle * f64::from(k) / steps).sin_cos();
            if let Some((x, y)) = disc.pixel(cosine * arc.start + sine * across) {
                picture.paste(&Picture::filled(1, 1, BOUNDARY), x, y);
            }
        }
    }
    Ok(picture)
}

fn boundary(geometry: &Geometry, receiver: Receiver) -> Result<Vec<BoundaryArc>> {
    let edges = DualBvh::build(geometry.positions.clone(), geometry.triangles.clone(), &BuildOptions::default())?;
    let faces = FaceTree::new(geometry.positions.clone(), geometry.triangles.clone());
    let viewer = Viewer { edges: &edges, faces: &faces };
    let mut view = View::default();
    viewer.approach(std::iter::once(receiver), &mut view);
    Ok(viewer.solve(0, receiver, Skips::default(), &mut view).boundary().to_vec())
}

/// Lambert's azimuthal projection onto the picture.
struct Disc {
    /// From the disc's axes to the world's.
    frame: DMat3,
    /// Distance from the middle of the horizon, or of the direction opposite, in units of twice the sine of half the angle.
    rim: f64,
}

impl Disc {
    fn new(normal: Option<DVec3>) -> Self {
        let axis = normal.unwrap_or(DVec3::Z);
        let (x, y) = axis.any_orthonormal_pair();
        Self { frame: DMat3::from_cols(x, y, axis), rim: if normal.is_some() { 2f64.sqrt() } else { 2.0 } }
    }

    /// The direction at the middle of a pixel; none outside of the disc.
    fn direction(&self, x: usize, y: usize) -> Option<DVec3> {
        let [u, v] = [x, y].map(|k| self.rim * ((k as f64 + 0.5) / SIZE as f64 * 2.0 - 1.0));
        let squared = u * u + v * v;
        if squared > self.rim * self.rim {
            return None;
        }
        let scale = (1.0 - squared / 4.0).sqrt();
        Some((self.frame * DVec3::new(scale * u, -scale * v, 1.0 - squared / 2.0)).normalize())
    }

    /// The pixel of a unit vector; none below the horizon.
    fn pixel(&self, w: DVec3) -> Option<(usize, usize)> {
        let w = self.frame.transpose() * w;
        let scale = (2.0 / (1.0 + w.z).max(1e-12)).sqrt();
        let [x, y] = [w.x, -w.y].map(|k| ((scale * k / self.rim + 1.0) / 2.0 * SIZE as f64).floor());
        let is_inside = |k: f64| (0.0..SIZE as f64).contains(&k);
        (is_inside(x) && is_inside(y)).then_some((x as usize, y as usize))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::scene::{GeometryBuilder, Mesh};

    #[test]
    fn projection_keeps_areas_and_returns() {
        for normal in [None, Some(DVec3::Y), Some(DVec3::new(0.6, 0.0, -0.8))] {
            let disc = Disc::new(normal);
            let inside = (0..SIZE * SIZE).filter_map(|i| {
                let w = disc.direction(i % SIZE, i / SIZE)?;
                assert_eq!(disc.pixel(w), Some((i % SIZE, i / SIZE)));
                Some(w)
            });
            let (count, cap) = inside
                .fold((0, 0), |(count, cap), w| (count + 1, cap + u32::from(w.dot(normal.unwrap_or(DVec3::Z)) > 0.5)));
            // A cap of 60 degrees is half a hemisphere.
            let expected = if normal.is_some() { 0.5 } else { 0.25 };
            assert!((f64::from(cap) / f64::from(count) - expected).abs() < 2e-3);
        }
    }

    /// A square over half of the hemisphere: sky on one side of the boundary, grey on the other.
    #[test]
    fn boundary_lies_between_sky_and_surface() {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 1.0);
        let corners = vec![corner(-1e4, 0.0), corner(1e4, 0.0), corner(1e4, 1e4), corner(-1e4, 1e4)];
        let mut builder = GeometryBuilder::default();
        let mesh = Mesh::new("half", corners, vec![[0, 1, 2], [0, 2, 3]]);
        builder.add(mesh, glam::DAffine3::IDENTITY).unwrap();
        let geometry = Arc::new(builder.build());
        let receiver = Receiver { position: DVec3::ZERO, normal: Some(DVec3::Z), excluded: &[] };
        let picture = draw_view(&geometry, receiver).unwrap();
        let count = |wanted: fn([u8; 3]) -> bool| {
            (0..SIZE * SIZE).filter(|i| wanted(picture.pixel(i % SIZE, i / SIZE))).count() as f64
        };
        let (sky, boundary) = (count(|p| p == SKY), count(|p| p == BOUNDARY));
        let surface = count(|p| p[0] == p[1] && p[1] == p[2] && p != OUTSIDE);
        assert!((sky / surface - 1.0).abs() < 0.02, "{sky} {surface}");
        assert!(boundary > SIZE as f64, "{boundary}");
    }
}
