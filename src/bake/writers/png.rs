//! Pictures for the eye: eight bits, sRGB.

use std::path::Path;

use crate::bake::BakedImage;
use crate::report::Picture;
use crate::{Error, Result};

/// Draws the result that an eye wants to see: `radiance` or `irradiance` tone-mapped, else `ambient_occlusion` in grey.
pub(super) fn write(path: &Path, image: &BakedImage) -> Result<()> {
    let BakedImage { width, height, .. } = *image;
    let colours = ["radiance", "irradiance"].iter().find_map(|name| image.arrays.get(name));
    let picture = match (colours, image.arrays.get("ambient_occlusion")) {
        (Some(colours), _) => Picture::tone_mapped(width, height, colours.data.as_chunks().0),
        (None, Some(occlusion)) => Picture::grey(width, height, &occlusion.data),
        (None, None) => {
            let names: Vec<_> = image.arrays.iter().map(|array| array.name.as_str()).collect();
            let message =
                format!("a picture shows radiance, irradiance or occlusion, not {}; write .exr", names.join(", "));
            return Err(Error::file(path, message));
        }
    };
    picture.write(path)
}

#[cfg(test)]
mod tests {
    use super::super::tests::image;
    use super::*;
    use crate::bake::Array;

    fn read(path: &Path) -> ::image::RgbImage {
        ::image::open(path).unwrap().into_rgb8()
    }

    #[test]
    fn occlusion_is_grey_and_light_comes_first() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut image = image();
        write(&path, &image).unwrap();
        let picture = read(&path);
        assert_eq!(picture.dimensions(), (3, 2));
        assert_eq!(picture.get_pixel(0, 0).0, [0; 3]);
        assert_eq!(picture.get_pixel(2, 1).0, [255; 3]);
        // sRGB of a linear half.
        assert_eq!(picture.get_pixel(2, 0).0, [188; 3]);

        image.arrays.push(Array::new("radiance", [2, 3, 3], [1.0, 0.0, 0.0].repeat(6))).unwrap();
        write(&path, &image).unwrap();
        let pixel = read(&path).get_pixel(1, 1).0;
        assert!(pixel[0] > 100 && pixel[1] == 0, "{pixel:?}");

        image.arrays.remove("radiance");
        image.arrays.remove("ambient_occlusion");
        assert!(write(&path, &image).unwrap_err().to_string().contains("visibility_sh"));
    }
}
