//! Modal state of the interpreter, and its update by each block in LinuxCNC's order: feed, dwell,
//! units, distance mode, motion, end.

use super::block::{AXES, Block};
use super::code::Motion;
use super::error::GcodeError;
use super::part_program::{GcodeProgram, GcodeSetting};
use crate::interpolate::arc::{Arc, ends_agree};
use crate::trajectory::path::{ArcSpec, POSITION_MAX_M, PathSegment, point};

/// Millimetres and inches.
const MM_M: f64 = 1e-3;
const INCH_M: f64 = 0.0254;
/// Largest number of moves of a program.
const MOVES_MAX: usize = 250_000;
/// Longest dwell.
const DWELL_MAX_S: f64 = 3600.0;
/// Tolerance on a radius that is too short regardless of its decimals, as in LinuxCNC, and the
/// largest one that they can explain.
const SHORT_M: f64 = 1.27e-6;
const SHORT_MAX_M: f64 = 1.27e-5;
/// Worst effect on half a chord of rounding the last decimal of end points and radius.
const ROUNDED: f64 = 0.5 + std::f64::consts::FRAC_1_SQRT_2;

/// The feed of G1 to G3.
#[derive(Clone, Copy, Debug)]
enum Feed {
    /// Along the whole path, until the first F.
    Path(f64),
    /// Of the linear axes, or of the rotary ones if only they move.
    Programmed { linear_m_s: f64, rotary_rad_s: f64 },
}

/// The state of the interpreter.
#[derive(Clone, Debug)]
pub(super) struct Modal<'a> {
    setting: &'a GcodeSetting<'a>,
    motion: Option<Motion>,
    unit_m: f64,
    incremental: bool,
    feed: Feed,
    position_m: Vec<f64>,
    pub(super) program: GcodeProgram,
}

impl<'a> Modal<'a> {
    pub(super) fn new(setting: &'a GcodeSetting<'a>) -> Self {
        Self {
            setting,
            motion: None,
            unit_m: MM_M,
            incremental: false,
            feed: Feed::Path(setting.feed_m_s),
            position_m: setting.start_m.to_vec(),
            program: GcodeProgram::default(),
        }
    }

    /// Executes one block.
    ///
    /// # Errors
    /// [`GcodeError`] for a word that is not allowed in its place.
    pub(super) fn block(&mut self, block: &Block) -> Result<(), GcodeError> {
        if let Some(feed) = block.number(b'F') {
            if feed <= 0.0 {
                return Err(block.refuse(b'F', "a feed above 0 a minute"));
            }
            // In the units before the block, as F comes first.
            self.feed = Feed::Programmed {
                linear_m_s: feed * self.unit_m / 60.0,
                rotary_rad_s: feed.to_radians() / 60.0,
            };
        }
        if block.dwells {
            self.dwell(block)?;
        } else if block.has_any(b"P") {
            return Err(block.refuse(b'P', "P only with G4"));
        }
        if let Some(inches) = block.inches {
            self.unit_m = if inches { INCH_M } else { MM_M };
        }
        self.incremental = block.incremental.unwrap_or(self.incremental);
        if block.no_motion {
            self.motion = None;
        }
        self.motion = block.motion.or(self.motion);
        let letters = b"XYZABCIJKR";
        if block.has_any(letters) {
            let Some(motion) = self.motion else {
                let first = letters.iter().find(|&&letter| block.has_any(&[letter]));
                return Err(block.refuse(*first.unwrap_or(&b'X'), "G0, G1, G2 or G3 first"));
            };
            self.go(block, motion)?;
        }
        Ok(())
    }

    /// Executes `G4 P`, in seconds.
    fn dwell(&mut self, block: &Block) -> Result<(), GcodeError> {
        match block.number(b'P') {
            Some(seconds) if (0.0..=DWELL_MAX_S).contains(&seconds) => {
                match self.program.segments.last_mut() {
                    Some(last) => last.dwell_s += seconds,
                    None => self.program.dwell_before_s += seconds,
                }
                Ok(())
            }
            Some(_) => Err(block.refuse(b'P', "P in seconds, 0 to 3600")),
            None => Err(GcodeError {
                word: "G4".to_owned(),
                ..block.refuse_all("P in seconds, 0 to 3600")
            }),
        }
    }

    fn is_rotary(&self, axis: usize) -> bool {
        self.setting.rotary.get(axis).copied().unwrap_or(false)
    }

    fn go(&mut self, block: &Block, motion: Motion) -> Result<(), GcodeError> {
        let mut to_m = self.position_m.clone();
        for (axis, letter) in AXES.into_iter().enumerate() {
            let Some(value) = block.number(letter) else { continue };
            let rotary = self.is_rotary(axis);
            let Some(to) = to_m.get_mut(axis) else {
                let allowed = format!("the cell has {} axes", self.position_m.len());
                return Err(block.refuse(letter, allowed));
            };
            let value = if rotary { value.to_radians() } else { value * self.unit_m };
            *to = value + if self.incremental { *to } else { 0.0 };
            if to.abs() > POSITION_MAX_M {
                let allowed = format!("at most {POSITION_MAX_M} m from 0");
                return Err(block.refuse(letter, allowed));
            }
        }
        let arc = match motion {
            Motion::Arc { clockwise } => Some(self.arc(block, &to_m, clockwise)?),
            Motion::Rapid | Motion::Line => {
                let given = b"IJKR".iter().find(|&&letter| block.has_any(&[letter]));
                if let Some(&letter) = given {
                    return Err(block.refuse(letter, "I, J, K and R only with G2 and G3"));
                }
                None
            }
        };
        let still = to_m == self.position_m;
        if arc.is_some() || !still {
            if self.program.segments.len() >= MOVES_MAX {
                return Err(block.refuse_all(format!("at most {MOVES_MAX} moves in a program")));
            }
            let feed_m_s = match motion {
                Motion::Rapid => self.setting.rapid_m_s,
                Motion::Line | Motion::Arc { .. } => self.feed_along(&to_m, arc),
            };
            self.program.segments.push(PathSegment {
                to_m: to_m.clone(),
                feed_m_s,
                arc,
                dwell_s: 0.0,
            });
            self.program.lines.push(block.line);
            self.program.rapid.push(motion == Motion::Rapid);
        }
        self.position_m = to_m;
        Ok(())
    }

