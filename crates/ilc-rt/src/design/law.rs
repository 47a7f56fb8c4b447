//! From `[learning]` to the law that a campaign uses; refuses what cannot learn before anything moves.
//!
//! `plan` hands out what is made here.

use super::error::DesignError;
use super::forecast;
use super::plan::model;
use super::weights::norm_optimal_cost;
use crate::config::{Cell, GateMeasure, Interface, LawName};
use crate::learning::gate::{Gate, GateRule, Measure};
use crate::learning::ladder::{Ladder, LadderRule};
use crate::learning::law::adjoint::Adjoint;
use crate::learning::law::constrained::{Bound, Bounds, Constrained, Limit};
use crate::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use crate::learning::law::model_inverse::ModelInverse;
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::learning::law::pd::{Pd, PdGains};
use crate::learning::law::q_filter::QFilter;
use crate::learning::{Law, LearningError};
use crate::model::StateSpace;
use crate::signal::butterworth;

/// A law that may start.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub struct Prepared {
    /// The law; `None` if nothing shall be learned.
    pub law: Option<Box<dyn Law>>,
    /// What the analysis says of it, as a sentence; empty if it can say nothing.
    pub verdict: String,
    /// What does not keep it from starting and should be known all the same, a sentence each.
    pub warnings: Vec<String>,
}

/// Makes the law that the cell names, with what goes round it, and asks the analysis.
pub(super) fn prepare(cell: &Cell, reference_m: &[f64]) -> Result<Prepared, DesignError> {
    let n_samples = reference_m.len() / cell.n_axes();
    let Some(law) = named(cell, reference_m, n_samples)? else {
        return Ok(Prepared { law: None, verdict: String::new(), warnings: Vec::new() });
    };
    let mut law = surrounded(law, cell).map_err(|source| refused(cell, source))?;
    let (verdict, warnings) = forecast::judge(law.as_mut(), cell, n_samples)?;
    Ok(Prepared { law: Some(law), verdict, warnings })
}

fn refused(cell: &Cell, source: LearningError) -> DesignError {
    DesignError::Learning { file: cell.file.display().to_string(), source }
}

fn named(
    cell: &Cell,
    reference_m: &[f64],
    n_samples: usize,
) -> Result<Option<Box<dyn Law>>, DesignError> {
    let name = cell.learning.law;
    if name == LawName::None {
        return Ok(None);
    }
    let believed = model(cell)
        .map_err(|source| DesignError::Model { file: cell.file.display().to_string(), source })?;
    let law = match name {
        LawName::None => return Ok(None),
        LawName::NormOptimal => {
            let cost = norm_optimal_cost(cell, reference_m)?;
            NormOptimal::new(&believed, n_samples, cost).map(|law| Box::new(law) as Box<dyn Law>)
        }
        LawName::Pd => pd(cell, n_samples),
        LawName::Constrained => constrained(cell, &believed, reference_m, n_samples),
        LawName::Adjoint => adjoint(cell, &believed, n_samples),
        LawName::ModelInverse => model_inverse(cell, &believed, n_samples),
        LawName::ErrorFeedforward => error_feedforward(cell, n_samples),
    };
    law.map(Some).map_err(|source| refused(cell, source))
}

type Made = Result<Box<dyn Law>, LearningError>;

fn low_pass(cell: &Cell, order: usize, cutoff_hz: f64) -> Result<QFilter, LearningError> {
    Ok(QFilter::ZeroPhase(butterworth(order, cutoff_hz, cell.cycle_s())?))
}

fn pd(cell: &Cell, n_samples: usize) -> Made {
    let pd = cell.learning.pd;
    let gains = PdGains { kp: pd.kp, kd: pd.kd, lead: pd.lead_samples };
    let filter = low_pass(cell, pd.order, pd.cutoff_hz)?;
    Ok(Box::new(Pd::new(gains, n_samples, cell.n_axes(), filter)?))
}

fn adjoint(cell: &Cell, believed: &StateSpace, n_samples: usize) -> Made {
    let adjoint = cell.learning.adjoint;
    let filter = match adjoint.cutoff_hz {
        Some(cutoff_hz) => low_pass(cell, adjoint.order, cutoff_hz)?,
        None => QFilter::None,
    };
    Ok(Box::new(Adjoint::new(believed, n_samples, adjoint.gain, filter)?))
}

