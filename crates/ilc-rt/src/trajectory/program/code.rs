//! Meaning of the G and M words.

/// The words that are understood, for refusals.
pub(super) const CODES: &str = "G0 G1 G2 G3 G4 G17 G20 G21 G61 G64 G80 G90 G91 M2 M30, and those that \
                                ask for what is so anyway: G8 G40 G49 G54 G91.1 G92.1 G92.2 G94 G97 G98 \
                                G99 M5 M9 M48 M49";

/// Course of the tool to the next point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    Rapid,
    Line,
    Arc { clockwise: bool },
}

/// A supported G or M word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Code {
    /// G0 to G3.
    Motion(Motion),
    /// G80: no motion until the next of G0 to G3.
    NoMotion,
    /// G4.
    Dwell,
    /// G20 (true) or G21.
    Inches(bool),
    /// G91 (true) or G90.
    Incremental(bool),
    /// G61 and G61.1 (true) or G64: exact stops at corners.
    ExactCorners(bool),
    /// M2 or M30.
    End,
    /// A state that holds whether it is asked for or not.
    AsItIs,
}

/// Meaning of a word, and its modal group: one word of a group may stand in a block.
///
/// The number is given in tenths. Groups of G words are those of RS274/NGC; those of M words
/// begin at 20.
pub(super) fn code(letter: u8, tenths: u32) -> Option<(Code, u32)> {
    use Code::{AsItIs, Dwell, End, ExactCorners, Inches, Incremental, Motion as Move, NoMotion};
    Some(match (letter, tenths) {
        (b'G', 0) => (Move(Motion::Rapid), 1),
        (b'G', 10) => (Move(Motion::Line), 1),
        (b'G', 20 | 30) => (Move(Motion::Arc { clockwise: tenths == 20 }), 1),
        (b'G', 800) => (NoMotion, 1),
        (b'G', 40) => (Dwell, 0),
        // No axis offset is ever set.
        (b'G', 921 | 922) => (AsItIs, 0),
        (b'G', 170) => (AsItIs, 2),
        (b'G', 900 | 910) => (Incremental(tenths == 910), 3),
        (b'G', 911) => (AsItIs, 4),
        (b'G', 940) => (AsItIs, 5),
        (b'G', 200 | 210) => (Inches(tenths == 200), 6),
        (b'G', 400) => (AsItIs, 7),
        (b'G', 490) => (AsItIs, 8),
        // Canned cycles, whose return level these set, are refused.
        (b'G', 980 | 990) => (AsItIs, 10),
        // The first work coordinate system, which is that of the machine.
        (b'G', 540) => (AsItIs, 12),
        (b'G', 610 | 611 | 640) => (ExactCorners(tenths != 640), 13),
        (b'G', 970) => (AsItIs, 14),
        (b'G', 80) => (AsItIs, 15),
        (b'M', 20 | 300) => (End, 20),
        // There is no spindle, no coolant, and no override.
        (b'M', 50) => (AsItIs, 21),
        (b'M', 90) => (AsItIs, 22),
        (b'M', 480 | 490) => (AsItIs, 23),
        _ => return None,
    })
}

/// Parses the number of a G or M word to tenths: `1`, `01`, `1.`, `1.0` and `+1` are 10. `None` for
/// a negative number, a second decimal, or too many digits.
pub(super) fn tenths(number: &str) -> Option<u32> {
    let number = number.strip_prefix('+').unwrap_or(number);
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(whole) || !digits(fraction) || whole.len() + fraction.len() == 0 {
        return None;
    }
    let whole = whole.trim_start_matches('0');
    let tenth = match fraction.trim_start_matches('0') {
        "" => 0,
        // `90.10` is no usual spelling of `90.1`.
        _ if fraction.len() == 1 => fraction.parse().ok()?,
        _ => return None,
    };
    match whole {
        "" => Some(tenth),
        _ if whole.len() <= 4 => Some(whole.parse::<u32>().ok()? * 10 + tenth),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_code_is_one_and_no_other_is() {
        for spelling in ["1", "01", "1.", "1.0", "001.00", "+1"] {
            assert_eq!(tenths(spelling), Some(10), "{spelling}");
        }
        assert_eq!(tenths("91.1"), Some(911));
        assert_eq!(tenths(".1"), Some(1));
        assert_eq!(tenths("0"), Some(0));
        for other in ["-1", "", ".", "+", "90.10", "1.01", "4294967297", "1e1", "1.05"] {
            assert_eq!(tenths(other), None, "{other}");
        }
    }

    #[test]
    fn unknown_codes_are_none() {
        for (letter, unknown) in [(b'G', 50), (b'G', 901), (b'G', 180), (b'M', 0), (b'M', 60)] {
            assert_eq!(code(letter, unknown), None);
        }
        assert_eq!(code(b'G', 911), Some((Code::AsItIs, 4)));
    }
}
