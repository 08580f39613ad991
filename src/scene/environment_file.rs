use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::Vec3;

use super::Environment;
use crate::{Error, Result};

/// Reads a latitude-longitude image by its extension.
pub(super) fn load(path: &Path) -> Result<Environment> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let (width, height, radiance) = match extension.as_str() {
        "exr" => load_exr(path)?,
        "hdr" => load_hdr(path)?,
        _ => return Err(Error::file(path, "not an environment by its extension; known are .exr and .hdr")),
    };
    Environment::new(width, height, radiance).map_err(|e| Error::file(path, e))
}

type Pixels = (usize, usize, Vec<Vec3>);

/// The first layer that has R, G and B, or else Y, alone or behind a prefix (`ViewLayer.Combined.R`).
fn load_exr(path: &Path) -> Result<Pixels> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_file(path)
        .map_err(|e| Error::file(path, one_line(e)))?;
    for layer in &image.layer_data {
        let channels = &layer.channel_data.list;
        let find = |colour: &str| {
            let is_colour = |name: &str| name.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case(colour));
            channels.iter().find(|channel| is_colour(&channel.name.to_string()))
        };
        let colours = match [find("R"), find("G"), find("B"), find("Y")] {
            [Some(r), Some(g), Some(b), _] => [r, g, b],
            [_, _, _, Some(y)] => [y, y, y],
            _ => continue,
        };
        if colours.iter().any(|channel| channel.sampling.x() != 1 || channel.sampling.y() != 1) {
            return Err(Error::file(path, "colour channels are subsampled; save them at full resolution"));
        }
        let whole = image.attributes.display_window;
        if layer.size != whole.size || layer.attributes.layer_position != whole.position {
            return Err(Error::file(path, "the data window is not the display window; save the whole image"));
        }
        let size = layer.size;
        let pixel =
            |i: usize| Vec3::from_array(colours.map(|channel| channel.sample_data.value_by_flat_index(i).to_f32()));
        return Ok((size.x(), size.y(), (0..size.area()).map(pixel).collect()));
    }
    Err(Error::file(path, "no layer has the channels R, G and B, or Y"))
}

fn load_hdr(path: &Path) -> Result<Pixels> {
    /// Pixels that a byte can stand for: run lengths give 16, those of the oldest files, hardly ever, more.
    const PIXELS_PER_BYTE: u64 = 64;
    let open = || {
        let mut reader = image::ImageReader::open(path).map_err(|e| Error::file(path, e))?;
        reader.set_format(image::ImageFormat::Hdr);
        reader.no_limits();
        Ok::<_, Error>(reader)
    };
    // The decoder makes room for what the header claims.
    let (width, height) = open()?.into_dimensions().map_err(|e| Error::file(path, one_line(e)))?;
    let bytes = std::fs::metadata(path).map_err(|e| Error::file(path, e))?.len();
    if u64::from(width) * u64::from(height) > PIXELS_PER_BYTE * bytes {
        return Err(Error::file(
            path,
            format!("{width} x {height} pixels in {bytes} bytes; the file is truncated or damaged"),
        ));
    }
    let image = open()?.decode().map_err(|e| Error::file(path, one_line(e)))?.into_rgb32f();
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok((width, height, image.pixels().map(|p| Vec3::from_array(p.0)).collect()))
}

