//! The way back inside: an axis that found its home on a limit switch rests outside its limits, where no verb moves
//! it. The servo loop brings it inside along a jerk-limited line, alone unless a guard
//! is wired to another drive. For `homing` only.

use super::lent::Lent;
use super::{End, Report, Task};
use crate::campaign::error::CampaignError;
use crate::campaign::options::Session;
use crate::campaign::travel::{Goal, Travel, Traveling, travel};
use crate::campaign::{inputs, nodes};
use crate::config::{Axis, Cell, LawName, Learning, Measure};
use crate::fieldbus::{Bus, BusError};
use crate::record::EndStatus;
use crate::trajectory::kind::Segment;

/// Distance from the limit at which an axis comes to rest inside, as a share of its travel.
const INSIDE_SHARE: f64 = 0.01;

/// Brings the axes that are homed, and rest outside their limits, inside; returns the bus.
pub(super) fn bring(
    cell: &Cell,
    tasks: &mut [Task<'_>],
    session: &Session,
    bus: Box<dyn Bus>,
    report: &mut Report<'_>,
) -> Result<(End, Box<dyn Bus>), CampaignError> {
    let mut outside: Vec<(&mut Task<'_>, f64)> = tasks
        .iter_mut()
        .filter_map(|task| {
            let inside_m = task.result.position_m.and_then(|at_m| inside_m(task.axis, at_m))?;
            Some((task, inside_m))
        })
        .collect();
    if outside.is_empty() {
        return Ok((End::completed(), bus));
    }
    // A guard on another drive is watched only where that drive takes part.
    let is_outside = |name: &str| outside.iter().any(|(task, _)| task.axis.name == name);
    let is_guarded_elsewhere =
        cell.inputs.iter().any(|input| inputs::stops_all(input) && !is_outside(&input.axis));
    let widened = widened(cell, &outside);
    let moved = if is_guarded_elsewhere { widened } else { alone(widened, &outside) };
    let place = |name: &str| moved.axes.iter().position(|axis| axis.name == name);
    let goals = outside
        .iter()
        .filter_map(|(task, to_m)| Some((place(&task.axis.name)?, Goal::At(*to_m))))
        .collect();
    let way = Travel { goals, speed_m_s: None, hold_s: Some(0.0) };
    let (lent, returned) = Lent::new(bus);
    let mut tell = |now: Option<&Traveling>| {
        let line = now.map(|now| described(&moved, now));
        report(line.as_deref())
    };
    let arrival = travel(&moved, &way, session, Box::new(lent), &mut tell);
    let Ok(mut bus) = returned.recv() else {
        return Err(CampaignError::Start {
            file: cell.file.display().to_string(),
            address: cell.bus.address.clone(),
            source: BusError::Closed,
        });
    };
    let (status, reason, signal) = match arrival {
        Ok(arrival) => (arrival.status, arrival.reason, arrival.signal),
        Err(error) => (EndStatus::Fault, error.to_string(), 0),
    };
    let mut left = None;
    for (task, _) in &mut outside {
        // With the limits of the cell again, which the drive keeps as well.
        let confirmed = nodes::confirm_homed(cell, task.axis, bus.as_mut(), session);
        let error = match confirmed {
            Ok(at_m) => {
                task.result.position_m = Some(at_m);
                inside_m(task.axis, at_m).map(|_| stays_outside(cell, task.axis, at_m))
            }
            Err(error) => Some(error),
        };
        if left.is_none() {
            left.clone_from(&error);
        }
        task.result.error = error;
    }
    let end = match (status, left) {
        (EndStatus::Completed, None) => End::completed(),
        (EndStatus::Completed, Some(left)) => End::fault(left),
        (_, Some(left)) => End { status, reason: format!("{reason}; {left}"), signal },
        (_, None) => End { status, reason, signal },
    };
    Ok((end, bus))
}

/// Returns the place inside to which an axis is brought; `None` if it is inside.
fn inside_m(axis: &Axis, at_m: f64) -> Option<f64> {
    let limits = &axis.limits;
    let (low_m, high_m) = (limits.position_min_m, limits.position_max_m);
    let half_count_m = 0.5 / axis.counts_per_m;
    let margin_m = INSIDE_SHARE * (high_m - low_m);
    if at_m < low_m - half_count_m {
        Some(low_m + margin_m)
    } else if at_m > high_m + half_count_m {
        Some(high_m - margin_m)
    } else {
        None
    }
}

fn stays_outside(cell: &Cell, axis: &Axis, at_m: f64) -> String {
    let (unit, limits) = (axis.unit.symbol(), &axis.limits);
    format!(
        "axis {name} is homed, but rests at {at_m:.6} {unit}, outside {} to {} {unit}: `ilc-rt home {} --axis {name}` \
         brings it inside",
        limits.position_min_m,
        limits.position_max_m,
        cell.file.display(),
        name = axis.name,
    )
}

/// Returns the cell with the limits of these axes reaching to where they are.
fn widened(cell: &Cell, outside: &[(&mut Task<'_>, f64)]) -> Cell {
    let mut widened = cell.clone();
    for (task, _) in outside {
        let axis = widened.axes.iter_mut().find(|axis| axis.name == task.axis.name);
        let (Some(axis), Some(at_m)) = (axis, task.result.position_m) else { continue };
        let limits = &mut axis.limits;
        let margin_m = INSIDE_SHARE * (limits.position_max_m - limits.position_min_m);
        limits.position_min_m = limits.position_min_m.min(at_m - margin_m);
        limits.position_max_m = limits.position_max_m.max(at_m + margin_m);
    }
    widened
}

/// Returns a cell of these axes alone. It learns nothing.
fn alone(cell: Cell, outside: &[(&mut Task<'_>, f64)]) -> Cell {
    let mut alone = cell;
    let target_m =
        |name: &str| outside.iter().find(|(task, _)| task.axis.name == name).map(|(_, to_m)| *to_m);
    alone.axes.retain(|axis| target_m(&axis.name).is_some());
    alone.inputs.retain(|input| target_m(&input.axis).is_some());
    alone.tcp_encoder = None;
    alone.learning =
        Learning { law: LawName::None, measure: Measure::Encoder, ..Learning::default() };
    alone.simulation.changes = Vec::new();
    let to_m: Vec<f64> = alone.axes.iter().filter_map(|axis| target_m(&axis.name)).collect();
    let segment = Segment {
        to_m: to_m.clone(),
        feed_m_s: None,
        center_m: None,
        clockwise: false,
        dwell_s: 0.0,
    };
    alone.program = alone.program.along(to_m, vec![segment]);
    alone
}

fn described(cell: &Cell, now: &Traveling) -> String {
    let shown = cell.axes.iter().zip(&now.position_m);
    let shown: Vec<String> = shown
        .map(|(axis, at_m)| format!("{} {at_m:.6} {}", axis.name, axis.unit.symbol()))
        .collect();
    if shown.is_empty() {
        let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
        return format!("bringing inside the limits: {}", names.join(", "));
    }
    format!("bringing inside the limits: {}", shown.join(", "))
}
