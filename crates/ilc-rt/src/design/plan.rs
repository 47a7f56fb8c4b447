//! From a cell description to the parts of the loop and of learning; refuses before anything moves.

use std::time::Duration;

use super::error::DesignError;
use super::fingerprint;
use super::law::{self, Prepared};
use super::traffic::{self, BusTraffic};
use crate::config::{
    Axis, Cell, ConfigError, Force, Input, InputUse, Level, Measure, Overrun, mode,
};
use crate::control::{Feedforward, PositionLoop};
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::cia402::{PdoMap, Scale, Supervision};
use crate::fieldbus::{AxisNetwork, Bus, CanopenAxes, Station};
use crate::model::{ModelError, StateSpace};
use crate::record::Meta;
use crate::rt::Nanos;
use crate::servo::{AxisSpec, ForceSpec, InputRole, InputSpec, Pace, ServoSpec, ToolSpec};
use crate::trajectory::{AxisLimits, Interpolator};

/// Heartbeats of the controller within the time after which a drive stops without them.
const BEATS_PER_DEADLINE: u32 = 4;
/// Timeout for enabling the drives.
const ENABLE_S: f64 = 3.0;
/// Missed cycles that are made up for where the cell asks for it; the answers to them may be missing so long.
const CATCH_UP_CYCLES: u32 = 10;

/// Plan of a cell's runs: none of its parts can fail any more.
#[derive(Debug)]
pub struct Plan {
    /// The servo cycle's own description; runs are filled in by the campaign.
    pub servo: ServoSpec,
    /// Set points.
    pub interpolator: Interpolator,
    /// Set points of a whole run, `n_samples * n_axes`.
    pub reference_m: Vec<f64>,
    /// Measurement to learn from.
    pub measure: Measure,
    /// Provenance of the records; the campaign's name is filled in by the campaign.
    pub meta: Meta,
    /// Fingerprint under which versions up to 0.1 kept the same campaign.
    pub(crate) legacy_fingerprint: String,
    /// True if the drives are simulated; filled in by the campaign.
    pub simulated: bool,
    /// Node number of the controller.
    controller: NodeId,
    /// Cyclic traffic of each bus, in the worst case.
    pub traffic: Vec<BusTraffic>,
}

impl Plan {
    /// Plans the runs of a cell, with another measurement to learn from if one is given.
    ///
    /// # Errors
    /// [`DesignError`] for a program beyond the limits, an overloaded bus, or a missing
    /// measurement.
    pub fn new(cell: &Cell, measure: Option<Measure>, lockstep: bool) -> Result<Self, DesignError> {
        crate::config::check(cell)?;
        let limits: Vec<AxisLimits> = cell.axes.iter().map(axis_limits).collect();
        let interpolator = super::program::interpolator(cell, &limits)?;
        let reference_m = interpolator.reference();
        super::program::check_range(cell, &reference_m)?;
        let program = super::program::program_json(cell, &reference_m);
        Self::with(cell, measure, lockstep, interpolator, program)
    }

    /// Plans the runs of a cell with other set points than those of its program; `program`
    /// describes them as JSON.
    pub(crate) fn with(
        cell: &Cell,
        measure: Option<Measure>,
        lockstep: bool,
        interpolator: Interpolator,
        program: String,
    ) -> Result<Self, DesignError> {
        let file = cell.file.display().to_string();
        let mut cell = cell.clone();
        cell.learning.measure = measure.unwrap_or(cell.learning.measure);
        crate::config::check(&cell)?;
        let traffic =
            traffic::of(&cell).map_err(|(key, source)| DesignError::Load { file, key, source })?;
        let reference_m = interpolator.reference();
        Ok(Self {
            servo: servo_spec(&cell, lockstep)?,
            controller: node(&cell, cell.controller_node())?,
            interpolator,
            reference_m,
            legacy_fingerprint: String::new(),
            measure: cell.learning.measure,
            meta: Meta {
                cell: cell.cell.name.clone(),
                campaign: String::new(),
                fingerprint: String::new(),
                law: String::new(),
                law_parameters: String::new(),
                measure: cell.learning.measure.name().to_owned(),
                program,
                cycle_s: cell.cycle_s(),
                n_axes: cell.n_axes(),
                axis_names: cell.axes.iter().map(|axis| axis.name.clone()).collect(),
                input_units: cell.axes.iter().map(|axis| input_unit(axis).to_owned()).collect(),
            },
            simulated: false,
            traffic,
        })
    }

