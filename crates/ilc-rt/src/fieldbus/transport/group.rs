//! Several buses as one: each frame goes to the bus of its node, SYNC and NMT to all, back to back.
//!
//! Node numbers are unique in a cell, so that the lower seven bits of an identifier name the bus, in both
//! directions. What is above the bus, from bring-up to the loop, does not see the difference.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::time::Duration;

use super::wait::Deadline;
use crate::fieldbus::{Bus, BusError, Frame};

/// Node numbers, 0 (all nodes) to 127.
const NUMBERS: usize = 128;
/// Lowest identifier of a heartbeat.
const HEARTBEATS: u16 = 0x700;
/// Longest wait on one bus while the others are not looked at.
const SLICE: Duration = Duration::from_micros(200);
/// Largest number of repeated broadcasts skipped in one look.
const SKIP_MAX: usize = 256;

/// The side of the buses that an endpoint is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupSide {
    /// It sends broadcasts, to every bus; one that it receives comes from another master.
    Controller,
    /// It receives each broadcast from every bus, and is given one: that of the last bus, after all
    /// frames before it.
    Drives,
}

/// Several buses, each with its own nodes.
pub struct Group {
    buses: Vec<Box<dyn Bus>>,
    /// Bus of each node number.
    place: [u8; NUMBERS],
    side: GroupSide,
    /// A broadcast that waits until the other buses are read.
    held: Option<Frame>,
    /// Bus of the frame that was read last.
    last: usize,
}

impl Group {
    /// Creates a group; `nodes` are numbers with the places of their buses. Cold.
    pub fn new(
        buses: Vec<Box<dyn Bus>>,
        nodes: impl IntoIterator<Item = (u8, u8)>,
        side: GroupSide,
    ) -> Self {
        let mut place = [0; NUMBERS];
        for (node, bus) in nodes {
            place[usize::from(node) % NUMBERS] = bus;
        }
        Self { buses, place, side, held: None, last: 0 }
    }

    /// Returns the next frame that has already arrived.
    fn next(&mut self) -> Result<Option<Frame>, BusError> {
        for _ in 0..SKIP_MAX {
            let mut is_quiet = true;
            for place in 0..self.buses.len() {
                match self.take(place, Duration::ZERO)? {
                    Taken::Frame(frame) => return Ok(Some(frame)),
                    Taken::Broadcast => is_quiet = false,
                    Taken::Nothing => {}
                }
            }
            if is_quiet {
                return Ok(self.held.take());
            }
        }
        Ok(None)
    }

    /// Reads one bus. A broadcast to the drives is put aside if it is from the last bus: all frames
    /// before it are on the buses already.
    fn take(&mut self, place: usize, timeout: Duration) -> Result<Taken, BusError> {
        let is_last = place + 1 == self.buses.len();
        if is_last && self.held.is_some() {
            return Ok(Taken::Nothing);
        }
        match self.buses[place].recv(timeout)? {
            None => Ok(Taken::Nothing),
            Some(frame) if self.side == GroupSide::Controller || node_of(&frame) != 0 => {
                self.last = place;
                Ok(Taken::Frame(frame))
            }
            Some(frame) => {
                if is_last {
                    self.held = Some(frame);
                }
                Ok(Taken::Broadcast)
            }
        }
    }
}

/// Result of a look at one bus.
enum Taken {
    Frame(Frame),
    Broadcast,
    Nothing,
}

/// Returns the node in an identifier; 0: a broadcast.
fn node_of(frame: &Frame) -> u8 {
    frame.id().to_le_bytes()[0] & 0x7F
}

