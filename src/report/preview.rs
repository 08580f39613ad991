use glam::DVec3;
use rayon::prelude::*;

use super::Picture;
use crate::reference::first_hit;
use crate::scene::{Camera, Environment, FaceTree, Geometry};

/// A picture of a bake as its user will see it: radiance at the vertices (one RGB for each, albedo not included),
/// interpolated over the faces, before the environment. `faces` is the tree over the triangles of `geometry`.
pub fn preview(
    geometry: &Geometry,
    faces: &FaceTree,
    radiance: &[[f64; 3]],
    environment: &Environment,
    camera: &Camera,
) -> Picture {
    /// Rays through a pixel, along each of its sides.
    const GRID: u32 = 2;
    let [width, height] = camera.resolution();
    let shade = |x: f64, y: f64| -> DVec3 {
        let direction = camera.direction(x, y);
        let Some(hit) = first_hit(faces, camera.position(), direction) else {
            return environment.radiance(direction).as_dvec3();
        };
        let corners = geometry.triangles[hit.face as usize];
        let light: DVec3 = corners
            .iter()
            .zip(hit.barycentric)
            .map(|(&vertex, weight)| DVec3::from(radiance[vertex as usize]) * weight)
            .sum();
        let material = &geometry.materials[geometry.triangle_material[hit.face as usize] as usize];
        light.max(DVec3::ZERO) * material.albedo.as_dvec3()
    };
    let colours: Vec<[f64; 3]> = (0..height * width)
        .into_par_iter()
        .map(|pixel| {
            let [x, y] = [pixel % width, pixel / width].map(f64::from);
            let samples = (0..GRID * GRID).map(|sample| {
                let [i, j] = [sample % GRID, sample / GRID].map(|k| (f64::from(k) + 0.5) / f64::from(GRID));
                shade(x + i, y + j)
            });
            (samples.sum::<DVec3>() / f64::from(GRID * GRID)).to_array()
        })
        .collect();
    Picture::tone_mapped(width as usize, height as usize, &colours)
}
