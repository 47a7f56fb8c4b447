//! A move without a run: some axes travel to a position or in a direction, then the drives are switched off; or all
//! axes hold. The servo loop makes it, so that every gate, limit and stop of a run applies.

use std::sync::Arc;

use super::error::CampaignError;
use super::fault::fault;
use super::inputs;
use super::nodes;
use super::options::{SIMULATED_PATIENCE_S, Session};
use super::pace::{MAILBOX, Pacer, Settings};
use super::reason::sentence;
use crate::config::{Axis, Cell};
use crate::design::{self, Plan};
use crate::fieldbus::Bus;
use crate::record::{EndStatus, Fault, FaultKind};
use crate::servo::{Cycle, Message, PhaseName, StopReason, mailbox};
use crate::trajectory::Interpolator;

/// Time between two reports of the position.
const REPORT_S: f64 = 0.2;
/// Time at rest before the drives are switched off.
const REST_S: f64 = 0.1;
/// Signal of a stop that is not a signal's: the caller released the axes.
const RELEASED: i32 = libc::SIGUSR1;

/// Destination of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A position.
    At(f64),
    /// A distance from the present position.
    By(f64),
    /// The limit in the direction of the sign.
    Limit(f64),
}

/// A move of some axes, while all others hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Travel {
    /// Axis and destination.
    pub goals: Vec<(usize, Goal)>,
    /// Velocity along the move; that of [`Cell::jog_velocity_m_s`] if not given.
    pub speed_m_s: Option<f64>,
    /// Time to hold after the move; `None`: until released.
    pub hold_s: Option<f64>,
}

/// A report of a move.
#[derive(Clone, Debug, PartialEq)]
pub struct Traveling {
    /// Present phase.
    pub phase: PhaseName,
    /// Position of every axis; empty before the first one is measured.
    pub position_m: Vec<f64>,
}

/// End of a move.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// Completed, interrupted or stopped by a fault.
    pub status: EndStatus,
    /// Reason, one sentence.
    pub reason: String,
    /// Signal that asked to stop, or 0.
    pub signal: i32,
    /// True if the caller released the axes.
    pub released: bool,
    /// Fault in fields.
    pub fault: Option<Fault>,
    /// Last measured position of every axis.
    pub position_m: Vec<f64>,
}

