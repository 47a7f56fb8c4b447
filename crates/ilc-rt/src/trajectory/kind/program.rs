//! `[program]` of a cell description: the keys common to all kinds of path, and those of some.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ButterflySection, ModulatedSection, PathKind, RasterSection, SpiralSection};
use crate::schema::field_order;

/// `[program]`: the path of the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Program {
    /// Start of each run and end of its return move, one coordinate per axis.
    pub start_m: Vec<f64>,
    /// Feed along the path for segments without their own.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub feed_m_s: f64,
    /// Kind of path.
    #[serde(default)]
    pub kind: PathKind,
    /// Part program of `kind = "gcode"`, set points of `kind = "table"`; in the folder of the cell
    /// description, or below it.
    pub file: Option<PathBuf>,
    /// Speed of G0; `feed_m_s` by default.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub rapid_m_s: Option<f64>,
    /// Skips blocks of the part program that begin with `/`.
    #[serde(default)]
    pub block_delete: bool,
    /// Largest centripetal acceleration of a smooth curve; by default only the axes' own limits
    /// apply.
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub curvature_acceleration_max_m_s2: Option<f64>,
    /// `[program.butterfly]`
    pub butterfly: Option<ButterflySection>,
    /// `[program.spiral]`
    pub spiral: Option<SpiralSection>,
    /// `[program.raster]`
    pub raster: Option<RasterSection>,
    /// `[program.modulated]`
    pub modulated: Option<ModulatedSection>,
    /// Corner mode; ignored without corners.
    #[serde(default = "default_corner")]
    pub corner: Corner,
    /// Length of the averaging window of `corner = "blend"`.
    #[serde(default = "default_blend_s")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub blend_s: f64,
    /// Dwell at the start, part of the run, so that learning can act ahead of the motion
    /// (look-ahead).
    #[serde(default = "default_dwell_before_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub dwell_before_s: f64,
    /// Dwell at the end, part of the run.
    #[serde(default = "default_dwell_after_s")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub dwell_after_s: f64,
    /// Settling time between the return to the start and the next run, in which learning computes.
    #[serde(default = "default_settle_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub settle_s: f64,
    /// `[[program.segment]]`, moves in order.
    #[serde(rename = "segment", default)]
    pub segments: Vec<Segment>,
}

/// A key or table of `[program]` that only some kinds of path read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// `[[program.segment]]`
    Segments,
    /// `center_m`, `clockwise` and `dwell_s` of a segment.
    Arcs,
    /// `file`
    File,
    /// `rapid_m_s`
    Rapid,
    /// `block_delete`
    BlockDelete,
    /// `[program.butterfly]`
    Butterfly,
    /// `[program.spiral]`
    Spiral,
    /// `[program.raster]`
    Raster,
    /// `[program.modulated]`
    Modulated,
    /// `curvature_acceleration_max_m_s2`
    CurvatureAcceleration,
}

impl Key {
    /// Returns the name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Segments => "[[program.segment]]",
            Self::Arcs => "[[program.segment]] center_m, clockwise, dwell_s",
            Self::File => "[program] file",
            Self::Rapid => "[program] rapid_m_s",
            Self::BlockDelete => "[program] block_delete",
            Self::Butterfly => "[program.butterfly]",
            Self::Spiral => "[program.spiral]",
            Self::Raster => "[program.raster]",
            Self::Modulated => "[program.modulated]",
            Self::CurvatureAcceleration => "[program] curvature_acceleration_max_m_s2",
        }
    }
}

impl Program {
    /// Returns straight moves and arcs from `start_m`, at the feed, corners and times of this program.
    #[must_use]
    pub fn along(&self, start_m: Vec<f64>, segments: Vec<Segment>) -> Self {
        // Every key is named: what another kind reads must not stay.
        Self {
            start_m,
            feed_m_s: self.feed_m_s,
            kind: PathKind::Points,
            file: None,
            rapid_m_s: None,
            block_delete: false,
            curvature_acceleration_max_m_s2: None,
            butterfly: None,
            spiral: None,
            raster: None,
            modulated: None,
            corner: self.corner,
            blend_s: self.blend_s,
            dwell_before_s: self.dwell_before_s,
            dwell_after_s: self.dwell_after_s,
            settle_s: self.settle_s,
            segments,
        }
    }

    /// Every key that only some kinds read, and true if it is given.
    pub fn given(&self) -> [(Key, bool); 10] {
        let is_extra = |s: &Segment| s.center_m.is_some() || s.clockwise || s.dwell_s > 0.0;
        [
            (Key::Segments, !self.segments.is_empty()),
            (Key::File, self.file.is_some()),
            (Key::Rapid, self.rapid_m_s.is_some()),
            (Key::BlockDelete, self.block_delete),
            (Key::Butterfly, self.butterfly.is_some()),
            (Key::Spiral, self.spiral.is_some()),
            (Key::Raster, self.raster.is_some()),
            (Key::Modulated, self.modulated.is_some()),
            (Key::CurvatureAcceleration, self.curvature_acceleration_max_m_s2.is_some()),
            (Key::Arcs, self.segments.iter().any(is_extra)),
        ]
    }

    /// Averaging window of blended corners; `None` for exact stops.
    pub fn window_s(&self) -> Option<f64> {
        (self.corner == Corner::Blend).then_some(self.blend_s)
    }

    /// `file`; empty if not given.
    pub fn file_name(&self) -> &Path {
        self.file.as_deref().unwrap_or(Path::new(""))
    }
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Segment {
    /// End point, one coordinate per axis.
    pub to_m: Vec<f64>,
    /// Feed along this segment.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub feed_m_s: Option<f64>,
    /// Centre of an arc, in the first two axes.
    pub center_m: Option<[f64; 2]>,
    /// Clockwise instead of anticlockwise.
    #[serde(default)]
    pub clockwise: bool,
    /// Dwell at its end.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub dwell_s: f64,
}

/// Corner mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Corner {
    /// Exact stop at every corner.
    ExactStop,
    /// Keep the feed and round the corner within the averaging window.
    Blend,
}
