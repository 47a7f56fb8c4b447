//! Homing: drives search their home by themselves, turn after turn, and are switched off; what then rests outside its
//! limits is brought inside. The controller starts, watches and stops them. For `cli` and `execute`.

mod inside;
mod lent;
mod round;
mod seeker;
mod turn;

use serde::Serialize;

use super::error::CampaignError;
use super::nodes;
use super::options::Session;
use super::pace::Settings;
use crate::config::{Axis, Cell, DriveHoming, HomingKind};
use crate::fieldbus::Bus;
use crate::record::EndStatus;

/// Receiver of the reports: called with a line for every change and at intervals, and without one in every cycle. As
/// soon as it returns a reason, the axes come to rest.
pub(super) type Report<'r> = dyn FnMut(Option<&str>) -> Option<String> + 'r;

/// Result of a homing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Homed {
    /// Completed, interrupted or failed.
    pub status: EndStatus,
    /// Reason, one sentence.
    pub reason: String,
    /// Signal that asked to stop, or 0.
    pub signal: i32,
    /// Axes, in the order of their turns.
    pub axes: Vec<HomedAxis>,
}

/// Result of an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HomedAxis {
    /// Name.
    pub axis: String,
    /// Node of its drive.
    pub node: u8,
    /// Homing method.
    pub method: i8,
    /// The drive tells that it is homed.
    pub homed: bool,
    /// It was homed before, and searched nothing.
    pub was_homed: bool,
    /// Position afterwards, if it is homed.
    pub position_m: Option<f64>,
    /// Unit of the position.
    pub unit: &'static str,
    /// Reason that it is not homed, or rests outside its limits.
    pub error: Option<String>,
}

/// An axis to be homed.
struct Task<'a> {
    axis: &'a Axis,
    homing: DriveHoming,
    result: HomedAxis,
}

/// End of a turn, or of the whole.
struct End {
    status: EndStatus,
    reason: String,
    signal: i32,
}

impl End {
    fn fault(reason: String) -> Self {
        Self { status: EndStatus::Fault, reason, signal: 0 }
    }

    fn completed() -> Self {
        let reason = "homed; the drives are off".to_owned();
        Self { status: EndStatus::Completed, reason, signal: 0 }
    }
}

/// Homes axes of a cell on a bus (`cell.bus.address`, open), those with a lower order first. An axis that is homed
/// already searches its home only if it is to do so again.
///
/// # Errors
/// [`CampaignError`] before anything has moved. Any later failure brings the axes to rest, and is in [`Homed`].
pub fn home(
    cell: &Cell,
    axes: &[usize],
    again: bool,
    session: &Session,
    bus: Box<dyn Bus>,
    report: &mut Report<'_>,
) -> Result<Homed, CampaignError> {
    home_on(cell, axes, again, session, bus, report).map(|(homed, _)| homed)
}

/// Returns the axes whose drives search their home.
pub fn homing_axes(cell: &Cell) -> Vec<usize> {
    let by_drive = |index: &usize| cell.axes[*index].homing.kind == HomingKind::Drive;
    (0..cell.n_axes()).filter(by_drive).collect()
}

/// Homes axes as [`home`] does, and returns the bus.
pub(super) fn home_on(
    cell: &Cell,
    axes: &[usize],
    again: bool,
    session: &Session,
    mut bus: Box<dyn Bus>,
    report: &mut Report<'_>,
) -> Result<(Homed, Box<dyn Bus>), CampaignError> {
    Settings::require(cell, session)?;
    let mut tasks = tasks(cell, axes);
    let chosen: Vec<&Axis> = tasks.iter().map(|task| task.axis).collect();
    let are_homed = nodes::prepare_homing(cell, bus.as_mut(), session, &chosen, again)?;
    let mut due = Vec::new();
    for (task, is_homed) in tasks.iter_mut().zip(are_homed) {
        if !is_homed {
            due.push(task);
            continue;
        }
        let at_m = nodes::position(cell, task.axis, bus.as_mut(), session)?;
        task.result.was_homed = true;
        task.result.homed = true;
        (task.result.position_m, task.result.error) = (Some(at_m), None);
    }
    let mut end = End::completed();
    for turn in due.chunk_by_mut(|one, next| one.homing.order == next.homing.order) {
        end = turn::take(cell, turn, session, bus.as_mut(), report)?;
        if end.status != EndStatus::Completed {
            break;
        }
    }
    if end.status == EndStatus::Completed {
        (end, bus) = inside::bring(cell, &mut tasks, session, bus, report)?;
    }
    let End { status, reason, signal } = end;
    let axes = tasks.into_iter().map(|task| task.result).collect();
    Ok((Homed { status, reason, signal, axes }, bus))
}

/// Returns the axes that the drives home, in the order of their turns.
fn tasks<'a>(cell: &'a Cell, axes: &[usize]) -> Vec<Task<'a>> {
    let chosen = axes.iter().filter_map(|index| cell.axes.get(*index));
    let mut tasks: Vec<Task<'a>> = chosen
        .filter_map(|axis| {
            let homing = axis.homing.by_drive(axis.limits.acceleration_max_m_s2)?;
            let result = HomedAxis {
                axis: axis.name.clone(),
                node: axis.node,
                method: homing.method,
                homed: false,
                was_homed: false,
                position_m: None,
                unit: axis.unit.symbol(),
                error: Some("its turn did not come".to_owned()),
            };
            Some(Task { axis, homing, result })
        })
        .collect();
    tasks.sort_by_key(|task| task.homing.order);
    tasks
}