impl Bus for Group {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let node = node_of(frame);
        // The heartbeat of the controller is for the drives on every bus.
        let is_to_all = self.side == GroupSide::Controller && frame.id() >= HEARTBEATS;
        if node > 0 && !is_to_all {
            let place = usize::from(self.place[usize::from(node)]);
            return self.buses.get_mut(place).map_or(Ok(()), |bus| bus.send(frame));
        }
        // All of them, even if one fails: the axes on the others must not miss it.
        let mut sent = Ok(());
        for bus in &mut self.buses {
            let now = bus.send(frame);
            sent = sent.and(now);
        }
        sent
    }

    fn keep_to(&mut self, nodes: &[u8]) -> Result<(), BusError> {
        for (number, bus) in (0_u8..).zip(&mut self.buses) {
            let is_on_it = |node: &u8| self.place[usize::from(*node) % NUMBERS] == number;
            let own: Vec<u8> = nodes.iter().copied().filter(is_on_it).collect();
            bus.keep_to(&own)?;
        }
        Ok(())
    }

    fn arrival(&self) -> Option<Duration> {
        self.buses.get(self.last)?.arrival()
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let found = self.next()?;
        if found.is_some() || timeout.is_zero() {
            return Ok(found);
        }
        let deadline = Deadline::after(timeout);
        while let Some(left) = deadline.left() {
            for place in 0..self.buses.len() {
                if let Taken::Frame(frame) = self.take(place, left.min(SLICE))? {
                    return Ok(Some(frame));
                }
                let found = self.next()?;
                if found.is_some() {
                    return Ok(found);
                }
            }
        }
        Ok(None)
    }
}

impl fmt::Debug for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Group").field("n_buses", &self.buses.len()).finish_non_exhaustive()
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;
    use crate::fieldbus::canopen::{NmtCommand, NodeId, sync};
    use crate::fieldbus::transport::loopback::{Loopback, pair};

    /// Two groups, node 1 on the first bus and node 2 on the second one.
    fn groups() -> (Group, Group) {
        let (left, right): (Vec<_>, Vec<_>) = (0..2).map(|_| pair(16).unwrap()).unzip();
        let boxed = |ends: Vec<Loopback>| {
            ends.into_iter().map(|end| Box::new(end) as Box<dyn Bus>).collect::<Vec<_>>()
        };
        let nodes = [(1, 0), (2, 1)];
        (
            Group::new(boxed(left), nodes, GroupSide::Controller),
            Group::new(boxed(right), nodes, GroupSide::Drives),
        )
    }

    fn all(group: &mut Group) -> Vec<u16> {
        std::iter::from_fn(|| group.recv(Duration::from_millis(2)).unwrap())
            .map(|frame| frame.id())
            .collect()
    }

    #[test]
    fn a_frame_goes_to_the_bus_of_its_node() {
        let (mut controller, mut drives) = groups();
        let command = |id| Frame::new(id, &[1]).unwrap();
        controller.send(&command(0x201)).unwrap();
        controller.send(&command(0x202)).unwrap();
        assert_eq!(drives.buses[0].recv(Duration::ZERO), Ok(Some(command(0x201))));
        assert_eq!(drives.buses[0].recv(Duration::ZERO), Ok(None));
        assert_eq!(all(&mut drives), [0x202]);
        drives.send(&command(0x182)).unwrap();
        assert_eq!(controller.buses[0].recv(Duration::ZERO), Ok(None));
        assert_eq!(all(&mut controller), [0x182]);
    }

    #[test]
    fn drives_are_given_each_broadcast_once_and_after_the_commands() {
        let (mut controller, mut drives) = groups();
        for _ in 0..2 {
            controller.send(&Frame::new(0x202, &[]).unwrap()).unwrap();
            controller.send(&Frame::new(0x201, &[]).unwrap()).unwrap();
            controller.send(&sync::frame()).unwrap();
            assert_eq!(all(&mut drives), [0x201, 0x202, 0x080]);
        }
        controller.send(&NmtCommand::Start.frame(NodeId::new(1))).unwrap();
        assert_eq!(all(&mut drives), [0x000]);
    }

    #[test]
    fn the_heartbeat_of_the_controller_is_for_every_bus() {
        let (mut controller, mut drives) = groups();
        controller.send(&Frame::new(0x77F, &[5]).unwrap()).unwrap();
        assert_eq!(all(&mut drives), [0x77F, 0x77F]);
        drives.send(&Frame::new(0x702, &[5]).unwrap()).unwrap();
        assert_eq!(all(&mut controller), [0x702]);
    }

    #[test]
    fn another_master_on_any_bus_is_seen() {
        let (mut controller, mut drives) = groups();
        drives.buses[1].send(&sync::frame()).unwrap();
        assert_eq!(all(&mut controller), [0x080]);
    }

    #[test]
    fn a_bus_that_fails_does_not_keep_a_broadcast_from_the_others() {
        let (mut controller, mut drives) = groups();
        drives.buses.remove(0);
        assert_eq!(controller.send(&sync::frame()), Err(BusError::Closed));
        assert_eq!(all(&mut drives), [0x080]);
    }
}
