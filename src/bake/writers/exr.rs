//! OpenEXR files: one named float channel per component, losslessly compressed, provenance as an attribute.

use std::path::Path;

use exr::error::Error as ExrError;
use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    ReadChannels, ReadLayers, Text, WritableImage,
};

use crate::bake::channels::{Channel, narrow, split};
use crate::bake::{Array, BakedImage, BakedVertices, Provenance};
use crate::{Error, Result};

use super::atomic::atomically;
use super::npz::Archive;

/// Pixels in a row of the image that holds results per vertex.
pub const VERTICES_PER_ROW: usize = 1024;

/// Attribute that holds the provenance as JSON, the layout included.
const PROVENANCE: &str = "silhouette";

/// The components of the results (`sh.l1.m-1`, `ambient_occlusion`, `R`, ...) and `coverage`.
pub(super) fn write_image(path: &Path, image: &BakedImage) -> Result<()> {
    let mut channels = split(&image.arrays, 2)?;
    channels.push(Channel { name: "coverage".into(), values: image.coverage.clone() });
    write(path, (image.width, image.height), channels, image.provenance.clone().with("layout", "row 0 on top"))
}

/// Vertex `i` becomes pixel `(i mod 1024, i div 1024)`; `coverage` is 1 for a vertex and 0 for the padding of the last
/// row. `position.x` ... and `normal.x` ... stand beside the components of the results.
pub(super) fn write_vertices(path: &Path, vertices: &BakedVertices) -> Result<()> {
    let count = vertices.positions.len();
    if count == 0 {
        return Err(Error::file(path, "no vertices, and an OpenEXR file needs a pixel; write .npz"));
    }
    let mut channels = split(&vertices.arrays, 1)?;
    for (stem, vectors) in [("position", &vertices.positions), ("normal", &vertices.normals)] {
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            let name = format!("{stem}.{letter}");
            let values = vectors.iter().map(|v| narrow(&name, v[axis])).collect::<Result<_>>()?;
            channels.push(Channel { name, values });
        }
    }
    channels.push(Channel { name: "coverage".into(), values: vec![1.0; count] });

    let width = count.min(VERTICES_PER_ROW);
    let height = count.div_ceil(width);
    channels.iter_mut().for_each(|channel| channel.values.resize(width * height, 0.0));
    let layout = format!("vertex i is pixel (i mod {width}, i div {width}), row 0 on top; coverage 0 is padding");
    write(path, (width, height), channels, vertices.provenance.clone().with("layout", layout))
}

fn write(path: &Path, size: (usize, usize), channels: Vec<Channel>, provenance: Provenance) -> Result<()> {
    if size.0 == 0 || size.1 == 0 {
        return Err(Error::file(path, "an OpenEXR file needs at least one pixel"));
    }
    let channels = channels
        .into_iter()
        .map(|channel| AnyChannel::new(text(&channel.name), FlatSamples::F32(channel.values)))
        .collect();
    let mut attributes = LayerAttributes {
        software_name: Some(text(&format!("silhouette {}", provenance.version))),
        comments: Some(text(&provenance.command_line)),
        ..LayerAttributes::default()
    };
    // One attribute for everything: a map's order would change from run to run.
    attributes.other.insert(text(PROVENANCE), AttributeValue::Text(text(&provenance.to_json())));
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let image = Image::from_layer(Layer::new(size, attributes, encoding, AnyChannels::sort(channels)));
    atomically(path, |file| image.write().to_buffered(file).map_err(|error| named(path, error)))
}

