//! A bus in memory whose frames take the time that they take on CAN, in lock-step.
//!
//! As [`InProcess`], but a frame arrives when it would on a bus with this bit rate: one after the
//! other, in the worst case of bit stuffing, by arbitration between the oldest frame of the controller and
//! that of each node. A SYNC begins a cycle; what is not through at its end arrives in a later one, so that a cell
//! that does not fit loses its answers as on a real bus. No clock of the computer takes part.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use super::loopback::{InProcess, Responder};
use super::opening::format_of;
use crate::fieldbus::canopen::sync;
use crate::fieldbus::load::BitRates;
use crate::fieldbus::{Bus, BusError, Frame};

/// Frames of the controller that may wait: as many as a CAN interface of Linux queues by default, and those that
/// its controller holds.
const WAITING_MAX: usize = 32;
/// Number of the controller among the senders; nodes have their own.
const CONTROLLER: u8 = 0;
/// The part of an identifier that names a node.
const NODE_MASK: u16 = 0x7F;
/// Identifiers of process data to the nodes, and of heartbeats: they do not end a wait for SYNC.
const CYCLIC: [std::ops::RangeInclusive<u16>; 2] = [0x200..=0x57F, 0x700..=0x77F];

/// Returns the bus in memory to `responder` that an address describes, with a cycle of `cycle_us`; with its bit rate, if
/// it states one. Up to `capacity` answers wait.
///
/// # Real Time
/// Cold: allocates.
#[expect(clippy::disallowed_methods, reason = "cold: set-up")]
pub fn in_process<R: Responder + 'static>(
    address: &str,
    responder: R,
    cycle_us: u32,
    capacity: usize,
) -> Box<dyn Bus> {
    let format = format_of(address);
    match format.bit_rates() {
        Some(rates) => Box::new(Timed::new(responder, rates, cycle_us, capacity)),
        None => Box::new(InProcess::new(responder, capacity)),
    }
}

/// A frame that waits for the bus.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: Frame,
    sender: u8,
}

/// A bus with a bit rate, whose far side runs in the caller's thread.
pub struct Timed<R> {
    responder: R,
    rates: BitRates,
    cycle_ns: u64,
    /// Time at which the next SYNC begins a cycle.
    cycle_at_ns: u64,
    /// Time until which the bus is taken.
    free_at_ns: u64,
    /// In the order in which they were sent.
    waiting: VecDeque<Waiting>,
    /// The frame on the bus that ends after its cycle.
    on_bus: Option<Waiting>,
    arrived: VecDeque<Frame>,
    capacity: usize,
}

impl<R: Responder> Timed<R> {
    /// Returns a bus to `responder` with a cycle of `cycle_us`, on which up to `capacity` frames of the nodes wait
    /// for the bus, and as many for the controller.
    ///
    /// # Real Time
    /// Cold: allocates both queues.
    pub fn new(responder: R, rates: BitRates, cycle_us: u32, capacity: usize) -> Self {
        Self {
            responder,
            rates,
            cycle_ns: u64::from(cycle_us) * 1000,
            cycle_at_ns: 0,
            free_at_ns: 0,
            waiting: VecDeque::with_capacity(capacity + WAITING_MAX),
            on_bus: None,
            arrived: VecDeque::with_capacity(capacity),
            capacity,
        }
    }

    /// Returns the far side, for reading.
    pub fn responder(&self) -> &R {
        &self.responder
    }

    /// Returns the far side, for changing.
    pub fn responder_mut(&mut self) -> &mut R {
        &mut self.responder
    }

    /// Returns the number of frames that wait for the bus.
    pub fn n_waiting(&self) -> usize {
        self.waiting.len() + usize::from(self.on_bus.is_some())
    }

    /// Carries frames until a time, or until none waits any more.
    fn carry(&mut self, until_ns: Option<u64>) {
        let is_over = |time_ns| until_ns.is_some_and(|until_ns| time_ns > until_ns);
        loop {
            if is_over(self.free_at_ns) {
                return;
            }
            if let Some(through) = self.on_bus.take() {
                self.deliver(through);
                continue;
            }
            if until_ns == Some(self.free_at_ns) {
                return;
            }
            let Some(winner) = self.arbitrate() else { return };
            self.free_at_ns += self.frame_ns(&winner.frame);
            self.on_bus = Some(winner);
        }
    }

    /// Takes the frame that wins the bus: the lowest identifier among the oldest frames of the senders.
    fn arbitrate(&mut self) -> Option<Waiting> {
        let mut seen = 0_u128;
        let mut best: Option<(usize, u16)> = None;
        for (place, waiting) in self.waiting.iter().enumerate() {
            let sender = 1 << (waiting.sender & 0x7F);
            let id = waiting.frame.id();
            if seen & sender == 0 && best.is_none_or(|(_, lowest)| id < lowest) {
                best = Some((place, id));
            }
            seen |= sender;
        }
        self.waiting.remove(best?.0)
    }

    /// Gives a frame that is through to the other side.
    fn deliver(&mut self, through: Waiting) {
        if through.sender != CONTROLLER {
            // A receiver that is a whole queue behind loses the newest frame.
            if self.arrived.len() < self.capacity {
                self.arrived.push_back(through.frame);
            }
            return;
        }
        let room = self.capacity + WAITING_MAX;
        let waiting = &mut self.waiting;
        self.responder.receive(&through.frame, &mut |frame| {
            if waiting.len() < room {
                // A node that sends NMT or SYNC itself is one of the nodes all the same.
                let node = (frame.id() & NODE_MASK).to_le_bytes()[0].max(1);
                waiting.push_back(Waiting { frame, sender: node });
            }
        });
    }

