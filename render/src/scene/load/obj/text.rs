//! Looks through the text of an OBJ file before tobj reads it: tobj's errors name no line, it takes
//! polylines for faces, and it mixes up vertices with and without normals.
//!
//! A text that passes is in a form that tobj reads rightly; one that is valid OBJ but not in that form
//! is written anew.

use std::borrow::Cow;
use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use super::super::error::{Place, SceneError};
use super::super::limits::{COORDINATE_MAX, TRIANGLES_MAX, VERTICES_MAX};
use super::super::text::{keyword, number, readable, shortened, words};

/// An OBJ file that can be given to tobj.
#[derive(Debug)]
pub(in super::super) struct ObjText<'a> {
    /// What tobj is to read.
    pub(in super::super) text: Cow<'a, str>,
    /// What else was found.
    pub(in super::super) survey: Survey,
}

/// What an OBJ file refers to, and what is odd about it.
#[derive(Debug, Default)]
pub(in super::super) struct Survey {
    /// The MTL files named, and in which line.
    pub(in super::super) libraries: Vec<(String, u32)>,
    /// The materials that have faces, in order of first use, and the line of that use.
    pub(in super::super) materials: Vec<(String, u32)>,
    /// Triangles before the first `usemtl`.
    pub(in super::super) triangles_without_material: u64,
    /// All triangles.
    pub(in super::super) triangles: u64,
    /// Normals and texture coordinates that are not finite: how many, and the line of the first.
    pub(in super::super) not_finite: Option<(u64, u32)>,
    /// Statements that OBJ does not have: how many, and the first with its line.
    pub(in super::super) unknown: Option<(u64, String, u32)>,
}

/// Checks every line of the file; the error names the first one that is wrong.
pub(in super::super) fn check<'a>(file: &Arc<Path>, bytes: &'a [u8]) -> Result<ObjText<'a>, SceneError> {
    let text = readable(bytes);
    let mut check = Check::default();
    for (index, line) in text.lines().enumerate() {
        check.line = index as u32 + 1;
        check.statement(line).map_err(|problem| SceneError::Obj {
            place: Place::line(file, check.line),
            problem,
        })?;
    }
    let (rewrite, survey) = (check.rewrite, check.survey);
    for (what, count, limit) in [
        ("vertices", check.defined[0], VERTICES_MAX),
        ("triangles", survey.triangles, TRIANGLES_MAX),
    ] {
        if count > limit {
            return Err(SceneError::Limit {
                path: file.to_path_buf(),
                what,
                count,
                limit,
            });
        }
    }
    let text = if rewrite {
        Cow::Owned(rewritten(&text))
    } else {
        text
    };
    Ok(ObjText { text, survey })
}

/// Positions, texture coordinates and normals, the order of `1/2/3`.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

#[derive(Default)]
struct Check<'t> {
    line: u32,
    survey: Survey,
    /// Whether tobj would misread the text as it is.
    rewrite: bool,
    /// How many of each of [`KINDS`] there are so far.
    defined: [u64; 3],
    /// Which of [`KINDS`] the corners since the last `g` or `o` have; tobj keeps these in one mesh
    /// and mixes up vertices if they differ.
    corner: Option<[bool; 3]>,
    material: Material<'t>,
    registered: HashSet<&'t str>,
}

/// The material for the faces to come.
#[derive(Default)]
enum Material<'t> {
    #[default]
    None,
    /// Named, but without a face since.
    Named(&'t str),
    InUse,
}

impl<'t> Check<'t> {
    fn statement(&mut self, line: &'t str) -> Result<(), String> {
        let (keyword, rest) = keyword(line);
        match keyword {
            "" => Ok(()),
            "v" => self.position(rest),
            "vt" => self.texture_coordinate(rest),
            "vn" => self.normal(rest),
            "f" => self.face(rest),
            "g" | "o" => {
                self.corner = None;
                Ok(())
            }
            "usemtl" => self.use_material(line, rest),
            "mtllib" => self.library(rest),
            // tobj takes a polyline for a face.
            "l" => {
                self.rewrite = true;
                Ok(())
            }
            _ if keyword.starts_with('#') || IGNORED.contains(&keyword) => Ok(()),
            _ => {
                let (line, first) = (self.line, || shortened(keyword));
                let (count, ..) = self.survey.unknown.get_or_insert_with(|| (0, first(), line));
                *count += 1;
                Ok(())
            }
        }
    }

    fn position(&mut self, rest: &str) -> Result<(), String> {
        let (numbers, count) = numbers::<4>(rest, 3, KINDS[0])?;
        // Colours after the coordinates, and comments, are left out.
        self.rewrite |= count > 4 || rest.contains('#');
        let w = if count == 4 { numbers[3] } else { 1.0 };
        for coordinate in &numbers[..3] {
            let coordinate = coordinate / w;
            if !coordinate.is_finite() {
                return Err(
                    "the vertex is not finite; export the mesh without NaN and infinite coordinates".into(),
                );
            }
            if coordinate.abs() > COORDINATE_MAX {
                return Err(format!(
                    "the vertex lies beyond {COORDINATE_MAX:e}; scale the mesh down"
                ));
            }
        }
        self.defined[0] += 1;
        Ok(())
    }

    fn texture_coordinate(&mut self, rest: &str) -> Result<(), String> {
        let (numbers, count) = numbers::<2>(rest, 1, KINDS[1])?;
        self.rewrite |= count < 2;
        self.count_not_finite(&numbers);
        self.defined[1] += 1;
        Ok(())
    }

    fn normal(&mut self, rest: &str) -> Result<(), String> {
        let (numbers, _) = numbers::<3>(rest, 3, KINDS[2])?;
        self.count_not_finite(&numbers);
        self.defined[2] += 1;
        Ok(())
    }

