//! The part of a scene that stands still: its surface for the receiver set-up, and its visibility baked by the integrator.

use std::collections::HashMap;
use std::f32::consts::PI;

use glam::{DVec3, Vec3};

use super::Surface;
use crate::bake::{Control, Method, Receivers, Request, integrate};
use crate::scene::Geometry;
use crate::sphere::Order;
use crate::{Error, Result};

/// Faces around a vertex belong to one smooth surface if their normals are within this angle, else to different sides of an
/// edge.
const CREASE: f64 = 40.0;

/// The surface of a scene's geometry, towards `eye`: triangles are turned so that their front is the side that the eye sees, and
/// vertices on creases are split.
pub fn static_surface(geometry: &Geometry, eye: DVec3) -> Surface {
    split(geometry, eye).0
}

/// As [`static_surface`], with transfer vectors of `order` at all vertices: the visibility of the scene itself, integrated by
/// `method`.
///
/// # Errors
/// As [`integrate`]; [`Error::Interrupted`] if `control` stops it.
pub fn baked_surface(
    geometry: &Geometry,
    eye: DVec3,
    order: Order,
    method: Method,
    control: &dyn Control,
) -> Result<Surface> {
    let (mut surface, faces) = split(geometry, eye);
    let points = surface.positions.iter().zip(&surface.normals).zip(faces);
    let receivers =
        Receivers::leaving_out(points.map(|((position, normal), own)| (position.as_dvec3(), normal.as_dvec3(), own)));
    let request = Request { order: order.bands(), transfer_sh: true, ..Request::default() };
    let outcome = integrate(geometry, None, &receivers, &request, method, None, control)?;
    if !outcome.done.iter().all(|done| *done) {
        return Err(Error::Interrupted);
    }
    let transfer = outcome.arrays.get("transfer_sh").expect("was asked for");
    surface.transfer = transfer.data.iter().map(|t| PI * *t as f32).collect();
    surface.transfer_len = order.len();
    Ok(surface)
}

/// The surface, and for every vertex the faces around it.
fn split(geometry: &Geometry, eye: DVec3) -> (Surface, Vec<Vec<u32>>) {
    let mut triangles: Vec<[u32; 3]> = geometry.triangles.to_vec();
    let mut normals = Vec::with_capacity(triangles.len());
    for (i, t) in triangles.iter_mut().enumerate() {
        let [a, b, c] = geometry.corners(i as u32);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let away = normal.dot(eye - a) < 0.0;
        if away {
            t.swap(1, 2);
        }
        normals.push(if away { -normal } else { normal });
    }
    let around = geometry.vertex_faces();
    let crease = CREASE.to_radians().cos();
    let mut surface = Surface {
        triangles: [].into(),
        albedo: geometry
            .triangle_material
            .iter()
            .map(|material| geometry.materials[*material as usize].albedo)
            .collect(),
        ..Surface::default()
    };
    let mut own = Vec::new();
    // Which split vertex stands at a corner (triangle, welded vertex).
    let mut corners: HashMap<(u32, u32), u32> = HashMap::new();
    for vertex in 0..geometry.positions.len() as u32 {
        let faces = around.of(vertex);
        // Smooth groups: each grows from its first face.
        let mut groups: Vec<(DVec3, Vec<u32>)> = Vec::new();
        for &face in faces {
            let normal = normals[face as usize];
            match groups.iter_mut().find(|(first, _)| first.dot(normal) > crease) {
                Some((_, group)) => group.push(face),
                None => groups.push((normal, vec![face])),
            }
        }
        for (first, group) in groups {
            let index = surface.positions.len() as u32;
            let sum: DVec3 = group
                .iter()
                .map(|&face| {
                    let t = geometry.triangles[face as usize];
                    let at = t.iter().position(|&v| v == vertex).unwrap_or_default();
                    let [p, q, r] = [0, 1, 2].map(|k| geometry.positions[t[(at + k) % 3] as usize].as_dvec3());
                    normals[face as usize] * (q - p).angle_between(r - p)
                })
                .sum();
            surface.positions.push(geometry.positions[vertex as usize]);
            surface.normals.push(sum.normalize_or(first).as_vec3());
            // All faces around the vertex are left out, as for vertices anywhere: the others end in it.
            own.push(faces.to_vec());
            corners.extend(group.into_iter().map(|face| ((face, vertex), index)));
        }
    }
    surface.triangles = (0u32..).zip(&triangles).map(|(i, t)| t.map(|v| corners[&(i, v)])).collect();
    surface.normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Z));
    (surface, own)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::shapes::{Cuboid, Icosphere};
    use crate::scene::{GeometryBuilder, Mesh};
    use crate::sphere::clamped_cosine;

    fn geometry(mesh: Mesh) -> Geometry {
        let mut builder = GeometryBuilder::default();
        builder.add(mesh, DAffine3::IDENTITY).unwrap();
        builder.build()
    }

    #[test]
    fn boxes_are_split_and_balls_are_not() {
        let cube = geometry(Cuboid { divisions: 1, ..Cuboid::default() }.mesh().unwrap());
        let surface = static_surface(&cube, DVec3::splat(9.0));
        assert_eq!((cube.positions.len(), surface.positions.len()), (8, 24));
        assert!(surface.normals.iter().all(|n| n.abs().max_element() > 0.999));
        let ball = geometry(Icosphere { subdivisions: 3, ..Icosphere::default() }.mesh().unwrap());
        let surface = static_surface(&ball, DVec3::ZERO);
        assert_eq!(ball.positions.len(), surface.positions.len());
        // Seen from within, normals point inwards.
        assert!(surface.positions.iter().zip(&surface.normals).all(|(p, n)| p.dot(*n) < -0.99));
    }

    #[test]
    fn nothing_in_the_way_leaves_the_cosine() {
        let cube = geometry(Cuboid { divisions: 1, ..Cuboid::default() }.mesh().unwrap());
        let order = Order::new(4).unwrap();
        let surface = baked_surface(&cube, DVec3::splat(9.0), order, Method::Exact, &()).unwrap();
        let vertices = surface.positions.iter().zip(&surface.normals).zip(surface.transfer.chunks_exact(16));
        // The three sides that the eye sees; the others are turned inwards, where there is something in the way.
        for ((_, n), transfer) in vertices.filter(|((p, n), _)| p.dot(**n) > 0.0) {
            for (t, c) in transfer.iter().zip(clamped_cosine(order, n.as_dvec3())) {
                assert!((f64::from(*t) - c).abs() < 1e-5, "{t} {c}");
            }
        }
    }
}