    /// Returns the network of the cell's axes on a bus whose nodes have been brought up.
    ///
    /// # Shapes
    /// - `maps`: the process data of each axis as mapped at bring-up
    pub fn network(&self, mut bus: Box<dyn Bus>, maps: &[PdoMap]) -> Box<dyn AxisNetwork> {
        let tool = self.servo.tool.map(|tool| tool.node);
        let nodes = self.servo.axes.iter().map(|axis| axis.node).chain(tool);
        // A system that cannot filter passes everything on, and the loop skips what is foreign.
        let _ = bus.keep_to(&nodes.map(NodeId::get).collect::<Vec<_>>());
        let axes = self.servo.axes.iter().zip(maps);
        let stations =
            axes.map(|(axis, &map)| Station { node: axis.node, mode: axis.mode, map }).collect();
        let network = CanopenAxes::new(bus, stations, tool).simulated(self.simulated);
        if maps.iter().all(|map| map.supervision != Supervision::Heartbeat) {
            return Box::new(network);
        }
        // Some of them may be lost before a drive stops.
        let every = (self.servo.silent_cycles_max / BEATS_PER_DEADLINE).max(1);
        Box::new(network.with_heartbeat(self.controller, every))
    }

    /// Returns the number of samples in a run.
    pub fn n_samples(&self) -> usize {
        self.interpolator.n_samples()
    }

    /// Creates the law that the cell names, with its ladder and its gate.
    ///
    /// A law that is predicted to diverge on the cell's own model is refused, unless the cell sets
    /// `allow_divergent`. Further results of the analysis are in [`Prepared::warnings`].
    ///
    /// # Errors
    /// [`DesignError::Model`] or [`DesignError::Learning`] if model or weights are unusable, or the
    /// law is predicted to diverge.
    pub fn law(&self, cell: &Cell) -> Result<Prepared, DesignError> {
        law::prepare(cell, &self.reference_m)
    }

    /// Returns the fingerprint of a campaign of this cell with another law.
    pub(crate) fn fingerprint_with(&self, cell: &Cell, law: &str, parameters: &str) -> String {
        fingerprint::of(cell, &self.meta, law, parameters)
    }

    /// Returns the bound of the learned input of each axis, in its unit.
    pub(crate) fn input_bounds(&self) -> Vec<f64> {
        self.servo.axes.iter().map(|axis| axis.input_max).collect()
    }

    /// Completes the provenance with the law that will be used; `earlier` are the parameters that
    /// versions up to 0.1 stored for it.
    pub fn name_law(&mut self, cell: &Cell, name: &str, parameters: &str, earlier: &str) {
        name.clone_into(&mut self.meta.law);
        parameters.clone_into(&mut self.meta.law_parameters);
        self.legacy_fingerprint = fingerprint::legacy(cell, &self.meta, name, earlier);
        self.meta.fingerprint = fingerprint::of(cell, &self.meta, name, parameters);
    }
}

/// Returns the model that learning uses: the axes' closed loops, block-diagonal.
///
/// # Errors
/// [`DesignError::Config`] for an axis without a model, [`DesignError::Model`] for an unusable one.
pub(super) fn model(cell: &Cell) -> Result<StateSpace, DesignError> {
    closed_loops(cell, mode::learned_model)
}

