use std::ops::ControlFlow;

use dual_bvh::Tile;
use glam::DVec3;

use crate::scene::FaceTree;

/// The faces that rays of a tile's receivers may meet, gathered once for every direction that they share.
#[derive(Default)]
pub(super) struct Beams {
    beams: Vec<Beam>,
    /// Only so many belong to the tile.
    count: usize,
}

/// What finds the faces along rays from the receivers of a tile.
pub(super) struct Rays<'a> {
    pub(super) faces: &'a FaceTree,
    pub(super) tile: Tile<'a>,
    pub(super) beams: &'a mut Beams,
}

/// Rays in one direction from anywhere in a tile.
#[derive(Default)]
struct Beam {
    direction: DVec3,
    /// The first ray, which may stay the only one, finds its own faces.
    is_gathered: bool,
    section: Section,
    /// Faces, and between which values of the section's normals a receiver's ray may meet them.
    faces: Vec<(u32, [[f64; 2]; 3])>,
    /// Whether there are so many faces that each ray had better look for its own.
    is_wide: bool,
}

/// A ray finds its own faces in the time in which it looks at so many.
const MANY: usize = 32;
/// So many are looked at, at most, to find those.
const LOOKS: usize = 200;

/// Directions that receivers share: those of the meridians' frames, and none.
const DIRECTIONS: usize = 9;

impl Beams {
    /// Begins with another tile.
    pub(super) fn begin(&mut self) {
        self.count = 0;
    }

    /// The faces for all receivers of the tile, if they are few.
    fn gathered(&mut self, faces: &FaceTree, tile: &Tile, direction: DVec3) -> Option<&Beam> {
        match self.beams[..self.count].iter().position(|beam| beam.direction == direction) {
            Some(number) => {
                let beam = &mut self.beams[number];
                if !beam.is_gathered {
                    beam.gather(faces, tile, direction);
                }
                (!beam.is_wide).then_some(&*beam)
            }
            None => {
                if self.count < DIRECTIONS && tile.radius > 0.0 {
                    if self.beams.len() == self.count {
                        self.beams.push(Beam::default());
                    }
                    let beam = &mut self.beams[self.count];
                    (beam.direction, beam.is_gathered) = (direction, false);
                    self.count += 1;
                }
                None
            }
        }
    }
}

impl Rays<'_> {
    /// Calls `visit` with every face that the ray from a receiver of the tile may meet, or that may touch the receiver if there is no
    /// direction (zero), in no particular order.
    pub(super) fn visit(self, position: DVec3, direction: DVec3, mut visit: impl FnMut(u32)) {
        match self.beams.gathered(self.faces, &self.tile, direction) {
            Some(beam) => beam.visit(position, visit),
            None => self.faces.visit(position, direction, |face| {
                visit(face);
                ControlFlow::Continue(())
            }),
        }
    }
}

