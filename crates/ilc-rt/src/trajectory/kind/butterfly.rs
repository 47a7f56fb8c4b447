//! The butterfly contour, with its first point at the start.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Job, Key, Kind, ProgramError};
use crate::interpolate::Interpolator;
use crate::schema::field_order;
use crate::trajectory::curve::{Butterfly, Curve};

/// `[program.butterfly]`: `r = scale (e^{cos t} - 2 cos 4t - sin⁵(t/12))`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ButterflySection {
    /// Size.
    #[schemars(range(max = 10.0), extend("exclusiveMinimum" = 0.0))]
    pub scale_m: f64,
    /// Revolutions of t; 12 close the contour.
    #[schemars(range(max = 12.0), extend("exclusiveMinimum" = 0.0))]
    pub turns: f64,
}

impl Default for ButterflySection {
    fn default() -> Self {
        Self { scale_m: 0.00185, turns: 1.0 }
    }
}

pub(super) const KIND: Kind = Kind {
    reads: &[Key::Butterfly, Key::CurvatureAcceleration],
    needs: &[],
    summary: "the butterfly contour, from `start_m`",
    file: None,
    is_plane: true,
    plan,
    describe: |_| "butterfly".to_owned(),
    example: "kind = \"butterfly\"\nstart_m = [0.04, 0.04]\nfeed_m_s = 0.02\n\
              curvature_acceleration_max_m_s2 = 0.02",
    example_file: "",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let ButterflySection { scale_m, turns } = job.program.butterfly.unwrap_or_default();
    let [x, y, ..] = Butterfly::new(scale_m, turns, [0.0; 2])?.at(0.0)[0];
    let start_m = job.start_m();
    let center_m = [start_m[0] - x, start_m[1] - y];
    job.along_curve(&Butterfly::new(scale_m, turns, center_m)?)
}
