use glam::DVec3;

use super::Picture;
use crate::scene::Geometry;

/// A view of a geometry along an axis, without perspective: shaded triangles behind marked lines.
pub(super) struct Orthographic {
    size: usize,
    /// From the scene to (column, row, height towards the viewer) in pixels.
    axes: [DVec3; 3],
    centre: DVec3,
    height: Vec<f64>,
    colour: Vec<[u8; 3]>,
    marks: Vec<Mark>,
}

/// What lines cover a pixel.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Mark {
    None,
    Hidden([u8; 3]),
    Visible([u8; 3]),
}

/// Seen from the front and from the back, lit along the view.
const FRONT: [f64; 3] = [205.0, 210.0, 218.0];
const BACK: [f64; 3] = [150.0, 130.0, 105.0];
const BACKGROUND: [u8; 3] = [255; 3];

impl Orthographic {
    /// A square picture of `size` pixels that just holds `bounds`, with `right` and `up` of the picture along these axes
    /// of the scene.
    pub(super) fn new(size: usize, [low, high]: [DVec3; 2], right: DVec3, up: DVec3) -> Self {
        // One scale for all views, so that they can be compared; a point has none.
        let extent = (high - low).max_element();
        let scale = if extent > 0.0 { 0.94 * size as f64 / extent } else { 1.0 };
        Self {
            size,
            axes: [right, -up, right.cross(up)].map(|axis| axis * scale),
            centre: (low + high) / 2.0,
            height: vec![f64::NEG_INFINITY; size * size],
            colour: vec![BACKGROUND; size * size],
            marks: vec![Mark::None; size * size],
        }
    }

    fn project(&self, p: DVec3) -> DVec3 {
        let middle = self.size as f64 / 2.0;
        let [column, row, height] = self.axes.map(|axis| axis.dot(p - self.centre));
        DVec3::new(column + middle, row + middle, height)
    }

