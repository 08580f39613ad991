/// Why a tree could not be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A corner is no vertex.
    #[error("face {face} refers to vertex {vertex}, but there are only {vertices} vertices; fix its indices")]
    Index {
        /// The face.
        face: usize,
        /// The index it holds.
        vertex: u32,
        /// Number of positions.
        vertices: usize,
    },
    /// A corner is not a number, or infinite.
    #[error("vertex {vertex} of face {face} has a coordinate that is infinite or not a number; repair or remove it")]
    Position {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: u32,
    },
    /// Two corners are the same vertex.
    #[error("face {face} has vertex {vertex} at two of its corners; remove the face")]
    Corner {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: u32,
    },
    /// More than a tree can number.
    #[error("{count} {what} are more than the {limit} that fit in one tree; split the mesh")]
    Size {
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        count: usize,
        /// How much fits.
        limit: usize,
    },
    /// An option is out of its domain.
    #[error("the option {name} is {value}; it must be {domain}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        domain: &'static str,
    },
}