    fn count_not_finite(&mut self, numbers: &[f32]) {
        if !numbers.iter().all(|n| n.is_finite()) {
            let (count, _) = self.survey.not_finite.get_or_insert((0, self.line));
            *count += 1;
        }
    }

    fn face(&mut self, rest: &'t str) -> Result<(), String> {
        let mut corners = 0;
        for word in words(rest) {
            let corner = corner(word, self.defined)?.map(|index| index.is_some());
            self.rewrite |= *self.corner.get_or_insert(corner) != corner;
            corners += 1;
        }
        if corners < 3 {
            return Err(format!("a face needs at least three vertices, not {corners}"));
        }
        self.rewrite |= rest.contains('#');
        self.survey.triangles += corners - 2;
        match self.material {
            Material::None => self.survey.triangles_without_material += corners - 2,
            Material::Named(name) => {
                if self.registered.insert(name) {
                    let (name, line) = (name.to_owned(), self.line);
                    self.survey.materials.push((name, line));
                }
                self.material = Material::InUse;
            }
            Material::InUse => {}
        }
        Ok(())
    }

    fn use_material(&mut self, line: &str, name: &'t str) -> Result<(), String> {
        if name.is_empty() {
            return Err("`usemtl` without a name; name a material of the MTL file".into());
        }
        // tobj finds the name after the first blank of the line.
        self.rewrite |= !line.starts_with("usemtl ");
        self.material = Material::Named(name);
        Ok(())
    }

    fn library(&mut self, rest: &str) -> Result<(), String> {
        if rest.is_empty() {
            return Err("`mtllib` without a file name; name an .mtl file".into());
        }
        self.survey.libraries.push((rest.to_owned(), self.line));
        Ok(())
    }
}

/// Statements that need no picture: smoothing, points, free-form surfaces, display hints.
const IGNORED: &[&str] = &[
    "s",
    "p",
    "vp",
    "mg",
    "cstype",
    "deg",
    "bmat",
    "step",
    "curv",
    "curv2",
    "surf",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "usemap",
    "maplib",
    "bsp",
    "bzp",
    "cdc",
    "cdp",
    "res",
    "call",
];

/// The first `N` numbers of a line, of which `count_min` must be there, and how many words there are.
fn numbers<const N: usize>(rest: &str, count_min: usize, kind: &str) -> Result<([f32; N], usize), String> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for word in words(rest) {
        if let Some(slot) = numbers.get_mut(count) {
            *slot = number(word)?;
        }
        count += 1;
    }
    if count < count_min {
        return Err(format!("a {kind} needs {count_min} numbers, not {count}"));
    }
    Ok((numbers, count))
}

/// One corner of a face as indices from 0; `defined` holds how many of each of [`KINDS`] there are.
fn corner(word: &str, defined: [u64; 3]) -> Result<[Option<u64>; 3], String> {
    let mut indices = [None; 3];
    for (kind, digits) in word.split('/').enumerate() {
        let Some(slot) = indices.get_mut(kind) else {
            return Err(format!(
                "`{}` has more than three indices; write vertex/texture/normal",
                shortened(word)
            ));
        };
        if digits.is_empty() && kind > 0 {
            continue;
        }
        let Ok(index) = digits.parse::<i64>() else {
            return Err(format!("`{}` is not a vertex of a face", shortened(word)));
        };
        *slot = Some(resolved(index, defined[kind]).ok_or_else(|| {
            format!(
                "{} index {index} is out of range: {} are defined above this line, counted from 1",
                KINDS[kind], defined[kind]
            )
        })?);
    }
    Ok(indices)
}

/// An index from 0, out of one from 1 or one that counts back from the last.
fn resolved(index: i64, defined: u64) -> Option<u64> {
    let resolved = match index {
        1.. => index.unsigned_abs() - 1,
        0 => return None,
        _ => defined.checked_sub(index.unsigned_abs())?,
    };
    (resolved < defined).then_some(resolved)
}

/// The same model in the form that tobj reads rightly: every corner has all three indices. Index 1 of
/// the texture coordinates and normals is a zero that stands for "not given".
fn rewritten(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 2);
    out.push_str("vt 0 0\nvn 0 0 0\n");
    let mut defined = [0; 3];
    for line in text.lines() {
        let (keyword, rest) = keyword(line);
        let kind = match keyword {
            "v" => 0,
            "vt" => 1,
            "vn" => 2,
            "f" => {
                rewrite_face(&mut out, rest, defined);
                continue;
            }
            "g" | "o" | "usemtl" => {
                // Writing to a string cannot fail.
                let _ = writeln!(out, "{keyword} {rest}");
                continue;
            }
            _ => continue,
        };
        defined[kind] += 1;
        rewrite_numbers(&mut out, keyword, rest);
    }
    out
}

fn rewrite_numbers(out: &mut String, keyword: &str, rest: &str) {
    let count = words(rest).count();
    let kept = match (keyword, count) {
        ("v", 4) => 4,
        ("vt", _) => 2,
        _ => 3,
    };
    out.push_str(keyword);
    for word in words(rest).chain(["0"]).take(kept) {
        out.push(' ');
        out.push_str(word);
    }
    out.push('\n');
}

fn rewrite_face(out: &mut String, rest: &str, defined: [u64; 3]) {
    out.push('f');
    for word in words(rest) {
        // The text was checked, so that every corner can be read.
        let [v, vt, vn] = corner(word, defined).unwrap_or_default();
        let (v, vt, vn) = (
            v.map_or(0, |v| v + 1),
            vt.map_or(1, |vt| vt + 2),
            vn.map_or(1, |vn| vn + 2),
        );
        let _ = write!(out, " {v}/{vt}/{vn}");
    }
    out.push('\n');
}

#[cfg(test)]
mod tests;