    /// Draws all triangles.
    pub(super) fn fill(&mut self, geometry: &Geometry) {
        for corners in (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t)) {
            let [a, b, c] = corners.map(|p| self.project(p));
            // Rows run downwards, so that a triangle seen from the front turns clockwise here.
            let normal = (c - a).cross(b - a);
            if normal.z == 0.0 {
                continue;
            }
            let shade = 0.35 + 0.65 * normal.z.abs() / normal.length();
            let base = if normal.z > 0.0 { FRONT } else { BACK };
            let colour = base.map(|x| (x * shade) as u8);
            let span = |x: [f64; 3]| {
                let low = x.into_iter().fold(f64::INFINITY, f64::min) - 0.5;
                let high = x.into_iter().fold(f64::NEG_INFINITY, f64::max) - 0.5;
                (low.ceil().max(0.0) as usize, ((high.floor() + 1.0).max(0.0) as usize).min(self.size))
            };
            let ((left, right), (top, bottom)) = (span([a.x, b.x, c.x]), span([a.y, b.y, c.y]));
            for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
                let p = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0);
                let weight = |u: DVec3, v: DVec3| (v - p).cross(u - p).z / normal.z;
                let (wa, wb, wc) = (weight(b, c), weight(c, a), weight(a, b));
                let height = wa * a.z + wb * b.z + wc * c.z;
                let i = y * self.size + x;
                if wa >= 0.0 && wb >= 0.0 && wc >= 0.0 && height > self.height[i] {
                    self.height[i] = height;
                    self.colour[i] = colour;
                }
            }
        }
    }

    /// Draws a ball.
    pub(super) fn ball(&mut self, center: DVec3, radius: f64, colour: [u8; 3]) {
        let p = self.project(center);
        let radius = radius * self.axes[0].length();
        let span = |x: f64| {
            let first = (x - radius - 0.5).ceil().max(0.0) as usize;
            first..((x + radius + 0.5).floor().max(0.0) as usize).min(self.size)
        };
        for (x, y) in span(p.y).flat_map(|y| span(p.x).map(move |x| (x, y))) {
            let square = (x as f64 + 0.5 - p.x).powi(2) + (y as f64 + 0.5 - p.y).powi(2);
            let rise = (radius * radius - square).max(0.0).sqrt();
            let i = y * self.size + x;
            if square <= radius * radius && p.z + rise > self.height[i] {
                self.height[i] = p.z + rise;
                self.colour[i] = colour.map(|c| (f64::from(c) * (0.35 + 0.65 * rise / radius)) as u8);
            }
        }
    }

    /// Marks a line; where triangles hide it, it is only hinted at. To be called after [`Self::fill`].
    pub(super) fn mark(&mut self, ends: [DVec3; 2], colour: [u8; 3]) {
        let [a, b] = ends.map(|p| self.project(p));
        let steps = (b - a).truncate().abs().max_element().ceil().max(1.0) as usize;
        for step in 0..=steps {
            let p = a.lerp(b, step as f64 / steps as f64);
            let (x, y) = (p.x as usize, p.y as usize);
            if x >= self.size || y >= self.size {
                continue;
            }
            let i = y * self.size + x;
            // Within a few pixels of the surface the line lies on it.
            let mark = if p.z + 3.0 >= self.height[i] { Mark::Visible(colour) } else { Mark::Hidden(colour) };
            if mark > self.marks[i] {
                self.marks[i] = mark;
            }
        }
    }

    /// The finished picture.
    pub(super) fn picture(self) -> Picture {
        let pixel = |(under, mark): (&[u8; 3], &Mark)| match *mark {
            Mark::None => *under,
            Mark::Visible(colour) => colour,
            Mark::Hidden(colour) => {
                std::array::from_fn(|k| ((3 * u16::from(under[k]) + u16::from(colour[k])) / 4) as u8)
            }
        };
        Picture::from_pixels(self.size, self.size, self.colour.iter().zip(&self.marks).map(pixel).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, Vec3};

    use super::*;
    use crate::scene::{GeometryBuilder, Mesh};

    /// A triangle with legs of 2 at z = 0 that faces +z, drawn from there or from behind.
    fn view(from_behind: bool) -> Orthographic {
        let mut builder = GeometryBuilder::default();
        let corners = vec![Vec3::NEG_ONE.with_z(0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(-1.0, 1.0, 0.0)];
        builder.add(Mesh::new("triangle", corners, vec![[0, 1, 2]]), DAffine3::IDENTITY).unwrap();
        let bounds = [DVec3::splat(-1.0), DVec3::splat(1.0)];
        let right = if from_behind { DVec3::NEG_X } else { DVec3::X };
        let mut view = Orthographic::new(100, bounds, right, DVec3::Y);
        view.fill(&builder.build());
        view
    }

    #[test]
    fn triangles_cover_their_area_and_show_their_side() {
        let front = view(false).picture();
        let full = FRONT.map(|x| x as u8);
        assert_eq!((front.pixel(10, 10), front.pixel(10, 90), front.pixel(90, 90)), (full, full, full));
        assert_eq!(front.pixel(90, 10), BACKGROUND);
        let covered = (0..100 * 100).filter(|i| front.pixel(i % 100, i / 100) == full).count() as f64;
        assert!((covered - 94.0 * 94.0 / 2.0).abs() < 94.0, "{covered}");
        let back = view(true).picture();
        assert_eq!((back.pixel(90, 10), back.pixel(10, 10)), (BACK.map(|x| x as u8), BACKGROUND));
    }

    #[test]
    fn nearer_triangles_win_whatever_the_order() {
        // A square at the given height; the lower one is turned over and shows its back.
        let square = |z: f32| {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z));
            let triangles = if z == 0.0 { [[0, 2, 1], [0, 3, 2]] } else { [[0, 1, 2], [0, 2, 3]] };
            Mesh::new("square", corners.to_vec(), triangles.to_vec())
        };
        for heights in [[0.0, 0.5], [0.5, 0.0]] {
            let mut builder = GeometryBuilder::default();
            for z in heights {
                builder.add(square(z), DAffine3::IDENTITY).unwrap();
            }
            let mut view = Orthographic::new(20, [DVec3::splat(-1.0), DVec3::splat(1.0)], DVec3::X, DVec3::Y);
            view.fill(&builder.build());
            assert_eq!(view.picture().pixel(10, 10), FRONT.map(|x| x as u8));
        }
    }

    #[test]
    fn balls_cover_their_discs_and_meet_where_they_are_equally_high() {
        let mut view = Orthographic::new(100, [DVec3::splat(-1.0), DVec3::splat(1.0)], DVec3::X, DVec3::Y);
        let (red, blue) = ([200, 0, 0], [0, 0, 200]);
        view.ball(DVec3::new(-0.2, 0.0, 0.0), 0.5, red);
        view.ball(DVec3::new(0.2, 0.0, 0.0), 0.5, blue);
        let picture = view.picture();
        for x in 20..80 {
            let [r, _, b] = picture.pixel(x, 50);
            assert!(if x < 50 { r > b } else { b > r }, "{x}");
        }
        let covered = (0..100 * 100).filter(|i| picture.pixel(i % 100, i / 100) != BACKGROUND).count() as f64;
        // Two discs less their lens.
        let (r, d) = (0.5 * 47.0f64, 0.4 * 47.0f64);
        let lens = 2.0 * r * r * (d / (2.0 * r)).acos() - d / 2.0 * (4.0 * r * r - d * d).sqrt();
        let expected = 2.0 * std::f64::consts::PI * r * r - lens;
        assert!((covered - expected).abs() < 0.01 * expected, "{covered} for {expected}");
    }

    #[test]
    fn lines_behind_triangles_are_hinted_at() {
        let mut view = view(false);
        let red = [200, 0, 0];
        let across = |z| [DVec3::new(-1.0, -0.5, z), DVec3::new(0.3, -0.5, z)];
        view.mark(across(-1.0), red);
        let mut nearer = view;
        let hidden = nearer.marks[73 * 100 + 20];
        assert!(hidden == Mark::Hidden(red));
        nearer.mark(across(0.0), red);
        assert_eq!(nearer.picture().pixel(20, 73), red);
    }
}
