use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;

use super::super::Mesh;
use super::cuboid::Face;
use super::grid::append_grid;
use super::random::Random;
use super::{Cuboid, Icosphere, check};
use crate::Result;

/// A furnished room: walls that face inwards, twelve boxes on the floor and five spheres over them.
///
/// It stands on the plane y = 0 around the y axis. Nothing touches anything: furniture ends a thousandth of the room's
/// height over what is below it.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Room {
    /// Lengths along x, y (up) and z. Default 12, 5, 10.
    pub size: [f64; 3],
    /// Where light gets in. Default a window.
    pub opening: Opening,
    /// How often the triangles of the spheres are cut in four. Default 4: 26,000 triangles in all.
    pub subdivisions: u32,
    /// Another seed gives other furniture. Default 1.
    pub seed: u64,
}

/// Where light gets into a [`Room`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Opening {
    /// Nowhere.
    Closed,
    /// Through a window in the wall at the far end of z.
    Window,
    /// From above: there is no ceiling.
    Ceiling,
}

impl Default for Room {
    fn default() -> Self {
        Self { size: [12.0, 5.0, 10.0], opening: Opening::Window, subdivisions: 4, seed: 1 }
    }
}

/// Cells along every side of a wall; the window fills the middle ones.
const WALL_CELLS: u32 = 8;

impl Room {
    /// The room's triangles, walls first.
    ///
    /// # Errors
    /// Sizes that are not positive, too many subdivisions.
    pub fn mesh(&self) -> Result<Mesh> {
        check("room", &self.size, 1000.0 + 100.0 * 4f64.powf(f64::from(self.subdivisions)))?;
        let size = DVec3::from_array(self.size);
        let mut mesh = self.walls();
        mesh.name = "room".into();
        let mut random = Random::new(self.seed);
        let sphere = Icosphere { radius: 1.0, subdivisions: self.subdivisions }.mesh()?;
        let gap = 1e-3 * size.y;
        for i in 0..12 {
            // One box to each of 4 x 3 cells of the floor, with room for its diagonal.
            let cell = DVec3::new(size.x / 4.0, 0.0, size.z / 3.0);
            let reach = cell.x.min(cell.z) * random.between(0.3, 0.45);
            let height = size.y * random.between(0.1, 0.45);
            let shape = Cuboid { size: [1.2 * reach, height, 1.4 * reach], ..Cuboid::default() }.mesh()?;
            let middle = cell * DVec3::new(f64::from(i % 4) - 1.5, 0.0, f64::from(i / 4) - 1.0);
            let turn = DQuat::from_rotation_y(random.between(0.0, std::f64::consts::TAU));
            let place = DAffine3::from_rotation_translation(turn, middle + (gap + height / 2.0) * DVec3::Y);
            mesh.append(&shape.transformed(place));
            if i % 3 == 1 || i == 6 {
                let radius = reach.min((size.y - height) / 2.0) * random.between(0.4, 0.6);
                let centre = middle + (height + radius + 2.0 * gap) * DVec3::Y;
                let place = DAffine3::from_scale_rotation_translation(DVec3::splat(radius), DQuat::IDENTITY, centre);
                mesh.append(&sphere.clone().transformed(place));
            }
        }
        Ok(mesh)
    }

    fn walls(&self) -> Mesh {
        let [x, y, z] = self.size;
        let [low, high] = [DVec3::new(-x / 2.0, 0.0, -z / 2.0), DVec3::new(x / 2.0, y, z / 2.0)];
        let mut mesh = Mesh::default();
        for face in Face::ALL {
            let is_ceiling = face.axis == 1 && face.is_upper;
            let has_window = self.opening == Opening::Window && face.axis == 2 && face.is_upper;
            // On that face the first coordinate runs along x, the second along y; swapped, it faces inwards.
            let is_wall = |row: u32, column: u32| {
                let is_window = (2..6).contains(&column) && (3..6).contains(&row);
                !(has_window && is_window || is_ceiling && self.opening == Opening::Ceiling)
            };
            append_grid(&mut mesh, [WALL_CELLS; 2], |u, v| face.point(low, high, v, u), is_wall);
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{EdgeKind, TriangleId};
    use super::super::tests::{geometry, is_closed, volume};
    use super::*;

    #[test]
    fn openings_leave_the_expected_border() {
        let border = |opening| {
            let room = geometry(Room { opening, subdivisions: 1, ..Room::default() }.mesh());
            assert_eq!(room.topology().bodies(), 18);
            room.topology().count(EdgeKind::Boundary)
        };
        assert_eq!(border(Opening::Closed), 0);
        assert_eq!(border(Opening::Window), 2 * (4 + 3));
        assert_eq!(border(Opening::Ceiling), 32);
    }

    #[test]
    fn walls_face_inwards_and_the_window_looks_along_z() {
        let closed = Room { opening: Opening::Closed, ..Room::default() };
        assert!((volume(&geometry(Ok(closed.walls()))) + 600.0).abs() < 1e-3);
        let window = geometry(Ok(Room::default().walls()));
        let topology = window.topology();
        let border = topology.edges().filter(|&e| topology.kind(e) == EdgeKind::Boundary);
        for p in border.flat_map(|e| topology.ends(e)).map(|v| window.positions[v.0 as usize]) {
            assert!(p.z == 5.0 && p.x.abs() <= 3.0 && (1.875..=3.75).contains(&p.y), "{p}");
        }
    }

    #[test]
    fn furniture_stays_inside_and_apart() {
        for seed in 1..20 {
            let room = geometry(Room { seed, opening: Opening::Closed, subdivisions: 2, ..Room::default() }.mesh());
            assert!(is_closed(&room));
            let topology = room.topology();
            let mut bounds = vec![[DVec3::INFINITY, DVec3::NEG_INFINITY]; topology.bodies()];
            for t in 0..room.triangles.len() as u32 {
                let [low, high] = &mut bounds[topology.body(TriangleId(t)) as usize];
                for p in room.corners(t) {
                    (*low, *high) = (low.min(p), high.max(p));
                }
            }
            let [walls, furniture @ ..] = bounds.as_slice() else { panic!("no bodies") };
            for (i, [low, high]) in furniture.iter().enumerate() {
                assert!(low.cmpgt(walls[0]).all() && high.cmplt(walls[1]).all(), "seed {seed}: body {i}");
                for [other_low, other_high] in &furniture[..i] {
                    assert!(!(low.cmple(*other_high).all() && high.cmpge(*other_low).all()), "seed {seed}: body {i}");
                }
            }
        }
    }

    #[test]
    fn default_room_has_the_benchmark_size() {
        let triangles = geometry(Room::default().mesh()).triangles.len();
        assert!((26_000..27_000).contains(&triangles), "{triangles}");
    }
}
