//! Straight legs with an oscillation superimposed along them, exponential/sigmoid.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::schema::field_order;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::exponential::{ExponentialSigmoid, ModulatedSegment};

/// `[program.modulated]`: an oscillation along the legs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ModulatedSection {
    /// Amplitude.
    #[schemars(range(min = 0.0))]
    pub amplitude_m: f64,
    /// Frequency.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub frequency_hz: f64,
}

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Segments, Key::Modulated],
    needs: &[Key::Segments, Key::Modulated],
    summary: "legs with an oscillation superimposed along them, exponential/sigmoid",
    file: None,
    is_plane: false,
    plan,
    describe: |program| format!("{} modulated legs", program.segments.len()),
    example: "kind = \"modulated\"\nstart_m = [0.0, 0.0]\nfeed_m_s = 0.02\n\
              segment = [{ to_m = [0.05, 0.0] }]\n\
              [program.modulated]\namplitude_m = 0.0005\nfrequency_hz = 3.0",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let program = job.program;
    let ModulatedSection { amplitude_m, frequency_hz } =
        program.modulated.ok_or(TrajectoryError::Empty)?;
    let leg = |segment: &super::Segment| ModulatedSegment {
        to_m: segment.to_m.clone(),
        feed_m_s: job.feed_m_s(segment),
        amplitude_m,
        frequency_hz,
    };
    let legs: Vec<ModulatedSegment> = program.segments.iter().map(leg).collect();
    let plan = ExponentialSigmoid::plan(&program.start_m, &legs, job.limits)?;
    job.play(&plan.sampled(job.cycle_s)?)
}
