//! Built-in shapes: parameter structs whose `mesh` is deterministic, wound counter-clockwise seen from outside, y up.
//!
//! Every struct reads from a scene file by its field names; fields left out have the documented default.

mod building;
mod cuboid;
mod foliage;
mod grid;
mod icosphere;
mod knots;
mod plane;
mod random;
mod room;
mod teapot;
mod torus_knot;

use serde::Deserialize;

pub use building::Building;
pub use cuboid::Cuboid;
pub use foliage::Foliage;
pub use icosphere::Icosphere;
pub use knots::Knots;
pub use plane::Plane;
pub(crate) use random::Random;
pub use room::{Opening, Room};
pub use teapot::Teapot;
pub use torus_knot::TorusKnot;

use super::Mesh;
use crate::{Error, Result};

/// A built-in shape with its parameters.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// See [`Plane`].
    Plane(Plane),
    /// See [`Cuboid`].
    Box(Cuboid),
    /// See [`Icosphere`].
    Icosphere(Icosphere),
    /// See [`TorusKnot`].
    TorusKnot(TorusKnot),
    /// See [`Knots`].
    Knots(Knots),
    /// See [`Teapot`].
    Teapot(Teapot),
    /// See [`Foliage`].
    Foliage(Foliage),
    /// See [`Room`].
    Room(Room),
    /// See [`Building`].
    Building(Building),
}

impl Shape {
    /// The shape's triangles.
    ///
    /// # Errors
    /// A parameter out of its domain, or more triangles than the largest scene may have.
    pub fn mesh(&self) -> Result<Mesh> {
        match self {
            Self::Plane(shape) => shape.mesh(),
            Self::Box(shape) => shape.mesh(),
            Self::Icosphere(shape) => shape.mesh(),
            Self::TorusKnot(shape) => shape.mesh(),
            Self::Knots(shape) => shape.mesh(),
            Self::Teapot(shape) => shape.mesh(),
            Self::Foliage(shape) => shape.mesh(),
            Self::Room(shape) => shape.mesh(),
            Self::Building(shape) => shape.mesh(),
        }
    }
}

/// Most triangles that a built-in shape generates: enough for every measurement, and far from filling the memory.
const MAX_TRIANGLES: f64 = 1e8;

/// Refuses a shape of zero, negative or absurd size before anything is allocated.
fn check(shape: &str, lengths: &[f64], triangles: f64) -> Result<()> {
    if let Some(length) = lengths.iter().find(|length| !(length.is_finite() && **length > 0.0)) {
        return Err(Error::input(format!("{shape}: lengths must be positive and finite, not {length}")));
    }
    if !(1.0..=MAX_TRIANGLES).contains(&triangles) {
        return Err(Error::input(format!(
            "{shape}: these parameters ask for {triangles} triangles; allowed are 1 to {MAX_TRIANGLES:e}"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::super::{EdgeKind, Geometry, GeometryBuilder};
    use super::*;

    /// The shape as a scene of its own.
    pub(super) fn geometry(mesh: Result<Mesh>) -> Geometry {
        let mut builder = GeometryBuilder::default();
        builder.add(mesh.unwrap(), DAffine3::IDENTITY).unwrap();
        builder.build()
    }

    /// Vertices - edges + faces.
    pub(super) fn euler_characteristic(geometry: &Geometry) -> isize {
        let edges = geometry.topology().edges().len();
        geometry.positions.len() as isize - edges as isize + geometry.triangles.len() as isize
    }

    /// Whether every edge has two faces that agree on the outside.
    pub(super) fn is_closed(geometry: &Geometry) -> bool {
        let topology = geometry.topology();
        topology.count(EdgeKind::Manifold) == topology.edges().len()
    }

    pub(super) fn area(geometry: &Geometry) -> f64 {
        let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t));
        corners.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    }

    /// Volume enclosed, positive when wound outwards (Gauss).
    pub(super) fn volume(geometry: &Geometry) -> f64 {
        let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t));
        corners.map(|[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn absurd_parameters_are_refused_in_one_line() {
        let shapes = [
            Shape::Plane(Plane { size: [0.0, 1.0], ..Plane::default() }),
            Shape::Plane(Plane { divisions: [100_000, 100_000], ..Plane::default() }),
            Shape::Box(Cuboid { size: [1.0, f64::NAN, 1.0], ..Cuboid::default() }),
            Shape::Box(Cuboid { divisions: 0, ..Cuboid::default() }),
            Shape::Icosphere(Icosphere { radius: -1.0, ..Icosphere::default() }),
            Shape::Icosphere(Icosphere { subdivisions: u32::MAX, ..Icosphere::default() }),
            Shape::TorusKnot(TorusKnot { tube: f64::INFINITY, ..TorusKnot::default() }),
            Shape::TorusKnot(TorusKnot { windings: [0, 0], ..TorusKnot::default() }),
            Shape::TorusKnot(TorusKnot { triangles: 10, ..TorusKnot::default() }),
            Shape::Knots(Knots { rows: 0, ..Knots::default() }),
            Shape::Knots(Knots { triangles: usize::MAX, ..Knots::default() }),
            Shape::Teapot(Teapot { divisions: 0 }),
            Shape::Foliage(Foliage { triangles: 0, ..Foliage::default() }),
            Shape::Room(Room { size: [1.0, 1.0, 0.0], ..Room::default() }),
            Shape::Building(Building { rooms: [0, 1], ..Building::default() }),
            Shape::Building(Building { rooms: [u32::MAX, u32::MAX], ..Building::default() }),
        ];
        for shape in shapes {
            let message = shape.mesh().unwrap_err().to_string();
            assert!(!message.is_empty() && !message.contains('\n'), "{shape:?}: {message}");
        }
    }
}
