//! Receiver set-up: what a camera sees through every pixel, by rasterisation in parallel bands of rows.

use std::ops::Range;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::{Receivers, Surface};
use crate::scene::Camera;

/// Rows that one task fills.
const BAND: usize = 32;

/// A camera with one receiver for every `scale` x `scale` pixels, whose ray passes through their middle.
#[derive(Clone, Debug)]
pub struct Viewport {
    /// The camera, at the resolution of the display.
    pub camera: Camera,
    /// Pixels of the display per receiver, across and down.
    pub scale: usize,
}

impl Viewport {
    /// Receivers across and down; the last ones may stand for less than all of their pixels.
    pub fn size(&self) -> [usize; 2] {
        self.camera.resolution().map(|side| (side as usize).div_ceil(self.scale))
    }

    /// Side of a pixel of the display at depth 1.
    pub fn pixel(&self) -> f32 {
        (self.camera.ray(1.0, 0.0) - self.camera.ray(0.0, 0.0)).length() as f32
    }

    /// Receivers of nothing, with room for transfer vectors of `transfer_len` coefficients, or none.
    pub fn nothing(&self, transfer_len: usize) -> Receivers {
        let [width, height] = self.size();
        Receivers::nothing(width, height, transfer_len)
    }

    fn ray(&self, x: usize, y: usize) -> DVec3 {
        let scale = self.scale as f64;
        self.camera.ray((x as f64 + 0.5) * scale, (y as f64 + 0.5) * scale)
    }
}

/// A triangle, or a part of one in front of the camera, ready to be filled.
struct Projected {
    triangle: u32,
    /// Corners on the image, in receivers.
    corners: [DVec2; 3],
    /// One over their depths.
    inverse_depth: [f64; 3],
    /// Weights of the triangle's own corners in each of these.
    weights: [[f32; 3]; 3],
    /// Twice the area on the image, positive or negative.
    area: f64,
    columns: Range<usize>,
    rows: Range<usize>,
    /// -1 where the camera sees the back: normals are turned.
    side: f32,
}

impl Projected {
    /// The edges opposite to the corners: positive inside, whichever way round the triangle appears.
    fn edges(&self) -> [Edge; 3] {
        let [a, b, c] = self.corners;
        let edges = if self.area > 0.0 { [(b, c), (c, a), (a, b)] } else { [(c, b), (a, c), (b, a)] };
        edges.map(|(a, b)| Edge::new(a, b))
    }

    /// Twice the areas that the middle of pixel (x, y) has with each edge, if it lies inside.
    fn covers(&self, edges: &[Edge; 3], x: usize, y: usize) -> Option<[f64; 3]> {
        let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let areas = [edges[0].area(p), edges[1].area(p), edges[2].area(p)];
        (0..3).all(|k| areas[k] > 0.0 || (areas[k] == 0.0 && edges[k].owns)).then_some(areas)
    }

    /// The share of every corner, times one over the depth.
    fn shares(&self, areas: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| areas[k] * self.inverse_depth[k])
    }

    fn depth(&self, areas: [f64; 3]) -> f64 {
        let [a, b, c] = self.shares(areas);
        (areas[0] + areas[1] + areas[2]) / (a + b + c)
    }

    /// Weights of the triangle's own corners.
    fn weights(&self, areas: [f64; 3]) -> [f32; 3] {
        let shares = self.shares(areas);
        let sum = shares[0] + shares[1] + shares[2];
        let mut weights = [0.0; 3];
        for (corner, share) in self.weights.iter().zip(shares) {
            let share = (share / sum) as f32;
            (0..3).for_each(|j| weights[j] += share * corner[j]);
        }
        weights
    }
}

/// Where no part is nearest.
const NOTHING_NEAR: u32 = u32::MAX;

/// A rectangle of pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rectangle {
    /// Columns.
    pub columns: Range<usize>,
    /// Rows.
    pub rows: Range<usize>,
}

impl Rectangle {
    /// Whether no pixel lies in it.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() || self.rows.is_empty()
    }
}

