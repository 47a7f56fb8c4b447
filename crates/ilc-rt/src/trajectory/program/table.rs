//! Set points as text: one row per servo cycle, one column per axis, separated by commas. Cold.
//!
//! The campaign reads the file of `kind = "table"` with it. A header line is optional; if present
//! it must name the axes in order, so that swapped columns are refused instead of driven.

use super::text::{shown, without_mark};
use crate::trajectory::grid::N_SAMPLES_MAX;

/// A refused table: the line from 1, its content, and the allowed one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {found}: {allowed}")]
pub struct TableError {
    /// Line of the text, from 1.
    pub line: usize,
    /// The text found.
    pub found: String,
    /// The values allowed.
    pub allowed: String,
}

/// Set points with their lines in the text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SetPointTable {
    /// Positions, `n_rows * n_axes`, time first.
    pub position_m: Vec<f64>,
    /// Line of each row, from 1.
    pub lines: Vec<usize>,
}

/// Reads a table of set points; `#` begins a comment, and lines without set points are skipped.
///
/// The text is UTF-8, with or without a byte order mark; comments may hold any bytes.
///
/// # Errors
/// [`TableError`] for the first line without exactly one finite number per axis, for a header with
/// other names, and for more than ten million rows.
pub fn read_table(text: &[u8], axis_names: &[&str]) -> Result<SetPointTable, TableError> {
    let mut table = SetPointTable::default();
    let text = without_mark(text).map_err(|reason| TableError {
        line: 1,
        found: "its encoding".to_owned(),
        allowed: reason.to_owned(),
    })?;
    let mut last = 1;
    for (number, line) in lines(text).enumerate() {
        last = number + 1;
        let row = line.split(|&byte| byte == b'#').next().unwrap_or(&[]).trim_ascii();
        if row.is_empty() {
            continue;
        }
        let refuse = |found: &[u8], allowed: String| {
            let found = if found.is_empty() { "an empty column".to_owned() } else { shown(found) };
            TableError { line: number + 1, found, allowed }
        };
        let Ok(plain) = std::str::from_utf8(row) else {
            return Err(refuse(row, "text in UTF-8 or plain ASCII".to_owned()));
        };
        let cells: Vec<&str> = plain.split(',').map(|cell| bare(cell.trim())).collect();
        if cells.len() != axis_names.len() || plain.contains([';', '\t']) {
            let allowed = format!(
                "{} columns are needed, separated by commas: {}{}",
                axis_names.len(),
                axis_names.join(", "),
                if plain.contains([';', '\t']) {
                    "; neither semicolons nor tabs separate, and decimals have a point"
                } else {
                    ""
                }
            );
            let found = TableError { line: number + 1, found: columns(&cells), allowed };
            return Err(found);
        }
        if table.lines.is_empty() && cells == axis_names {
            continue;
        }
        if table.lines.len() >= N_SAMPLES_MAX {
            return Err(refuse(b"one more row", format!("at most {N_SAMPLES_MAX} rows")));
        }
        for cell in cells {
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => table.position_m.push(value),
                _ => {
                    let allowed = format!(
                        "finite numbers, or a head line that names the axes in order: {}",
                        axis_names.join(", ")
                    );
                    return Err(refuse(cell.as_bytes(), allowed));
                }
            }
        }
        table.lines.push(number + 1);
    }
    if table.lines.is_empty() {
        return Err(TableError {
            line: last,
            found: "no set points".to_owned(),
            allowed: "at least one row is needed".to_owned(),
        });
    }
    Ok(table)
}

/// Splits at `\n`, `\r\n` or `\r`.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let text = rest?;
        let Some(end) = text.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
            rest = None;
            return (!text.is_empty()).then_some(text);
        };
        let length = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&text[end + length..]);
        Some(&text[..end])
    })
}

/// Removes the quotation marks that some programs put around a cell.
fn bare(cell: &str) -> &str {
    cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).unwrap_or(cell)
}

