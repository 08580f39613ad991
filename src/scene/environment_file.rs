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
    let mut reader = image::ImageReader::open(path).map_err(|e| Error::file(path, e))?;
    reader.set_format(image::ImageFormat::Hdr);
    reader.no_limits();
    let image = reader.decode().map_err(|e| Error::file(path, one_line(e)))?.into_rgb32f();
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok((width, height, image.pixels().map(|p| Vec3::from_array(p.0)).collect()))
}

fn one_line(error: impl ToString) -> String {
    error.to_string().replace('\n', " ")
}
