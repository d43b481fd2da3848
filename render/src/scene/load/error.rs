//! What can be wrong with a scene: every error says what, where and what to do.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::limits;

/// A place in a text file, shown as `file:line` or `file:line:column`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file, as it was opened.
    pub file: Arc<Path>,
    /// Line, counted from 1.
    pub line: u32,
    /// Column in characters, counted from 1, where it is known.
    pub column: Option<u32>,
}

impl Place {
    /// The whole of a line.
    pub(super) fn line(file: &Arc<Path>, line: u32) -> Self {
        Self {
            file: Arc::clone(file),
            line,
            column: None,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file.display(), self.line)?;
        match self.column {
            Some(column) => write!(f, ":{column}"),
            None => Ok(()),
        }
    }
}

/// Why a scene was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file name ends neither in `.toml` nor in `.obj`.
    #[error("{}: neither a .toml scene nor an .obj mesh; give a file whose name ends in one of these", path.display())]
    UnknownKind {
        /// The file that was asked for.
        path: PathBuf,
    },
    /// A file is not there, or cannot be read.
    #[error("{}cannot read {}: {source}; {remedy}", prefix(named_at.as_ref()), path.display())]
    Unreadable {
        /// Where the file is named; `None` for the scene file itself.
        named_at: Option<Place>,
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
        /// What to do about it.
        remedy: String,
    },
    /// More of something than a limit allows.
    #[error("{}: {count} {what} are more than the limit of {limit}; make it smaller or split it", path.display())]
    Limit {
        /// The file that brought the excess.
        path: PathBuf,
        /// What was counted, in the plural.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// How many are accepted.
        limit: u64,
    },
    /// The scene file is not TOML.
    #[error("{place}: {problem}")]
    Toml {
        /// Where reading stopped.
        place: Place,
        /// What the TOML parser says.
        problem: String,
    },
    /// A key or table that does not exist.
    #[error("{place}: unknown key `{key}` in {table}; did you mean `{nearest}`? ({table} knows {})", known.join(", "))]
    UnknownKey {
        /// Where the key stands.
        place: Place,
        /// The key.
        key: String,
        /// The table, as written in a scene file.
        table: &'static str,
        /// The known key that is most like it.
        nearest: &'static str,
        /// All keys of the table.
        known: &'static [&'static str],
    },
    /// A key that must be given.
    #[error("{place}: {table} lacks `{key}`; add for example `{key} = {example}`")]
    MissingKey {
        /// Where the table begins.
        place: Place,
        /// The table, as written in a scene file.
        table: &'static str,
        /// The key.
        key: &'static str,
        /// A value that would do.
        example: &'static str,
    },
    /// A value of the wrong type.
    #[error("{place}: `{key}` must be {expected}, not {found}")]
    WrongType {
        /// Where the value stands.
        place: Place,
        /// Its key.
        key: &'static str,
        /// What is accepted, with an example.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A value of the right type that makes no sense.
    #[error("{place}: `{key}` {problem}")]
    BadValue {
        /// Where the value stands.
        place: Place,
        /// Its key.
        key: &'static str,
        /// What is wrong and what to do, continuing the sentence.
        problem: String,
    },
    /// A path names an environment variable other than the one that is known.
    #[error(
        "{place}: unknown variable `{variable}` in a path; only $GRIDLIGHT_SCENES is known, and only at the start"
    )]
    UnknownVariable {
        /// Where the path stands.
        place: Place,
        /// The variable, with its `$`.
        variable: String,
    },
    /// A malformed OBJ file.
    #[error("{place}: {problem}")]
    Obj {
        /// The first offending line.
        place: Place,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A malformed MTL file.
    #[error("{place}: {problem}")]
    Mtl {
        /// The first offending line.
        place: Place,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A texture that is there but cannot be decoded.
    #[error("{named_at}: texture {}: {problem}; save it anew as PNG or JPEG with sides of at most {} pixels", path.display(), limits::TEXTURE_SIDE_MAX)]
    Texture {
        /// Where the texture is named.
        named_at: Place,
        /// The picture file.
        path: PathBuf,
        /// What the decoder says.
        problem: String,
    },
    /// Nothing to see.
    #[error("{}: {reason}", path.display())]
    NoTriangles {
        /// The scene file or the mesh.
        path: PathBuf,
        /// Why there is none, and what to do.
        reason: String,
    },
    /// Nothing emits.
    #[error("{}: nothing emits light; add a [[light.quad]] with corner, edge_u, edge_v and radiance, or give a material of a mesh a `Ke`", path.display())]
    NoLight {
        /// The scene file.
        path: PathBuf,
    },
}

fn prefix(place: Option<&Place>) -> String {
    place.map_or_else(String::new, |place| format!("{place}: "))
}
