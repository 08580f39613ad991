use std::path::{Path, PathBuf};

/// What can go wrong, in one line that names the culprit and says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read, understood or written.
    #[error("{}{}: {message}", path.display(), line.map(|n| format!(":{n}")).unwrap_or_default())]
    File {
        /// The file at fault.
        path: PathBuf,
        /// Line in a text file, counted from 1.
        line: Option<usize>,
        /// What is wrong and what to do about it.
        message: String,
    },
    /// A value handed to the library or the command line is out of its domain.
    #[error("{0}")]
    Input(String),
    /// The work was cancelled; what was kept is told by the caller that cancelled.
    #[error("interrupted")]
    Interrupted,
    /// The contour search could not be built.
    #[error(transparent)]
    Contours(#[from] dual_bvh::Error),
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error about `path` as a whole.
    pub fn file(path: impl AsRef<Path>, message: impl ToString) -> Self {
        Self::File { path: path.as_ref().to_owned(), line: None, message: message.to_string() }
    }

    /// An error at `line` (from 1) of the text file `path`.
    pub fn line(path: impl AsRef<Path>, line: usize, message: impl ToString) -> Self {
        Self::File { path: path.as_ref().to_owned(), line: Some(line), message: message.to_string() }
    }

    /// An error about a value.
    pub fn input(message: impl ToString) -> Self {
        Self::Input(message.to_string())
    }
}