    /// Returns the speed along the path of all axes for a feed of the linear axes, or, if none of
    /// them moves, of the rotary ones.
    fn feed_along(&self, to_m: &[f64], arc: Option<ArcSpec>) -> f64 {
        let (linear_m_s, rotary_rad_s) = match self.feed {
            Feed::Path(feed_m_s) => return feed_m_s,
            Feed::Programmed { linear_m_s, rotary_rad_s } => (linear_m_s, rotary_rad_s),
        };
        let gone = |rotary: bool| {
            let axes = to_m.iter().zip(&self.position_m).enumerate();
            axes.filter(|(axis, _)| self.is_rotary(*axis) == rotary)
                .fold(0.0_f64, |sum, (_, (to, from))| sum.hypot(to - from))
        };
        let turned_rad = gone(true);
        if turned_rad <= 0.0 {
            return linear_m_s;
        }
        let round_m = arc.and_then(|arc| {
            let (from, to) = (point(&self.position_m).ok()?, point(to_m).ok()?);
            let all_m = Arc::new(from, to, arc.plane, arc.center_m, arc.clockwise)?.length_m;
            Some((all_m.powi(2) - turned_rad.powi(2)).max(0.0).sqrt())
        });
        let linear_m = round_m.unwrap_or_else(|| gone(false));
        if linear_m > 0.0 {
            linear_m_s * linear_m.hypot(turned_rad) / linear_m
        } else {
            rotary_rad_s
        }
    }

    /// Returns the centre, from I and J (relative to the start) or from R (below 0 for the longer
    /// way round).
    fn arc(&self, block: &Block, to_m: &[f64], clockwise: bool) -> Result<ArcSpec, GcodeError> {
        let (&[x, y, ..], &[to_x, to_y, ..]) = (&self.position_m[..], to_m) else {
            return Err(block.refuse_all("arcs need two axes"));
        };
        if self.is_rotary(0) || self.is_rotary(1) {
            return Err(block.refuse_all("arcs need linear axes X and Y"));
        }
        if block.number(b'K').is_some_and(|k| k != 0.0) {
            return Err(block.refuse(b'K', "arcs lie in the plane of X and Y: no K, or 0"));
        }
        let center_m = match ([b'I', b'J'].map(|letter| block.number(letter)), block.has_any(b"R"))
        {
            ([None, None], true) if block.has_any(b"K") => {
                return Err(block.refuse_all("either I and J, or R"));
            }
            ([None, None], true) => self.center_by_radius(block, [to_x, to_y], clockwise)?,
            ([None, None], false) => return Err(block.refuse_all("I and J, or R, is needed")),
            ([i, j], false) => {
                [x + i.unwrap_or(0.0) * self.unit_m, y + j.unwrap_or(0.0) * self.unit_m]
            }
            _ => return Err(block.refuse_all("either I and J, or R")),
        };
        let near = (x - center_m[0]).hypot(y - center_m[1]);
        let far = (to_x - center_m[0]).hypot(to_y - center_m[1]);
        if !ends_agree(near, far) {
            return Err(block.refuse_all(format!(
                "both ends as far from the centre, to a thousandth or 10 um: here {:.4} and {:.4} mm",
                near * 1e3,
                far * 1e3
            )));
        }
        Ok(ArcSpec { plane: [0, 1], center_m, clockwise })
    }

    fn center_by_radius(
        &self,
        block: &Block,
        [to_x, to_y]: [f64; 2],
        clockwise: bool,
    ) -> Result<[f64; 2], GcodeError> {
        let (x, y) = (self.position_m[0], self.position_m[1]);
        let radius_m = block.number(b'R').unwrap_or(0.0) * self.unit_m;
        let [dx, dy] = [to_x - x, to_y - y];
        let half_m = 0.5 * dx.hypot(dy);
        if half_m <= 0.0 || half_m - radius_m.abs() > self.short_m(block) {
            let allowed = format!(
                "at least half the distance of the ends, {} mm, and ends that differ",
                1000.0 * half_m
            );
            return Err(block.refuse(b'R', allowed));
        }
        // A radius short of a semicircle by no more than rounding means a semicircle.
        let reach_m = (radius_m.abs() - half_m).max(0.0) * (radius_m.abs() + half_m);
        let side = if clockwise { -1.0 } else { 1.0 } * radius_m.signum();
        let height = side * reach_m.sqrt() / (2.0 * half_m);
        Ok([0.5 * (x + to_x) - dy * height, 0.5 * (y + to_y) + dx * height])
    }

    /// Returns the largest shortfall of a radius from half the chord that the last decimal written
    /// in the block explains.
    fn short_m(&self, block: &Block) -> f64 {
        let words = [b'X', b'Y', b'R'].into_iter().filter_map(|letter| block.word(letter));
        let places = words.map(|word| word.places).max().unwrap_or(0);
        let last_m = self.unit_m * 0.1_f64.powi(i32::try_from(places).unwrap_or(i32::MAX));
        // Numbers without decimals are taken as exact.
        if places < 2 { SHORT_M } else { (ROUNDED * last_m).clamp(SHORT_M, SHORT_MAX_M) }
    }
}
