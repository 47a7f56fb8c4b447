//! A subset of G-code (RS-274): lines, arcs in the XY plane, dwells, units, absolute and incremental.
//!
//! The grammar is the crate `gcode`'s, which keeps lines and places but reads numbers in single
//! precision: too coarse for 10 nm on a metre. So each number is read again from its place.

use gcode::{Code, Value};

use crate::trajectory::path::{ArcSpec, PathSegment};

/// What is understood, for refusals.
const CODES: &str = "G0 G1 G2 G3 G4 G17 G20 G21 G90 G91 M2 M30";
/// Millimetres and inches.
const MM_M: f64 = 1e-3;
const INCH_M: f64 = 0.0254;
/// Letters of the axes, in the order of the coordinates.
const AXES: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// A refused program: the line from 1, the word, and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {word}: {allowed}")]
pub struct GcodeError {
    /// Line of the text, from 1.
    pub line: usize,
    /// The word, as written.
    pub word: String,
    /// What is wrong and what is allowed.
    pub allowed: String,
}

/// What a program says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GcodeProgram {
    /// Moves in order.
    pub segments: Vec<PathSegment>,
    /// Rest before the first move.
    pub dwell_before_s: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Motion {
    Rapid,
    Line,
    Arc { clockwise: bool },
}

/// A word of a block: its letter, its number, and how it is written.
struct Word {
    letter: char,
    number: f64,
    text: String,
}

/// What holds from block to block.
struct Modal {
    motion: Option<Motion>,
    unit_m: f64,
    incremental: bool,
    feed_m_s: f64,
    rapid_m_s: f64,
    position_m: Vec<f64>,
    program: GcodeProgram,
}

/// Reads a program that begins at `start_m`; `feed_m_s` holds until the first F, `rapid_m_s` is the
/// speed of G0.
///
/// # Errors
/// [`GcodeError`] for the first word that is not understood, or not allowed where it is.
pub fn read_gcode(
    text: &str,
    start_m: &[f64],
    feed_m_s: f64,
    rapid_m_s: f64,
) -> Result<GcodeProgram, GcodeError> {
    let parsed = gcode::parse(text).map_err(|found| {
        let first = found.iter().next();
        let line = first.map_or(0, |diagnostic| diagnostic.span.line) + 1;
        let word = first.and_then(|diagnostic| {
            text.get(diagnostic.span.start..diagnostic.span.start + diagnostic.span.length)
        });
        GcodeError {
            line,
            word: word.unwrap_or("").trim().to_owned(),
            allowed: format!("cannot be read: words are a letter and a number; allowed {CODES}"),
        }
    })?;
    let mut modal = Modal {
        motion: None,
        unit_m: MM_M,
        incremental: false,
        feed_m_s,
        rapid_m_s,
        position_m: start_m.to_vec(),
        program: GcodeProgram::default(),
    };
    for block in &parsed.blocks {
        let mut codes: Vec<(char, u32, Option<u32>, usize)> = Vec::new();
        let mut words: Vec<(Word, usize)> = Vec::new();
        let mut read = |letter: char, value: &Value, span: gcode::core::Span| {
            word(text, letter, value, span).map(|word| words.push((word, span.line + 1)))
        };
        for code in &block.codes {
            let (letter, number, span, arguments) = match code {
                Code::General(code) => ('G', code.number, code.span, &code.args),
                Code::Miscellaneous(code) => ('M', code.number, code.span, &code.args),
                Code::ToolChange(code) => ('T', code.number, code.span, &code.args),
                _ => continue,
            };
            codes.push((
                letter,
                number.major(),
                number.minor().map(std::num::NonZeroU32::get),
                span.line + 1,
            ));
            for argument in arguments {
                read(argument.letter, &argument.value, argument.span)?;
            }
        }
        for address in &block.word_addresses {
            read(address.letter, &address.value, address.span)?;
        }
        if modal.block(&codes, &words)? {
            break;
        }
    }
    Ok(modal.program)
}

