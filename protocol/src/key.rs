//! The key of a grid: who has it belongs to the grid, and nobody else.
//!
//! A key is 32 bytes from the system's random numbers. As text it is a line of its own, so that a file
//! may hold comments, and the next key beside the present one while the machines are changed over.

use std::fmt;

use thiserror::Error;

use crate::limits;

/// Bytes of a key; [`secure`](crate::secure) needs exactly so many.
const KEY_BYTES: usize = 32;

/// Begins the line of a key. Says what it is to people, and to programs that look for lost secrets.
const PREFIX: &str = "gridlight-key-1:";

/// Separates fingerprints from any other use of a key's digest.
const FINGERPRINT_CONTEXT: &str = "gridlight 2026 fingerprint of a key";

/// Bytes of a fingerprint: enough to tell keys apart, too few to be taken for one.
const FINGERPRINT_BYTES: usize = 6;

/// One key. Its secret is shown by [`Self::to_line`] alone.
#[derive(Clone)]
pub struct Key([u8; KEY_BYTES]);

impl Key {
    /// A new key that nobody knows.
    ///
    /// # Errors
    ///
    /// When the system has no random numbers.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut secret = [0; KEY_BYTES];
        getrandom::fill(&mut secret)?;
        Ok(Self(secret))
    }

    /// A name by which people may speak of the key, as `3f9a-22c1-9b07`; it gives nothing away.
    pub fn fingerprint(&self) -> String {
        let digest = blake3::derive_key(FINGERPRINT_CONTEXT, &self.0);
        let parts: Vec<String> = digest[..FINGERPRINT_BYTES]
            .chunks_exact(2)
            .map(|pair| format!("{:02x}{:02x}", pair[0], pair[1]))
            .collect();
        parts.join("-")
    }

    /// The secret, as a line of a key file.
    pub fn to_line(&self) -> String {
        format!("{PREFIX}{}", hex(&self.0))
    }

    /// The reverse of [`Self::to_line`].
    fn from_line(line: &str) -> Option<Self> {
        let digits = line.strip_prefix(PREFIX)?.as_bytes();
        let mut secret = [0; KEY_BYTES];
        if digits.len() != 2 * KEY_BYTES {
            return None;
        }
        for (byte, pair) in secret.iter_mut().zip(digits.chunks_exact(2)) {
            let [high, low] = [pair[0], pair[1]].map(|digit| char::from(digit).to_digit(16));
            *byte = (high? << 4 | low?) as u8;
        }
        Some(Self(secret))
    }

    pub(crate) fn secret(&self) -> &[u8; KEY_BYTES] {
        &self.0
    }
}

/// Bytes in lower-case hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    digits
        .filter_map(|digit| char::from_digit(digit.into(), 16))
        .collect()
}

/// Shows the fingerprint: secrets do not belong into logs.
impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Key({})", self.fingerprint())
    }
}

/// The keys that are valid: one, or while machines are changed over two.
#[derive(Clone, Debug)]
pub struct Keys(Vec<Key>);

/// A text holds no keys.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum KeyTextError {
    /// A line is neither a key nor a comment.
    #[error("line {line} is no key: a key is `{PREFIX}` and {} hexadecimal digits", 2 * KEY_BYTES)]
    NoKeyInLine {
        /// Its number, from 1.
        line: usize,
    },
    /// There are comments alone.
    #[error("there is no key in it")]
    Empty,
    /// There are too many.
    #[error("there are {count} keys in it, allowed are {}", limits::KEYS)]
    TooMany {
        /// So many.
        count: usize,
    },
}

impl Keys {
    /// Reads a key file's text: a key a line; empty lines and those that begin with `#` do not count.
    pub fn parse(text: &str) -> Result<Self, KeyTextError> {
        let lines = text.lines().map(str::trim).zip(1..);
        let keys = lines
            .filter(|(text, _)| !text.is_empty() && !text.starts_with('#'))
            .map(|(text, line)| Key::from_line(text).ok_or(KeyTextError::NoKeyInLine { line }));
        let keys = keys.collect::<Result<Vec<Key>, _>>()?;
        match keys.len() {
            0 => Err(KeyTextError::Empty),
            1..=limits::KEYS => Ok(Self(keys)),
            count => Err(KeyTextError::TooMany { count }),
        }
    }

    /// In the file's order.
    pub fn iter(&self) -> impl Iterator<Item = &Key> {
        self.0.iter()
    }

    /// The fingerprints, for people.
    pub fn fingerprints(&self) -> String {
        let fingerprints: Vec<String> = self.iter().map(Key::fingerprint).collect();
        fingerprints.join(" and ")
    }
}

/// Keys that anybody can guess.
#[cfg(test)]
pub(crate) mod of_digits {
    use super::*;

    /// The line of the key whose hexadecimal digits are all the same.
    pub(crate) fn line(digit: char) -> String {
        format!("{PREFIX}{}", digit.to_string().repeat(2 * KEY_BYTES))
    }

    pub(crate) fn key(digit: char) -> Key {
        Key::from_line(&line(digit)).unwrap()
    }

    pub(crate) fn keys(digits: &[char]) -> Keys {
        Keys(digits.iter().copied().map(key).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::of_digits::line;
    use super::*;

    fn fingerprints(text: &str) -> Result<String, KeyTextError> {
        Keys::parse(text).map(|keys| keys.fingerprints())
    }

    #[test]
    fn a_key_survives_its_text() {
        let key = Key::generate().unwrap();
        assert_eq!(fingerprints(&key.to_line()), Ok(key.fingerprint()));
        assert_eq!(Keys::parse(&line('a')).unwrap().0[0].secret(), &[0xaa; KEY_BYTES]);
    }

    #[test]
    fn no_two_keys_are_alike() {
        let [one, other] = [(); 2].map(|()| Key::generate().unwrap());
        assert_ne!(one.secret(), other.secret());
        assert_ne!(one.fingerprint(), other.fingerprint());
    }

    #[test]
    fn a_file_may_hold_two_keys_and_comments_but_not_three() {
        let two = format!("# the next\n{}\n\n  # the present\n{}\n", line('1'), line('2'));
        let expected = [line('1'), line('2')].map(|line| fingerprints(&line).unwrap());
        assert_eq!(fingerprints(&two), Ok(expected.join(" and ")));
        let three = format!("{two}{}", line('3'));
        assert_eq!(fingerprints(&three), Err(KeyTextError::TooMany { count: 3 }));
    }

    #[test]
    fn what_is_no_key_is_refused_with_its_line() {
        assert_eq!(fingerprints("# nothing\n"), Err(KeyTextError::Empty));
        let short = &line('1')[1..];
        let long = line('1') + "0";
        let other = line('g');
        let signed = format!("{PREFIX}{}", "+1".repeat(KEY_BYTES));
        for text in ["secret", short, &long, &other, &signed] {
            let error = fingerprints(&format!("# a comment\n{text}")).unwrap_err();
            assert_eq!(error, KeyTextError::NoKeyInLine { line: 2 }, "{text}");
        }
    }

    #[test]
    fn a_secret_is_not_shown_by_accident() {
        let shown = format!("{:?}", Keys::parse(&line('7')).unwrap());
        assert!(!shown.contains("7777"), "{shown}");
    }
}
