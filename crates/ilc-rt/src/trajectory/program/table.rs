//! Set points as text: one row a servo cycle, one column an axis, separated by commas. Cold.
//!
//! The supervisor reads the file of `kind = "table"` with it. A head line is optional; where there is
//! one it must name the axes in order, so that exchanged columns are refused instead of driven.

/// A refused table: the line from 1, what is there, and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {found}: {allowed}")]
pub struct TableError {
    /// Line of the text, from 1.
    pub line: usize,
    /// What is there.
    pub found: String,
    /// What is allowed.
    pub allowed: String,
}

/// Set points, and where they stand in the text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SetPointTable {
    /// Positions, `n_rows * n_axes`, time first.
    pub position_m: Vec<f64>,
    /// Line of each row, from 1.
    pub lines: Vec<usize>,
}

/// Reads a table of set points; empty lines and those that begin with `#` are passed over.
///
/// # Errors
/// [`TableError`] for the first line that has not one finite number for each axis, and for a head line
/// with other names.
pub fn read_table(text: &str, axis_names: &[&str]) -> Result<SetPointTable, TableError> {
    let mut table = SetPointTable::default();
    for (number, text) in text.lines().enumerate() {
        let row = text.trim();
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let refuse = |found: &str, allowed: String| TableError {
            line: number + 1,
            found: found.to_owned(),
            allowed,
        };
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != axis_names.len() {
            let allowed = format!(
                "{} columns are needed, separated by commas: {}",
                axis_names.len(),
                axis_names.join(", ")
            );
            return Err(refuse(&format!("{} columns", cells.len()), allowed));
        }
        if table.lines.is_empty() && cells == axis_names {
            continue;
        }
        for cell in cells {
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => table.position_m.push(value),
                _ => {
                    let allowed = format!(
                        "finite numbers, or a head line that names the axes in order: {}",
                        axis_names.join(", ")
                    );
                    return Err(refuse(cell, allowed));
                }
            }
        }
        table.lines.push(number + 1);
    }
    if table.lines.is_empty() {
        return Err(TableError {
            line: text.lines().count().max(1),
            found: "no set points".to_owned(),
            allowed: "at least one row is needed".to_owned(),
        });
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 2] = ["x", "y"];

    #[test]
    fn head_comments_and_empty_lines_are_passed_over() {
        let table = read_table("# by hand\nx, y\n\n0.0, 1e-3\n -2.5,3\n", &NAMES).unwrap();
        assert_eq!(table.position_m, [0.0, 1e-3, -2.5, 3.0]);
        assert_eq!(table.lines, [4, 5]);
        assert_eq!(read_table("0,1", &NAMES).unwrap().lines, [1]);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let refused = |text: &str| read_table(text, &NAMES).unwrap_err().to_string();
        assert!(refused("y,x\n0,0").contains("line 1: y: finite numbers, or a head line"));
        assert!(refused("0,0\n0,0,0").contains("line 2: 3 columns: 2 columns are needed"));
        assert!(refused("0,0\n0,nan").contains("line 2: nan"));
        assert!(refused("0,0\n0,1 mm").contains("1 mm"));
        assert!(refused("0,0\nx,y").contains("line 2: x"));
        assert!(refused("# nothing\n").contains("no set points"));
    }
}