/// Number of columns, for a refusal.
fn columns(cells: &[&str]) -> String {
    let last_is_empty = cells.len() > 1 && cells.last().is_some_and(|cell| cell.is_empty());
    let noun = if cells.len() == 1 { "column" } else { "columns" };
    format!("{} {noun}{}", cells.len(), if last_is_empty { ", the last one empty" } else { "" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    const NAMES: [&str; 2] = ["x", "y"];

    #[test]
    fn head_comments_and_empty_lines_are_passed_over() {
        let table = read_table(b"# by hand\nx, y\n\n0.0, 1e-3\n -2.5,3\n", &NAMES).unwrap();
        assert_eq!(table.position_m, [0.0, 1e-3, -2.5, 3.0]);
        assert_eq!(table.lines, [4, 5]);
        assert_eq!(read_table(b"0,1", &NAMES).unwrap().lines, [1]);
    }

    #[test]
    fn a_comment_may_follow_the_data_and_hold_any_bytes() {
        let table =
            read_table(b"x,y # head\n0.0,0.0 # start \xb5m\n#\n1,2#\xff\n", &NAMES).unwrap();
        assert_eq!(table.position_m, [0.0, 0.0, 1.0, 2.0]);
        assert_eq!(table.lines, [2, 4]);
    }

    #[test]
    fn spreadsheets_marks_line_ends_and_quotes_are_read() {
        for text in [
            &b"\xef\xbb\xbfx,y\r\n0,1\r\n2,3\r\n"[..],
            b"x,y\r0,1\r2,3",
            b"\"x\",\"y\"\n\n0,1\n\t\n\"2\",+3.\n\n",
        ] {
            assert_eq!(
                read_table(text, &NAMES).unwrap().position_m,
                [0.0, 1.0, 2.0, 3.0],
                "{text:?}"
            );
        }
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let refused = |text: &[u8]| {
            let line = read_table(text, &NAMES).unwrap_err().to_string();
            assert!(!line.contains(char::is_control), "{line:?}");
            line
        };
        assert!(refused(b"y,x\n0,0").contains("line 1: y: finite numbers, or a head line"));
        assert!(refused(b"0,0\n0,0,0").contains("line 2: 3 columns: 2 columns are needed"));
        assert!(refused(b"0,0\n0,0,").contains("line 2: 3 columns, the last one empty"));
        assert!(refused(b"0,0\n0,nan").contains("line 2: nan"));
        assert!(refused(b"0,0\n-inf,0").contains("line 2: -inf"));
        assert!(refused(b"0,0\n1e999,0").contains("line 2: 1e999"));
        assert!(refused(b"0,0\n0,1 mm").contains("1 mm"));
        assert!(refused(b"0,0\n0,\n").contains("line 2: an empty column"));
        assert!(refused(b"0,0\nx,y").contains("line 2: x"));
        assert!(refused(b"# nothing\n").contains("no set points"));
        assert!(refused(b"").contains("line 1: no set points"));
        assert!(refused(b"0;0\n").contains("neither semicolons nor tabs"));
        assert!(refused(b"0,0\n0,5;1,5\n").contains("line 2: 3 columns: 2 columns are needed"));
        assert!(refused(b"0,5;1\n").contains("decimals have a point"));
        assert!(refused(b"0\t0\n").contains("neither semicolons nor tabs"));
        assert!(refused(b"0,0\n0,\xb5\n").contains("line 2: 0,\u{fffd}: text in UTF-8"));
        assert!(refused(b"\xff\xfe0\0,\0").contains("line 1: its encoding: the text is in UTF-16"));
        assert!(refused(b"0,\x1b[31m").contains("\\u{1b}[31m"));
    }

    #[test]
    fn no_bytes_make_it_panic() {
        let mut random = Random(37);
        let alphabet = b"0123456789.,-+eE#;\"xy \t\r\n\xb5\xff\0naif";
        for round in 0..20_000 {
            let text: Vec<u8> =
                (0..=round % 40).map(|_| alphabet[random.below(alphabet.len())]).collect();
            if let Ok(table) = read_table(&text, &NAMES) {
                assert_eq!(table.position_m.len(), 2 * table.lines.len());
                assert!(table.position_m.iter().all(|value| value.is_finite()));
            }
        }
    }
}
