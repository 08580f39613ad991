use std::sync::Arc;

use glam::DVec3;

use crate::{Error, Result};

use super::channels::flip_phase;
use super::{Array, Arrays, Phase, Provenance};

/// A finished result, ready to be written.
#[derive(Clone, Debug)]
pub enum Baked {
    /// One row per vertex or point.
    Vertices(BakedVertices),
    /// One row per pixel.
    Image(BakedImage),
}

/// Results at the vertices of a mesh, or at loose points.
#[derive(Clone, Debug)]
pub struct BakedVertices {
    /// Position of every receiver.
    pub positions: Vec<DVec3>,
    /// Unit normal of every receiver.
    pub normals: Vec<DVec3>,
    /// Receivers at the corners of every triangle; empty for loose points.
    pub triangles: Arc<[[u32; 3]]>,
    /// Results of shape `[receivers, ...]`.
    pub arrays: Arrays,
    /// Where the results come from.
    pub provenance: Provenance,
}

/// Results at the pixels of an image: row 0 on top, pixel `(x, y)` at `y * width + x`.
#[derive(Clone, Debug)]
pub struct BakedImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Share of every pixel that a surface covers, in [0, 1]: a black pixel is not an empty one.
    pub coverage: Vec<f32>,
    /// Results of shape `[height, width, ...]`, zero where nothing covers the pixel.
    pub arrays: Arrays,
    /// Where the results come from.
    pub provenance: Provenance,
}

impl BakedImage {
    /// Spreads `rows`, of shape `[pixels.len(), ...]`, over an image: row `i` belongs to pixel `pixels[i]`, which it
    /// covers wholly.
    ///
    /// # Errors
    /// When an array has another number of rows, or a pixel lies outside the image.
    pub fn from_rows(
        width: usize,
        height: usize,
        pixels: &[u32],
        rows: Arrays,
        provenance: Provenance,
    ) -> Result<Self> {
        let size = width * height;
        if let Some(pixel) = pixels.iter().find(|&&pixel| pixel as usize >= size) {
            return Err(Error::input(format!("pixel {pixel} lies outside an image of {width} x {height}")));
        }
        let mut coverage = vec![0.0; size];
        for &pixel in pixels {
            coverage[pixel as usize] = 1.0;
        }
        let mut arrays = Arrays::new();
        for array in rows {
            check_leading(&array, &[pixels.len()])?;
            let shape = [&[height, width], &array.shape[1..]].concat();
            let length: usize = array.shape[1..].iter().product();
            let mut data = vec![0.0; size * length];
            for (row, &pixel) in pixels.iter().enumerate() {
                let (from, to) = (row * length, pixel as usize * length);
                data[to..to + length].copy_from_slice(&array.data[from..from + length]);
            }
            arrays.push(Array::new(array.name, shape, data))?;
        }
        Ok(Self { width, height, coverage, arrays, provenance })
    }
}

impl Baked {
    /// The results.
    pub fn arrays(&self) -> &Arrays {
        match self {
            Self::Vertices(vertices) => &vertices.arrays,
            Self::Image(image) => &image.arrays,
        }
    }

    /// Where the results come from.
    pub fn provenance(&self) -> &Provenance {
        match self {
            Self::Vertices(vertices) => &vertices.provenance,
            Self::Image(image) => &image.provenance,
        }
    }

    /// The same results with spherical harmonics in the phase convention `phase`.
    ///
    /// # Errors
    /// None for results that pass [`Baked::check`].
    pub fn in_phase(mut self, phase: Phase) -> Result<Self> {
        let (arrays, provenance, leading) = match &mut self {
            Self::Vertices(vertices) => (&mut vertices.arrays, &mut vertices.provenance, 1),
            Self::Image(image) => (&mut image.arrays, &mut image.provenance, 2),
        };
        if provenance.sh_phase != phase {
            *arrays = flip_phase(std::mem::take(arrays), leading)?;
            provenance.sh_phase = phase;
        }
        Ok(self)
    }

