//! Files of results: all of a file appears under its name, or nothing does.

mod atomic;
pub mod exr;
mod glb;
pub mod npz;
mod ply;
mod png;
mod spool;

use std::fmt;
use std::path::Path;

use crate::{Error, Result};

use super::{Baked, BakedImage, BakedVertices};

pub use atomic::{atomically, discard_unfinished};
pub use spool::Spool;

/// Kinds of files that results can be written to, each by its extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NumPy archive, double precision: vertices and images.
    Npz,
    /// Polygons with one property per component: vertices.
    Ply,
    /// One channel per component: vertices and images.
    Exr,
    /// glTF 2.0 with custom attributes: vertices.
    Glb,
    /// Picture for the eye: images.
    Png,
}

/// What a result belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Vertices or points.
    Vertices,
    /// Pixels.
    Image,
}

impl Format {
    const ALL: [Self; 5] = [Self::Npz, Self::Ply, Self::Exr, Self::Glb, Self::Png];

    /// The format that `path`'s extension asks for.
    ///
    /// # Errors
    /// When the extension is unknown or cannot hold results of this `layout`; the line lists those that can.
    pub fn of(path: &Path, layout: Layout) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let found = Self::ALL.into_iter().find(|format| format.to_string() == extension);
        match found {
            Some(format) if format.holds(layout) => Ok(format),
            _ => {
                let known: Vec<_> =
                    Self::ALL.iter().filter(|format| format.holds(layout)).map(|format| format!(".{format}")).collect();
                let what = match layout {
                    Layout::Vertices => "results per vertex",
                    Layout::Image => "images",
                };
                let given = if extension.is_empty() { "no extension".into() } else { format!(".{extension}") };
                Err(Error::file(path, format!("{given} says nothing of how to write {what}; use {}", known.join(", "))))
            }
        }
    }

    fn holds(self, layout: Layout) -> bool {
        match self {
            Self::Npz | Self::Exr => true,
            Self::Ply | Self::Glb => layout == Layout::Vertices,
            Self::Png => layout == Layout::Image,
        }
    }
}

impl fmt::Display for Format {
    /// The extension, without its dot.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Npz => "npz",
            Self::Ply => "ply",
            Self::Exr => "exr",
            Self::Glb => "glb",
            Self::Png => "png",
        })
    }
}

/// Writes `baked` to `path` in the format of its extension.
///
/// # Errors
/// When the extension does not suit, the parts of `baked` do not fit together, a number does not fit the format's
/// precision, or the file cannot be written. Then whatever stood at `path` before still does.
pub fn write(path: &Path, baked: &Baked) -> Result<()> {
    baked.check()?;
    match baked {
        Baked::Vertices(vertices) => write_vertices(path, vertices),
        Baked::Image(image) => write_image(path, image),
    }
}

fn write_vertices(path: &Path, vertices: &BakedVertices) -> Result<()> {
    match Format::of(path, Layout::Vertices)? {
        Format::Ply => ply::write(path, vertices),
        Format::Exr => exr::write_vertices(path, vertices),
        Format::Glb => glb::write(path, vertices),
        Format::Npz | Format::Png => npz::write_vertices(path, vertices),
    }
}

fn write_image(path: &Path, image: &BakedImage) -> Result<()> {
    match Format::of(path, Layout::Image)? {
        Format::Exr => exr::write_image(path, image),
        Format::Png => png::write(path, image),
        Format::Npz | Format::Ply | Format::Glb => npz::write_image(path, image),
    }
}

/// Fails if a result of this `layout` could not be written to `path`: to be asked before hours of computing.
///
/// # Errors
/// When the extension does not suit or the folder is missing or not writable.
pub fn check_target(path: &Path, layout: Layout) -> Result<()> {
    Format::of(path, layout)?;
    atomic::check_folder(path)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::Arc;

    use glam::DVec3;

    use super::*;
    use crate::bake::{Array, Arrays, Provenance};

    /// A tetrahedron with results of every kind, none of them alike.
    pub(crate) fn tetrahedron() -> BakedVertices {
        let mut arrays = Arrays::new();
        let numbers = |n: usize, seed: f64| (0..n).map(|i| (seed + i as f64 * 0.7).sin()).collect::<Vec<_>>();
        arrays.push(Array::new("ambient_occlusion", [4], numbers(4, 0.1))).unwrap();
        arrays.push(Array::new("visibility_sh", [4, 9], numbers(36, 0.2))).unwrap();
        arrays.push(Array::new("transfer_sh", [4, 4], numbers(16, 0.3))).unwrap();
        arrays.push(Array::new("bent_normal", [4, 3], numbers(12, 0.4))).unwrap();
        BakedVertices {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y * 2.0, DVec3::new(0.1f32.into(), 0.0, -3.0)],
            normals: vec![DVec3::Z, DVec3::X, DVec3::Y, DVec3::NEG_Z],
            triangles: Arc::from([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
            arrays,
            provenance: Provenance::new("isolines").with("order", 3).with("scene", "tétraèdre.obj"),
        }
    }

    /// An image of 3 x 2 pixels, one of them uncovered.
    pub(crate) fn image() -> BakedImage {
        let mut rows = Arrays::new();
        rows.push(Array::new("ambient_occlusion", [5], vec![0.0, 0.25, 0.5, 0.75, 1.0])).unwrap();
        rows.push(Array::new("visibility_sh", [5, 4], (0..20).map(f64::from).collect())).unwrap();
        BakedImage::from_rows(3, 2, &[0, 1, 2, 3, 5], rows, Provenance::new("qmc")).unwrap()
    }

    #[test]
    fn unknown_extensions_list_the_known() {
        let message = |path: &str, layout| Format::of(Path::new(path), layout).unwrap_err().to_string();
        assert_eq!(
            message("a/out.xyz", Layout::Vertices),
            "a/out.xyz: .xyz says nothing of how to write results per vertex; use .npz, .ply, .exr, .glb"
        );
        assert_eq!(
            message("out", Layout::Image),
            "out: no extension says nothing of how to write images; use .npz, .exr, .png"
        );
        assert!(message("out.png", Layout::Vertices).contains(".glb"));
        assert_eq!(Format::of(Path::new("OUT.EXR"), Layout::Image).unwrap(), Format::Exr);
    }

    #[test]
    fn a_failing_write_leaves_nothing_and_keeps_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let mut bad = tetrahedron();
        bad.arrays.push(Array::new("huge", [4], vec![1e300; 4])).unwrap();
        for extension in ["ply", "exr", "glb"] {
            let path = folder.path().join("out").with_extension(extension);
            std::fs::write(&path, "before").unwrap();
            let message = write(&path, &Baked::Vertices(bad.clone())).unwrap_err().to_string();
            assert!(message.contains("huge") && message.contains(".npz"), "{message}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
            std::fs::remove_file(&path).unwrap();
        }
        write(&folder.path().join("missing/out.npz"), &Baked::Vertices(bad)).unwrap_err();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn files_do_not_depend_on_when_they_are_written() {
        let folder = tempfile::tempdir().unwrap();
        for format in Format::ALL {
            let bytes = |name: &str| {
                let path = folder.path().join(name).with_extension(format.to_string());
                let baked =
                    if format.holds(Layout::Image) { Baked::Image(image()) } else { Baked::Vertices(tetrahedron()) };
                write(&path, &baked).unwrap();
                std::fs::read(path).unwrap()
            };
            assert!(bytes("a") == bytes("b"), "{format}");
        }
    }
}