/// Moves axes of a cell on a bus (`cell.bus.address`, open). `report` is called with every change and at intervals; as
/// soon as it returns a reason, the axes come to rest.
///
/// # Errors
/// [`CampaignError`] before anything has moved, e.g. for a destination beyond the limits. Any later failure brings the
/// axes to rest and is reported in the [`Arrival`].
pub fn travel(
    cell: &Cell,
    travel: &Travel,
    session: &Session,
    mut bus: Box<dyn Bus>,
    report: &mut dyn FnMut(Option<&Traveling>) -> Option<String>,
) -> Result<Arrival, CampaignError> {
    check_speed(cell, travel)?;
    for (axis, goal) in &travel.goals {
        if let Goal::At(position_m) = goal {
            check_inside(cell, &cell.axes[*axis], *position_m)?;
        }
    }
    let (maps, words) = nodes::prepare(cell, bus.as_mut(), session)?;
    let mut to_m = nodes::positions(cell, bus.as_mut(), session)?;
    for (axis, goal) in &travel.goals {
        let (described, at_m) = (&cell.axes[*axis], to_m[*axis]);
        let limits = &described.limits;
        to_m[*axis] = match *goal {
            Goal::At(position_m) => position_m,
            Goal::By(distance_m) => at_m + distance_m,
            Goal::Limit(sign) if sign < 0.0 => limits.position_min_m,
            Goal::Limit(_) => limits.position_max_m,
        };
        check_inside(cell, described, to_m[*axis])?;
        if let Some(input) = inputs::blocking(cell, &words, *axis, to_m[*axis] - at_m) {
            return Err(CampaignError::Travel {
                axis: described.name.clone(),
                what: format!("destination {:.6} {}", to_m[*axis], described.unit.symbol()),
                allowed: format!(
                    "away from limit switch {}, which is reached",
                    inputs::place(cell, input)
                ),
            });
        }
    }
    let speed_m_s = travel.speed_m_s.unwrap_or_else(|| {
        let moved = travel.goals.iter().map(|(axis, _)| cell.jog_velocity_m_s(*axis));
        moved.fold(f64::INFINITY, f64::min)
    });
    let mut plan = hold(cell, session, &to_m)?;
    let ticks = |span_s: f64| -> u32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let ticks = (span_s / cell.cycle_s()).ceil() as u32;
        ticks
    };
    // Without a goal nothing moves, and any speed does.
    let speed_m_s = if speed_m_s.is_finite() { speed_m_s } else { cell.program.feed_m_s };
    plan.servo.return_feed_m_s = speed_m_s;
    plan.servo.approach_feed_m_s = speed_m_s;
    plan.servo.resets_faults |= session.reset_faults;
    plan.simulated = session.simulated;
    plan.servo.settle_ticks = travel.hold_s.map_or(u32::MAX, |hold_s| ticks(hold_s + REST_S));
    if session.forgives_stalls() {
        let patience = ticks(SIMULATED_PATIENCE_S);
        plan.servo.hold_cycles_max = patience;
        plan.servo.forgive_overruns(patience);
    }
    let settings = if session.lockstep { None } else { Some(Settings::of(cell, session)?) };
    nodes::go(cell, bus.as_mut())?;
    let (mail, loop_side) = mailbox(MAILBOX, Arc::clone(&session.stop));
    let network = plan.network(bus, &maps);
    let cycle = Cycle::new(network, plan.servo.clone(), plan.interpolator, loop_side);
    let pacer = match settings {
        None => Pacer::in_line(cycle),
        Some(settings) => Pacer::on_clock(cycle, settings)?.0,
    };
    let every = u64::from(ticks(REPORT_S)).max(1);
    Ok(Journey::new(cell, mail, every).pursue(cell, session, pacer, report))
}

/// Returns a plan whose program is a hold of one sample.
fn hold(cell: &Cell, session: &Session, at_m: &[f64]) -> Result<Plan, CampaignError> {
    let mut cell = cell.clone();
    cell.program.start_m = at_m.to_vec();
    let hold = Interpolator::hold(at_m, 1, cell.cycle_s()).map_err(|source| {
        design::DesignError::Program {
            file: cell.file.display().to_string(),
            key: "destination".to_owned(),
            source: Box::new(source),
            units: cell.units(),
        }
    })?;
    Ok(Plan::with(&cell, session.measure, session.lockstep, hold, String::new())?)
}

fn check_speed(cell: &Cell, travel: &Travel) -> Result<(), CampaignError> {
    let Some(speed_m_s) = travel.speed_m_s else { return Ok(()) };
    for (axis, _) in &travel.goals {
        let described = &cell.axes[*axis];
        let most_m_s = cell.jog_velocity_m_s(*axis);
        if !(speed_m_s > 0.0 && speed_m_s <= most_m_s) {
            let unit = described.unit.symbol();
            return Err(CampaignError::Travel {
                axis: described.name.clone(),
                what: format!("speed {speed_m_s} {unit}/s"),
                allowed: format!(
                    "above 0, up to {most_m_s} {unit}/s ([safety] approach_velocity_m_s, or a tenth of \
                     limits.velocity_max_m_s)"
                ),
            });
        }
    }
    Ok(())
}

fn check_inside(cell: &Cell, axis: &Axis, position_m: f64) -> Result<(), CampaignError> {
    let limits = &axis.limits;
    // Rounding of counts must not refuse the limit itself.
    let half_count_m = 0.5 / axis.counts_per_m;
    let (low_m, high_m) = (limits.position_min_m, limits.position_max_m);
    if position_m >= low_m - half_count_m && position_m <= high_m + half_count_m {
        return Ok(());
    }
    let unit = axis.unit.symbol();
    Err(CampaignError::Travel {
        axis: axis.name.clone(),
        what: format!("destination {position_m:.6} {unit}"),
        allowed: format!("{low_m} to {high_m} {unit} ({}: limits)", cell.file.display()),
    })
}

