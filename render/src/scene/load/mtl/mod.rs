//! One MTL file: looked through line by line, read by tobj, and put into terms of diffuse surfaces.

mod appearance;
mod texture_reference;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

pub(super) use self::appearance::{Appearance, GREY};
pub(super) use self::texture_reference::TextureReference;
use super::error::{Place, SceneError};
use super::limits::RADIANCE_MAX;
use super::text::{keyword, number, readable, shortened, words};

/// The materials of one MTL file by name; of two with the same name the later one.
pub(super) type Library = BTreeMap<String, Appearance>;

/// Reads the bytes of an MTL file.
pub(super) fn read(file: &Arc<Path>, bytes: &[u8]) -> Result<Library, SceneError> {
    let text = readable(bytes);
    let mut check = Check::default();
    for (index, line) in text.lines().enumerate() {
        check.line = index as u32 + 1;
        check.statement(line).map_err(|problem| SceneError::Mtl {
            place: Place::line(file, check.line),
            problem,
        })?;
    }
    let whole_file = |problem| SceneError::Mtl {
        place: Place::line(file, 1),
        problem,
    };
    if check.starts.is_empty() && text.lines().any(|line| words(line).next().is_some()) {
        return Err(whole_file(
            "there is no `newmtl` in this file; is it an MTL file?".into(),
        ));
    }
    let (materials, _) = tobj::load_mtl_buf(&mut check.checked.as_bytes())
        .map_err(|error| whole_file(format!("tobj cannot read this file: {error}")))?;
    let starts = check.starts.into_iter();
    Ok(starts
        .zip(materials)
        .map(|(start, material)| {
            let place = Place::line(file, start.map_line.unwrap_or(start.line));
            (material.name.clone(), appearance::of(&material, place))
        })
        .collect())
}

/// Keeps what the renderer uses, after a look at every value: tobj takes on trust that a colour has
/// three numbers.
#[derive(Default)]
struct Check {
    line: u32,
    /// The statements for tobj.
    checked: String,
    /// Where each material is.
    starts: Vec<Start>,
}

/// The lines of one material.
struct Start {
    /// Of `newmtl`.
    line: u32,
    /// Of `map_Kd`.
    map_line: Option<u32>,
}

impl Check {
    fn statement(&mut self, line: &str) -> Result<(), String> {
        let (keyword, rest) = keyword(line);
        if keyword.eq_ignore_ascii_case("newmtl") {
            if rest.is_empty() {
                return Err("`newmtl` without a name; name the material".into());
            }
            self.starts.push(Start {
                line: self.line,
                map_line: None,
            });
            self.keep("newmtl", rest);
            return Ok(());
        }
        let Some(known) = USED.iter().find(|k| k.eq_ignore_ascii_case(keyword)) else {
            return Ok(());
        };
        let Some(start) = self.starts.last_mut() else {
            return Err(format!("`{keyword}` before the first `newmtl`; move it below"));
        };
        let value = match *known {
            "Kd" | "Ks" | "Tf" => colour(keyword, rest, f32::MIN)?,
            "Ke" => colour(keyword, rest, 0.0)?,
            "d" => {
                // `-halo` fades by direction; the number behind it is the opacity.
                let value = words(rest).find(|word| *word != "-halo").unwrap_or("");
                finite(keyword, value)?.to_string()
            }
            "illum" => {
                let value = words(rest).next().unwrap_or("");
                let Ok(model) = value.parse::<u8>() else {
                    return Err(format!(
                        "`illum` must be a whole number, not `{}`",
                        shortened(value)
                    ));
                };
                model.to_string()
            }
            "map_Kd" => {
                TextureReference::parse(rest)?;
                start.map_line = Some(self.line);
                rest.to_owned()
            }
            _ => "1".to_owned(),
        };
        self.keep(known, &value);
        Ok(())
    }

    fn keep(&mut self, keyword: &str, value: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.checked, "{keyword} {value}");
    }
}

/// The keywords that make a difference, if only to a note.
const USED: &[&str] = &["Kd", "Ks", "Ke", "Tf", "d", "illum", "map_Kd", "map_Ke", "map_d"];

/// One number for all three channels, or three.
fn colour(keyword: &str, rest: &str, min: f32) -> Result<String, String> {
    let values: Vec<&str> = words(rest).collect();
    let channels = match values[..] {
        [grey] => [grey; 3],
        [red, green, blue] => [red, green, blue],
        _ => {
            return Err(format!(
                "`{keyword}` must be three numbers (RGB), not `{}`",
                shortened(rest)
            ));
        }
    };
    for channel in channels {
        let value = finite(keyword, channel)?;
        if !(min..=RADIANCE_MAX).contains(&value) {
            return Err(format!(
                "`{keyword}` is {value}; give values from 0 to {RADIANCE_MAX:e}"
            ));
        }
    }
    Ok(channels.join(" "))
}

fn finite(keyword: &str, word: &str) -> Result<f32, String> {
    let value = number(word).map_err(|problem| format!("`{keyword}`: {problem}"))?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{keyword}` is not finite; give an ordinary number"))
    }
}
