//! Inputs and safe torque off of drives at given times, as `[[simulation.change]]` states them. For the machine.

use ilc_rt::config::Cell;

/// Happening at a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Happening {
    /// These digital inputs are on from now on, beside the switches.
    Inputs(u32),
    /// Safe torque off is active, or not any more.
    TorqueOff(bool),
}

/// The happenings of all drives, in the order of their times.
#[derive(Clone, Debug, Default)]
pub(crate) struct Script {
    /// Time, axis, happening.
    all: Vec<(u64, usize, Happening)>,
    n_done: usize,
}

impl Script {
    /// Reads the happenings of a cell description; of two at the same time the later one in it lasts.
    pub(crate) fn new(cell: &Cell) -> Self {
        let mut all = Vec::new();
        for change in &cell.simulation.changes {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 1e12"
            )]
            let at_us = (change.after_s * 1e6).round() as u64;
            for (axis, described) in cell.axes.iter().enumerate() {
                if change.axis.as_ref().is_none_or(|name| *name == described.name) {
                    let inputs = change.digital_inputs.map(Happening::Inputs);
                    let torque_off = change.torque_off.map(Happening::TorqueOff);
                    all.extend(
                        inputs.into_iter().chain(torque_off).map(|what| (at_us, axis, what)),
                    );
                }
            }
        }
        all.sort_by_key(|(at_us, ..)| *at_us);
        Self { all, n_done: 0 }
    }

    /// Returns the next happening that is due, with its axis, once.
    pub(crate) fn due(&mut self, time_us: u64) -> Option<(usize, Happening)> {
        let (_, axis, what) = self.all.get(self.n_done).filter(|(at_us, ..)| *at_us <= time_us)?;
        self.n_done += 1;
        Some((*axis, *what))
    }
}