fn one_line(error: impl ToString) -> String {
    error.to_string().replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use exr::prelude::*;

    use super::*;

    fn pixel(x: usize, y: usize) -> Vec3 {
        Vec3::new(x as f32, y as f32, 0.25) * 0.5
    }

    /// Writes a 6 x 3 image whose channels have these names.
    fn write_exr(path: &Path, names: [&str; 3], compression: Compression) {
        let size = Vec2(6, 3);
        let channel = |(k, name): (usize, &str)| {
            let samples = (0..18).map(|i| pixel(i % 6, i / 6)[k]).collect();
            AnyChannel::new(name, FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort(names.into_iter().enumerate().map(channel).collect());
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let layer = Layer::new(size, LayerAttributes::named("light"), encoding, channels);
        Image::from_layer(layer).write().to_file(path).unwrap();
    }

    #[test]
    fn exr_pixels_arrive_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.exr");
        for compression in [Compression::Uncompressed, Compression::ZIP16, Compression::PIZ, Compression::RLE] {
            for names in [["R", "G", "B"], ["View.Combined.R", "View.Combined.G", "View.Combined.B"]] {
                write_exr(&path, names, compression);
                let image = Environment::load(&path).unwrap();
                assert_eq!((image.width(), image.height()), (6, 3));
                for (i, l) in image.pixels().iter().enumerate() {
                    assert_eq!(*l, pixel(i % 6, i / 6));
                }
            }
        }
        write_exr(&path, ["Z", "Y", "X"], Compression::ZIP1);
        assert_eq!(Environment::load(&path).unwrap().pixels()[9], Vec3::splat(0.5));
    }

    #[test]
    fn hdr_pixels_arrive_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.hdr");
        // A power of two, halves and quarters are exact in shared-exponent pixels.
        let pixels: Vec<image::Rgb<f32>> = (0..18).map(|i| image::Rgb(pixel(i % 6, i / 6).to_array())).collect();
        image::codecs::hdr::HdrEncoder::new(fs::File::create(&path).unwrap()).encode(&pixels, 6, 3).unwrap();
        let image = Environment::load(&path).unwrap();
        assert_eq!((image.width(), image.height()), (6, 3));
        for (i, l) in image.pixels().iter().enumerate() {
            // One of 256 steps of the brightest colour.
            assert!(l.distance(pixel(i % 6, i / 6)) <= pixel(i % 6, i / 6).max_element() / 64.0);
        }
    }

    #[test]
    fn bad_images_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, why: &str| {
            let path = folder.path().join(name);
            let message = Environment::load(&path).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{}: ", path.display())) && message.contains(why), "{message}");
            assert!(!message.contains('\n'), "{message}");
        };
        let path = folder.path().join("light.exr");
        refused("light.exr", "");
        write_exr(&path, ["U", "V", "W"], Compression::ZIP16);
        refused("light.exr", "R, G and B, or Y");
        write_exr(&path, ["R", "G", "B"], Compression::ZIP16);
        let whole = fs::read(&path).unwrap();
        for length in [0, 4, 100, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            refused("light.exr", "");
        }
        fs::write(folder.path().join("light.hdr"), b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 6\n12").unwrap();
        refused("light.hdr", "");
        fs::write(folder.path().join("light.hdr"), b"not an image").unwrap();
        refused("light.hdr", "");
        fs::write(folder.path().join("light.png"), b"").unwrap();
        refused("light.png", "known are .exr and .hdr");
    }

    #[test]
    fn windows_that_differ_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.exr");
        let channels = SpecificChannels::rgb(|_: Vec2<usize>| (1f32, 1f32, 1f32));
        let attributes = LayerAttributes::named("light").with_position(Vec2(1, 0));
        let layer = Layer::new((4, 2), attributes, Encoding::default(), channels);
        let whole = ImageAttributes::new(IntegerBounds::from_dimensions((6, 3)));
        Image::empty(whole).with_layer(layer).write().to_file(&path).unwrap();
        assert!(Environment::load(&path).unwrap_err().to_string().contains("display window"));
    }

    #[test]
    fn light_that_is_none_names_its_pixel() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.exr");
        write_rgb_file(&path, 4, 2, |x, y| (1f32, if (x, y) == (3, 1) { f32::INFINITY } else { 1.0 }, 1f32)).unwrap();
        let message = Environment::load(&path).unwrap_err().to_string();
        assert!(message.contains("light.exr: radiance of pixel (3, 1) is (1, inf, 1)"), "{message}");
    }
}