/// A word with its number in double precision.
fn word(
    text: &str,
    letter: char,
    value: &Value,
    span: gcode::core::Span,
) -> Result<Word, GcodeError> {
    let written = text.get(span.start..span.start + span.length).unwrap_or("").trim().to_owned();
    let refuse = |allowed: &str| GcodeError {
        line: span.line + 1,
        word: if written.is_empty() { letter.to_string() } else { written.clone() },
        allowed: allowed.to_owned(),
    };
    let Value::Literal(coarse) = value else {
        return Err(refuse("variables are not read: write a number"));
    };
    let digits: String = written
        .trim_start_matches(|c: char| c.is_ascii_alphabetic())
        .chars()
        .filter(|c| !c.is_whitespace())
        .collect();
    let number: f64 = digits.parse().map_err(|_| refuse("the number cannot be read"))?;
    if !number.is_finite() || (number - f64::from(*coarse)).abs() > 1e-5 * number.abs() + 1e-30 {
        return Err(refuse("the number cannot be read: write a finite decimal number"));
    }
    Ok(Word { letter: letter.to_ascii_uppercase(), number, text: written })
}

impl Modal {
    /// Carries out one block; returns whether the program ends with it.
    fn block(
        &mut self,
        codes: &[(char, u32, Option<u32>, usize)],
        words: &[(Word, usize)],
    ) -> Result<bool, GcodeError> {
        let (mut dwells, mut ends, mut moves) = (false, false, 0);
        let mut line = words.first().map_or(1, |word| word.1);
        for &(letter, major, minor, at) in codes {
            line = at;
            let written = match minor {
                Some(minor) => format!("{letter}{major}.{minor}"),
                None => format!("{letter}{major}"),
            };
            match (letter, major, minor) {
                ('G', 0, None) => (self.motion, moves) = (Some(Motion::Rapid), moves + 1),
                ('G', 1, None) => (self.motion, moves) = (Some(Motion::Line), moves + 1),
                ('G', 2 | 3, None) => {
                    self.motion = Some(Motion::Arc { clockwise: major == 2 });
                    moves += 1;
                }
                ('G', 4, None) => dwells = true,
                ('G', 17, None) => {}
                ('G', 20, None) => self.unit_m = INCH_M,
                ('G', 21, None) => self.unit_m = MM_M,
                ('G', 90, None) => self.incremental = false,
                ('G', 91, None) => self.incremental = true,
                ('M', 2 | 30, None) => ends = true,
                _ => return Err(refuse(line, &written, format!("allowed {CODES}"))),
            }
            if moves > 1 {
                return Err(refuse(line, &written, "one of G0 G1 G2 G3 in a block".to_owned()));
            }
        }
        for (position, (word, at)) in words.iter().enumerate() {
            let known = "XYZABCIJRFP".contains(word.letter);
            if !known {
                let allowed = "allowed words: X Y Z A B C I J R F P".to_owned();
                return Err(refuse(*at, &word.text, allowed));
            }
            if words[..position].iter().any(|(other, _)| other.letter == word.letter) {
                return Err(refuse(*at, &word.text, "once in a block".to_owned()));
            }
        }
        if let Some(feed) = number(words, 'F') {
            let feed_m_s = feed * self.unit_m / 60.0;
            if feed_m_s <= 0.0 {
                let text = written(words, 'F');
                return Err(refuse(line, &text, "a feed above 0 a minute".to_owned()));
            }
            self.feed_m_s = feed_m_s;
        }
        if dwells {
            self.dwell(words, line)?;
        } else if words.iter().any(|(word, _)| word.letter == 'P') {
            return Err(refuse(line, &written(words, 'P'), "P only with G4".to_owned()));
        }
        if words.iter().any(|(word, _)| AXES.contains(&word.letter) || "IJR".contains(word.letter))
        {
            self.go(words, line)?;
        }
        Ok(ends)
    }

    /// `G4 P`, in seconds.
    fn dwell(&mut self, words: &[(Word, usize)], line: usize) -> Result<(), GcodeError> {
        match number(words, 'P') {
            Some(seconds) if (0.0..=3600.0).contains(&seconds) => {
                match self.program.segments.last_mut() {
                    Some(last) => last.dwell_s += seconds,
                    None => self.program.dwell_before_s += seconds,
                }
                Ok(())
            }
            _ => Err(refuse(line, "G4", "P in seconds, 0 to 3600".to_owned())),
        }
    }

