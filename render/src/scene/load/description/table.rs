//! Typed values out of a TOML table, with errors that name the place.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::super::error::{Place, SceneError};

/// The text of a scene file, from which bytes are turned into lines and columns.
#[derive(Debug)]
pub(super) struct Document<'a> {
    file: Arc<Path>,
    text: &'a str,
    /// The first byte of each line but the first.
    line_starts: Vec<usize>,
}

impl<'a> Document<'a> {
    pub(super) fn new(file: &Arc<Path>, text: &'a str) -> Self {
        Self {
            file: Arc::clone(file),
            text,
            line_starts: text.match_indices('\n').map(|(at, _)| at + 1).collect(),
        }
    }

    /// Line and column of a byte of the text.
    pub(super) fn place(&self, byte: usize) -> Place {
        let lines_before = self.line_starts.partition_point(|&start| start <= byte);
        let start = match lines_before {
            0 => 0,
            _ => self.line_starts[lines_before - 1],
        };
        let before = self.text.get(start..byte).unwrap_or_default();
        Place {
            file: Arc::clone(&self.file),
            line: lines_before as u32 + 1,
            column: Some(before.chars().count() as u32 + 1),
        }
    }
}

/// One table of the scene file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Table<'a> {
    document: &'a Document<'a>,
    /// As people write it: `[camera]`.
    name: &'static str,
    entries: &'a DeTable<'a>,
    start: usize,
}

