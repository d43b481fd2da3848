//! OBJ and MTL files as lines of plain text, whatever wrote them.

use std::borrow::Cow;

/// The text of a file: bytes that are not UTF-8 replaced, a byte order mark removed, every space an
/// ASCII one, and a line that goes on after a `\` joined (the line numbers stay as they were).
pub(super) fn readable(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut text = String::from_utf8_lossy(bytes);
    if !text.is_ascii() || text.contains('\x0b') {
        let plain = |c: char| if c != '\n' && c.is_whitespace() { ' ' } else { c };
        text = Cow::Owned(text.chars().map(plain).collect());
    }
    if text.contains("\\\n") || text.contains("\\\r\n") {
        text = Cow::Owned(joined(&text));
    }
    text
}

/// Takes out the line breaks after a `\` and puts them back after the end of the whole line. A
/// comment ends with its line: it may name a folder.
fn joined(text: &str) -> String {
    let mut whole = String::with_capacity(text.len());
    let mut owed = 0;
    for line in text.lines() {
        let is_comment = owed == 0 && line.trim_ascii_start().starts_with('#');
        if let Some(start) = line.strip_suffix('\\').filter(|_| !is_comment) {
            whole.push_str(start);
            whole.push(' ');
            owed += 1;
        } else {
            whole.push_str(line);
            whole.extend(std::iter::repeat_n('\n', owed + 1));
            owed = 0;
        }
    }
    whole
}

/// The words of a line up to a comment.
pub(super) fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split_ascii_whitespace()
        .take_while(|word| !word.starts_with('#'))
}

/// Splits a line into its keyword and the rest, both without surrounding spaces.
pub(super) fn keyword(line: &str) -> (&str, &str) {
    let line = line.trim_ascii();
    let (keyword, rest) = line
        .split_once(|c: char| c.is_ascii_whitespace())
        .unwrap_or((line, ""));
    (keyword, rest.trim_ascii_start())
}

/// One number of a text file, finite or not.
pub(super) fn number(word: &str) -> Result<f32, String> {
    match word.parse() {
        Ok(number) => Ok(number),
        Err(_) => Err(format!("`{}` is not a number", shortened(word))),
    }
}

/// A word of somebody else's file for use in a message.
pub(super) fn shortened(word: &str) -> String {
    const LENGTH_MAX: usize = 60;
    match word.char_indices().nth(LENGTH_MAX) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn continued_lines_are_joined_and_later_lines_keep_their_numbers() {
        let text = readable(b"f 1 \\\n2 \\\r\n3\nv 1 2 3\n");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines, ["f 1  2  3", "", "", "v 1 2 3"]);
    }

    #[test]
    fn a_comment_that_ends_with_a_backslash_ends_there() {
        assert_eq!(readable(b"# C:\\rooms\\\nv 1 2 3\n"), "# C:\\rooms\\\nv 1 2 3\n");
    }

    #[test]
    fn plain_text_is_not_copied() {
        assert!(matches!(readable(b"v 1 2 3\r\nf 1 2 3"), Cow::Borrowed(_)));
    }

    #[test]
    fn byte_order_mark_and_odd_spaces_are_removed() {
        assert_eq!(readable("\u{feff}v\u{a0}1\u{b}2".as_bytes()), "v 1 2");
        assert_eq!(readable(b"# \xb9ibenik"), "# \u{fffd}ibenik");
    }

    #[test]
    fn keyword_and_rest_are_parted_at_any_space() {
        assert_eq!(keyword("  usemtl\t old stone "), ("usemtl", "old stone"));
        assert_eq!(keyword("o"), ("o", ""));
        assert_eq!(keyword(""), ("", ""));
    }
}
