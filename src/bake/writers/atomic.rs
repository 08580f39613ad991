//! Whole files or none: content goes to a temporary file in the same folder, which then takes the final name.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// Temporary files that are being written.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Creates or replaces the file `path` with what `content` writes; on any error `path` stays as it was and nothing
/// else stays behind.
///
/// # Errors
/// What `content` returns, or a failure to create, write or rename.
pub fn atomically(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let file = temporary(path)?;
    let _listed = Listed::new(file.path());
    let mut writer = BufWriter::new(file.reopen().map_err(|error| Error::file(path, error))?);
    content(&mut writer)?;
    writer.flush().map_err(|error| Error::file(path, error))?;
    drop(writer);
    file.persist(path).map_err(|refused| Error::file(path, refused.error))?;
    Ok(())
}

/// Fails unless a file could be made in `path`'s folder.
pub(super) fn check_folder(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::file(path, "is a folder; name a file"));
    }
    temporary(path).map(drop)
}

/// Deletes every temporary file, for a process that ends at once without unwinding.
pub fn discard_unfinished() {
    for path in unfinished().drain(..) {
        // Whether it is already gone does not matter to a process that is ending.
        let _ = std::fs::remove_file(path);
    }
}

/// A file without a name in `path`'s folder, which is gone when it is closed.
pub(super) fn scratch(path: &Path) -> Result<File> {
    tempfile::tempfile_in(folder(path)).map_err(|error| refused(path, &error))
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn refused(path: &Path, error: &std::io::Error) -> Error {
    let (folder, kind) = (folder(path).display(), error.kind());
    if kind == std::io::ErrorKind::NotFound {
        Error::file(path, format!("the folder {folder} does not exist"))
    } else {
        Error::file(path, format!("cannot create a file in {folder}: {kind}"))
    }
}

fn temporary(path: &Path) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".unfinished-");
    #[cfg(unix)]
    {
        // As for any new file, less the umask; temporary files would otherwise be private and stay so.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder(path)).map_err(|error| refused(path, &error))
}

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps a path in [`UNFINISHED`] for as long as it lives.
struct Listed(PathBuf);

impl Listed {
    fn new(path: &Path) -> Self {
        unfinished().push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        unfinished().retain(|path| *path != self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        atomically(&path, |file| {
            file.write_all(b"half").unwrap();
            file.flush().unwrap();
            assert!(!path.exists());
            assert_eq!(names(folder.path()).len(), 1);
            Err(Error::Interrupted)
        })
        .unwrap_err();
        assert!(names(folder.path()).is_empty());
        atomically(&path, |file| file.write_all(b"whole").map_err(|error| Error::file(&path, error))).unwrap();
        assert_eq!(names(folder.path()), ["a.txt"]);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "whole");
        #[cfg(unix)]
        {
            // Readable by others wherever an ordinary new file is.
            use std::os::unix::fs::PermissionsExt;
            std::fs::write(folder.path().join("b.txt"), "").unwrap();
            let mode = |name| std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
            assert_eq!(mode("a.txt"), mode("b.txt"));
        }
    }

    #[test]
    fn unfinished_files_can_be_discarded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        // Other tests may be writing at this moment: only this folder's file is taken out of the list.
        let result = atomically(&path, |_| {
            let ours: Vec<_> = unfinished().iter().filter(|path| path.starts_with(folder.path())).cloned().collect();
            assert_eq!(ours.len(), 1);
            std::fs::remove_file(&ours[0]).unwrap();
            Ok(())
        });
        assert!(result.is_err());
        assert!(!unfinished().iter().any(|path| path.starts_with(folder.path())));
    }

    #[test]
    fn targets_that_cannot_be_written_are_named() {
        let folder = tempfile::tempdir().unwrap();
        check_folder(&folder.path().join("a.npz")).unwrap();
        assert!(names(folder.path()).is_empty());
        assert!(check_folder(folder.path()).unwrap_err().to_string().contains("is a folder"));
        let message = check_folder(&folder.path().join("no/a.npz")).unwrap_err().to_string();
        assert!(message.ends_with("no does not exist"), "{message}");
    }
}
