//! What the battery's scenes are made of: loose triangles.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::Result;
use crate::bake::Receivers;
use crate::scene::shapes::{Icosphere, Random, TorusKnot};
use crate::scene::{Geometry, GeometryBuilder, Mesh};

/// Corners in the order of the winding.
pub(super) type Triangle = [Vec3; 3];

/// A point with integer coordinates in units of 1/16: what transforms of the battery keep exact.
pub(super) fn grid(x: i32, y: i32, z: i32) -> Vec3 {
    Vec3::new(x as f32, y as f32, z as f32) / 16.0
}

/// Welded and cleaned like any input.
pub(super) fn scene(triangles: &[Triangle]) -> Result<Arc<Geometry>> {
    let indices = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut builder = GeometryBuilder::default();
    builder.add(Mesh::new("stress", triangles.as_flattened().to_vec(), indices), DAffine3::IDENTITY)?;
    Ok(Arc::new(builder.build()))
}

/// A planar convex polygon as a fan.
pub(super) fn polygon(corners: &[Vec3]) -> Vec<Triangle> {
    corners.windows(2).skip(1).map(|edge| [corners[0], edge[0], edge[1]]).collect()
}

/// A closed box, wound outwards.
pub(super) fn cuboid(low: Vec3, high: Vec3) -> Vec<Triangle> {
    let corner = |k: usize| {
        let end = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
        Vec3::new(end(0), end(1), end(2))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    quads.iter().flat_map(|quad| polygon(&quad.map(corner))).collect()
}

/// A ball of 80 triangles.
pub(super) fn ball(centre: Vec3, radius: f64) -> Result<Vec<Triangle>> {
    let mesh = Icosphere { radius, subdivisions: 1 }.mesh()?;
    Ok(moved(&loose(&mesh), |p| p + centre))
}

/// A trefoil knot of some 500 triangles.
pub(super) fn knot() -> Result<Vec<Triangle>> {
    Ok(loose(&TorusKnot { triangles: 500, ..TorusKnot::default() }.mesh()?))
}

fn loose(mesh: &Mesh) -> Vec<Triangle> {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect()
}

/// The four triangles between a triangle's corners and the middles of its sides.
pub(super) fn split(&[a, b, c]: &Triangle) -> [Triangle; 4] {
    let (ab, bc, ca) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
}

/// Every corner moved.
pub(super) fn moved(triangles: &[Triangle], place: impl Fn(Vec3) -> Vec3) -> Vec<Triangle> {
    triangles.iter().map(|t| t.map(&place)).collect()
}

/// Boxes, mostly overlapping, from quarters to eighths within [-2, 3.25]^3: edges in common planes and lines, on the octants' boundaries
/// and through each other.
pub(super) fn boxes(random: &mut Random, count: usize) -> Vec<Triangle> {
    let mut coordinate = || 4 * random.between(-8.0, 8.0).floor() as i32;
    let mut one = || {
        let low = [coordinate(), coordinate(), coordinate()];
        let size = [coordinate(), coordinate(), coordinate()].map(|x| x.abs() / 2 + 4);
        let [lo, hi] = [low, std::array::from_fn(|k| low[k] + size[k])].map(|[x, y, z]| grid(x, y, z));
        cuboid(lo, hi)
    };
    (0..count).flat_map(|_| one()).collect()
}

/// Unrelated triangles on the grid within [-2, 2]^3.
pub(super) fn soup(random: &mut Random, count: usize) -> Vec<Triangle> {
    let mut coordinate = || random.between(-32.0, 33.0).floor() as i32;
    (0..count).map(|_| [(); 3].map(|()| grid(coordinate(), coordinate(), coordinate()))).collect()
}

/// A random unit vector; every third time an axis.
pub(super) fn direction(random: &mut Random) -> DVec3 {
    let pick = (9.0 * random.unit()) as usize;
    if pick < 3 {
        let sign = if random.unit() < 0.5 { 1.0 } else { -1.0 };
        return sign * [DVec3::X, DVec3::Y, DVec3::Z][pick];
    }
    random.in_ball().try_normalize().unwrap_or(DVec3::Y)
}

/// Receivers in [-`reach`, `reach`]^3, with few bits in their coordinates, which transforms of the battery keep.
pub(super) fn floating(random: &mut Random, count: usize, reach: f64) -> Receivers {
    let few = |x: f64| (x * 2f64.powi(16)).round() * 2f64.powi(-16);
    Receivers::points((0..count).map(|_| {
        let p = [(); 3].map(|()| few(random.between(-reach, reach)));
        (DVec3::from(p), direction(random))
    }))
}

/// The same receivers, wherever `place` puts them, with their normals turned.
pub(super) fn placed(receivers: &Receivers, place: impl Fn(DVec3) -> DVec3, turn: DMat3) -> Receivers {
    let positions = receivers.positions.iter().map(|&p| place(p));
    Receivers::points(positions.zip(receivers.normals.iter().map(|&n| turn * n)))
}
