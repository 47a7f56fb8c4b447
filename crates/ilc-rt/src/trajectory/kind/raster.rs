//! A raster: parallel rows in alternating directions, and back to the start.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::interpolate::limits::is_positive;
use crate::schema::field_order;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::path::PathSegment;

/// `[program.raster]`: rows along the first axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct RasterSection {
    /// Length of a row.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub width_m: f64,
    /// Distance of the rows.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub pitch_m: f64,
    /// Number of rows.
    #[schemars(range(min = 1, max = 10_000))]
    pub rows: usize,
    /// Returns to the start along the same path.
    #[serde(default)]
    pub there_and_back: bool,
}

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Raster],
    needs: &[Key::Raster],
    summary: "rows along the first axis",
    file: None,
    is_plane: true,
    plan,
    describe: |_| "raster".to_owned(),
    example: "kind = \"raster\"\nstart_m = [0.0, 0.0]\nfeed_m_s = 0.02\n\
              [program.raster]\nwidth_m = 0.02\npitch_m = 0.005\nrows = 3\nthere_and_back = true",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let raster = job.program.raster.ok_or(TrajectoryError::Empty)?;
    let segments = raster.segments(job.start_m(), job.program.feed_m_s)?;
    job.along_segments(segments, &[], 0.0)
}

impl RasterSection {
    /// Returns rows of `width_m` along the first axis, `pitch_m` apart along the second; with
    /// `there_and_back` the same way backward to the start.
    ///
    /// # Errors
    /// [`TrajectoryError::Shape`] for sizes or rows out of range.
    /// # Source
    /// - \[barton2010\], Section 8.1.2: two rasters forward, two in reverse
    pub fn segments(
        &self,
        start_m: [f64; 2],
        feed_m_s: f64,
    ) -> Result<Vec<PathSegment>, TrajectoryError> {
        let &Self { width_m, pitch_m, rows, there_and_back } = self;
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
        let corners = corners.into_iter().skip(1);
        Ok(corners.map(|corner| PathSegment::line(corner.to_vec(), feed_m_s)).collect())
    }
}
