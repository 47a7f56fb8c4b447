//! Set points, one row per servo cycle, from the start of the program.

use super::{FileKind, Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::trajectory::motion::set_points;
use crate::trajectory::program::{TableError, read_table};

/// Tolerance on the distance of the first row from the start.
const START_M: f64 = 1e-9;

pub(super) const KIND: Kind = Kind {
    reads: &[Key::File],
    needs: &[Key::File],
    summary: "set points, one row per servo cycle: one comma-separated column per axis, decimal \
              point. An optional header names the axes in order; `#` starts a comment, also after \
              data. The first row is `start_m`; the axes are at rest there and at the last row. \
              Set points are sent unchanged: if velocity, acceleration or jerk over the cycle \
              would exceed a limit, the table is rejected with the row",
    file: Some(FileKind { content: "set points", bytes_max: 64 << 20 }),
    is_plane: false,
    plan,
    describe: |program| format!("set points of {}", program.file_name().display()),
    example: "kind = \"table\"\nstart_m = [0.0, 0.0]\nfeed_m_s = 0.02\nfile = \"example.txt\"\n\
              dwell_after_s = 1.0",
    example_file: "x,y\n0.0,0.0\n0.0,0.0\n",
};

/// Rejects a table that does not start where the axes rest before a run.
fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let table = read_table(job.text, job.axis_names)?;
    let starts = table.position_m.iter().zip(&job.program.start_m);
    for (name, (&found_m, &start_m)) in job.axis_names.iter().zip(starts) {
        if (found_m - start_m).abs() > START_M {
            return Err(ProgramError::Table(TableError {
                line: table.lines.first().copied().unwrap_or(1),
                found: format!("axis {name} begins at {found_m}"),
                allowed: format!("the first row must be [program] start_m, {start_m}"),
            }));
        }
    }
    job.play(&set_points(&table.position_m, job.limits, job.cycle_s)?)
}
