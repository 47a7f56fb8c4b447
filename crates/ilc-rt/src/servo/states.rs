//! States of the drives, told when one changes.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::Message;

impl Cycle {
    /// Tells the states, if one has changed since the last tick.
    pub(super) fn tell_states(&mut self) {
        let states = std::array::from_fn(|axis| {
            let drive = &self.drives[axis];
            if drive.heard { drive.state() } else { None }
        });
        if states != self.drive_states {
            self.drive_states = states;
            self.mail.tell(Message::Drives(states));
        }
    }
}