/// Returns the model that the laws use: its inputs are counted in the unit of their weights.
///
/// # Errors
/// As [`model`].
pub(super) fn weighed_model(cell: &Cell) -> Result<StateSpace, DesignError> {
    closed_loops(cell, |axis, cycle_s| mode::weighed_model(axis, axis, cycle_s))
}

fn closed_loops(
    cell: &Cell,
    of_axis: impl Fn(&Axis, f64) -> Result<StateSpace, ModelError>,
) -> Result<StateSpace, DesignError> {
    if let Some(axis) = cell.axes.iter().find(|axis| axis.model.is_none()) {
        let key = format!("[[axis]] {}: model", axis.name);
        let (law, file, name) = (cell.learning.law.as_str(), cell.file.display(), &axis.name);
        let allowed = format!(
            "law = \"{law}\" needs [axis.model]: `ilc-rt identify {file} --axis {name}` measures it"
        );
        return Err(refused(cell, &key, &"missing", &allowed).into());
    }
    let mut models = cell.axes.iter().map(|axis| of_axis(axis, cell.cycle_s()));
    let mut whole = || {
        let first = models
            .next()
            .unwrap_or_else(|| StateSpace::static_gain(nalgebra::dmatrix![1.0], None))?;
        models.try_fold(first, |all, next| all.append(&next?))
    };
    whole().map_err(|source| DesignError::Model { file: cell.file.display().to_string(), source })
}

fn axis_limits(axis: &Axis) -> AxisLimits {
    AxisLimits {
        velocity_max_m_s: axis.limits.velocity_max_m_s,
        acceleration_max_m_s2: axis.limits.acceleration_max_m_s2,
        jerk_max_m_s3: axis.limits.jerk_max_m_s3,
    }
}

pub(crate) fn input_unit(axis: &Axis) -> &'static str {
    mode::unit_of(axis.input_kind(), axis.unit)
}

fn servo_spec(cell: &Cell, lockstep: bool) -> Result<ServoSpec, ConfigError> {
    let ticks = |span_s: f64| -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked spans"
        )]
        let ticks = (span_s / cell.cycle_s()).ceil() as u32;
        ticks
    };
    Ok(ServoSpec {
        axes: cell
            .axes
            .iter()
            .map(|axis| {
                Ok(AxisSpec {
                    node: node(cell, axis.node)?,
                    mode: axis.interface,
                    scale: axis_scale(cell, axis)?,
                    limits: axis_limits(axis),
                    position_min_m: axis.limits.position_min_m,
                    position_max_m: axis.limits.position_max_m,
                    following_error_max_m: axis.limits.following_error_max_m,
                    position_loop: PositionLoop {
                        gain_per_s: axis.position_loop.map_or(0.0, |p| p.gain_per_s),
                        velocity_feedforward: axis
                            .position_loop
                            .map_or(0.0, |p| p.velocity_feedforward),
                    },
                    input: axis.input_kind(),
                    input_max: mode::bound_of(axis.input_kind(), &cell.learning),
                    cascade: mode::cascade_gains(axis),
                    velocity_share: axis
                        .cascade
                        .map_or(1.0, |cascade| cascade.velocity_share(cell.cycle_s())),
                    force: axis.force.map(|force| ForceSpec {
                        rated_n: force.rated_n,
                        max_n: force.max_n(),
                        mass_kg: force.mass_kg,
                        coulomb_n: force.coulomb_n,
                        integral_time_s: force.integral_time_s.unwrap_or(0.0),
                    }),
                    feedforward: feedforward(axis),
                })
            })
            .collect::<Result<_, ConfigError>>()?,
        tool: cell
            .tcp_encoder
            .map(|tool| -> Result<_, ConfigError> {
                Ok(ToolSpec {
                    node: node(cell, tool.node)?,
                    scale: scale(cell, tool.counts_per_m)?,
                })
            })
            .transpose()?,
        inputs: cell.inputs.iter().filter_map(|input| input_spec(cell, input)).collect(),
        starts_on_input: false,
        cycle: Nanos::from_micros(cell.cell.cycle_us),
        pace: if lockstep {
            Pace::Answers(Duration::from_secs_f64(cell.safety.answer_timeout_s))
        } else {
            Pace::Clock
        },
        runs: 0..0,
        start_m: cell.program.start_m.clone(),
        return_feed_m_s: cell.program.feed_m_s,
        approach_feed_m_s: cell.safety.approach_velocity_m_s.unwrap_or(cell.program.feed_m_s),
        resets_faults: cell.safety.reset_faults,
        settle_ticks: ticks(cell.program.settle_s),
        // A guard has to be steady before the drives are switched on.
        enable_ticks: ticks(ENABLE_S)
            + cell.inputs.iter().map(|input| input.debounce_cycles).max().unwrap_or(0),
        silent_cycles_max: cell.safety.silent_cycles_max,
        overrun_cycles_max: match cell.realtime.overrun {
            Overrun::Stop => 0,
            Overrun::KeepPhase | Overrun::CatchUp => cell.safety.overrun_cycles_max,
        },
        catch_up_cycles_max: match cell.realtime.overrun {
            Overrun::CatchUp => CATCH_UP_CYCLES,
            Overrun::KeepPhase | Overrun::Stop => 0,
        },
        hold_cycles_max: 0,
    })
}