    /// Fails unless all parts fit together: lengths, corner indices, finite positions and coverage.
    ///
    /// # Errors
    /// One line that names the part.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Vertices(vertices) => {
                let count = vertices.positions.len();
                if vertices.normals.len() != count {
                    return Err(Error::input(format!("{count} positions but {} normals", vertices.normals.len())));
                }
                if let Some(i) =
                    (0..count).find(|&i| !(vertices.positions[i].is_finite() && vertices.normals[i].is_finite()))
                {
                    return Err(Error::input(format!("receiver {i}: its position or normal is not finite")));
                }
                if let Some(i) =
                    vertices.triangles.iter().position(|corners| corners.iter().any(|&c| c as usize >= count))
                {
                    return Err(Error::input(format!("triangle {i}: a corner lies beyond the {count} receivers")));
                }
                vertices.arrays.iter().try_for_each(|array| check_leading(array, &[count]))
            }
            Self::Image(image) => {
                let size = image.width * image.height;
                if image.coverage.len() != size || image.coverage.iter().any(|c| !(0.0..=1.0).contains(c)) {
                    return Err(Error::input(format!("coverage must be {size} numbers in [0, 1]")));
                }
                image.arrays.iter().try_for_each(|array| check_leading(array, &[image.height, image.width]))
            }
        }
    }
}

fn check_leading(array: &Array, leading: &[usize]) -> Result<()> {
    if array.shape.starts_with(leading) {
        return Ok(());
    }
    let (name, shape) = (&array.name, &array.shape);
    Err(Error::input(format!("array {name}: shape {shape:?} should begin with {leading:?}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(name: &str, shape: &[usize]) -> Arrays {
        let mut arrays = Arrays::new();
        let size: usize = shape.iter().product();
        arrays.push(Array::new(name, shape, (0..size).map(|i| i as f64 + 1.0).collect())).unwrap();
        arrays
    }

    #[test]
    fn rows_go_to_their_pixels_and_the_rest_stays_uncovered() {
        let image = BakedImage::from_rows(3, 2, &[4, 0], rows("bent_normal", &[2, 3]), Provenance::default()).unwrap();
        assert_eq!(image.coverage, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let array = image.arrays.get("bent_normal").unwrap();
        assert_eq!(array.shape, [2, 3, 3]);
        assert_eq!(array.data[..3], [4.0, 5.0, 6.0]);
        assert_eq!(array.data[12..15], [1.0, 2.0, 3.0]);
        assert_eq!(array.data.iter().sum::<f64>(), 21.0);
        Baked::Image(image).check().unwrap();
        assert!(BakedImage::from_rows(3, 2, &[6], rows("a", &[1]), Provenance::default()).is_err());
        assert!(BakedImage::from_rows(3, 2, &[1], rows("a", &[2]), Provenance::default()).is_err());
    }

    #[test]
    fn parts_that_do_not_fit_are_named() {
        let good = BakedVertices {
            positions: vec![DVec3::ZERO; 2],
            normals: vec![DVec3::Z; 2],
            triangles: Arc::from([[0, 1, 0]]),
            arrays: rows("a", &[2]),
            provenance: Provenance::default(),
        };
        let message = |vertices: BakedVertices| Baked::Vertices(vertices).check().unwrap_err().to_string();
        Baked::Vertices(good.clone()).check().unwrap();
        assert!(message(BakedVertices { normals: vec![], ..good.clone() }).contains("0 normals"));
        assert!(message(BakedVertices { triangles: Arc::from([[0, 1, 2]]), ..good.clone() }).contains("triangle 0"));
        assert!(message(BakedVertices { arrays: rows("a", &[3]), ..good.clone() }).contains("array a"));
        assert!(message(BakedVertices { positions: vec![DVec3::ZERO, DVec3::NAN], ..good }).contains("receiver 1"));
    }

    #[test]
    fn phase_is_recorded_and_applied_once() {
        let arrays = rows("visibility_sh", &[1, 4]);
        let baked = Baked::Vertices(BakedVertices {
            positions: vec![DVec3::ZERO],
            normals: vec![DVec3::Z],
            triangles: Arc::from([]),
            arrays,
            provenance: Provenance::default(),
        });
        let flipped = baked.in_phase(Phase::CondonShortley).unwrap().in_phase(Phase::CondonShortley).unwrap();
        assert_eq!(flipped.arrays().get("visibility_sh").unwrap().data, [1.0, -2.0, 3.0, -4.0]);
        assert_eq!(flipped.provenance().sh_phase, Phase::CondonShortley);
    }
}