    fn frame_ns(&self, frame: &Frame) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and at most some milliseconds"
        )]
        let span_ns = (self.rates.frame_us(frame.payload().len()) * 1e3).round() as u64;
        span_ns
    }
}

impl<R: Responder> Bus for Timed<R> {
    /// Puts a frame in the queue of the controller. SYNC lets a cycle pass; other services than process data
    /// are over before this returns.
    ///
    /// # Errors
    /// [`BusError::Full`] if the bus is so far behind that the queue is full; [`BusError::TooLong`].
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if frame.payload().len() > self.rates.payload_max() {
            return Err(BusError::TooLong);
        }
        let own = self.waiting.iter().filter(|waiting| waiting.sender == CONTROLLER);
        let is_full = own.count() >= WAITING_MAX;
        if !is_full {
            self.waiting.push_back(Waiting { frame: *frame, sender: CONTROLLER });
        }
        self.free_at_ns = self.free_at_ns.max(self.cycle_at_ns);
        if sync::is_sync(frame) {
            self.cycle_at_ns += self.cycle_ns;
            self.carry(Some(self.cycle_at_ns));
        } else if CYCLIC.iter().all(|range| !range.contains(&frame.id())) {
            self.carry(None);
            self.cycle_at_ns = self.cycle_at_ns.max(self.free_at_ns);
        }
        if is_full { Err(BusError::Full) } else { Ok(()) }
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        Ok(self.arrived.pop_front())
    }
}

impl<R: fmt::Debug> fmt::Debug for Timed<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Timed")
            .field("responder", &self.responder)
            .field("rates", &self.rates)
            .field("waiting", &self.waiting.len())
            .finish_non_exhaustive()
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

    const RATES: BitRates = BitRates::classical(1_000_000);

    /// Nodes that answer SYNC with eight bytes each, and count what they hear.
    #[derive(Debug)]
    struct Nodes {
        numbers: Vec<u16>,
        heard: Vec<u16>,
    }

    impl Responder for Nodes {
        fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame)) {
            self.heard.push(frame.id());
            if sync::is_sync(frame) {
                for number in &self.numbers {
                    reply(Frame::new(0x180 + number, &[0; 8]).unwrap());
                }
            }
        }
    }

    fn bus(numbers: &[u16]) -> Timed<Nodes> {
        let nodes = Nodes { numbers: numbers.to_vec(), heard: Vec::new() };
        Timed::new(nodes, RATES, 1000, 64)
    }

    fn ids(bus: &mut Timed<Nodes>) -> Vec<u16> {
        std::iter::from_fn(|| bus.recv(Duration::ZERO).unwrap()).map(|frame| frame.id()).collect()
    }

    #[test]
    fn what_fits_arrives_in_its_cycle_by_priority() {
        // 55 us, and 7 times 135 us: 1000 us exactly.
        let mut bus = bus(&[7, 6, 5, 4, 3, 2, 1]);
        for _ in 0..3 {
            bus.send(&sync::frame()).unwrap();
            assert_eq!(ids(&mut bus), [0x181, 0x182, 0x183, 0x184, 0x185, 0x186, 0x187]);
            assert_eq!(bus.n_waiting(), 0);
        }
    }

    #[test]
    fn what_does_not_fit_arrives_in_a_later_cycle() {
        let mut bus = bus(&[1, 2, 3, 4, 5, 6, 7, 8]);
        let command = Frame::new(0x201, &[]).unwrap();
        // Twice 55 us, and six answers: the seventh is on the bus when the cycle ends.
        bus.send(&command).unwrap();
        bus.send(&sync::frame()).unwrap();
        assert_eq!(ids(&mut bus), [0x181, 0x182, 0x183, 0x184, 0x185, 0x186]);
        bus.send(&command).unwrap();
        bus.send(&sync::frame()).unwrap();
        // It ends first; what waited wins over the command, and SYNC waits behind the command.
        assert_eq!(ids(&mut bus), [0x187, 0x188, 0x181, 0x182, 0x183, 0x184, 0x185]);
        assert_eq!(bus.n_waiting(), 3);
    }

    #[test]
    fn commands_take_their_time_and_come_before_sync() {
        let mut bus = bus(&[1]);
        for id in [0x201, 0x202] {
            bus.send(&Frame::new(id, &[0; 8]).unwrap()).unwrap();
            assert!(bus.responder().heard.is_empty(), "they wait for SYNC");
        }
        bus.send(&sync::frame()).unwrap();
        // The queue of the controller is first in, first out, whatever the identifier.
        assert_eq!(bus.responder().heard, [0x201, 0x202, 0x080]);
        assert_eq!(ids(&mut bus), [0x181]);
    }

    #[test]
    fn a_controller_that_sends_too_much_finds_its_queue_full() {
        let mut bus = bus(&[]);
        let mut full = 0;
        for _ in 0..10 {
            for id in 0x201..=0x20F {
                let sent = bus.send(&Frame::new(id, &[0; 8]).unwrap());
                full += usize::from(sent == Err(BusError::Full));
            }
            let _ = bus.send(&sync::frame());
        }
        // Seven of the fifteen commands are through in each cycle.
        assert!(full > 0 && bus.n_waiting() <= WAITING_MAX, "{full}, {}", bus.n_waiting());
    }

    #[test]
    fn other_services_are_over_at_once() {
        let mut bus = bus(&[1]);
        bus.send(&Frame::new(0x601, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]).unwrap()).unwrap();
        assert_eq!(bus.responder().heard, [0x601]);
        assert_eq!(bus.send(&Frame::fd(0x201, &[0; 12]).unwrap()), Err(BusError::TooLong));
    }
}
