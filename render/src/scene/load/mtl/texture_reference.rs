//! The rest of a `map_Kd` line: options, then a file name that may hold spaces.

use glam::Vec2;

use super::super::text::{number, shortened};
use crate::scene::Wrap;

/// Which picture, and how it lies on the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in super::super) struct TextureReference {
    /// The file name as written.
    pub(in super::super) file: String,
    /// Texture coordinates are multiplied by this (`-s`) …
    pub(in super::super) scale: Vec2,
    /// … and then shifted by this (`-o`).
    pub(in super::super) offset: Vec2,
    /// `-clamp`.
    pub(in super::super) wrap: Wrap,
    /// Whether there are options that change the look and are not rendered.
    pub(in super::super) has_ignored_options: bool,
}

impl TextureReference {
    /// Reads what follows `map_Kd`.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut reference = Self {
            file: String::new(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            wrap: Wrap::Repeat,
            has_ignored_options: false,
        };
        let mut rest = Rest(text.trim_ascii());
        while let Some(option) = rest.option() {
            reference.take(option, &mut rest)?;
        }
        let quoted = rest.0.strip_prefix('"').and_then(|r| r.strip_suffix('"'));
        quoted.unwrap_or(rest.0).clone_into(&mut reference.file);
        if reference.file.is_empty() {
            return Err("`map_Kd` without a file name; name a PNG or JPEG file".into());
        }
        Ok(reference)
    }

    fn take(&mut self, option: &str, rest: &mut Rest<'_>) -> Result<(), String> {
        let missing = || format!("`{option}` of `map_Kd` lacks its value");
        match option {
            "-s" => self.scale = rest.vector(Vec2::ONE)?.ok_or_else(missing)?,
            "-o" => self.offset = rest.vector(Vec2::ZERO)?.ok_or_else(missing)?,
            "-clamp" => {
                self.wrap = match rest.word().ok_or_else(missing)? {
                    "on" => Wrap::Clamp,
                    "off" => Wrap::Repeat,
                    other => {
                        let other = shortened(other);
                        return Err(format!("`-clamp` must be `on` or `off`, not `{other}`"));
                    }
                }
            }
            // How texels are filtered: no other look.
            "-blendu" | "-blendv" | "-texres" | "-boost" | "-type" => {
                rest.word().ok_or_else(missing)?;
            }
            "-cc" | "-imfchan" | "-bm" => {
                rest.word().ok_or_else(missing)?;
                self.has_ignored_options = true;
            }
            "-mm" | "-t" => {
                rest.vector(Vec2::ZERO)?.ok_or_else(missing)?;
                self.has_ignored_options = true;
            }
            _ => {
                let option = shortened(option);
                return Err(format!("`map_Kd` has no option `{option}`"));
            }
        }
        Ok(())
    }
}

/// What is left of the line.
struct Rest<'a>(&'a str);

impl<'a> Rest<'a> {
    fn word(&mut self) -> Option<&'a str> {
        let (word, rest) = self
            .0
            .split_once(|c: char| c.is_ascii_whitespace())
            .unwrap_or((self.0, ""));
        self.0 = rest.trim_ascii_start();
        (!word.is_empty()).then_some(word)
    }

    /// The next word if it is an option and not the file name.
    fn option(&mut self) -> Option<&'a str> {
        let mut ahead = Rest(self.0);
        let option = ahead.word()?;
        let letters = option.strip_prefix('-')?;
        let is_option = !ahead.0.is_empty() && letters.bytes().all(|b| b.is_ascii_alphabetic());
        is_option.then(|| {
            self.0 = ahead.0;
            option
        })
    }

    /// One to three numbers, of which the first two count; `fill` where the second is not given.
    fn vector(&mut self, fill: Vec2) -> Result<Option<Vec2>, String> {
        let mut vector = fill;
        let mut count = 0;
        while count < 3 {
            let mut ahead = Rest(self.0);
            let Some(Ok(value)) = ahead.word().map(number) else {
                break;
            };
            if !value.is_finite() {
                return Err("an option of `map_Kd` is not finite; give an ordinary number".into());
            }
            if count < 2 {
                vector[count] = value;
            }
            count += 1;
            self.0 = ahead.0;
        }
        Ok((count > 0).then_some(vector))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> TextureReference {
        TextureReference::parse(text).expect("readable")
    }

    #[test]
    fn a_plain_name_is_repeated_and_may_hold_spaces() {
        let reference = parse(" my textures/old stone.png ");
        assert_eq!(reference.file, "my textures/old stone.png");
        assert_eq!(reference.wrap, Wrap::Repeat);
        assert_eq!((reference.scale, reference.offset), (Vec2::ONE, Vec2::ZERO));
    }

    #[test]
    fn scale_offset_and_clamp_are_read_in_any_order() {
        let reference = parse("-clamp on -o 0.25 0.5 0 -s 2 3 1 -blendu off a.png");
        assert_eq!(reference.file, "a.png");
        assert_eq!(reference.scale, Vec2::new(2.0, 3.0));
        assert_eq!(reference.offset, Vec2::new(0.25, 0.5));
        assert_eq!(reference.wrap, Wrap::Clamp);
        assert!(!reference.has_ignored_options);
    }

    #[test]
    fn a_second_number_that_is_left_out_changes_nothing() {
        assert_eq!(parse("-s 2 a.png").scale, Vec2::new(2.0, 1.0));
        assert_eq!(parse("-o 0.5 a.png").offset, Vec2::new(0.5, 0.0));
    }

    #[test]
    fn a_name_that_begins_with_a_minus_is_no_option() {
        assert_eq!(parse("-a.png").file, "-a.png");
        assert_eq!(parse("\"-s.png\"").file, "-s.png");
    }

    #[test]
    fn options_without_effect_are_remembered() {
        assert!(parse("-mm 0 2 a.png").has_ignored_options);
    }

    #[test]
    fn nonsense_is_refused_with_the_reason() {
        let problem = |text| TextureReference::parse(text).expect_err("refused");
        assert!(problem("").contains("without a file name"));
        assert!(problem("-s big a.png").contains("lacks its value"));
        assert!(problem("-s nan a.png").contains("not finite"));
        assert!(problem("-clamp maybe a.png").contains("`on` or `off`"));
        assert!(problem("-frobnicate on a.png").contains("-frobnicate"));
    }
}
