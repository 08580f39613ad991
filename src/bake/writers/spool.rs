use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write, copy};
use std::path::{Path, PathBuf};

use zip::ZipWriter;

use crate::bake::partial::{DONE, check_run, without_mask};
use crate::bake::{Arrays, Partial, Provenance};
use crate::scene::npy;
use crate::{Error, Result};

use super::atomic::{atomically, scratch};
use super::npz::{PROVENANCE, add_provenance, open, start};

/// Results that come in blocks of rows, on their way into a NumPy archive: they wait in nameless temporary files beside it, so that
/// memory need not hold them.
pub struct Spool {
    path: PathBuf,
    columns: Vec<Column>,
    rows: usize,
}

struct Column {
    name: String,
    /// Of one row.
    shape: Vec<usize>,
    file: BufWriter<File>,
}

impl Spool {
    /// Nothing yet for the archive `path`.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), columns: Vec::new(), rows: 0 }
    }

    /// What an interrupted run that was to write `path` has [kept](Spool::keep).
    ///
    /// # Errors
    /// When the file cannot be read, or was made from other input or with other settings.
    pub fn reopen(path: &Path, expected: &Provenance) -> Result<Self> {
        let part = Partial::path(path);
        let provenance = Partial::provenance(&part)?;
        check_run(&part, expected, &provenance)?;
        let refuse = |message: String| Error::file(&part, message);
        if provenance.sh_phase != expected.sh_phase {
            return Err(refuse("was made with another --sh-phase; delete it or repeat the earlier command".into()));
        }
        let mut spool = Self::new(path);
        let damaged = |error: &dyn std::fmt::Display| refuse(format!("truncated or damaged ({error})"));
        let mut zip = open(&part)?;
        let (mut rows, mut has_mask) = (None, false);
        for i in 0..zip.len() {
            let mut file = zip.by_index(i).map_err(|error| damaged(&error))?;
            let name = file.name().map_err(|error| damaged(&error))?.trim_end_matches(".npy").to_owned();
            if name == PROVENANCE {
                continue;
            }
            let header = npy::Header::read(&mut file).map_err(refuse)?;
            let Some((&count, shape)) = header.shape.split_first() else { return Err(damaged(&name)) };
            if *rows.get_or_insert(count) != count {
                return Err(refuse("its arrays have different numbers of rows".into()));
            }
            if name == DONE {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
                header.check(bytes.len() as u64).map_err(refuse)?;
                if header.numbers(&bytes).map_err(refuse)?.iter().any(|&done| done != 1.0) {
                    return Err(refuse(
                        "holds receivers that are not finished, as no run by blocks leaves; begin anew".into(),
                    ));
                }
                has_mask = true;
                continue;
            }
            let mut column = Column { name, shape: shape.to_vec(), file: BufWriter::new(scratch(path)?) };
            let bytes = copy(&mut file, &mut column.file).map_err(|error| damaged(&error))?;
            header.check(bytes).map_err(refuse)?;
            spool.columns.push(column);
        }
        if !has_mask {
            return Err(without_mask(&part));
        }
        spool.rows = rows.unwrap_or_default();
        Ok(spool)
    }

    /// Rows that are there.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds rows.
    ///
    /// # Errors
    /// When the arrays are not those of the rows before, or a file cannot be written.
    pub fn append(&mut self, arrays: &Arrays) -> Result<()> {
        if self.columns.is_empty() {
            let column = |array: &crate::bake::Array| {
                let file = BufWriter::new(scratch(&self.path)?);
                Ok(Column { name: array.name.clone(), shape: array.shape[1..].to_vec(), file })
            };
            self.columns = arrays.iter().map(column).collect::<Result<_>>()?;
        }
        let rows = arrays.iter().next().map_or(0, |array| array.shape[0]);
        let are_same = self.columns.len() == arrays.len()
            && self.columns.iter().zip(arrays).all(|(column, array)| {
                column.name == array.name && array.shape[0] == rows && column.shape == array.shape[1..]
            });
        if !are_same {
            return Err(Error::input("the finished part has other arrays than those asked for; begin anew"));
        }
        for (column, array) in self.columns.iter_mut().zip(arrays) {
            let mut numbers = array.data.iter().map(|x| x.to_le_bytes());
            numbers.try_for_each(|x| column.file.write_all(&x)).map_err(|error| Error::file(&self.path, error))?;
        }
        self.rows += rows;
        Ok(())
    }

    /// Writes all rows into the archive, as [`npz::write`](super::npz::write) would have.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&mut self, provenance: &Provenance) -> Result<()> {
        let path = self.path.clone();
        self.write_to(&path, provenance, false)
    }

    /// Writes all rows as the finished part of an interrupted run, from which another one may go on.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn keep(&mut self, provenance: &Provenance) -> Result<PathBuf> {
        let part = Partial::path(&self.path);
        self.write_to(&part, provenance, true)?;
        Ok(part)
    }

    fn write_to(&mut self, path: &Path, provenance: &Provenance, is_part: bool) -> Result<()> {
        let Self { columns, rows, .. } = self;
        atomically(path, |file| {
            let mut zip = ZipWriter::new(file);
            let all = || -> zip::result::ZipResult<()> {
                for Column { name, shape, file } in columns {
                    file.flush()?;
                    file.rewind()?;
                    let shape = [&[*rows], &shape[..]].concat();
                    start(&mut zip, name, "<f8", &shape, 8 * shape.iter().product::<usize>())?;
                    copy(&mut BufReader::new(file.get_ref()), &mut zip)?;
                    file.seek(SeekFrom::End(0))?;
                }
                if is_part {
                    start(&mut zip, DONE, "<f8", &[*rows], 8 * *rows)?;
                    (0..*rows).try_for_each(|_| zip.write_all(&1f64.to_le_bytes()))?;
                }
                add_provenance(&mut zip, provenance)
            };
            all().and_then(|()| zip.finish().map(drop)).map_err(|error| Error::file(path, error))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::npz;
    use super::*;
    use crate::bake::{Array, Phase};

    fn rows(range: std::ops::Range<usize>) -> Arrays {
        let numbers =
            |of: usize| range.clone().flat_map(move |i| (0..of).map(move |j| (i as f64 + 0.1 * j as f64).sin()));
        let mut arrays = Arrays::new();
        arrays.push(Array::new("ambient_occlusion", [range.len()], numbers(1).collect())).unwrap();
        arrays.push(Array::new("vector_irradiance", [range.len(), 3, 3], numbers(9).collect())).unwrap();
        arrays
    }

    #[test]
    fn blocks_make_the_file_that_the_whole_makes() {
        let folder = tempfile::tempdir().unwrap();
        let [whole, blocks] = ["whole.npz", "blocks.npz"].map(|name| folder.path().join(name));
        let provenance = Provenance::new("isolines").with("isolines", 64);
        npz::write(&whole, &rows(0..1000), &provenance).unwrap();
        let mut spool = Spool::new(&blocks);
        spool.append(&rows(0..300)).unwrap();
        // Interrupted, and gone on with, twice.
        for (from, to) in [(300, 700), (700, 1000)] {
            let part = spool.keep(&provenance).unwrap();
            assert_eq!(npz::read(&part).unwrap().arrays.get("done").unwrap().data, vec![1.0; from]);
            spool = Spool::reopen(&blocks, &provenance).unwrap();
            assert_eq!(spool.rows(), from);
            spool.append(&rows(from..to)).unwrap();
        }
        spool.write(&provenance).unwrap();
        assert!(std::fs::read(&whole).unwrap() == std::fs::read(&blocks).unwrap());
        // Nothing else stays but the part, which its owner removes.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn other_parts_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let provenance = Provenance::new("isolines").with("isolines", 64);
        let mut spool = Spool::new(&path);
        spool.append(&rows(0..3)).unwrap();
        let mut other = rows(3..4);
        other.remove("ambient_occlusion");
        assert!(spool.append(&other).unwrap_err().to_string().contains("other arrays"));
        let part = spool.keep(&provenance).unwrap();
        let message = |expected: &Provenance| Spool::reopen(&path, expected).err().unwrap().to_string();
        assert!(message(&Provenance::new("isolines").with("isolines", 32)).contains("isolines = 64, not 32"));
        let phase = Provenance { sh_phase: Phase::CondonShortley, ..provenance.clone() };
        assert!(message(&phase).contains("--sh-phase"));
        npz::write(&part, &rows(0..3), &provenance).unwrap();
        assert!(message(&provenance).contains("no array `done`"));
        let done = vec![true, false, true];
        Partial { arrays: rows(0..3), done, provenance: provenance.clone() }.write(&part).unwrap();
        assert!(message(&provenance).contains("not finished"));
        let bytes = std::fs::read(&part).unwrap();
        for cut in (0..bytes.len()).step_by(53) {
            std::fs::write(&part, &bytes[..cut]).unwrap();
            let message = message(&provenance);
            assert!(message.contains("a.npz.partial.npz: ") && !message.contains('\n'), "{message}");
        }
        std::fs::remove_file(&part).unwrap();
        assert!(message(&provenance).contains("No such file"));
    }
}