/// Returns what the loop watches of an input; `None` for one that validation would have refused.
fn input_spec(cell: &Cell, input: &Input) -> Option<InputSpec> {
    let axis = cell.axes.iter().position(|axis| axis.name == input.axis)?;
    let role = match input.purpose {
        InputUse::Guard => InputRole::Guard,
        InputUse::Start => InputRole::Start,
        InputUse::Stop => InputRole::Stop,
        InputUse::Limit => InputRole::Limit(input.direction_of(&cell.axes[axis])?.sign()),
    };
    Some(InputSpec {
        axis,
        mask: 1 << input.bit,
        is_high: input.active == Level::High,
        role,
        debounce_cycles: input.debounce_cycles,
    })
}

/// Returns the feed-forwards of an axis, from their shares.
fn feedforward(axis: &Axis) -> Feedforward {
    let share = axis.feedforward.unwrap_or_default();
    let of = |value: fn(&Force) -> f64| axis.force.as_ref().map_or(0.0, value);
    Feedforward {
        velocity: share.velocity,
        lead_s: share.lead_s,
        mass_kg: share.acceleration * of(|force| force.mass_kg),
        viscous_n_s_m: share.friction * of(|force| force.viscous_n_s_m),
        coulomb_n: share.friction * of(|force| force.coulomb_n),
        coulomb_velocity_m_s: of(|force| force.coulomb_velocity_m_s),
    }
}

/// Returns the node of a validated number.
pub(crate) fn node(cell: &Cell, number: u8) -> Result<NodeId, ConfigError> {
    NodeId::new(number).ok_or_else(|| refused(cell, "node", &number, "1 to 127"))
}

/// Returns the scale of an axis, with its sign and its zero.
pub(crate) fn axis_scale(cell: &Cell, axis: &Axis) -> Result<Scale, ConfigError> {
    let scale = scale(cell, axis.counts_per_m)?;
    Ok(scale.reversed(axis.reversed).with_zero_m(axis.homing.offset_m))
}

fn scale(cell: &Cell, counts_per_m: f64) -> Result<Scale, ConfigError> {
    Scale::new(counts_per_m).ok_or_else(|| refused(cell, "counts_per_m", &counts_per_m, "above 0"))
}

pub(super) fn refused(
    cell: &Cell,
    key: &str,
    value: &dyn std::fmt::Display,
    allowed: &str,
) -> ConfigError {
    ConfigError::Value {
        file: cell.file.display().to_string(),
        key: key.to_owned(),
        value: value.to_string(),
        allowed: allowed.to_owned(),
    }
}
