use glam::{DAffine3, DVec3};
use serde::Deserialize;

use super::super::Mesh;
use super::{Room, check};
use crate::Result;

/// A block of furnished rooms side by side, each with other furniture: most of the building is hidden from anywhere
/// within.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Building {
    /// Rooms along x and z. Default 5 each: 650,000 triangles.
    pub rooms: [u32; 2],
    /// Space between the walls of neighbouring rooms. Default 0.3.
    pub wall: f64,
    /// Every room; its seed is that of the first one. Windows look along z.
    pub room: Room,
}

impl Default for Building {
    fn default() -> Self {
        Self { rooms: [5; 2], wall: 0.3, room: Room::default() }
    }
}

impl Building {
    /// The building's triangles, centred over the origin.
    ///
    /// # Errors
    /// No rooms, too many, lengths that are not positive.
    pub fn mesh(&self) -> Result<Mesh> {
        let [columns, rows] = self.rooms;
        let each = 1000.0 + 100.0 * 4f64.powf(f64::from(self.room.subdivisions));
        check("building", &[self.wall], each * f64::from(columns) * f64::from(rows))?;
        let [x, _, z] = self.room.size;
        let mut mesh = Mesh { name: "building".into(), ..Mesh::default() };
        for i in 0..columns * rows {
            let room = Room { seed: self.room.seed.wrapping_add(u64::from(i)), ..self.room.clone() }.mesh()?;
            let middle = |i: u32, n: u32, size: f64| (size + self.wall) * (f64::from(i) - 0.5 * f64::from(n - 1));
            let place = DVec3::new(middle(i % columns, columns, x), 0.0, middle(i / columns, rows, z));
            mesh.append(&room.transformed(DAffine3::from_translation(place)));
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::geometry;
    use super::*;

    #[test]
    fn rooms_stand_side_by_side() {
        let room = Room { subdivisions: 0, ..Room::default() };
        let building = geometry(Building { rooms: [3, 2], room, ..Building::default() }.mesh());
        assert_eq!(building.topology().bodies(), 6 * 18);
        let [low, high] = building.bounds().unwrap();
        assert!((high.x - low.x - 3.0 * 12.0 - 0.6).abs() < 1e-5 && (high.z - low.z - 20.3).abs() < 1e-5);
    }
}
