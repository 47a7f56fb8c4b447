//! A raster: rows to and fro, and back to the start.

use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::path::PathSegment;

/// Rows of `width_m` along the first axis, `pitch_m` apart along the second; with `there_and_back`
/// the same way backwards to the start.
///
/// # Errors
/// [`TrajectoryError::Shape`] for sizes or rows out of range.
/// # Source
/// - [barton2010], Section 8.1.2: two rasters forward, two in reverse
pub fn raster(
    start_m: [f64; 2],
    width_m: f64,
    pitch_m: f64,
    rows: usize,
    feed_m_s: f64,
    there_and_back: bool,
) -> Result<Vec<PathSegment>, TrajectoryError> {
    let refuse = |name, value, allowed| Err(TrajectoryError::Shape { name, value, allowed });
    for (name, value) in [("width_m", width_m), ("pitch_m", pitch_m), ("feed_m_s", feed_m_s)] {
        if !is_positive(value) {
            return refuse(name, value, "a finite number above 0");
        }
    }
    if !(1..=10_000).contains(&rows) {
        return refuse("rows", rows as f64, "1 to 10000");
    }
    let [x, y] = start_m;
    let mut corners = vec![[x, y]];
    for row in 0..rows {
        let height = y + row as f64 * pitch_m;
        let [from, to] = if row % 2 == 0 { [x, x + width_m] } else { [x + width_m, x] };
        if row > 0 {
            corners.push([from, height]);
        }
        corners.push([to, height]);
    }
    if there_and_back {
        corners.extend(corners.clone().into_iter().rev().skip(1));
    }
    Ok(corners
        .into_iter()
        .skip(1)
        .map(|corner| PathSegment::line(corner.to_vec(), feed_m_s))
        .collect())
}
