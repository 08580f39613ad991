use std::path::{Path, PathBuf};

use crate::{Error, Result};

use super::writers::npz;
use super::{Array, Arrays, Provenance};

/// Name of the array that marks finished receivers by 1.
pub(super) const DONE: &str = "done";

/// What an interrupted run has finished.
#[derive(Clone, Debug, PartialEq)]
pub struct Partial {
    /// Results of all receivers; rows that are not done are zero.
    pub arrays: Arrays,
    /// Whether each receiver is finished.
    pub done: Vec<bool>,
    /// What was being computed.
    pub provenance: Provenance,
}

impl Partial {
    /// Where the finished part of `out` is kept: `teapot.glb` gives `teapot.glb.partial.npz`.
    pub fn path(out: &Path) -> PathBuf {
        let mut name = out.file_name().unwrap_or_default().to_owned();
        name.push(".partial.npz");
        out.with_file_name(name)
    }

    /// Number of finished receivers.
    pub fn finished(&self) -> usize {
        self.done.iter().filter(|&&done| done).count()
    }

    /// Writes the results and the `done` mask.
    ///
    /// # Errors
    /// When an array has another number of rows than the mask, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.check(self.done.len())?;
        let mut arrays = self.arrays.clone();
        arrays.push(Array::new(DONE, [self.done.len()], self.done.iter().map(|&done| done.into()).collect()))?;
        npz::write(path, &arrays, &self.provenance)
    }

    /// Reads the finished part of a run that is to go on as `expected`.
    ///
    /// # Errors
    /// When the file cannot be read, or was made from other input or with other settings: the line says which.
    pub fn read(path: &Path, expected: &Provenance) -> Result<Self> {
        let archive = npz::read(path)?;
        let (mut arrays, provenance) = (archive.arrays, archive.provenance.unwrap_or_default());
        check_run(path, expected, &provenance)?;
        let Some(done) = arrays.remove(DONE) else { return Err(without_mask(path)) };
        let partial = Self { arrays, done: done.data.iter().map(|&done| done != 0.0).collect(), provenance };
        partial.check(partial.done.len()).map_err(|error| Error::file(path, error))?;
        Ok(partial)
    }

    /// What was being computed by the run whose finished part is `path`.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn provenance(path: &Path) -> Result<Provenance> {
        Ok(npz::read_provenance(path)?.unwrap_or_default())
    }

    /// Fails unless this is a part of a run over `receivers` receivers.
    ///
    /// # Errors
    /// One line that says what has another length.
    pub fn check(&self, receivers: usize) -> Result<()> {
        if self.done.len() != receivers {
            let message =
                format!("the finished part covers {} receivers, not {receivers}; begin anew", self.done.len());
            return Err(Error::input(message));
        }
        match self.arrays.iter().find(|array| array.shape.first() != Some(&receivers)) {
            Some(array) => {
                Err(Error::input(format!("array {}: not one row for each of {receivers} receivers", array.name)))
            }
            None => Ok(()),
        }
    }
}

/// Fails unless the finished part `path`, made as `found` says, is one of a run that is to go on as `expected`.
pub(super) fn check_run(path: &Path, expected: &Provenance, found: &Provenance) -> Result<()> {
    match expected.disagreement(found) {
        None => Ok(()),
        Some((name, wanted, found)) => {
            let message =
                format!("was made with {name} = {found}, not {wanted}; delete it or repeat the earlier command");
            Err(Error::file(path, message))
        }
    }
}

/// The archive `path` does not say which receivers are finished.
pub(super) fn without_mask(path: &Path) -> Error {
    Error::file(path, format!("has no array `{DONE}`: not the finished part of a run"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resumes_only_the_same_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = Partial::path(&folder.path().join("teapot.glb"));
        assert_eq!(path.file_name().unwrap(), "teapot.glb.partial.npz");
        let mut arrays = Arrays::new();
        arrays.push(Array::new("ambient_occlusion", [3], vec![0.5, 0.0, 0.25])).unwrap();
        let provenance = Provenance::new("isolines").with("isolines", 64);
        let partial = Partial { arrays, done: vec![true, false, true], provenance: provenance.clone() };
        partial.write(&path).unwrap();
        assert_eq!(partial.finished(), 2);
        assert_eq!(Partial::read(&path, &provenance).unwrap(), partial);

        let message = |expected: &Provenance| Partial::read(&path, expected).unwrap_err().to_string();
        assert!(message(&Provenance::new("isolines").with("isolines", 256)).contains("isolines = 64, not 256"));
        assert!(partial.check(4).unwrap_err().to_string().contains("covers 3 receivers, not 4"));
        npz::write(&path, &Arrays::new(), &provenance).unwrap();
        assert!(message(&provenance).contains("no array `done`"));
        let short = Partial { done: vec![true; 2], ..partial };
        assert!(short.write(&path).unwrap_err().to_string().contains("array ambient_occlusion"));
    }
}