impl<'a> Table<'a> {
    /// The table itself, after a look that it holds known keys only.
    pub(super) fn new(
        document: &'a Document<'a>,
        name: &'static str,
        entries: &'a DeTable<'a>,
        span: Range<usize>,
        known: &'static [&'static str],
    ) -> Result<Self, SceneError> {
        let unknown = entries
            .iter()
            .filter(|(key, _)| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|(key, _)| key.span().start);
        if let Some((key, _)) = unknown {
            return Err(SceneError::UnknownKey {
                place: document.place(key.span().start),
                nearest: nearest(key.get_ref(), known),
                key: key.get_ref().to_string(),
                table: name,
                known,
            });
        }
        Ok(Self {
            document,
            name,
            entries,
            start: span.start,
        })
    }

    /// Where the table begins.
    pub(super) fn place(self) -> Place {
        self.document.place(self.start)
    }

    /// Where the value of a key stands; the table's beginning when the key is not given.
    pub(super) fn place_of(self, key: &'static str) -> Place {
        let start = self.value(key).map_or(self.start, |value| value.span().start);
        self.document.place(start)
    }

    /// An error about the value of a key.
    pub(super) fn bad_value(self, key: &'static str, problem: impl Into<String>) -> SceneError {
        SceneError::BadValue {
            place: self.place_of(key),
            key,
            problem: problem.into(),
        }
    }

    /// Turns an absent value into an error that shows an example.
    pub(super) fn required<T>(
        self,
        key: &'static str,
        example: &'static str,
        value: Option<T>,
    ) -> Result<T, SceneError> {
        value.ok_or_else(|| SceneError::MissingKey {
            place: self.place(),
            table: self.name,
            key,
            example,
        })
    }

    /// A finite number.
    pub(super) fn number(self, key: &'static str) -> Result<Option<f32>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let number =
            as_number(value.get_ref()).ok_or_else(|| self.wrong_type(key, value, "a number such as 1.5"))?;
        self.finite(key, value, number).map(Some)
    }

    /// Three finite numbers.
    pub(super) fn vector(self, key: &'static str) -> Result<Option<Vec3>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let expected = "an array of three numbers such as [0, 1.5, 4]";
        let wrong_type = |value| self.wrong_type(key, value, expected);
        let Some([x, y, z]) = value.get_ref().as_array().map(|array| &array[..]) else {
            return Err(wrong_type(value));
        };
        let component = |value: &'a Spanned<DeValue<'a>>| {
            let number = as_number(value.get_ref()).ok_or_else(|| wrong_type(value))?;
            self.finite(key, value, number)
        };
        Ok(Some(Vec3::new(component(x)?, component(y)?, component(z)?)))
    }

    /// A factor for all three axes, or one for each.
    pub(super) fn factors(self, key: &'static str) -> Result<Option<Vec3>, SceneError> {
        match self.value(key) {
            Some(value) if value.get_ref().is_array() => self.vector(key),
            Some(value) if as_number(value.get_ref()).is_none() => Err(self.wrong_type(
                key,
                value,
                "a number such as 2 or an array of three such as [1, 2, 1]",
            )),
            _ => Ok(self.number(key)?.map(Vec3::splat)),
        }
    }

    /// A whole number from 1 to `max`.
    pub(super) fn count(self, key: &'static str, max: u32) -> Result<Option<u32>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        let DeValue::Integer(digits) = value.get_ref() else {
            return Err(self.wrong_type(key, value, "a whole number such as 1024"));
        };
        u32::from_str_radix(digits.as_str(), digits.radix())
            .ok()
            .filter(|number| (1..=max).contains(number))
            .map(Some)
            .ok_or_else(|| self.bad_value(key, format!("is {digits}; give 1 to {max}")))
    }

    /// A string.
    pub(super) fn text(self, key: &'static str) -> Result<Option<&'a str>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        match value.get_ref() {
            DeValue::String(text) => Ok(Some(text)),
            _ => Err(self.wrong_type(key, value, "a string such as \"room.obj\"")),
        }
    }

    /// A table inside this one.
    pub(super) fn table(
        self,
        key: &'static str,
        name: &'static str,
        known: &'static [&'static str],
    ) -> Result<Option<Table<'a>>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        match value.get_ref() {
            DeValue::Table(entries) => {
                Table::new(self.document, name, entries, value.span(), known).map(Some)
            }
            _ => Err(self.wrong_type(key, value, "one table, written in single brackets")),
        }
    }

    /// The entries of an array of tables inside this one; none when the key is not given.
    pub(super) fn tables(
        self,
        key: &'static str,
        name: &'static str,
        known: &'static [&'static str],
    ) -> Result<Vec<Table<'a>>, SceneError> {
        let Some(value) = self.value(key) else {
            return Ok(Vec::new());
        };
        let wrong_type = |value| self.wrong_type(key, value, "a list of tables, each written in [[ ]]");
        let DeValue::Array(array) = value.get_ref() else {
            return Err(wrong_type(value));
        };
        array
            .iter()
            .map(|entry| match entry.get_ref() {
                DeValue::Table(entries) => Table::new(self.document, name, entries, entry.span(), known),
                _ => Err(wrong_type(entry)),
            })
            .collect()
    }

    fn value(self, key: &'static str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.entries.get(key)
    }

    fn finite(self, key: &'static str, value: &Spanned<DeValue<'_>>, number: f32) -> Result<f32, SceneError> {
        if number.is_finite() {
            return Ok(number);
        }
        Err(SceneError::BadValue {
            place: self.document.place(value.span().start),
            key,
            problem: "is not finite; give an ordinary number".into(),
        })
    }

    fn wrong_type(
        self,
        key: &'static str,
        value: &Spanned<DeValue<'_>>,
        expected: &'static str,
    ) -> SceneError {
        let found = match value.get_ref() {
            DeValue::Array(array) => format!("an array of {}", array.len()),
            DeValue::Integer(_) => "a whole number".into(),
            DeValue::Datetime(_) => "a date".into(),
            other => format!("a {}", other.type_str()),
        };
        SceneError::WrongType {
            place: self.document.place(value.span().start),
            key,
            expected,
            found,
        }
    }
}

/// The value as a number in `f32`; infinite when it is too large.
fn as_number(value: &DeValue<'_>) -> Option<f32> {
    let number = match value {
        DeValue::Float(float) => float.as_str().parse::<f64>().ok()?,
        DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix()).ok()? as f64,
        _ => return None,
    };
    Some(number as f32)
}

/// The known key that is most like `key`: one that contains it (or is contained), else the fewest typing errors away.
fn nearest(key: &str, known: &'static [&'static str]) -> &'static str {
    let key = key.to_lowercase();
    let likeness = |candidate: &str| {
        let contained = key.len() > 2 && (candidate.contains(&key) || key.contains(candidate));
        strsim::normalized_damerau_levenshtein(&key, candidate) + f64::from(u8::from(contained))
    };
    known
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        .copied()
        .unwrap_or_default()
}