/// Draws a surface into `receivers`, in front of what they hold where it is nearer. Returns a rectangle around what may have
/// changed.
///
/// Pixels belong to a triangle if their middle does; of two triangles that share an edge exactly one gets a pixel in the middle
/// of which it passes. Parts nearer than a millionth of the surface's greatest depth are cut away.
///
/// # Panics
/// If the receivers are not those of the viewport, or the surface's parts do not fit together.
pub fn draw(viewport: &Viewport, surface: &Surface, receivers: &mut Receivers) -> Rectangle {
    let size = viewport.size();
    assert_eq!([receivers.width(), receivers.height()], size);
    assert!(surface.transfer_len == 0 || surface.transfer_len == receivers.transfer.len());
    let camera = &viewport.camera;
    let seen: Vec<DVec3> = surface.positions.par_iter().map(|p| camera.project(p.as_dvec3())).collect();
    let near = 1e-6 * seen.iter().map(|p| p.z).fold(0.0, f64::max);
    let projected: Vec<Projected> = surface
        .triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, corners)| project(viewport, surface, &seen, near, i as u32, *corners, size))
        .collect();
    let changed = projected.iter().fold(None, |sum: Option<Rectangle>, p| match sum {
        None => Some(Rectangle { columns: p.columns.clone(), rows: p.rows.clone() }),
        Some(r) => Some(Rectangle {
            columns: r.columns.start.min(p.columns.start)..r.columns.end.max(p.columns.end),
            rows: r.rows.start.min(p.rows.start)..r.rows.end.max(p.rows.end),
        }),
    });
    let Some(changed) = changed else { return Rectangle { columns: 0..0, rows: 0..0 } };
    // Which triangles touch which band, in order: results do not depend on the number of threads.
    let bands = size[1].div_ceil(BAND);
    let mut by_band: Vec<Vec<u32>> = vec![Vec::new(); bands];
    for (i, p) in (0u32..).zip(&projected) {
        for band in &mut by_band[p.rows.start / BAND..(p.rows.end - 1) / BAND + 1] {
            band.push(i);
        }
    }
    let fill = |band: usize, mut rows: Rows<'_>| {
        if by_band[band].is_empty() {
            return;
        }
        let first = band * BAND;
        let range = changed.rows.start.max(first)..changed.rows.end.min(first + BAND);
        let area = Rectangle { columns: changed.columns.clone(), rows: range };
        // What is nearest, then what it looks like there: nothing is worked out that something else hides.
        let mut nearest = vec![NOTHING_NEAR; area.columns.len() * area.rows.len()];
        for &i in &by_band[band] {
            rows.cover(&projected[i as usize], i, first, &area, &mut nearest);
        }
        let pixels = area.rows.clone().flat_map(|y| area.columns.clone().map(move |x| (x, y)));
        for ((x, y), &i) in pixels.zip(&nearest) {
            if i != NOTHING_NEAR {
                rows.resolve(viewport, surface, &projected[i as usize], first, x, y);
            }
        }
    };
    let stride = receivers.stride();
    Rows::split(receivers, stride * BAND).into_par_iter().enumerate().for_each(|(band, rows)| fill(band, rows));
    changed
}

