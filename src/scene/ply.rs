use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use glam::Vec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType};
use smallvec::SmallVec;

use super::geometry::{is_in_range, out_of_range};
use super::polygon::triangulate;
use super::{Material, Mesh};
use crate::{Error, Result};

/// Reads the mesh of a PLY file, text or binary of either byte order.
///
/// Polygons are cut into triangles. Whatever else the file holds (normals, colours) is left out.
///
/// # Errors
/// A malformed or truncated file, no vertices with x, y, z or no faces with `vertex_indices` (or `vertex_index`), a
/// coordinate that is not finite or out of range, a face of fewer than three corners or with an index out of range. Text
/// files name the line, binary ones the element.
pub(super) fn load(path: &Path) -> Result<Mesh> {
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    let mut reader = Reader::new(BufReader::new(file));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(|e| explain(path, true, e))?;
    let is_text = header.encoding == Encoding::Ascii;
    let element = |name: &str| header.elements.iter().find(|(key, _)| *key == name).map(|(_, element)| element);
    check_header(element("vertex"), element("face")).map_err(|message| Error::file(path, message))?;

    let mut positions = Vec::new();
    let mut faces = (0, Vec::new());
    for (name, element) in &header.elements {
        let first_line = reader.line();
        let refuse = |i: usize, message: String| match is_text {
            true => Error::line(path, first_line + i, message),
            false => Error::file(path, message),
        };
        if element.count > 0 && element.properties.is_empty() {
            return Err(Error::file(path, format!("element `{name}` has no properties")));
        }
        match name.as_str() {
            "vertex" => {
                let vertices = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                for (i, Vertex(p)) in vertices.map_err(|e| explain(path, is_text, e))?.into_iter().enumerate() {
                    if !is_in_range(p) {
                        return Err(refuse(i, format!("vertex {i} {}", out_of_range(p))));
                    }
                    positions.push(p);
                }
            }
            "face" => {
                let read = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                faces = (first_line, read.map_err(|e| explain(path, is_text, e))?);
            }
            _ => {
                let skipped = Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header);
                skipped.map_err(|e| explain(path, is_text, e))?;
            }
        }
    }

    let mut triangles = Vec::with_capacity(faces.1.len());
    for (i, Face(corners)) in faces.1.iter().enumerate() {
        let refuse = |message: String| match is_text {
            true => Error::line(path, faces.0 + i, message),
            false => Error::file(path, message),
        };
        if corners.len() < 3 {
            return Err(refuse(format!("face {i} has {} corners; it needs at least three", corners.len())));
        }
        if let Some(v) = corners.iter().find(|&&v| v as usize >= positions.len()) {
            return Err(refuse(format!("face {i} refers to vertex {v}, but there are only {}", positions.len())));
        }
        triangulate(corners, &positions, &mut triangles);
    }
    if triangles.is_empty() {
        return Err(Error::file(path, "no triangles in this file"));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Mesh { name, positions, triangles, material: Material::default() })
}

/// Names of the list of a face's corners, both in use.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

fn check_header(vertex: Option<&ElementDef>, face: Option<&ElementDef>) -> std::result::Result<(), &'static str> {
    let vertex = vertex.ok_or("the header declares no vertices")?;
    let face = face.ok_or("the header declares no faces")?;
    let is_scalar = |name: &&str| {
        let mut properties = vertex.properties.iter();
        properties.any(|(key, p)| key == name && matches!(p.data_type, PropertyType::Scalar(_)))
    };
    if !["x", "y", "z"].iter().all(is_scalar) {
        return Err("vertices need the properties x, y and z");
    }
    let is_list = |(key, p): (&String, &ply_rs_bw::ply::PropertyDef)| {
        CORNERS.contains(&key.as_str()) && matches!(p.data_type, PropertyType::List(..))
    };
    match face.properties.iter().any(is_list) {
        true => Ok(()),
        false => Err("faces need a list property vertex_indices"),
    }
}

fn explain(path: &Path, is_text: bool, error: ParseError) -> Error {
    let line = error.line().filter(|_| is_text);
    // The parser quotes the line and the reason below one another; the reason comes last.
    let text = error.to_string();
    let text = line.and_then(|n| text.strip_prefix(&format!("Line {n}: "))).unwrap_or(&text);
    let message = text.split_whitespace().collect::<Vec<_>>().join(" ");
    Error::File { path: path.to_owned(), line, message }
}

struct Vertex(Vec3);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self(Vec3::ZERO)
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        match value.to_f32_lossy() {
            Some(x) => self.0[axis] = x,
            None => return PropertyAccessResult::UnsupportedType,
        }
        PropertyAccessResult::Set
    }
}

/// A face's corners, triangles and quadrilaterals without an allocation of their own: there may be millions.
struct Face(SmallVec<[u32; 4]>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(SmallVec::new())
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        // Negative indices become one that no mesh has, to be refused with the face's number.
        let corners = match value {
            Property::ListInt(list) => list.into_iter().map(|v| u32::try_from(v).unwrap_or(u32::MAX)).collect(),
            other => match other.to_u32_list() {
                Some(corners) => SmallVec::from_slice(&corners),
                None => return PropertyAccessResult::UnsupportedType,
            },
        };
        self.0 = corners;
        PropertyAccessResult::Set
    }
}

