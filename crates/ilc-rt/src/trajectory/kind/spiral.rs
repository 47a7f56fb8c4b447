//! A spiral from its centre, which is the start.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::schema::field_order;
use crate::trajectory::curve::Spiral;
use crate::trajectory::error::TrajectoryError;

/// `[program.spiral]`: from its centre, counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct SpiralSection {
    /// Distance of the turns.
    #[schemars(range(max = 10.0), extend("exclusiveMinimum" = 0.0))]
    pub pitch_m: f64,
    /// Turns.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub turns: f64,
}

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Spiral, Key::CurvatureAcceleration],
    needs: &[Key::Spiral],
    summary: "a spiral with its centre at `start_m`",
    file: None,
    is_plane: true,
    plan,
    describe: |_| "spiral".to_owned(),
    example: "kind = \"spiral\"\nstart_m = [0.04, 0.04]\nfeed_m_s = 0.02\n\
              [program.spiral]\npitch_m = 0.004\nturns = 3.0",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let SpiralSection { pitch_m, turns } = job.program.spiral.ok_or(TrajectoryError::Empty)?;
    job.along_curve(&Spiral::new(pitch_m, turns, job.start_m())?)
}
