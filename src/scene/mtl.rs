use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The MTL files that an OBJ file names.
pub(super) struct MaterialLibrary {
    obj: PathBuf,
    /// Names defined so far; `None` until the first library is read.
    names: RefCell<Option<BTreeSet<String>>>,
    error: RefCell<Option<Error>>,
}

impl MaterialLibrary {
    /// The libraries of the OBJ file at `obj`, none read yet.
    pub(super) fn new(obj: &Path) -> Self {
        Self { obj: obj.to_owned(), names: RefCell::default(), error: RefCell::default() }
    }

    /// Reads the library that `line` of the OBJ file names. Errors are kept for [`Self::take_error`].
    pub(super) fn load(&self, name: &Path, line: usize) -> tobj::MTLLoadResult {
        match self.statements(name, line) {
            Ok(statements) => tobj::load_mtl_buf(&mut statements.as_bytes()),
            Err(error) => {
                self.error.borrow_mut().get_or_insert(error);
                Err(tobj::LoadError::ReadError)
            }
        }
    }

    /// Whether `usemtl` may name this material: some library defines it, or there is no library at all.
    pub(super) fn defines(&self, material: &str) -> bool {
        self.names.borrow().as_ref().is_none_or(|names| names.contains(material))
    }

    /// What went wrong while reading libraries.
    pub(super) fn take_error(&self) -> Option<Error> {
        self.error.take()
    }

    /// The statements of a library that matter, checked: the parser panics on colours of fewer than three numbers.
    fn statements(&self, name: &Path, line: usize) -> Result<String> {
        let mut names = self.names.borrow_mut();
        let names = names.get_or_insert_default();
        let path = self.obj.parent().unwrap_or(Path::new("")).join(name);
        let bytes = fs::read(&path)
            .map_err(|e| Error::line(&self.obj, line, format!("material library {}: {e}", path.display())))?;
        let mut statements = String::new();
        let mut current = None;
        for (number, text) in (1..).zip(String::from_utf8_lossy(&bytes).lines()) {
            let mut words = text.split_whitespace();
            match words.next() {
                Some("newmtl") => {
                    let material = text.trim()["newmtl".len()..].trim();
                    if material.is_empty() {
                        return Err(Error::line(path, number, "newmtl without a name"));
                    }
                    names.insert(material.to_owned());
                    current = Some(material.to_owned());
                }
                Some("Kd") => {
                    let colour: Vec<f32> = words.map_while(|word| word.parse().ok()).collect();
                    if colour.len() != 3 || colour.iter().any(|x| !(0.0..=1.0).contains(x)) {
                        return Err(Error::line(path, number, "Kd needs three numbers in [0, 1]: red, green, blue"));
                    }
                    if current.is_none() {
                        return Err(Error::line(path, number, "Kd before the first newmtl"));
                    }
                }
                _ => continue,
            }
            statements.push_str(text.trim());
            statements.push('\n');
        }
        Ok(statements)
    }
}