/// An element that is read over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn load_bytes(bytes: &[u8]) -> Result<Mesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        fs::write(&path, bytes).unwrap();
        load(&path)
    }

    const HEADER: &str = "element vertex 4\nproperty uchar red\nproperty float x\nproperty double y\nproperty short z\n\
        element camera 1\nproperty list uchar float view\nelement face 2\nproperty list uchar int vertex_indices\n\
        end_header\n";

    fn text(body: &str) -> Vec<u8> {
        format!("ply\nformat ascii 1.0\ncomment of ours\n{HEADER}{body}").into_bytes()
    }

    const BODY: &str = "9 0 0 0\n9 1.5 0 0\n9 1.5 1.25e0 -3\n9 0 1.25 0\n2 7 8\n4 0 1 2 3\n3 0 1 2\n";

    fn binary(byte_order: &str) -> Vec<u8> {
        let mut bytes = format!("ply\nformat binary_{byte_order}_endian 1.0\n{HEADER}").into_bytes();
        let mut put = |value: &[u8]| match byte_order {
            "big" => bytes.extend(value.iter().rev()),
            _ => bytes.extend(value),
        };
        for (x, y, z) in [(0f32, 0f64, 0i16), (1.5, 0.0, 0), (1.5, 1.25, -3), (0.0, 1.25, 0)] {
            put(&[9]);
            put(&x.to_le_bytes());
            put(&y.to_le_bytes());
            put(&z.to_le_bytes());
        }
        put(&[2]);
        put(&7f32.to_le_bytes());
        put(&8f32.to_le_bytes());
        for face in [&[0, 1, 2, 3][..], &[0, 1, 2]] {
            put(&[face.len() as u8]);
            face.iter().for_each(|v: &i32| put(&v.to_le_bytes()));
        }
        bytes
    }

    #[test]
    fn all_encodings_give_the_same_mesh() {
        let mesh = load_bytes(&text(BODY)).unwrap();
        assert_eq!(mesh.positions[2], Vec3::new(1.5, 1.25, -3.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(mesh.name, "mesh");
        assert_eq!(load_bytes(&binary("little")).unwrap(), mesh);
        assert_eq!(load_bytes(&binary("big")).unwrap(), mesh);
    }

    #[test]
    fn bad_text_names_the_line() {
        for (from, to, line, why) in [
            ("9 1.5 0 0\n", "9 1.5 nan 0\n", 15, "parse"),
            ("9 1.5 0 0\n", "9 1e39 0 0\n", 15, "not finite"),
            ("9 1.5 0 0\n", "9 2e15 0 0\n", 15, "accepted range"),
            ("9 1.5 0 0\n", "9 1.5 0\n", 15, "found nothing"),
            ("4 0 1 2 3\n", "4 0 1 2 4\n", 19, "face 0 refers to vertex 4"),
            ("3 0 1 2\n", "3 0 -1 2\n", 20, "face 1 refers to vertex"),
            ("3 0 1 2\n", "2 0 1\n", 20, "face 1 has 2 corners"),
            ("3 0 1 2\n", "3 0 1\n", 20, "found only 2"),
            ("3 0 1 2\n", "", 20, "expected 2, got 1"),
        ] {
            let message = load_bytes(&text(&BODY.replace(from, to))).unwrap_err().to_string();
            assert!(message.contains(&format!("mesh.ply:{line}: ")) && message.contains(why), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn bad_headers_are_refused() {
        for (from, to, why) in [
            ("ply\n", "plain\n", "magic number"),
            ("ascii", "morse", "parse"),
            ("end_header\n", "", "mesh.ply"),
            ("element vertex", "element corner", "no vertices"),
            ("element face", "element polygon", "no faces"),
            ("double y", "double w", "x, y and z"),
            ("vertex_indices", "corners", "vertex_indices"),
            (
                "element face 2\nproperty list uchar int vertex_indices",
                "element face 0\nproperty list uchar int vertex_index",
                "no triangles",
            ),
        ] {
            let whole = String::from_utf8(text(BODY)).unwrap();
            assert!(whole.contains(from));
            let message = load_bytes(whole.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(message.contains(why) && !message.contains('\n'), "{message}");
        }
        assert!(load_bytes(b"").is_err());
        assert!(load(Path::new("missing.ply")).unwrap_err().to_string().starts_with("missing.ply: "));
        let bare = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uchar int vertex_index\nelement empty 99999999999\nend_header\n";
        let bytes = [bare.as_bytes(), &[0; 25]].concat();
        assert!(load_bytes(&bytes).unwrap_err().to_string().contains("`empty` has no properties"));
    }

    #[test]
    fn truncation_anywhere_is_an_error() {
        for whole in [text(BODY), binary("little"), binary("big")] {
            // Without the last line break a text is still whole.
            for length in 0..whole.len() - 1 {
                if whole[length..] == *b"2\n" {
                    continue;
                }
                let message = load_bytes(&whole[..length]).unwrap_err().to_string();
                assert!(!message.contains('\n'), "{message}");
            }
        }
    }
}