/// A move in progress.
struct Journey {
    mail: crate::servo::Mailbox,
    now: Traveling,
    n_axes: usize,
    /// Cycles between two reports, and the SYNC of the last one.
    every: u64,
    reported_sync: u64,
    stopping: Option<StopReason>,
    released: Option<String>,
}

impl Journey {
    fn new(cell: &Cell, mail: crate::servo::Mailbox, every: u64) -> Self {
        Self {
            mail,
            now: Traveling { phase: PhaseName::Enabling, position_m: Vec::new() },
            n_axes: cell.n_axes(),
            every,
            reported_sync: 0,
            stopping: None,
            released: None,
        }
    }

    fn pursue(
        mut self,
        cell: &Cell,
        session: &Session,
        mut pacer: Pacer,
        report: &mut dyn FnMut(Option<&Traveling>) -> Option<String>,
    ) -> Arrival {
        self.tell(Some(()), report);
        loop {
            let has_ended = pacer.poll();
            self.read(report);
            if has_ended {
                break;
            }
            self.tell(None, report);
        }
        let result = pacer.end();
        self.read(report);
        if let Some(Err(error)) = result.as_ref().map(|result| result.released) {
            tracing::warn!("nodes could not be taken out of operation: {error}");
        }
        self.arrival(cell, session, result.is_some())
    }

    /// Reports, or only asks whether to go on.
    fn tell(
        &mut self,
        news: Option<()>,
        report: &mut dyn FnMut(Option<&Traveling>) -> Option<String>,
    ) {
        let wish = report(news.map(|()| &self.now));
        if let (Some(why), None) = (wish, &self.released) {
            self.released = Some(why);
            self.mail.stop(RELEASED);
        }
    }

    fn read(&mut self, report: &mut dyn FnMut(Option<&Traveling>) -> Option<String>) {
        while let Some(message) = self.mail.read() {
            match message {
                Message::Sample(sample) => {
                    self.now.position_m = sample.encoder_m[..self.n_axes].to_vec();
                    if sample.sync >= self.reported_sync + self.every {
                        self.reported_sync = sample.sync;
                        self.tell(Some(()), report);
                    }
                }
                Message::Phase(phase, _) => {
                    self.now.phase = phase;
                    self.tell(Some(()), report);
                }
                Message::Stopping(reason) => self.stopping = Some(reason),
                Message::RunStarted { .. }
                | Message::RunEnded { .. }
                | Message::Before(_)
                | Message::Cycle(_)
                | Message::Inputs(_)
                | Message::Drives(_) => {}
            }
        }
    }

    fn arrival(self, cell: &Cell, session: &Session, is_alive: bool) -> Arrival {
        let (status, reason, fault) = match (self.stopping, self.released.clone()) {
            (Some(StopReason::Asked(RELEASED)), Some(why)) => (EndStatus::Interrupted, why, None),
            (Some(reason), _) => {
                let fault = fault(reason, cell);
                let status =
                    if fault.is_some() { EndStatus::Fault } else { EndStatus::Interrupted };
                (status, sentence(reason, cell, session), fault)
            }
            (None, _) if !is_alive => (
                EndStatus::Fault,
                "the loop's thread died; the drives stop by themselves".to_owned(),
                Some(Fault::new(FaultKind::LoopDied)),
            ),
            (None, _) => (EndStatus::Completed, "arrived; the drives are off".to_owned(), None),
        };
        let signal = match self.stopping {
            Some(StopReason::Asked(signal)) if signal != RELEASED => signal,
            _ => 0,
        };
        let released = self.released.is_some() && status == EndStatus::Interrupted && signal == 0;
        Arrival { status, reason, signal, released, fault, position_m: self.now.position_m }
    }
}