/// Reads every channel of the first layer as an array `[height, width]`, in alphabetical order.
///
/// # Errors
/// When the file is missing, truncated or no OpenEXR image, or when a channel is subsampled or holds infinities or NaN.
pub fn read(path: &Path) -> Result<Archive> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|error| named(path, error))?;
    let layer = image.layer_data;
    let mut archive = Archive::default();
    for channel in layer.channel_data.list {
        let data = channel.sample_data.values_as_f32().map(f64::from).collect();
        let array = Array::new(channel.name.to_string(), [layer.size.height(), layer.size.width()], data);
        archive.arrays.push(array).map_err(|error| Error::file(path, error))?;
    }
    if let Some(AttributeValue::Text(json)) = layer.attributes.other.get(&text(PROVENANCE)) {
        let provenance = serde_json::from_slice(json.as_slice());
        archive.provenance = Some(provenance.map_err(|error| Error::file(path, format!("provenance: {error}")))?);
    }
    Ok(archive)
}

/// UTF-8 as it is; the format does not say otherwise.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

fn named(path: &Path, error: ExrError) -> Error {
    match error {
        ExrError::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            Error::file(path, "truncated: the OpenEXR file ends too early")
        }
        ExrError::Io(error) => Error::file(path, error),
        other => Error::file(path, format!("not a readable OpenEXR image: {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{image, tetrahedron};
    use super::*;
    use crate::bake::Arrays;

    #[test]
    fn images_come_back_channel_by_channel() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_image(&path, &image()).unwrap();
        let archive = read(&path).unwrap();
        let names: Vec<_> = archive.arrays.iter().map(|array| array.name.as_str()).collect();
        assert_eq!(names, ["ambient_occlusion", "coverage", "sh.l0.m0", "sh.l1.m-1", "sh.l1.m0", "sh.l1.m1"]);
        let channel = |name: &str| archive.arrays.get(name).unwrap();
        assert_eq!(channel("ambient_occlusion").shape, [2, 3]);
        assert_eq!(channel("ambient_occlusion").data, [0.0, 0.25, 0.5, 0.75, 0.0, 1.0]);
        assert_eq!(channel("coverage").data, [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(channel("sh.l1.m-1").data, [1.0, 5.0, 9.0, 13.0, 0.0, 17.0]);
        assert_eq!(archive.provenance.unwrap().method, "qmc");
    }

    #[test]
    fn vertices_wrap_to_rows_and_padding_is_uncovered() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut vertices = tetrahedron();
        write_vertices(&path, &vertices).unwrap();
        let archive = read(&path).unwrap();
        let occlusion = archive.arrays.get("ambient_occlusion").unwrap();
        assert_eq!(occlusion.shape, [1, 4]);
        let exact = &vertices.arrays.get("ambient_occlusion").unwrap().data;
        assert!(occlusion.data.iter().zip(exact).all(|(read, &exact)| *read == f64::from(exact as f32)));
        let provenance = archive.provenance.unwrap();
        assert!(provenance.parameters.contains(&("scene".into(), "tétraèdre.obj".into())));
        assert!(provenance.parameters.iter().any(|(name, value)| name == "layout" && value.contains("mod 4")));

        let count = VERTICES_PER_ROW + 1;
        vertices.positions = vec![vertices.positions[3]; count];
        vertices.normals = vec![vertices.normals[3]; count];
        vertices.arrays = Arrays::new();
        vertices.arrays.push(Array::new("a", [count], (0..count).map(|i| i as f64).collect())).unwrap();
        write_vertices(&path, &vertices).unwrap();
        let arrays = read(&path).unwrap().arrays;
        assert_eq!(arrays.get("coverage").unwrap().shape, [2, VERTICES_PER_ROW]);
        assert_eq!(arrays.get("coverage").unwrap().data.iter().sum::<f64>(), count as f64);
        assert_eq!(arrays.get("a").unwrap().data[count - 1..count + 1], [VERTICES_PER_ROW as f64, 0.0]);
        assert_eq!(arrays.get("position.z").unwrap().data[0], -3.0);
    }

    #[test]
    fn bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let message = || read(&path).unwrap_err().to_string();
        assert!(message().contains("No such file"));
        std::fs::write(&path, "not an image").unwrap();
        assert!(message().contains("not a readable OpenEXR image"), "{}", message());
        write_image(&path, &image()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in (0..whole.len()).step_by(47) {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(message().starts_with(&path.display().to_string()));
        }
    }
}
