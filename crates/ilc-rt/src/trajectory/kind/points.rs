//! Straight moves and arcs.

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::trajectory::path::{ArcSpec, PathSegment};

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Segments, Key::Arcs],
    needs: &[Key::Segments],
    summary: "lines and arcs",
    file: None,
    is_plane: false,
    plan,
    describe: |program| format!("{} segments", program.segments.len()),
    example: "start_m = [0.0, 0.0]\nfeed_m_s = 0.02\nsegment = [{ to_m = [0.02, 0.0] }, \
              { to_m = [0.0, 0.02], center_m = [0.0, 0.0], dwell_s = 0.1 }]",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let segments = job.program.segments.iter().map(|segment| PathSegment {
        to_m: segment.to_m.clone(),
        feed_m_s: job.feed_m_s(segment),
        arc: segment.center_m.map(|center_m| ArcSpec {
            plane: [0, 1],
            center_m,
            clockwise: segment.clockwise,
        }),
        dwell_s: segment.dwell_s,
    });
    job.along_segments(segments.collect(), &[], 0.0)
}