fn model_inverse(cell: &Cell, believed: &StateSpace, n_samples: usize) -> Made {
    let inverse = cell.learning.model_inverse;
    let filter = low_pass(cell, inverse.order, inverse.cutoff_hz)?;
    Ok(Box::new(ModelInverse::new(believed, n_samples, inverse.gain, filter)?))
}

/// The loop clamps the input to `input_max_m_s`; the law knows it, so that it does not learn on beyond.
fn error_feedforward(cell: &Cell, n_samples: usize) -> Made {
    let section = cell.learning.error_feedforward;
    let rule = Feedforward {
        gain: section.gain_per_s,
        lead: section.lead_samples,
        limit: cell.learning.input_max_m_s,
    };
    let filter = low_pass(cell, section.order, section.cutoff_hz)?;
    Ok(Box::new(ErrorFeedforward::new(rule, n_samples, cell.n_axes(), filter)?))
}

/// What the cell allows of each axis becomes bounds of the input; those of a set point only where the
/// input is added to one.
fn constrained(cell: &Cell, believed: &StateSpace, reference_m: &[f64], n_samples: usize) -> Made {
    let (learning, section) = (&cell.learning, &cell.learning.constrained);
    let sides = |lower: &dyn Fn(usize) -> f64, upper: &dyn Fn(usize) -> f64| Bound {
        lower: Limit::PerChannel((0..cell.n_axes()).map(lower).collect()),
        upper: Limit::PerChannel((0..cell.n_axes()).map(upper).collect()),
    };
    let within = |most: &dyn Fn(usize) -> f64| sides(&|i| -most(i), most);
    let is_csp = |i: usize| cell.axes[i].interface == Interface::Csp;
    let by_unit = |csp: f64, csv: f64| within(&|i| if is_csp(i) { csp } else { csv });
    let optional = |csp: Option<f64>, csv: Option<f64>| {
        let free = f64::INFINITY;
        (csp.is_some() || csv.is_some()).then(|| by_unit(csp.unwrap_or(free), csv.unwrap_or(free)))
    };
    let limit = |i: usize, given: Option<f64>, own: f64| {
        if is_csp(i) { given.unwrap_or(own) } else { f64::INFINITY }
    };
    let set_point = |bound: Bound| (0..cell.n_axes()).any(is_csp).then_some(bound);
    let bounds = Bounds {
        input: Some(by_unit(learning.input_max_m, learning.input_max_m_s)),
        change: optional(section.change_max_m, section.change_max_m_s),
        step: optional(section.step_max_m, section.step_max_m_s),
        position: set_point(sides(
            &|i| if is_csp(i) { cell.axes[i].limits.position_min_m } else { f64::NEG_INFINITY },
            &|i| limit(i, None, cell.axes[i].limits.position_max_m),
        )),
        velocity: set_point(within(&|i| {
            limit(i, section.velocity_max_m_s, cell.axes[i].limits.velocity_max_m_s)
        })),
        acceleration: set_point(within(&|i| {
            limit(i, section.acceleration_max_m_s2, cell.axes[i].limits.acceleration_max_m_s2)
        })),
        output: None,
        reference: Some(reference_m.to_vec()),
        output_reference: None,
    };
    let weights = Weights { q: section.q, s: section.s, r: section.r, rate: section.rate };
    Ok(Box::new(Constrained::new(believed, n_samples, weights, bounds)?))
}

/// The ladder next to the law, the gate round both: it judges every run, and what it keeps or restores
/// is the next input as it is, whatever gain the ladder has.
fn surrounded(law: Box<dyn Law>, cell: &Cell) -> Made {
    let mut law = law;
    let mut runs_a_step = 1;
    if let Some(ladder) = cell.learning.ladder {
        let rule = LadderRule {
            repeats: ladder.repeats,
            slow: ladder.slow,
            increase: ladder.increase,
            lowest: ladder.lowest,
            highest: ladder.highest,
        };
        law = Box::new(Ladder::new(law, rule)?);
        runs_a_step = ladder.repeats;
    }
    if let Some(gate) = cell.learning.gate {
        let rule = GateRule {
            measure: match gate.measure {
                GateMeasure::Rms => Measure::Rms { n_channels: cell.n_axes() },
                GateMeasure::Max => Measure::Max,
            },
            tolerance: gate.tolerance_m,
            resume: gate.resume,
            growth: gate.growth,
            // A step's error shows in all its runs; the ladder must have seen them to answer.
            patience: gate.patience * runs_a_step,
        };
        law = Box::new(Gate::new(law, rule)?);
    }
    Ok(law)
}
