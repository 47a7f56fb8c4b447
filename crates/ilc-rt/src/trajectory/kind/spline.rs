//! A smooth curve through points.

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::trajectory::curve::Spline;

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Segments, Key::CurvatureAcceleration],
    needs: &[Key::Segments],
    summary: "a natural cubic spline through start and points",
    file: None,
    is_plane: false,
    plan,
    describe: |program| format!("spline through {} points", program.segments.len() + 1),
    example: "kind = \"spline\"\nstart_m = [0.0, 0.0]\nfeed_m_s = 0.02\nsegment = [\
              { to_m = [0.03, 0.01] }, { to_m = [0.05, 0.05] }, { to_m = [0.0, 0.04] }]",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let program = job.program;
    let points_m: Vec<Vec<f64>> = std::iter::once(&program.start_m)
        .chain(program.segments.iter().map(|segment| &segment.to_m))
        .cloned()
        .collect();
    job.along_curve(&Spline::through(&points_m)?)
}
