//! The tokens of a part program. Lossless: concatenated they are the text.
//!
//! A word is a letter and its number; blanks may stand anywhere in it, as in RS274/NGC, where
//! `G0 x +0. 12 34y 7` is `G0 X0.1234 Y7`. Invalid characters are a token of their own kind, so
//! that the reader refuses them with their line.

/// Kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Spaces, tabs and the like.
    Blank,
    /// `\n`, `\r\n` or `\r`.
    LineEnd,
    /// `( … )` or `; …` to the end of the line.
    Comment,
    /// `( …` without its end in the line.
    OpenComment,
    /// `( … (`: comments do not nest.
    NestedComment,
    /// `%`.
    Percent,
    /// `/`.
    Slash,
    /// A letter, and the number after it if there is one.
    Word,
    /// Any other character.
    Stray,
}

/// A piece of the text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token<'a> {
    pub(super) kind: Kind,
    pub(super) text: &'a [u8],
    /// Line of its beginning, from 1.
    pub(super) line: usize,
}

/// The tokens of a text, in order.
#[derive(Clone, Debug)]
pub(super) struct Tokens<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Tokens<'a> {
    pub(super) fn of(text: &'a [u8]) -> Self {
        Self { rest: text, line: 1 }
    }

    /// Returns the current line, from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }
}

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        let (kind, length) = first(self.rest)?;
        let (text, rest) = self.rest.split_at(length);
        let token = Token { kind, text, line: self.line };
        self.rest = rest;
        self.line += usize::from(kind == Kind::LineEnd);
        Some(token)
    }
}

/// Returns kind and length of the first token.
fn first(text: &[u8]) -> Option<(Kind, usize)> {
    let found = match *text.first()? {
        b'\r' if text.get(1) == Some(&b'\n') => (Kind::LineEnd, 2),
        b'\n' | b'\r' => (Kind::LineEnd, 1),
        byte if is_blank(byte) => (Kind::Blank, count(text, is_blank)),
        b'(' => comment(text),
        b';' => (Kind::Comment, count(text, |byte| !is_line_end(byte))),
        b'%' => (Kind::Percent, 1),
        b'/' => (Kind::Slash, 1),
        byte if byte.is_ascii_alphabetic() => (Kind::Word, word(text)),
        // A multi-byte character stays whole, for display.
        byte if byte >= 0xc0 => (Kind::Stray, 1 + count(&text[1..], |next| next & 0xc0 == 0x80)),
        _ => (Kind::Stray, 1),
    };
    Some(found)
}

fn comment(text: &[u8]) -> (Kind, usize) {
    let inside = count(&text[1..], |byte| byte != b'(' && byte != b')' && !is_line_end(byte));
    match text.get(1 + inside) {
        Some(b')') => (Kind::Comment, inside + 2),
        Some(b'(') => (Kind::NestedComment, inside + 2),
        _ => (Kind::OpenComment, inside + 1),
    }
}

/// Returns the length of a letter and its number: a sign, then digits with at most one point, with
/// blanks among them.
fn word(text: &[u8]) -> usize {
    let (mut length, mut number, mut point) = (1, false, false);
    for (at, &byte) in text.iter().enumerate().skip(1) {
        match byte {
            b'+' | b'-' if !number => {}
            b'.' if !point => point = true,
            b'0'..=b'9' => {}
            byte if is_blank(byte) => continue,
            _ => break,
        }
        number = true;
        length = at + 1;
    }
    length
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

fn is_line_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

fn count(text: &[u8], holds: impl Fn(u8) -> bool) -> usize {
    text.iter().take_while(|&&byte| holds(byte)).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    fn words(text: &str) -> Vec<String> {
        Tokens::of(text.as_bytes())
            .filter(|token| token.kind == Kind::Word)
            .map(|token| String::from_utf8_lossy(token.text).into_owned())
            .collect()
    }

    #[test]
    fn a_word_keeps_its_number_whatever_blanks_are_in_it() {
        assert_eq!(words("G0 x +0. 12 34y 7"), ["G0", "x +0. 12 34", "y 7"]);
        assert_eq!(words("G20.X-.5Y5.\tF 1\t0"), ["G20.", "X-.5", "Y5.", "F 1\t0"]);
        assert_eq!(words("X1e3 Y--1 Z1.2.3"), ["X1", "e3", "Y-", "Z1.2"]);
    }

    #[test]
    fn every_kind_is_told_from_the_others() {
        let kinds = |text: &str| Tokens::of(text.as_bytes()).map(|t| t.kind).collect::<Vec<_>>();
        assert_eq!(kinds("%\r\n"), [Kind::Percent, Kind::LineEnd]);
        assert_eq!(kinds("/G1(a;b);c(\r"), {
            [Kind::Slash, Kind::Word, Kind::Comment, Kind::Comment, Kind::LineEnd]
        });
        assert_eq!(kinds("(a\n(b(c)")[..3], {
            [Kind::OpenComment, Kind::LineEnd, Kind::NestedComment]
        });
        assert_eq!(kinds("#1=[2]"), [Kind::Stray; 6]);
        assert_eq!(kinds("é\0"), [Kind::Stray; 2]);
        let lines: Vec<usize> = Tokens::of(b"G1\r\nG2\rG3\nG4").map(|token| token.line).collect();
        assert_eq!(lines, [1, 1, 2, 2, 3, 3, 4]);
    }

    #[test]
    fn any_bytes_come_back_one_after_the_other() {
        let mut random = Random(31);
        let alphabet = b"GXYfn01239.+-()%;/ \t\r\n#[=\xc3\xa9\xff\0*";
        for round in 0..20_000 {
            let length = 1 + round % 60;
            let text: Vec<u8> =
                (0..length).map(|_| alphabet[random.below(alphabet.len())]).collect();
            let again: Vec<u8> = Tokens::of(&text).flat_map(|t| t.text.to_vec()).collect();
            assert_eq!(again, text);
            assert!(Tokens::of(&text).all(|token| !token.text.is_empty()));
        }
    }
}
