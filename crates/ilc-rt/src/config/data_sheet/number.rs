//! Numbers of a data sheet: decimal or hexadecimal, with the node number in a sum.

/// A number, or a sum that contains the node number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    /// The number.
    Plain(i64),
    /// This much more than the node number.
    OfNode(i64),
}

impl Number {
    /// Returns the number for a node; `None` if it depends on the node and that is unknown.
    pub(super) fn of(self, node: Option<u8>) -> Option<i64> {
        match self {
            Self::Plain(number) => Some(number),
            Self::OfNode(offset) => offset.checked_add(i64::from(node?)),
        }
    }
}

/// Returns the number that a text states, e.g. `0x1F`, `31`, `-1` or `$NODEID + 0x180`; `None` for any
/// other text.
pub(super) fn number(text: &str) -> Option<Number> {
    let mut sum = 0_i64;
    let mut nodes = 0_u32;
    for term in text.split('+').map(str::trim) {
        if term.eq_ignore_ascii_case("$nodeid") {
            nodes += 1;
        } else {
            sum = sum.checked_add(plain(term)?)?;
        }
    }
    match nodes {
        0 => Some(Number::Plain(sum)),
        1 => Some(Number::OfNode(sum)),
        _ => None,
    }
}

/// Returns a decimal or hexadecimal number with its sign.
pub(super) fn plain(text: &str) -> Option<i64> {
    let (is_negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest.trim_start()),
        None => (false, text),
    };
    let magnitude = match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        Some(hex) if hex.bytes().all(|b| b.is_ascii_hexdigit()) => i64::from_str_radix(hex, 16),
        None if digits.bytes().all(|b| b.is_ascii_digit()) => digits.parse(),
        _ => return None,
    };
    magnitude.ok().map(|number| if is_negative { -number } else { number })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_number_is_read() {
        for (text, found) in [
            ("0x1A", Number::Plain(26)),
            ("0XfF", Number::Plain(255)),
            ("402", Number::Plain(402)),
            ("007", Number::Plain(7)),
            ("-32768", Number::Plain(-32_768)),
            ("-0x10", Number::Plain(-16)),
            ("$NODEID+0x180", Number::OfNode(0x180)),
            ("$NodeId + 0x200", Number::OfNode(0x200)),
            ("0x40000200 + $NODEID", Number::OfNode(0x4000_0200)),
            ("$NODEID", Number::OfNode(0)),
            ("$NODEID+384", Number::OfNode(384)),
        ] {
            assert_eq!(number(text), Some(found), "{text}");
        }
        assert_eq!(number("$NODEID+0x180").and_then(|n| n.of(Some(5))), Some(0x185));
        assert_eq!(number("$NODEID+0x180").and_then(|n| n.of(None)), None);
    }

    #[test]
    fn other_texts_are_no_numbers() {
        for text in [
            "",
            "+",
            "0x",
            "0xG",
            "1.5",
            "$NODEID+$NODEID",
            "$NODE",
            "--1",
            "0x+1",
            "9999999999999999999",
            "1+",
            "９",
        ] {
            assert_eq!(number(text), None, "{text}");
        }
    }
}
