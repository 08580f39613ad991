use std::path::Path;
use std::sync::LazyLock;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::prelude::{BitMapBackend, FontStyle, IntoDrawingArea, RGBColor, ViridisRGB};
use plotters::style::register_font;
use rayon::prelude::*;

use crate::bake::writers::atomically;
use crate::{Error, Result};

/// Colour of pixels that have no value.
const NOTHING: RGBColor = RGBColor(128, 128, 128);

/// An 8-bit sRGB picture, row 0 on top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<[u8; 3]>,
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, rgb: vec![colour; width * height] }
    }

    /// Linear values as grey, 0 black and 1 white; values outside are clamped.
    ///
    /// # Panics
    /// When there are not `width * height` values.
    pub fn grey(width: usize, height: usize, values: &[f64]) -> Self {
        Self::from_pixels(width, height, values.iter().map(|&x| [srgb(x); 3]).collect())
    }

    /// Linear Rec. 709 radiance: exposed so that the logarithmic mean of the luminance of all pixels that are not black
    /// becomes 0.18, then compressed by L / (1 + L) on the luminance (Reinhard, Stark, Shirley and Ferwerda 2002,
    /// equation 3).
    ///
    /// # Panics
    /// When there are not `width * height` colours.
    pub fn tone_mapped(width: usize, height: usize, colours: &[[f64; 3]]) -> Self {
        Self::exposed(width, height, colours, Self::exposure(colours))
    }

    /// The factor that brings the logarithmic mean of the luminance of all pixels that are not black to 0.18.
    pub fn exposure(colours: &[[f64; 3]]) -> f64 {
        let logarithms = colours.iter().map(|&colour| luminance(colour)).filter(|&l| l > 0.0).map(f64::ln);
        let (count, sum) = logarithms.fold((0u32, 0.0), |(count, sum), ln| (count + 1, sum + ln));
        0.18 / (sum / f64::from(count.max(1))).exp()
    }

    /// Linear Rec. 709 radiance times `exposure`, compressed as in [`Picture::tone_mapped`]: the frames of a film share one.
    ///
    /// # Panics
    /// When there are not `width * height` colours.
    pub fn exposed(width: usize, height: usize, colours: &[[f64; 3]], exposure: f64) -> Self {
        let map = |&colour: &[f64; 3]| {
            let scale = exposure / (1.0 + (exposure * luminance(colour)).max(0.0));
            colour.map(|x| srgb(scale * x))
        };
        Self::from_pixels(width, height, colours.par_iter().map(map).collect())
    }

    /// Values in false colour (viridis) by their place on `scale`; `None` becomes mid grey.
    ///
    /// # Panics
    /// When there are not `width * height` values.
    pub fn false_colour(width: usize, height: usize, values: &[Option<f64>], scale: Decades) -> Self {
        let pixel = |value: &Option<f64>| {
            let RGBColor(r, g, b) = value.map_or(NOTHING, |x| colour(scale.position(x)));
            [r, g, b]
        };
        Self::from_pixels(width, height, values.iter().map(pixel).collect())
    }

    pub(super) fn from_pixels(width: usize, height: usize, rgb: Vec<[u8; 3]>) -> Self {
        assert_eq!(rgb.len(), width * height, "one value per pixel");
        Self { width, height, rgb }
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Colour of the pixel in column `x` of row `y`.
    ///
    /// # Panics
    /// When it lies outside.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        assert!(x < self.width);
        self.rgb[y * self.width + x]
    }

    /// Copies `other` with its top left corner at `(x, y)`; what does not fit is cut off.
    pub fn paste(&mut self, other: &Self, x: usize, y: usize) {
        let columns = other.width.min(self.width.saturating_sub(x));
        for row in 0..other.height.min(self.height.saturating_sub(y)) {
            let (from, to) = (row * other.width, (y + row) * self.width + x);
            self.rgb[to..to + columns].copy_from_slice(&other.rgb[from..from + columns]);
        }
    }

    /// Lets `draw` add text and lines.
    ///
    /// # Errors
    /// When drawing fails.
    pub fn draw(
        &mut self,
        draw: impl FnOnce(&DrawingArea<BitMapBackend<'_>, Shift>) -> std::result::Result<(), Box<dyn std::error::Error>>,
    ) -> Result<()> {
        let size = (self.width as u32, self.height as u32);
        let area = BitMapBackend::with_buffer(self.rgb.as_flattened_mut(), size).into_drawing_area();
        load_font();
        draw(&area).and_then(|()| Ok(area.present()?)).map_err(|error| Error::input(format!("drawing failed: {error}")))
    }

    /// Writes the picture as PNG.
    ///
    /// # Errors
    /// When the file cannot be written, or the picture has no pixel.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (width, height) = (self.width as u32, self.height as u32);
        atomically(path, |file| {
            PngEncoder::new(file)
                .write_image(self.rgb.as_flattened(), width, height, ExtendedColorType::Rgb8)
                .map_err(|error| Error::file(path, error))
        })
    }
}