impl Beam {
    fn gather(&mut self, faces: &FaceTree, tile: &Tile, direction: DVec3) {
        self.is_gathered = true;
        self.faces.clear();
        self.is_wide = false;
        self.section = Section::new(tile, direction);
        let mut looked = 0;
        let section = &self.section;
        faces.visit_beam([tile.center - tile.half, tile.center + tile.half], direction, |face| {
            let bounds = section.bounds(faces.corners(face).map(|corner| corner.as_dvec3()));
            if section.meets(&bounds) {
                self.faces.push((face, bounds));
            }
            looked += 1;
            self.is_wide = self.faces.len() > MANY || looked > LOOKS;
            if self.is_wide { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    /// Calls `visit` with every face that the ray from a receiver may meet.
    ///
    /// What is left out lies on one side of a plane through the ray, or behind, by far more than rounding: it does not cover the ray's
    /// direction, whoever decides.
    #[inline(always)]
    fn visit(&self, position: DVec3, mut visit: impl FnMut(u32)) {
        let from = position - self.section.center;
        let [x, y, z] = self.section.normals.map(|normal| normal.dot(from));
        for &(face, [[x0, x1], [y0, y1], [z0, z1]]) in &self.faces {
            if (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1) & (z0 <= z) & (z <= z1) {
                visit(face);
            }
        }
    }
}

/// A beam by the planes around it.
#[derive(Default)]
struct Section {
    center: DVec3,
    half: DVec3,
    /// Two normals across, and one against the direction; without a direction the axes.
    normals: [DVec3; 3],
    /// Whether it ends in the direction of the last normal's opposite, too.
    is_box: bool,
}

impl Section {
    fn new(&Tile { center, half, .. }: &Tile, direction: DVec3) -> Self {
        let Some(along) = direction.try_normalize() else {
            return Self { center, half, normals: DVec3::AXES, is_box: true };
        };
        let (x, y) = along.any_orthonormal_pair();
        Self { center, half, normals: [x, y, -along], is_box: false }
    }

    /// Between which values of the normals a ray may meet a triangle: conservatively, by far more than rounding.
    fn bounds(&self, corners: [DVec3; 3]) -> [[f64; 2]; 3] {
        const MARGIN: f64 = 1e-6;
        let [a, b, c] = corners.map(|corner| corner - self.center);
        let margin = MARGIN * (a.abs().max(b.abs()).max(c.abs()) + self.half).element_sum();
        let mut bounds = self.normals.map(|normal| {
            let (a, b, c) = (normal.dot(a), normal.dot(b), normal.dot(c));
            [a.min(b).min(c) - margin, a.max(b).max(c) + margin]
        });
        if !self.is_box {
            bounds[2][1] = f64::INFINITY;
        }
        bounds
    }

    /// Whether a ray of the beam may meet a triangle with these bounds.
    fn meets(&self, bounds: &[[f64; 2]; 3]) -> bool {
        self.normals.iter().zip(bounds).all(|(normal, &[low, high])| {
            let reach = normal.abs().dot(self.half);
            low <= reach && high >= -reach
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::scene::faces_at;
    use crate::visibility::chart::{Chart, Outlook};
    use crate::visibility::{Frame, Isolines, MeridianFrame, Meridians};

    fn tree(corners: &[[Vec3; 3]]) -> FaceTree {
        let triangles: Arc<[[u32; 3]]> = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        FaceTree::new(corners.as_flattened().into(), triangles)
    }

    fn vertex(grid: i32) -> impl Strategy<Value = Vec3> {
        (-grid..=grid, -grid..=grid, -grid..=grid).prop_map(|(x, y, z)| Vec3::new(x as f32, y as f32, z as f32))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

        /// Tiles of any size among few faces and many.
        #[test]
        fn neighbours_find_what_each_would_alone(
            corners in prop::collection::vec([vertex(3), vertex(3), vertex(3)], 1..80),
            center in vertex(3),
            offsets in prop::collection::vec(vertex(2), 2..6),
            size in prop::sample::select(vec![1e-3, 0.1, 0.5, 1.0]),
            octant in 0..MeridianFrame::COUNT,
        ) {
            let faces = tree(&corners);
            let meridians = Meridians::new(14).unwrap();
            let isolines = Isolines::new(14).unwrap();
            let points: Vec<DVec3> = offsets.iter().map(|x| center.as_dvec3() + size * x.as_dvec3()).collect();
            let tile = Tile::new(points.iter().map(|&p| (p, None)));
            let depths = |position, tile, beams: &mut Beams| {
                let mut depths = [0; 2];
                let axes = MeridianFrame::of_octant(octant).axes();
                let outlook = Outlook { chart: &meridians, axes, position, normal: None };
                Meridians::count(outlook, Rays { faces: &faces, tile, beams }, &[], |_, covers| depths[0] += covers);
                let axes = Frame::facing(Some(axes.z_axis), 0).axes();
                let outlook = Outlook { chart: &isolines, axes, position, normal: None };
                Isolines::count(outlook, Rays { faces: &faces, tile, beams }, &[], |_, covers| depths[1] += covers);
                depths
            };
            let mut beams = Beams::default();
            for &p in points.iter().chain(&points) {
                let alone = depths(p, Tile::lone(p, None), &mut Beams::default());
                prop_assert_eq!(depths(p, tile, &mut beams), alone);
                let mut around = Vec::new();
                Rays { faces: &faces, tile, beams: &mut beams }.visit(p, DVec3::ZERO, |face| around.push(face));
                prop_assert!(faces_at(&faces, [p])[0].iter().all(|face| around.contains(face)));
            }
        }
    }

    #[test]
    fn few_of_many_faces_are_gathered() {
        let corner = |i: i32| Vec3::new((i % 30) as f32, (i / 30) as f32, 5.0);
        let corners: Vec<_> = (0..900).map(|i| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|x| corner(i) + x)).collect();
        let faces = tree(&corners);
        let points = [DVec3::new(12.4, 17.4, 4.0), DVec3::new(12.6, 17.6, 4.0)];
        let tile = Tile::new(points.into_iter().map(|p| (p, None)));
        let mut beams = Beams::default();
        assert!(beams.gathered(&faces, &tile, DVec3::Z).is_none(), "the first one looks alone");
        let gathered = |beam: &Beam| beam.faces.iter().map(|&(face, _)| face).collect::<Vec<_>>();
        assert_eq!(beams.gathered(&faces, &tile, DVec3::Z).map(gathered), Some(vec![17 * 30 + 12]));
        // The box around the triangle is around the first two points, but not around the third.
        for (point, number) in points.into_iter().chain([DVec3::new(13.1, 17.5, 4.0)]).zip([1, 1, 0]) {
            let mut met = 0;
            Rays { faces: &faces, tile, beams: &mut beams }.visit(point, DVec3::Z, |_| met += 1);
            assert_eq!(met, number);
        }
        for _ in 0..2 {
            assert!(beams.gathered(&faces, &tile, DVec3::X).is_none_or(|beam| beam.faces.is_empty()));
        }
        beams.begin();
        let mut wide = tile;
        (wide.half, wide.radius) = (DVec3::splat(9.0), 16.0);
        for _ in 0..3 {
            assert!(beams.gathered(&faces, &wide, DVec3::Z).is_none(), "each looks alone");
        }
    }
}
