//! Display of untrusted texts: without control characters.

use std::fmt::Write as _;

/// Largest number of characters of a name.
pub const NAME_MAX: usize = 64;
/// Largest number of characters of a foreign text in a line for people.
pub const TEXT_MAX: usize = 400;

/// Unicode format characters, including those that reverse the direction of writing.
const FORMAT: [(char, char); 14] = [
    ('\u{ad}', '\u{ad}'),
    ('\u{600}', '\u{605}'),
    ('\u{61c}', '\u{61c}'),
    ('\u{6dd}', '\u{6dd}'),
    ('\u{70f}', '\u{70f}'),
    ('\u{180e}', '\u{180e}'),
    ('\u{200b}', '\u{200f}'),
    ('\u{2028}', '\u{202e}'),
    ('\u{2060}', '\u{206f}'),
    ('\u{feff}', '\u{feff}'),
    ('\u{fff9}', '\u{fffb}'),
    ('\u{110bd}', '\u{110cd}'),
    ('\u{1bca0}', '\u{1bca3}'),
    ('\u{e0000}', '\u{e0fff}'),
];

/// Returns whether a character is a control or format character, or separates lines.
pub fn is_hidden(character: char) -> bool {
    character.is_control()
        || FORMAT.iter().any(|(first, last)| (*first..=*last).contains(&character))
}

/// Returns a text in one line with every character visible: an escape character is `\x1b`. A text
/// longer than `length_max` characters is truncated with three dots.
pub fn printable(text: &str, length_max: usize) -> String {
    let mut seen = String::new();
    for (place, character) in text.chars().enumerate() {
        if place == length_max {
            seen.push_str("...");
            break;
        }
        show(character, &mut seen);
    }
    seen
}

/// Returns a text with its line breaks, and with other hidden characters visible.
pub fn printable_lines(text: &str) -> String {
    let mut seen = String::with_capacity(text.len());
    for character in text.chars() {
        if character == '\n' {
            seen.push('\n');
        } else {
            show(character, &mut seen);
        }
    }
    seen
}

/// Returns printable JSON: hidden characters, which occur in strings only, are written as
/// equivalent escapes.
pub fn printable_json(text: &str) -> String {
    let mut seen = String::with_capacity(text.len());
    for character in text.chars() {
        if character != '\n' && is_hidden(character) {
            let mut units = [0; 2];
            for unit in character.encode_utf16(&mut units) {
                let _ = write!(seen, "\\u{unit:04x}");
            }
        } else {
            seen.push(character);
        }
    }
    seen
}

fn show(character: char, seen: &mut String) {
    match character {
        '\n' => seen.push_str("\\n"),
        '\t' => seen.push_str("\\t"),
        '\r' => seen.push_str("\\r"),
        hidden if is_hidden(hidden) => {
            let _ = match u32::from(hidden) {
                code @ 0..0x100 => write!(seen, "\\x{code:02x}"),
                code @ 0x100..0x1_0000 => write!(seen, "\\u{code:04x}"),
                code => write!(seen, "\\U{code:08x}"),
            };
        }
        other => seen.push(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_is_seen() {
        assert_eq!(printable("x\u{1b}[2J\0\u{7}\r\n", 99), "x\\x1b[2J\\x00\\x07\\r\\n");
        assert_eq!(
            printable("a\u{202e}b\u{9b}\u{7f}\u{e0001}", 99),
            "a\\u202eb\\x9b\\x7f\\U000e0001"
        );
        assert_eq!(printable("Größe µ 轴", 99), "Größe µ 轴");
        assert_eq!(printable(&"x".repeat(10_000_000), 4), "xxxx...");
        assert_eq!(printable_lines("a\nb\u{1b}"), "a\nb\\x1b");
    }

    #[test]
    fn json_means_the_same() {
        let text = serde_json::json!({ "name": "a\u{202e}\u{9b}\u{e0001}\u{1b}\n" }).to_string();
        let seen = printable_json(&text);
        assert!(!seen.chars().any(is_hidden), "{seen}");
        let (before, after): (serde_json::Value, serde_json::Value) =
            (serde_json::from_str(&text).unwrap(), serde_json::from_str(&seen).unwrap());
        assert_eq!(before, after);
    }
}
