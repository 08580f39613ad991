use glam::Vec3;
use rayon::prelude::*;

use super::lanes::LANES;
use super::receiver_setup::Rectangle;

/// The points that a camera sees: one per pixel, in planes of single precision.
///
/// Rows are `stride` numbers apart, a multiple of eight; what pads them, and pixels through which nothing is seen, have the
/// depth [`Receivers::NOTHING`].
#[derive(Clone, Debug, Default)]
pub struct Receivers {
    width: usize,
    height: usize,
    stride: usize,
    /// x, y and z of the points, world space.
    pub position: [Vec<f32>; 3],
    /// Unit normals, turned towards the camera.
    pub normal: [Vec<f32>; 3],
    /// Diffuse reflectance.
    pub albedo: [Vec<f32>; 3],
    /// Distance along the view, as in the 2007 paper's z_p.
    pub depth: Vec<f32>,
    /// Coefficients of a transfer vector, integral of V max(0, n.w) y with the visibility V of the static scene: one plane each.
    /// Without any, receivers see all of their hemisphere but for the proxies.
    pub transfer: Vec<Vec<f32>>,
}

impl Receivers {
    /// The depth of pixels through which nothing is seen.
    pub const NOTHING: f32 = f32::INFINITY;
    /// Where their points are: no proxy reaches that far, and its square is finite.
    pub const NOWHERE: f32 = 1e18;

    /// Pixels through which nothing is seen, with room for transfer vectors of `transfer_len` coefficients, or none.
    pub fn nothing(width: usize, height: usize, transfer_len: usize) -> Self {
        let stride = width.next_multiple_of(LANES);
        let plane = |x: f32| vec![x; stride * height];
        Self {
            width,
            height,
            stride,
            position: std::array::from_fn(|_| plane(Self::NOWHERE)),
            normal: std::array::from_fn(|axis| plane(if axis == 2 { 1.0 } else { 0.0 })),
            albedo: std::array::from_fn(|_| plane(0.0)),
            depth: plane(Self::NOTHING),
            transfer: (0..transfer_len).map(|_| plane(0.0)).collect(),
        }
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// From a pixel to the one below it in every plane.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Groups of eight neighbours in a row.
    pub fn groups(&self) -> usize {
        self.stride / LANES
    }

    /// Place of pixel (x, y) in every plane.
    #[inline(always)]
    pub fn index(&self, x: usize, y: usize) -> usize {
        y * self.stride + x
    }

    /// The point at a place.
    #[inline(always)]
    pub fn point(&self, index: usize) -> Vec3 {
        let [x, y, z] = &self.position;
        Vec3::new(x[index], y[index], z[index])
    }

    /// The normal at a place.
    #[inline(always)]
    pub fn normal_at(&self, index: usize) -> Vec3 {
        let [x, y, z] = &self.normal;
        Vec3::new(x[index], y[index], z[index])
    }

    /// Whether something is seen at a place.
    #[inline(always)]
    pub fn is_seen(&self, index: usize) -> bool {
        self.depth[index] < Self::NOTHING
    }

    /// Number of pixels through which something is seen.
    pub fn seen(&self) -> usize {
        self.depth.iter().filter(|depth| **depth < Self::NOTHING).count()
    }

    /// Copies what is seen at a place of `other` to a place of this buffer.
    ///
    /// # Panics
    /// If the two have transfer vectors of different length, or a place lies outside.
    pub fn copy(&mut self, to: usize, other: &Self, from: usize) {
        assert_eq!(self.transfer.len(), other.transfer.len());
        let planes = [
            (&mut self.position, &other.position),
            (&mut self.normal, &other.normal),
            (&mut self.albedo, &other.albedo),
        ];
        for (mine, theirs) in planes {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| mine[to] = theirs[from]);
        }
        self.transfer.iter_mut().zip(&other.transfer).for_each(|(mine, theirs)| mine[to] = theirs[from]);
        self.depth[to] = other.depth[from];
    }

    /// Copies a rectangle of pixels from a buffer of the same size.
    ///
    /// # Panics
    /// If the buffers differ in size, or the rectangle lies outside.
    pub fn copy_rectangle(&mut self, other: &Self, rectangle: &Rectangle) {
        let stride = self.stride;
        let mine = self.position.iter_mut().chain(&mut self.normal).chain(&mut self.albedo).chain(&mut self.transfer);
        let theirs = other.position.iter().chain(&other.normal).chain(&other.albedo).chain(&other.transfer);
        let planes: Vec<_> = mine.zip(theirs).chain(std::iter::once((&mut self.depth, &other.depth))).collect();
        planes.into_par_iter().for_each(|(mine, theirs)| {
            for y in rectangle.rows.clone() {
                let range = y * stride + rectangle.columns.start..y * stride + rectangle.columns.end;
                mine[range.clone()].copy_from_slice(&theirs[range]);
            }
        });
    }
}
