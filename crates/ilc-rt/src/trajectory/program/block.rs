//! One block of a part program: its words, each letter at most once, and one word per modal group.

use super::code::{CODES, Code, Motion, code, tenths};
use super::error::GcodeError;
use super::text::shown;
use super::token::Token;

/// Letters of the axes, in the order of the coordinates.
pub(super) const AXES: [u8; 6] = *b"XYZABC";
/// Largest number of a word.
const NUMBER_MAX: f64 = 1e9;

/// A word: its number, and its spelling.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word<'a> {
    pub(super) number: f64,
    /// Digits after the point.
    pub(super) places: usize,
    text: &'a [u8],
}

/// The words of a line.
#[expect(clippy::struct_excessive_bools, reason = "each tells whether a word is there")]
#[derive(Clone, Debug, Default)]
pub(super) struct Block<'a> {
    /// Line, from 1.
    pub(super) line: usize,
    pub(super) motion: Option<Motion>,
    pub(super) no_motion: bool,
    pub(super) dwells: bool,
    pub(super) inches: Option<bool>,
    pub(super) incremental: Option<bool>,
    pub(super) ends: bool,
    words: [Option<Word<'a>>; 26],
    /// The modal groups with a word, as bits.
    groups: u32,
    /// The motion word, or the first word of all.
    head: &'a [u8],
    is_begun: bool,
}

impl<'a> Block<'a> {
    pub(super) fn new(line: usize) -> Self {
        Self { line, ..Self::default() }
    }

    /// Adds a word; `exact` is true if the path comes to rest at its corners.
    ///
    /// # Errors
    /// [`GcodeError`] for a word that is unknown or repeated.
    pub(super) fn take(&mut self, token: &Token<'a>, exact: bool) -> Result<(), GcodeError> {
        let letter = token.text[0].to_ascii_uppercase();
        let refuse = |allowed: String| {
            Err(GcodeError { line: token.line, word: shown(token.text), allowed })
        };
        let is_first = !self.is_begun;
        self.is_begun = true;
        if self.head.is_empty() && letter != b'N' {
            self.head = token.text;
        }
        if letter == b'O' {
            return refuse("program numbers and subroutines (O words) are not read".to_owned());
        }
        if !b"GMNFSTPIJKR".contains(&letter) && !AXES.contains(&letter) {
            return refuse("allowed words: G M X Y Z A B C I J K R F P S T N".to_owned());
        }
        // Blanks are ignored; the tokens contain no other non-ASCII characters.
        let digits: String = token.text[1..]
            .iter()
            .filter(|b| b.is_ascii_graphic())
            .map(|&b| char::from(b))
            .collect();
        let number = match digits.parse::<f64>() {
            Ok(number) if number.abs() <= NUMBER_MAX => number,
            Ok(_) => return refuse(format!("a number from -{NUMBER_MAX:e} to {NUMBER_MAX:e}")),
            Err(_) => {
                let allowed = "a decimal number after the letter; parameters (#) and expressions \
                               ([ ]) are not read";
                return refuse(allowed.to_owned());
            }
        };
        if letter == b'G' || letter == b'M' {
            return self.code(token, letter, tenths(&digits), exact);
        }
        let whole_and_positive = !digits.starts_with('-') && number.fract() == 0.0;
        match letter {
            b'N' if !is_first => return refuse("N begins the block".to_owned()),
            b'N' | b'T' if !whole_and_positive => {
                return refuse("a whole number from 0".to_owned());
            }
            b'S' if number < 0.0 => return refuse("a speed from 0".to_owned()),
            _ => {}
        }
        let place = usize::from(letter - b'A');
        if self.words[place].is_some() {
            return refuse("once in a block".to_owned());
        }
        let places = digits.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        self.words[place] = Some(Word { number, places, text: token.text });
        Ok(())
    }

    fn code(
        &mut self,
        token: &Token<'a>,
        letter: u8,
        tenths: Option<u32>,
        exact: bool,
    ) -> Result<(), GcodeError> {
        let refuse = |allowed: String| {
            Err(GcodeError { line: token.line, word: shown(token.text), allowed })
        };
        let Some((code, group)) = tenths.and_then(|tenths| code(letter, tenths)) else {
            return refuse(format!("allowed {CODES}"));
        };
        if self.groups & (1 << group) != 0 {
            let allowed = match group {
                1 => "one of G0 G1 G2 G3 G80 in a block",
                _ => "one word of its modal group in a block",
            };
            return refuse(allowed.to_owned());
        }
        self.groups |= 1 << group;
        match code {
            Code::Motion(motion) => {
                self.motion = Some(motion);
                self.head = token.text;
            }
            Code::NoMotion => self.no_motion = true,
            Code::Dwell => self.dwells = true,
            Code::Inches(inches) => self.inches = Some(inches),
            Code::Incremental(incremental) => self.incremental = Some(incremental),
            Code::ExactCorners(wanted) if wanted != exact => {
                let is = if exact { "comes to rest at each corner" } else { "rounds its corners" };
                return refuse(format!(
                    "how corners are taken is not set by the program, and this one {is}"
                ));
            }
            Code::End => self.ends = true,
            Code::ExactCorners(_) | Code::AsItIs => {}
        }
        Ok(())
    }

    /// True if it holds nothing but a comment.
    pub(super) fn is_empty(&self) -> bool {
        !self.is_begun
    }

    pub(super) fn word(&self, letter: u8) -> Option<Word<'a>> {
        self.words[usize::from(letter - b'A')]
    }

    pub(super) fn number(&self, letter: u8) -> Option<f64> {
        self.word(letter).map(|word| word.number)
    }

    pub(super) fn has_any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|&letter| self.word(letter).is_some())
    }

    /// Returns the refusal of a word of this block.
    pub(super) fn refuse(&self, letter: u8, allowed: impl Into<String>) -> GcodeError {
        let written = self.word(letter).map_or(self.head, |word| word.text);
        GcodeError { line: self.line, word: shown(written), allowed: allowed.into() }
    }

    /// Returns the refusal of the whole block, named by its motion or its first word.
    pub(super) fn refuse_all(&self, allowed: impl Into<String>) -> GcodeError {
        GcodeError { line: self.line, word: shown(self.head), allowed: allowed.into() }
    }
}