    fn go(&mut self, words: &[(Word, usize)], line: usize) -> Result<(), GcodeError> {
        let Some(motion) = self.motion else {
            return Err(refuse(
                line,
                &words.first().map_or_else(String::new, |(word, _)| word.text.clone()),
                "G0, G1, G2 or G3 first".to_owned(),
            ));
        };
        let mut to_m = self.position_m.clone();
        for (axis, letter) in AXES.into_iter().enumerate() {
            let Some(value) = number(words, letter) else { continue };
            let Some(to) = to_m.get_mut(axis) else {
                let allowed = format!("the cell has {} axes", self.position_m.len());
                return Err(refuse(line, &written(words, letter), allowed));
            };
            *to = value * self.unit_m + if self.incremental { *to } else { 0.0 };
        }
        let arc = if let Motion::Arc { clockwise } = motion {
            Some(self.arc(words, &to_m, clockwise, line)?)
        } else {
            for letter in ['I', 'J', 'R'] {
                if number(words, letter).is_some() {
                    let allowed = "I, J and R only with G2 and G3".to_owned();
                    return Err(refuse(line, &written(words, letter), allowed));
                }
            }
            None
        };
        let still = to_m.iter().zip(&self.position_m).all(|(to, from)| (to - from).abs() <= 0.0);
        if arc.is_some() || !still {
            let feed_m_s = if motion == Motion::Rapid { self.rapid_m_s } else { self.feed_m_s };
            self.program.segments.push(PathSegment {
                to_m: to_m.clone(),
                feed_m_s,
                arc,
                dwell_s: 0.0,
            });
        }
        self.position_m = to_m;
        Ok(())
    }

    /// The centre, from I and J (from the start) or from R (below 0 for the longer way round).
    fn arc(
        &self,
        words: &[(Word, usize)],
        to_m: &[f64],
        clockwise: bool,
        line: usize,
    ) -> Result<ArcSpec, GcodeError> {
        let code = if clockwise { "G2" } else { "G3" };
        let (&[x, y, ..], &[to_x, to_y, ..]) = (&self.position_m[..], to_m) else {
            return Err(refuse(line, code, "arcs need two axes".to_owned()));
        };
        let offset = ['I', 'J'].map(|letter| number(words, letter));
        let center_m = match (offset, number(words, 'R')) {
            ([None, None], Some(radius)) => {
                let radius_m = radius * self.unit_m;
                let [dx, dy] = [to_x - x, to_y - y];
                let chord_m = dx.hypot(dy);
                let reach = radius_m * radius_m - 0.25 * chord_m * chord_m;
                // Half a micrometre of rounding in the program's decimals is no reason to refuse.
                if chord_m <= 0.0 || reach < -1e-6 * radius_m.abs() {
                    let allowed = format!(
                        "at least half the distance of the ends, {} mm, and ends that differ",
                        500.0 * chord_m
                    );
                    return Err(refuse(line, &written(words, 'R'), allowed));
                }
                let side = if clockwise { -1.0 } else { 1.0 } * radius_m.signum();
                let height = side * reach.max(0.0).sqrt() / chord_m;
                [0.5 * (x + to_x) - dy * height, 0.5 * (y + to_y) + dx * height]
            }
            ([None, None], None) => {
                return Err(refuse(line, code, "I and J, or R, is needed".to_owned()));
            }
            ([i, j], None) => {
                [x + i.unwrap_or(0.0) * self.unit_m, y + j.unwrap_or(0.0) * self.unit_m]
            }
            _ => return Err(refuse(line, code, "either I and J, or R".to_owned())),
        };
        let near = (x - center_m[0]).hypot(y - center_m[1]);
        let far = (to_x - center_m[0]).hypot(to_y - center_m[1]);
        if near <= 0.0 || (near - far).abs() > 1e-5_f64.max(1e-3 * near) {
            let allowed = format!(
                "both ends as far from the centre: here {:.4} and {:.4} mm",
                near * 1e3,
                far * 1e3
            );
            return Err(refuse(line, code, allowed));
        }
        Ok(ArcSpec { plane: [0, 1], center_m, clockwise })
    }
}

fn number(words: &[(Word, usize)], letter: char) -> Option<f64> {
    words.iter().find(|(word, _)| word.letter == letter).map(|(word, _)| word.number)
}

fn written(words: &[(Word, usize)], letter: char) -> String {
    words
        .iter()
        .find(|(word, _)| word.letter == letter)
        .map_or_else(|| letter.to_string(), |(word, _)| word.text.clone())
}