/// The triangle's parts in front of the camera that cover the middle of some pixel.
fn project(
    viewport: &Viewport,
    surface: &Surface,
    seen: &[DVec3],
    near: f64,
    triangle: u32,
    corners: [u32; 3],
    size: [usize; 2],
) -> impl Iterator<Item = Projected> {
    let camera = &viewport.camera;
    let scale = viewport.scale as f64;
    let corner = |k: usize| seen[corners[k] as usize];
    let unit = |k: usize| std::array::from_fn(|i| if i == k { 1.0f32 } else { 0.0 });
    let mut polygon: Vec<(DVec3, [f32; 3])> = Vec::new();
    if (0..3).all(|k| corner(k).z > near) {
        polygon.extend((0..3).map(|k| (corner(k), unit(k))));
    } else if (0..3).any(|k| corner(k).z > near) {
        // Cut at the near plane in space, then project the new corners.
        for k in 0..3 {
            let next = (k + 1) % 3;
            let (a, b) = (corner(k).z, corner(next).z);
            if a > near {
                polygon.push((corner(k), unit(k)));
            }
            if (a > near) != (b > near) {
                // From the corner in front to the one behind, whichever comes first: both triangles at an edge cut alike.
                let (front, back) = if a > near { (k, next) } else { (next, k) };
                let (front_z, back_z) = (corner(front).z, corner(back).z);
                let t = (front_z - near) / (front_z - back_z);
                let [p, q] = [front, back].map(|k| surface.positions[corners[k] as usize].as_dvec3());
                let mut weights = [0.0; 3];
                (weights[front], weights[back]) = ((1.0 - t) as f32, t as f32);
                let mut cut = camera.project(p.lerp(q, t));
                cut.z = cut.z.max(0.5 * near);
                polygon.push((cut, weights));
            }
        }
    }
    let [a, b, c] = corners.map(|v| surface.positions[v as usize].as_dvec3());
    let facing = (b - a).cross(c - a).dot(camera.position() - a);
    let side = if facing < 0.0 { -1.0 } else { 1.0 };
    let fan = (1..polygon.len().saturating_sub(1)).map(move |k| [polygon[0], polygon[k], polygon[k + 1]]);
    fan.filter_map(move |part| {
        let corners = part.map(|(p, _)| DVec2::new(p.x, p.y) / scale);
        let [a, b, c] = corners;
        let area = (b - a).perp_dot(c - a);
        if !(area.is_finite() && area != 0.0) {
            return None;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Middles of pixels, i + 1/2, between low and high.
        let range = |low: f64, high: f64, size: usize| {
            let first = (low - 0.5).ceil().clamp(0.0, size as f64) as usize;
            let end = ((high - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
            first..end
        };
        let (columns, rows) = (range(low.x, high.x, size[0]), range(low.y, high.y, size[1]));
        (!columns.is_empty() && !rows.is_empty()).then(|| Projected {
            triangle,
            corners,
            inverse_depth: part.map(|(p, _)| p.z.recip()),
            weights: part.map(|(_, weights)| weights),
            area,
            columns,
            rows,
            side,
        })
    })
}

/// An edge of a triangle, ready to tell the side of points.
struct Edge {
    from: DVec2,
    along: DVec2,
    /// -1 where the edge is taken backwards.
    sign: f64,
    /// Whether points on it belong to the triangle on its positive side: to one of the two at every edge.
    owns: bool,
}

impl Edge {
    /// From a to b.
    fn new(a: DVec2, b: DVec2) -> Self {
        let owns = (a.x, a.y) < (b.x, b.y);
        let (from, to) = if owns { (a, b) } else { (b, a) };
        Self { from, along: to - from, sign: if owns { 1.0 } else { -1.0 }, owns }
    }

    /// Twice the signed area of the edge and p: the same number with the other sign for the edge turned round, to the bit.
    fn area(&self, p: DVec2) -> f64 {
        self.sign * self.along.perp_dot(p - self.from)
    }
}

/// Some rows of all planes of receivers.
struct Rows<'a> {
    stride: usize,
    position: [&'a mut [f32]; 3],
    normal: [&'a mut [f32]; 3],
    albedo: [&'a mut [f32]; 3],
    depth: &'a mut [f32],
    transfer: Vec<&'a mut [f32]>,
}

impl<'a> Rows<'a> {
    /// Cuts all planes into chunks.
    fn split(receivers: &'a mut Receivers, chunk: usize) -> Vec<Self> {
        let stride = receivers.stride();
        let mut position = receivers.position.each_mut().map(|plane| plane.chunks_mut(chunk));
        let mut normal = receivers.normal.each_mut().map(|plane| plane.chunks_mut(chunk));
        let mut albedo = receivers.albedo.each_mut().map(|plane| plane.chunks_mut(chunk));
        let mut transfer: Vec<_> = receivers.transfer.iter_mut().map(|plane| plane.chunks_mut(chunk)).collect();
        let depth = receivers.depth.chunks_mut(chunk);
        depth
            .map(|depth| {
                let next = |planes: &mut [std::slice::ChunksMut<'a, f32>; 3]| {
                    planes.each_mut().map(|chunks| chunks.next().expect("planes are of one size"))
                };
                Self {
                    stride,
                    position: next(&mut position),
                    normal: next(&mut normal),
                    albedo: next(&mut albedo),
                    depth,
                    transfer: transfer.iter_mut().map(|c| c.next().expect("planes are of one size")).collect(),
                }
            })
            .collect()
    }

    /// Enters part number `i` in the pixels of `area` that it covers nearer than what is there; `first` is the first of these
    /// rows.
    fn cover(&mut self, part: &Projected, i: u32, first: usize, area: &Rectangle, nearest: &mut [u32]) {
        let edges = part.edges();
        for y in part.rows.start.max(area.rows.start)..part.rows.end.min(area.rows.end) {
            let mut entered = false;
            for x in part.columns.clone() {
                let Some(areas) = part.covers(&edges, x, y) else {
                    // Rows of a triangle have no gaps.
                    if entered {
                        break;
                    }
                    continue;
                };
                entered = true;
                let depth = part.depth(areas) as f32;
                let stored = &mut self.depth[(y - first) * self.stride + x];
                if depth >= 0.0 && depth < *stored {
                    *stored = depth;
                    nearest[(y - area.rows.start) * area.columns.len() + x - area.columns.start] = i;
                }
            }
        }
    }

    /// Works out what pixel (x, y) sees of the part that is nearest there.
    fn resolve(&mut self, viewport: &Viewport, surface: &Surface, part: &Projected, first: usize, x: usize, y: usize) {
        let Some(areas) = part.covers(&part.edges(), x, y) else { return };
        let depth = part.depth(areas);
        let i = (y - first) * self.stride + x;
        let corners = surface.triangles[part.triangle as usize].map(|v| v as usize);
        let albedo = surface.albedo[part.triangle as usize];
        let weights = part.weights(areas);
        let normal: Vec3 = (0..3).map(|k| surface.normals[corners[k]] * weights[k]).sum();
        let normal = normal.normalize_or(Vec3::Z) * part.side;
        let position = (viewport.camera.position() + depth * viewport.ray(x, y)).as_vec3();
        for axis in 0..3 {
            self.position[axis][i] = position[axis];
            self.normal[axis][i] = normal[axis];
            self.albedo[axis][i] = albedo[axis];
        }
        if self.transfer.is_empty() {
            return;
        }
        if surface.transfer_len == 0 {
            let mut cosine = [0.0; 36];
            super::shade::cosine_into(normal, &mut cosine[..self.transfer.len()]);
            self.transfer.iter_mut().zip(cosine).for_each(|(plane, x)| plane[i] = x);
            return;
        }
        for (k, plane) in self.transfer.iter_mut().enumerate() {
            plane[i] = (0..3).map(|j| weights[j] * surface.transfer[corners[j] * surface.transfer_len + k]).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::bake::Pixels;
    use crate::scene::shapes::{Cuboid, Random, TorusKnot};
    use crate::scene::{Geometry, GeometryBuilder};

    fn surface(geometry: &Geometry) -> Surface {
        let normals = geometry.angle_weighted_normals();
        Surface {
            positions: geometry.positions.to_vec(),
            normals: normals.iter().map(|n| n.unwrap_or(DVec3::Z).as_vec3()).collect(),
            triangles: geometry.triangles.clone(),
            albedo: vec![Vec3::splat(0.5); geometry.triangles.len()],
            ..Surface::default()
        }
    }

    fn knot() -> Geometry {
        let mut builder = GeometryBuilder::default();
        builder.add(TorusKnot { triangles: 2000, ..TorusKnot::default() }.mesh().unwrap(), DAffine3::IDENTITY).unwrap();
        builder.build()
    }

    fn viewport(position: DVec3, resolution: [u32; 2], scale: usize) -> Viewport {
        Viewport { camera: Camera::new(position, DVec3::ZERO, DVec3::Y, 50.0, resolution).unwrap(), scale }
    }

    /// Set-up and primary rays see the same surfaces at the same depths.
    #[test]
    fn equals_primary_rays() {
        let geometry = knot();
        let surface = surface(&geometry);
        let faces = geometry.face_tree();
        // From outside, and from within, with triangles across the plane of the camera.
        for position in [DVec3::new(1.0, 2.0, 5.0), DVec3::new(0.3, 0.9, 0.4)] {
            let viewport = viewport(position, [101, 77], 1);
            let mut receivers = viewport.nothing(0);
            draw(&viewport, &surface, &mut receivers);
            let pixels = Pixels::new(&geometry, &faces, &viewport.camera);
            let mut expected = vec![None; 101 * 77];
            for (i, pixel) in pixels.indices.iter().enumerate() {
                expected[*pixel as usize] = Some(pixels.receivers.positions[i]);
            }
            let mut wrong = 0;
            for (pixel, expected) in expected.iter().enumerate() {
                let i = receivers.index(pixel % 101, pixel / 101);
                let found = receivers.is_seen(i).then(|| receivers.point(i).as_dvec3());
                match (found, expected) {
                    (None, None) => {}
                    (Some(found), Some(expected)) => {
                        assert!(found.distance(*expected) < 1e-4 * position.distance(*expected), "{found} {expected}");
                    }
                    // A silhouette through the middle of a pixel, to the last bits.
                    _ => wrong += 1,
                }
            }
            assert!(wrong < 3, "{wrong}");
            assert!(receivers.seen() > 200, "{}", receivers.seen());
        }
    }

    #[test]
    fn neighbours_leave_no_gap_and_share_no_pixel() {
        // A fan of random triangles over a rectangle: every pixel is covered once.
        let mut random = Random::new(9);
        for _ in 0..20 {
            let centre = Vec3::new(random.between(-0.9, 0.9) as f32, random.between(-0.9, 0.9) as f32, 0.0);
            let mut positions = vec![centre];
            let sides = 40;
            positions.extend((0..sides).map(|k| {
                // On a coarse grid: some are equal, and the triangle between them empty.
                let (s, c) = (std::f32::consts::TAU * k as f32 / sides as f32).sin_cos();
                let scale = 1.0 / s.abs().max(c.abs());
                Vec3::new((c * scale * 8.0).round() / 8.0, (s * scale * 8.0).round() / 8.0, 0.0)
            }));
            let viewport = viewport(DVec3::new(0.0, 0.0, 1.0), [64, 64], 1);
            let mut drawn = [0u8; 64 * 64];
            for k in 0..sides as u32 {
                let single = Surface {
                    normals: vec![Vec3::Z; positions.len()],
                    positions: positions.clone(),
                    triangles: [[0, 1 + k, 1 + (k + 1) % sides as u32]].into(),
                    albedo: vec![Vec3::ONE],
                    ..Surface::default()
                };
                let mut receivers = viewport.nothing(0);
                draw(&viewport, &single, &mut receivers);
                for (i, count) in drawn.iter_mut().enumerate() {
                    *count += u8::from(receivers.is_seen(i));
                }
            }
            assert!(drawn.iter().all(|count| *count == 1), "{drawn:?}");
        }
    }

    #[test]
    fn pixels_on_edges_belong_to_one_triangle() {
        // Squares with corners in middles of pixels, each cut along one of its diagonals, seen from either side.
        let mut covered = [[0u8; 13]; 13];
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let corner = |di: u32, dj: u32| DVec2::new(f64::from(4 * (i + di)) + 0.5, f64::from(4 * (j + dj)) + 0.5);
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let halves = if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[b, a, d], [b, d, c]] };
            for corners in halves {
                let part = Projected {
                    triangle: 0,
                    corners,
                    inverse_depth: [1.0; 3],
                    weights: [[0.0; 3]; 3],
                    area: (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]),
                    columns: 0..13,
                    rows: 0..13,
                    side: 1.0,
                };
                for (y, row) in covered.iter_mut().enumerate() {
                    for (x, count) in row.iter_mut().enumerate() {
                        *count += u8::from(part.covers(&part.edges(), x, y).is_some());
                    }
                }
            }
        }
        // Inside; along the border they may belong to what lies beyond.
        for (x, y) in (1usize..12).flat_map(|x| (1usize..12).map(move |y| (x, y))) {
            assert_eq!(covered[y][x], 1, "{x} {y}");
        }
    }

    #[test]
    fn coarse_receivers_look_through_the_middle_of_their_pixels() {
        let mut builder = GeometryBuilder::default();
        builder.add(Cuboid::default().mesh().unwrap(), DAffine3::IDENTITY).unwrap();
        let surface = surface(&builder.build());
        let [fine, coarse] = [1, 3].map(|scale| {
            let viewport = viewport(DVec3::new(2.0, 3.0, 4.0), [99, 75], scale);
            let mut receivers = viewport.nothing(4);
            draw(&viewport, &surface, &mut receivers);
            receivers
        });
        assert_eq!((coarse.width(), coarse.height()), (33, 25));
        for y in 0..25 {
            for x in 0..33 {
                let (i, j) = (coarse.index(x, y), fine.index(3 * x + 1, 3 * y + 1));
                assert_eq!(coarse.depth[i], fine.depth[j]);
                assert_eq!(coarse.point(i), fine.point(j));
                assert_eq!(coarse.transfer[2][i], fine.transfer[2][j]);
            }
        }
    }
}
