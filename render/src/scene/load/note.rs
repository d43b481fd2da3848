//! What a person should know about a scene that was accepted.

use std::fmt;
use std::path::PathBuf;

use super::error::Place;
use super::framing::Framing;

/// A warning: the scene is rendered, but not quite as its files say.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// An MTL file is not there; its materials show as grey.
    MtlMissing {
        /// Where it is named.
        named_at: Place,
        /// Where it was looked for.
        path: PathBuf,
    },
    /// A texture is not there; the material shows as grey.
    TextureMissing {
        /// Where it is named.
        named_at: Place,
        /// Where it was looked for.
        path: PathBuf,
        /// The material.
        material: String,
    },
    /// A file was found under a name with other capitals.
    OtherCase {
        /// Where it is named.
        named_at: Place,
        /// The file that was taken.
        path: PathBuf,
    },
    /// Materials that no MTL file of the mesh has; they show as grey.
    MaterialsUnknown {
        /// The first use.
        named_at: Place,
        /// Their names.
        materials: Vec<String>,
    },
    /// Triangles before the first `usemtl`; they show as grey.
    NoMaterial {
        /// The mesh.
        path: PathBuf,
        /// How many.
        triangles: u64,
    },
    /// Materials that are shown in a simpler way than the MTL file says.
    Simplified {
        /// The MTL file.
        path: PathBuf,
        /// What is simplified.
        simplification: Simplification,
        /// The names of the materials.
        materials: Vec<String>,
    },
    /// Normals or texture coordinates that are not finite were replaced by zero.
    NotFinite {
        /// The first.
        place: Place,
        /// How many.
        count: u64,
    },
    /// Lines that are not OBJ were ignored.
    StatementsUnknown {
        /// The first.
        place: Place,
        /// Its keyword.
        keyword: String,
        /// How many.
        count: u64,
    },
    /// Triangles without area were dropped.
    DegenerateDropped {
        /// How many, for each mesh that has some.
        counts: Vec<(PathBuf, u64)>,
    },
    /// The file gives no camera, or a mesh alone gives no light.
    Framed {
        /// The scene file or the mesh.
        path: PathBuf,
        /// What was chosen.
        framing: Framing,
    },
}

/// In which way a material is shown simpler than its MTL file says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Simplification {
    /// `Ks` beside a diffuse colour is left out; it stands in for a black `Kd`.
    Gloss,
    /// A mirror is shown as diffuse.
    Mirror,
    /// Glass is shown as diffuse.
    Glass,
    /// The albedo was clamped into [0, 1].
    Clamped,
    /// There is no colour at all: grey.
    NoKd,
    /// `Kd` is black beside a `map_Kd`: the map counts alone.
    MapAlone,
    /// `map_d` is ignored: nothing is cut out.
    CutOut,
    /// `map_Ke` is ignored: `Ke` counts alone.
    EmissionMap,
    /// Options of `map_Kd` that change colours or add noise are ignored.
    MapOptions,
}

impl fmt::Display for Simplification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gloss => "gloss (Ks) is not rendered, shown as diffuse",
            Self::Mirror => "mirrors are not rendered, shown as diffuse",
            Self::Glass => "glass is not rendered, shown as diffuse",
            Self::Clamped => "albedo (Kd) clamped into 0 to 1",
            Self::NoKd => "no Kd, shown as grey 0.5",
            Self::MapAlone => "Kd is black, map_Kd is shown alone",
            Self::CutOut => "map_d is ignored, nothing is cut out",
            Self::EmissionMap => "map_Ke is ignored, Ke counts alone",
            Self::MapOptions => "map_Kd's options -mm, -bm, -cc, -t and -imfchan are ignored",
        })
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MtlMissing { named_at, path } => write!(
                f,
                "{named_at}: {} is missing; its materials show as grey 0.5",
                path.display()
            ),
            Self::TextureMissing {
                named_at,
                path,
                material,
            } => write!(
                f,
                "{named_at}: texture {} is missing; material `{material}` shows as grey 0.5",
                path.display()
            ),
            Self::OtherCase { named_at, path } => write!(
                f,
                "{named_at}: there is no file of exactly this name; {} was taken",
                path.display()
            ),
            Self::MaterialsUnknown { named_at, materials } => write!(
                f,
                "{named_at}: no MTL file has {}; shown as grey 0.5",
                Names(materials)
            ),
            Self::NoMaterial { path, triangles } => write!(
                f,
                "{}: {triangles} triangles have no material; shown as grey 0.5",
                path.display()
            ),
            Self::Simplified {
                path,
                simplification,
                materials,
            } => write!(f, "{}: {simplification}: {}", path.display(), Names(materials)),
            Self::NotFinite { place, count } => write!(
                f,
                "{place}: {count} normals or texture coordinates are not finite (this is the first); zero was taken"
            ),
            Self::StatementsUnknown {
                place,
                keyword,
                count,
            } => write!(
                f,
                "{place}: {count} lines are not OBJ (the first begins with `{keyword}`); ignored"
            ),
            Self::DegenerateDropped { counts } => {
                let total: u64 = counts.iter().map(|(_, count)| count).sum();
                write!(f, "{total} triangles without area were dropped")?;
                for (index, (path, count)) in counts.iter().enumerate() {
                    let before = if index == 0 { ":" } else { "," };
                    write!(f, "{before} {count} of {}", path.display())?;
                }
                Ok(())
            }
            Self::Framed { path, framing } => write!(f, "{}: {framing}", path.display()),
        }
    }
}

/// The first few of many names.
struct Names<'a>(&'a [String]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN_MAX: usize = 4;
        for (index, name) in self.0.iter().take(SHOWN_MAX).enumerate() {
            let before = if index == 0 { "" } else { ", " };
            write!(f, "{before}`{name}`")?;
        }
        match self.0.len().checked_sub(SHOWN_MAX) {
            None | Some(0) => Ok(()),
            Some(more) => write!(f, " and {more} more"),
        }
    }
}
