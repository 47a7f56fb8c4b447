//! The homing before the first run, where the options ask for it. For `execute` only.

use super::announce::Announcer;
use super::error::CampaignError;
use super::homing::{self, Homed};
use super::options::{Outcome, Session};
use crate::config::Cell;
use crate::fieldbus::Bus;
use crate::record::{EndStatus, Event, Fault, FaultKind, StateName};

/// Homes every axis whose drive searches its home and is not homed; returns the bus, or the end of the campaign before
/// its first run.
pub(super) fn home(
    cell: &Cell,
    session: &Session,
    bus: Box<dyn Bus>,
    announcer: &mut Announcer<'_>,
    iteration: u32,
) -> Result<Result<Box<dyn Bus>, Outcome>, CampaignError> {
    let axes = homing::homing_axes(cell);
    if axes.is_empty() {
        return Ok(Ok(bus));
    }
    announcer.publish(&Event::State { state: StateName::Homing, iteration });
    // Signals stop it; nothing else does.
    let mut report = |_: Option<&str>| None;
    let (homed, bus) = homing::home_on(cell, &axes, false, session, bus, &mut report)?;
    if homed.status == EndStatus::Completed {
        return Ok(Ok(bus));
    }
    Ok(Err(end(cell, homed, announcer, iteration)))
}

/// Publishes the end of a campaign whose axes are not homed.
fn end(cell: &Cell, homed: Homed, announcer: &mut Announcer<'_>, iteration: u32) -> Outcome {
    let Homed { status, reason, signal, axes } = homed;
    if status == EndStatus::Fault {
        let failed = axes.iter().find(|axis| axis.error.is_some());
        let fault = Fault {
            axis: failed.map(|axis| axis.axis.clone()),
            node: failed.map(|axis| axis.node),
            ..Fault::new(FaultKind::NotHomed)
        };
        announcer.publish(&Event::Fault { reason: reason.clone(), fault });
    }
    announcer.publish(&Event::State { state: StateName::Stopped, iteration });
    announcer.publish(&Event::End { status, reason: reason.clone(), iterations: 0 });
    let axis_units = cell.axes.iter().map(|axis| axis.unit.symbol()).collect();
    Outcome { status, reason, signal, campaign: String::new(), axis_units, runs: Vec::new() }
}
