//! Encoding of program files, and the form in which a piece of one is shown.

/// Largest number of characters of the text in a refusal.
const SHOWN_MAX: usize = 40;

/// Removes a byte order mark of UTF-8, as written by editors and spreadsheets.
///
/// # Errors
/// Refusal of a text in UTF-16 or UTF-32.
pub(super) fn without_mark(text: &[u8]) -> Result<&[u8], &'static str> {
    if text.starts_with(&[0xff, 0xfe]) || text.starts_with(&[0xfe, 0xff]) {
        return Err("the text is in UTF-16: save it in UTF-8 or plain ASCII");
    }
    // UTF-16 without a mark: every other byte of plain text is 0.
    if text.len() > 3
        && (text[..4] == [text[0], 0, text[2], 0] || text[..4] == [0, text[1], 0, text[3]])
    {
        return Err("the text is in UTF-16: save it in UTF-8 or plain ASCII");
    }
    Ok(text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text))
}

/// Returns a piece of the text in one line and without control characters, for an error.
pub(super) fn shown(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(&text[..text.len().min(8 * SHOWN_MAX)]);
    let mut shown = String::new();
    // Other white space, such as a no-break space, is what is refused: it must be seen.
    let mut characters = text.trim_matches(|c: char| c.is_ascii_whitespace()).chars();
    for character in characters.by_ref().take(SHOWN_MAX) {
        match character {
            '\'' | '"' | '\\' => shown.push(character),
            _ => shown.extend(character.escape_debug()),
        }
    }
    if characters.next().is_some() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_passed_over_and_other_encodings_named() {
        assert_eq!(without_mark(b"\xef\xbb\xbfG1"), Ok(&b"G1"[..]));
        assert_eq!(without_mark(b"G1"), Ok(&b"G1"[..]));
        for text in [&b"\xff\xfeG\0"[..], b"\xfe\xff\0G", b"G\x001\0", b"\0G\x001"] {
            assert!(without_mark(text).unwrap_err().contains("UTF-16"), "{text:?}");
        }
        assert!(without_mark(b"").is_ok() && without_mark(b"\0").is_ok());
    }

    #[test]
    fn what_is_shown_is_short_and_has_no_control_characters() {
        assert_eq!(shown(b" X\x1b[31m\r\n\xff "), "X\\u{1b}[31m\\r\\n\u{fffd}");
        assert_eq!(shown("\u{a0}\u{2028}\u{3000}x".as_bytes()), r"\u{a0}\u{2028}\u{3000}x");
        assert_eq!(shown(&[b'9'; 5000]).chars().count(), SHOWN_MAX + 1);
    }
}
