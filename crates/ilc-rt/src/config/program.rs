//! The sections of a cell description that concern the job: the program and the learning.

use std::path::PathBuf;

use serde::Deserialize;

use super::path::{ButterflySection, ModulatedSection, PathKind, RasterSection, SpiralSection};

/// `[program]`: where the tool goes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// Start and end of each run's return move, one coordinate an axis.
    pub start_m: Vec<f64>,
    /// Speed along the path where a segment names none.
    pub feed_m_s: f64,
    /// What kind of path it is.
    #[serde(default)]
    pub kind: PathKind,
    /// Part program of `kind = "gcode"`, set points of `kind = "table"`; a relative path begins at the
    /// cell description.
    pub file: Option<PathBuf>,
    /// Speed of G0; `feed_m_s` if it is not given.
    pub rapid_m_s: Option<f64>,
    /// Highest acceleration across a smooth curve; the axes' own limits if it is not given.
    pub curvature_acceleration_m_s2: Option<f64>,
    /// `[program.butterfly]`
    pub butterfly: Option<ButterflySection>,
    /// `[program.spiral]`
    pub spiral: Option<SpiralSection>,
    /// `[program.raster]`
    pub raster: Option<RasterSection>,
    /// `[program.modulated]`
    pub modulated: Option<ModulatedSection>,
    /// How corners are taken; not read where there are none.
    #[serde(default = "default_corner")]
    pub corner: Corner,
    /// Length of the averaging window of `corner = "blend"`.
    #[serde(default = "default_blend_s")]
    pub blend_s: f64,
    /// Rest at the start that belongs to the run, so that learning can prepare.
    #[serde(default = "default_dwell_before_s")]
    pub dwell_before_s: f64,
    /// Rest at the end that belongs to the run.
    #[serde(default = "default_dwell_after_s")]
    pub dwell_after_s: f64,
    /// Rest between the return to the start and the next run: the gap in which learning computes.
    #[serde(default = "default_settle_s")]
    pub settle_s: f64,
    /// `[[program.segment]]`, moves in order.
    #[serde(rename = "segment", default)]
    pub segments: Vec<Segment>,
}

fn default_corner() -> Corner {
    Corner::ExactStop
}

fn default_blend_s() -> f64 {
    0.04
}

fn default_dwell_before_s() -> f64 {
    0.1
}

fn default_dwell_after_s() -> f64 {
    0.2
}

fn default_settle_s() -> f64 {
    0.3
}

/// `[[program.segment]]`: a straight move, or an arc if it has a centre.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// End point, one coordinate an axis.
    pub to_m: Vec<f64>,
    /// Speed along this segment.
    pub feed_m_s: Option<f64>,
    /// Centre of an arc, in the first two axes.
    pub center_m: Option<[f64; 2]>,
    /// Which way round the arc is.
    #[serde(default)]
    pub clockwise: bool,
    /// Rest at its end.
    #[serde(default)]
    pub dwell_s: f64,
}

/// How corners are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Corner {
    /// Come to rest at every corner.
    ExactStop,
    /// Keep the feed and round the corner within the averaging window.
    Blend,
}

/// `[learning]`: which law learns, from what, and how far it may go.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Learning {
    /// The law.
    pub law: LawName,
    /// The measurement whose error is learned from.
    pub measure: Measure,
    /// Largest learned input of a csp axis.
    pub input_max_m: f64,
    /// Largest learned input of a csv axis.
    pub input_max_m_s: f64,
    /// Growth of the RMS error over the best run at which the best input is restored.
    pub rollback_ratio: f64,
    /// Whether a law may start of which the analysis says that it will not converge.
    pub allow_divergent: bool,
    /// `[learning.norm_optimal]`
    pub norm_optimal: NormOptimalSection,
    /// `[learning.pd]`
    pub pd: PdSection,
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            law: LawName::NormOptimal,
            measure: Measure::Tcp,
            input_max_m: 0.005,
            input_max_m_s: 0.05,
            rollback_ratio: 1.5,
            allow_divergent: false,
            norm_optimal: NormOptimalSection::default(),
            pd: PdSection::default(),
        }
    }
}

/// Which law learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    /// Norm-optimal; with `rate` it is CO-ILC.
    NormOptimal,
    /// Proportional-derivative with zero-phase low-pass.
    Pd,
    /// No learning: every run is like the first.
    None,
}

/// Which measurement is learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The encoder in each drive.
    Encoder,
    /// The tool centre point.
    Tcp,
}

/// `[learning.norm_optimal]`: weights of the quadratic cost.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NormOptimalSection {
    /// Weight of the next error.
    pub q: f64,
    /// Weight of the next input.
    pub s: f64,
    /// Weight of the change of input.
    pub r: f64,
    /// Weight d of the rate of the change of input (Haas eq. 7).
    pub rate: f64,
}

impl Default for NormOptimalSection {
    fn default() -> Self {
        Self { q: 1.0, s: 0.0, r: 0.0, rate: 3.0 }
    }
}

/// `[learning.pd]`: gains and the zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PdSection {
    /// Proportional gain.
    pub kp: f64,
    /// Derivative gain, per sample difference.
    pub kd: f64,
    /// Lead of the error over the input.
    pub lead_samples: usize,
    /// Order of the low-pass.
    pub order: usize,
    /// Cut-off of the low-pass.
    pub cutoff_hz: f64,
}

impl Default for PdSection {
    fn default() -> Self {
        Self { kp: 0.5, kd: 0.0, lead_samples: 1, order: 2, cutoff_hz: 10.0 }
    }
}
