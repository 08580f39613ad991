use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use glam::Vec3;

use super::geometry::{is_in_range, out_of_range};
use super::mtl::MaterialLibrary;
use super::polygon::triangulate;
use super::{Material, Mesh};
use crate::{Error, Result};

/// Reads the meshes of a Wavefront OBJ file with its MTL libraries: one mesh per object (`o`, `g`) and material.
///
/// Polygons are cut into triangles. Of a material, its diffuse colour `Kd` is taken as linear albedo; a file that
/// names no library gets the default material. Normals, texture coordinates, lines and points are left out.
///
/// # Errors
/// Each names the line: malformed statements, coordinates that are not finite or out of range, faces of fewer than
/// three corners or with an index out of range, a missing or malformed library, a material that no library defines.
/// A file without faces is an error too.
pub(super) fn load(path: &Path) -> Result<Vec<Mesh>> {
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    let library = MaterialLibrary::new(path);
    let line = Cell::new(0);
    let mut statements = Statements::new(BufReader::new(file), &library, &line);
    let options =
        tobj::LoadOptions { single_index: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let loaded = tobj::load_obj_buf(&mut statements, &options, |name| library.load(name, line.get()));
    if let Some(error) = library.take_error() {
        return Err(error);
    }
    let (models, materials) = loaded.map_err(|error| statements.explain(path, error))?;
    let materials = materials.map_err(|e| Error::file(path, e))?;

    let mut meshes = Vec::new();
    for tobj::Model { mesh, name } in models {
        let positions: Vec<Vec3> = mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect();
        let mut triangles = Vec::with_capacity(mesh.indices.len() / 3);
        if mesh.face_arities.is_empty() {
            triangles.extend(mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
        } else {
            let mut corners = mesh.indices.as_slice();
            for &arity in &mesh.face_arities {
                let (polygon, rest) = corners.split_at(arity as usize);
                triangulate(polygon, &positions, &mut triangles);
                corners = rest;
            }
        }
        let material = mesh.material_id.map_or_else(Material::default, |id| Material {
            name: materials[id].name.clone(),
            albedo: materials[id].diffuse.map_or(Material::default().albedo, Vec3::from_array),
        });
        if !triangles.is_empty() {
            meshes.push(Mesh { name, positions, triangles, material });
        }
    }
    if meshes.is_empty() {
        return Err(Error::file(path, "no triangles in this file"));
    }
    Ok(meshes)
}

/// The statements of an OBJ file, one line at a time, as the parser is to see them: with continued lines joined,
/// without what is not needed, and checked for what it would let pass or report without a line.
struct Statements<'a, R> {
    file: R,
    library: &'a MaterialLibrary,
    /// Line of the statement handed out last, shared with the reader of libraries.
    line: &'a Cell<usize>,
    /// Lines read so far.
    lines: usize,
    statement: String,
    consumed: usize,
    vertices: usize,
    /// Largest vertex index of any face, from 1, and its line.
    highest: (usize, usize),
    fault: Option<String>,
}

impl<'a, R: BufRead> Statements<'a, R> {
    fn new(file: R, library: &'a MaterialLibrary, line: &'a Cell<usize>) -> Self {
        let statement = String::new();
        Self { file, library, line, lines: 0, statement, consumed: 0, vertices: 0, highest: (0, 0), fault: None }
    }

    /// Reads the next statement; false at the end of the file.
    fn advance(&mut self) -> io::Result<bool> {
        self.statement.clear();
        self.consumed = 0;
        self.line.set(self.lines + 1);
        let mut raw = Vec::new();
        loop {
            raw.clear();
            if self.file.read_until(b'\n', &mut raw)? == 0 {
                return Ok(!self.statement.is_empty());
            }
            self.lines += 1;
            // Names may be in any encoding; what matters is ASCII.
            let text = String::from_utf8_lossy(&raw).replace('\t', " ");
            match text.trim().strip_suffix('\\') {
                Some(continued) => {
                    self.statement.push_str(continued);
                    self.statement.push(' ');
                }
                None => {
                    self.statement.push_str(text.trim());
                    self.statement.push('\n');
                    return Ok(true);
                }
            }
        }
    }

    /// Whether the parser is to see the statement; what is wrong with it otherwise.
    fn check(&mut self) -> std::result::Result<bool, String> {
        let mut words = self.statement.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        match keyword {
            "v" => {
                self.vertices += 1;
                let mut position = Vec3::ZERO;
                for k in 0..3 {
                    let word = words.next().ok_or("a vertex needs three coordinates")?;
                    position[k] = word.parse().map_err(|_| format!("coordinate `{word}` is not a number"))?;
                }
                if !is_in_range(position) {
                    return Err(format!("vertex {} {}", self.vertices, out_of_range(position)));
                }
            }
            "f" => {
                let mut corners = 0;
                for word in words {
                    corners += 1;
                    let index: isize = (word.split('/').next().and_then(|v| v.parse().ok()))
                        .ok_or_else(|| format!("`{word}` is not a face corner"))?;
                    if index == 0 || index.unsigned_abs() > self.vertices && index < 0 {
                        return Err(format!(
                            "a face refers to vertex {index}, but the file has {} so far",
                            self.vertices
                        ));
                    }
                    // Later vertices may still come; the parser decides at the end of the object.
                    self.highest = self.highest.max((index.max(0) as usize, self.line.get()));
                }
                if corners < 3 {
                    return Err(format!("a face needs at least three corners, this one has {corners}"));
                }
            }
            "usemtl" => {
                let name = self.statement["usemtl".len()..].trim();
                if !self.library.defines(name) {
                    return Err(format!("material `{name}` is in none of the libraries named so far"));
                }
            }
            "o" | "g" | "mtllib" => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn explain(self, path: &Path, error: tobj::LoadError) -> Error {
        match (self.fault, error) {
            (Some(fault), _) => Error::line(path, self.line.get(), fault),
            (None, tobj::LoadError::FaceVertexOutOfBounds) => {
                let (index, line) = self.highest;
                Error::line(
                    path,
                    line,
                    format!("a face refers to vertex {index}, but the file has {} so far", self.vertices),
                )
            }
            (None, error) => Error::line(path, self.line.get(), error),
        }
    }
}

impl<R: BufRead> Read for Statements<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(buffer)?;
        self.consume(read);
        Ok(read)
    }
}

impl<R: BufRead> BufRead for Statements<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        while self.consumed == self.statement.len() && self.advance()? {
            match self.check() {
                Ok(true) => {}
                Ok(false) => self.statement.clear(),
                Err(fault) => {
                    self.fault = Some(fault);
                    return Err(io::ErrorKind::InvalidData.into());
                }
            }
        }
        Ok(&self.statement.as_bytes()[self.consumed..])
    }

    fn consume(&mut self, count: usize) {
        self.consumed += count;
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// Loads an OBJ file of this text, beside the given further files.
    fn load_text(obj: &str, others: &[(&str, &str)]) -> Result<Vec<Mesh>> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in others {
            fs::write(folder.path().join(name), text).unwrap();
        }
        let path = folder.path().join("mesh.obj");
        fs::write(&path, obj).unwrap();
        load(&path)
    }

    #[track_caller]
    fn refused(obj: &str, others: &[(&str, &str)], file_and_line: &str, why: &str) {
        let message = load_text(obj, others).unwrap_err().to_string();
        assert!(message.contains(&format!("{file_and_line}: ")) && message.contains(why), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn polygons_relative_indices_and_continued_lines_are_read() {
        let text = format!("# a comment\n{CORNERS}vt 0 0\nvn 0 0 1\n\tf 1/1/1 2//1 \\\n 3/1 -1\nl 1 2\np 1\ns off\n");
        let meshes = load_text(&text, &[]).unwrap();
        assert_eq!(meshes.len(), 1);
        assert_eq!(meshes[0].triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(meshes[0].positions[2], Vec3::new(1.0, 1.0, 0.0));
        assert_eq!(meshes[0].material, Material::default());
    }

    #[test]
    fn objects_and_materials_become_meshes() {
        let text = format!(
            "mtllib one two.mtl\n{CORNERS}o left\nusemtl red\nf 1 2 3\nusemtl\tplain\nf 1 3 4\no right\nf 2 3 4\n"
        );
        let mtl = "newmtl red\nKa 1\n Kd 0.5 0 0\nNs oops\nnewmtl plain\n";
        let meshes = load_text(&text, &[("one two.mtl", mtl)]).unwrap();
        let summary: Vec<_> = meshes.iter().map(|m| (m.name.as_str(), m.material.name.as_str())).collect();
        assert_eq!(summary, [("left", "red"), ("left", "plain"), ("right", "plain")]);
        assert_eq!(meshes[0].material.albedo, Vec3::new(0.5, 0.0, 0.0));
        assert_eq!(meshes[1].material.albedo, Material::default().albedo);
    }

    #[test]
    fn without_a_library_materials_are_default() {
        let meshes = load_text(&format!("{CORNERS}usemtl anything\nf 1 2 3\n"), &[]).unwrap();
        assert_eq!(meshes[0].material, Material::default());
    }

    #[test]
    fn bad_files_name_the_line() {
        let with = |rest: &str| format!("{CORNERS}{rest}");
        refused("", &[], "mesh.obj", "no triangles");
        refused(CORNERS, &[], "mesh.obj", "no triangles");
        refused("v 0 0 0\nv 1 nan 0\n", &[], "mesh.obj:2", "not finite");
        refused("v 0 0 0\nv 1 1e40 0\n", &[], "mesh.obj:2", "not finite");
        refused("v 0 0 0\nv 1 0 2e15\n", &[], "mesh.obj:2", "accepted range of ±1e15");
        refused("v 0 0 0\nv 1 0 x\n", &[], "mesh.obj:2", "`x` is not a number");
        refused("v 0 0 0\nv 1 0", &[], "mesh.obj:2", "three coordinates");
        refused(&with("f 1 2 3\n\nf 1 2 5\n"), &[], "mesh.obj:7", "vertex 5, but the file has 4");
        refused(&with("f 1 2 0\n"), &[], "mesh.obj:5", "vertex 0");
        refused(&with("f 1 2 -5\n"), &[], "mesh.obj:5", "vertex -5");
        refused(&with("f 1 2 99999999999999999999\n"), &[], "mesh.obj:5", "not a face corner");
        refused(&with("f 1 2 3/-7/1\nf 1 2\n"), &[], "mesh.obj:6", "at least three corners");
        refused(&with("f 1 2 a/b\n"), &[], "mesh.obj:5", "`a/b` is not a face corner");
        refused(&with("f 1 2 3/b\n"), &[], "mesh.obj:5", "face parse error");
        refused(&with("f\n"), &[], "mesh.obj:5", "this one has 0");
        assert!(load(Path::new("missing.obj")).unwrap_err().to_string().starts_with("missing.obj: "));
    }

    #[test]
    fn bad_libraries_name_the_line() {
        let obj = format!("{CORNERS}mtllib m.mtl\nusemtl a\nf 1 2 3\n");
        refused(&obj, &[], "mesh.obj:5", "m.mtl");
        refused(&obj, &[("m.mtl", "newmtl b\n")], "mesh.obj:6", "`a` is in none");
        refused(&obj, &[("m.mtl", "newmtl a\nKd 0.5\n")], "m.mtl:2", "three numbers");
        refused(&obj, &[("m.mtl", "newmtl a\nKd 0.5 0.5 nan\n")], "m.mtl:2", "in [0, 1]");
        refused(&obj, &[("m.mtl", "newmtl a\nKd 0.5 0.5 2\n")], "m.mtl:2", "in [0, 1]");
        refused(&obj, &[("m.mtl", "Kd 0.5 0.5 0.5\n")], "m.mtl:1", "before the first newmtl");
        refused(&obj, &[("m.mtl", "newmtl\n")], "m.mtl:1", "without a name");
    }
}