/// A logarithmic scale of four decades that ends at a greatest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decades {
    /// Value at the upper end.
    pub greatest: f64,
}

impl Decades {
    const COUNT: f64 = 4.0;

    /// Place of `x` on the scale: 0 at its lower end and for anything below, 1 at its upper end.
    pub fn position(self, x: f64) -> f64 {
        if x > 0.0 { (1.0 + (x / self.greatest).log10() / Self::COUNT).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Value at the lower end.
    pub fn least(self) -> f64 {
        self.greatest * 10f64.powf(-Self::COUNT)
    }
}

/// Colour of a place in [0, 1] on a scale, from dark blue to yellow with lightness rising evenly (viridis).
pub(super) fn colour(position: f64) -> RGBColor {
    ViridisRGB::get_color(position)
}

/// Luminance of a linear Rec. 709 colour.
fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// sRGB encoding of a linear value (IEC 61966-2-1), clamped to [0, 1].
fn srgb(linear: f64) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let encoded = if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// Makes the font known to the drawing library, once: no font of the system is needed.
pub(super) fn load_font() {
    static FONT: LazyLock<bool> =
        LazyLock::new(|| register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular()).is_ok());
    assert!(*FONT, "the embedded font is well-formed");
}

#[cfg(test)]
mod tests {
    use plotters::prelude::{BLACK, IntoFont, Text};

    use super::*;

    #[test]
    fn srgb_by_its_standard() {
        assert_eq!([0.0, 0.0031308, 0.5, 1.0, 7.0, -1.0].map(srgb), [0, 10, 188, 255, 255, 0]);
    }

    #[test]
    fn tone_mapping_is_exposed_by_the_mean_and_never_clips_white() {
        let picture = Picture::tone_mapped(3, 1, &[[5.0; 3], [5.0; 3], [0.0; 3]]);
        // 0.18 / 1.18, whatever the unit of radiance.
        assert_eq!(picture.pixel(0, 0), [srgb(0.18 / 1.18); 3]);
        assert_eq!(picture.pixel(2, 0), [0; 3]);
        let picture = Picture::tone_mapped(2, 1, &[[1e-3; 3], [1e9; 3]]);
        assert!(picture.pixel(0, 0)[0] < picture.pixel(1, 0)[0]);
        assert_eq!(Picture::tone_mapped(1, 1, &[[0.0; 3]]).pixel(0, 0), [0; 3]);
    }

    #[test]
    fn false_colours_rise_over_four_decades() {
        let scale = Decades { greatest: 2.0 };
        let close = |x: f64, position: f64| assert!((scale.position(x) - position).abs() < 1e-12);
        close(2.0, 1.0);
        close(0.02, 0.5);
        close(scale.least(), 0.0);
        close(1e-9, 0.0);
        close(0.0, 0.0);
        let picture = Picture::false_colour(3, 1, &[Some(2.0), Some(0.0), None], scale);
        let lightness = |x| picture.pixel(x, 0).iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!(lightness(0) > lightness(1) + 200);
        assert_eq!(picture.pixel(2, 0), [128; 3]);
    }

    #[test]
    fn text_is_drawn_without_a_font_of_the_system() {
        let mut picture = Picture::filled(60, 20, [255; 3]);
        picture
            .draw(|area| Ok(area.draw(&Text::new("RMSE", (2, 2), ("sans-serif", 14).into_font().color(&BLACK)))?))
            .unwrap();
        let dark = |columns: std::ops::Range<usize>| {
            columns.flat_map(|x| (0..20).map(move |y| (x, y))).filter(|&(x, y)| picture.pixel(x, y)[0] < 100).count()
        };
        assert!(dark(0..60) > 30);
        assert_eq!(dark(55..60), 0);
    }

    #[test]
    fn pasting_cuts_off_what_does_not_fit() {
        let mut picture = Picture::filled(3, 3, [0; 3]);
        picture.paste(&Picture::filled(2, 2, [9; 3]), 2, 1);
        let lit: Vec<_> = (0..9).filter(|i| picture.pixel(i % 3, i / 3) == [9; 3]).collect();
        assert_eq!(lit, [5, 8]);
    }
}
