use std::path::Path;

use super::{Mesh, gltf, obj, ply};
use crate::{Error, Result};

/// Reads the meshes of a file by its extension: `.obj`, `.ply`, `.gltf` or `.glb`, in world space of that file.
///
/// # Errors
/// A file that is missing, unreadable, malformed, without triangles, or of an unknown extension: one line that names it.
pub fn load_meshes(path: impl AsRef<Path>) -> Result<Vec<Mesh>> {
    let path = path.as_ref();
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "obj" => obj::load(path),
        "ply" => ply::load(path).map(|mesh| vec![mesh]),
        "gltf" | "glb" => gltf::load(path),
        _ => Err(Error::file(path, "not a mesh by its extension; known are .obj, .ply, .gltf and .glb")),
    }
}