fn refuse(line: usize, word: &str, allowed: String) -> GcodeError {
    GcodeError { line, word: word.to_owned(), allowed }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<GcodeProgram, GcodeError> {
        read_gcode(text, &[0.0, 0.0], 0.05, 0.2)
    }

    #[test]
    fn lines_arcs_dwells_and_units() {
        let program = read(
            "%\n(a part) ; and more\nN10 G21 G90 G17\nG4 P0.5\nG0 X10 Y-5.5\nG1 X20 F600\nY5 (modal)\n\
             G3 X10 Y15 I-10 J0\nG4 P1.25\nG91 G2 X10 Y10 R10\nG20 G1 X1\nM30\nG1 X999\n",
        )
        .unwrap();
        assert!((program.dwell_before_s - 0.5).abs() < 1e-15);
        let s = &program.segments;
        assert_eq!(s.len(), 6, "{s:?}");
        let near = |i: usize, x: f64, y: f64| {
            assert!((s[i].to_m[0] - x).hypot(s[i].to_m[1] - y) < 1e-12, "{:?}", s[i]);
        };
        near(0, 0.01, -0.0055);
        near(1, 0.02, -0.0055);
        near(2, 0.02, 0.005);
        near(3, 0.01, 0.015);
        near(4, 0.02, 0.025);
        near(5, 0.0454, 0.025);
        assert!((s[0].feed_m_s - 0.2).abs() < 1e-15 && (s[1].feed_m_s - 0.01).abs() < 1e-15);
        let arc = s[3].arc.unwrap();
        assert!(!arc.clockwise && (arc.center_m[0] - 0.01).abs() < 1e-15);
        assert!((s[3].dwell_s - 1.25).abs() < 1e-15);
        let arc = s[4].arc.unwrap();
        assert!(arc.clockwise);
        assert!((arc.center_m[0] - 0.02).hypot(arc.center_m[1] - 0.015) < 1e-9, "{arc:?}");
    }

    #[test]
    fn numbers_are_read_in_double_precision() {
        let program = read("G1 X123.4567891 F100").unwrap();
        assert!((program.segments[0].to_m[0] - 0.123_456_789_1).abs() < 1e-16);
    }

    #[test]
    fn refusals_name_line_word_and_what_is_allowed() {
        for (text, line, word) in [
            ("G1 X1\nG5 X2\n", 2, "G5"),
            ("G21\n\nG18\n", 3, "G18"),
            ("G1 X1 Z2\n", 1, "Z2"),
            ("X5\n", 1, "X5"),
            ("G1 X1 X2\n", 1, "X2"),
            ("G1 X1 F0\n", 1, "F0"),
            ("G2 X10 Y0\n", 1, "G2"),
            ("G2 X10 Y0 R1\n", 1, "R1"),
            ("G2 X10 Y0 I4 J0\n", 1, "G2"),
            ("G1 X1 I3\n", 1, "I3"),
            ("G4\n", 1, "G4"),
            ("G1 X#1\n", 1, "X"),
            ("G0 G1 X1\n", 1, "G1"),
            ("M6 T1\n", 1, "M6"),
            ("G1 X1 P3\n", 1, "P3"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.line, line, "{text:?} {error}");
            assert!(error.word.starts_with(word), "{text:?} {error}");
            assert!(!error.to_string().contains('\n'));
        }
        let error = read("G1 X1\nG1 Y!\n").unwrap_err();
        assert_eq!(error.line, 2, "{error}");
    }

    #[test]
    fn arcs_by_radius_go_the_short_or_the_long_way() {
        let center = |text: &str| read(text).unwrap().segments[0].arc.unwrap().center_m;
        let h = 75.0_f64.sqrt() * 1e-3;
        assert!((center("G3 X10 Y0 R10")[1] - h).abs() < 1e-12, "left of the chord");
        assert!((center("G2 X10 Y0 R10")[1] + h).abs() < 1e-12);
        assert!((center("G3 X10 Y0 R-10")[1] + h).abs() < 1e-12, "the long way");
        let half = center("G3 X10 Y0 R5");
        assert!((half[0] - 0.005).hypot(half[1]) < 1e-12);
    }
}
