//! A bus with injected faults, as from a bad line, a switch or a foreign node; reproducible by
//! seed.

use std::collections::VecDeque;
use std::time::Duration;

use ilc_rt::fieldbus::canopen::{Emergency, Heartbeat, NmtState, sync};
use ilc_rt::fieldbus::{Bus, BusError, Frame};

use crate::rig::node;

/// Limit on the SYNCs of a test campaign: beyond it, the campaign hangs.
const SYNCS_MAX: u32 = 60_000;

/// Pseudo-random numbers from a seed (`SplitMix64`).
#[derive(Clone, Debug)]
pub struct Draws(u64);

impl Draws {
    /// Creates the generator from a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number below `n`; 0 if `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.bits() % (n.max(1) as u64)).unwrap_or(0)
    }

    /// Returns true with a probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        ((self.bits() >> 11) as f64) < probability * (1_u64 << 53) as f64
    }

    /// Returns a random byte.
    pub fn byte(&mut self) -> u8 {
        self.bits().to_le_bytes()[0]
    }
}

/// Direction of the affected frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Frames of the nodes.
    ToController,
    /// Frames of the controller.
    ToNodes,
}

/// Probability of each fault of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Loss.
    pub loss: f64,
    /// Delay by some SYNCs.
    pub delay: f64,
    /// Largest delay in SYNCs.
    pub delay_syncs_max: usize,
    /// Duplication.
    pub duplication: f64,
    /// Reordering with the next frame.
    pub reordering: f64,
    /// Corruption: a flipped bit in the payload, or a truncated one.
    pub corruption: f64,
    /// Per SYNC: a frame of neither the controller nor its nodes.
    pub foreign: f64,
}

/// A bus with faults between two SYNC counts.
pub struct FaultyBus {
    inner: Box<dyn Bus>,
    faults: Faults,
    way: Way,
    during: std::ops::Range<u32>,
    draws: Draws,
    n_syncs: u32,
    /// Frames for the controller, next first.
    ready: VecDeque<Frame>,
    /// Frames held until a SYNC, in either direction.
    late: Vec<(u32, Frame)>,
    /// The frame that the next one overtakes.
    overtaken: Option<Frame>,
}

impl std::fmt::Debug for FaultyBus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FaultyBus")
            .field("faults", &self.faults)
            .field("n_syncs", &self.n_syncs)
            .finish_non_exhaustive()
    }
}

impl FaultyBus {
    /// Injects faults on a bus while the number of SYNCs is in `during`.
    pub fn new(
        inner: Box<dyn Bus>,
        faults: Faults,
        way: Way,
        during: std::ops::Range<u32>,
        seed: u64,
    ) -> Self {
        Self {
            inner,
            faults,
            way,
            during,
            draws: Draws::new(seed),
            n_syncs: 0,
            ready: VecDeque::new(),
            late: Vec::new(),
            overtaken: None,
        }
    }

    fn is_bad(&self, way: Way) -> bool {
        self.way == way && self.during.contains(&self.n_syncs)
    }

    /// Applies faults to a frame; returns the frames that arrive now, in order.
    fn suffer(&mut self, frame: Frame) -> Vec<Frame> {
        let faults = self.faults;
        if self.draws.chance(faults.loss) {
            return Vec::new();
        }
        let frame = if self.draws.chance(faults.corruption) {
            corrupted(&frame, &mut self.draws)
        } else {
            frame
        };
        if self.draws.chance(faults.delay) {
            #[expect(clippy::cast_possible_truncation, reason = "a few SYNCs")]
            let later = 1 + self.draws.below(faults.delay_syncs_max) as u32;
            self.late.push((self.n_syncs + later, frame));
            return Vec::new();
        }
        if self.overtaken.is_none() && self.draws.chance(faults.reordering) {
            self.overtaken = Some(frame);
            return Vec::new();
        }
        let mut arriving = vec![frame];
        if self.draws.chance(faults.duplication) {
            arriving.push(frame);
        }
        arriving.extend(self.overtaken.take());
        arriving
    }

    /// Returns the delayed frames that are due.
    fn due(&mut self) -> Vec<Frame> {
        let now = self.n_syncs;
        let (due, late): (Vec<_>, Vec<_>) = self.late.drain(..).partition(|(when, _)| *when <= now);
        self.late = late;
        due.into_iter().map(|(_, frame)| frame).collect()
    }
}

impl Bus for FaultyBus {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let going = if self.is_bad(Way::ToNodes) { self.suffer(*frame) } else { vec![*frame] };
        for frame in going {
            self.inner.send(&frame)?;
        }
        if !sync::is_sync(frame) {
            return Ok(());
        }
        self.n_syncs += 1;
        assert!(self.n_syncs < SYNCS_MAX, "a campaign that does not end");
        let due = self.due();
        match self.way {
            Way::ToController => self.ready.extend(due),
            Way::ToNodes => {
                for frame in due {
                    self.inner.send(&frame)?;
                }
            }
        }
        if self.during.contains(&self.n_syncs) && self.draws.chance(self.faults.foreign) {
            let stranger = foreign(&mut self.draws);
            match self.way {
                Way::ToController => self.ready.push_back(stranger),
                Way::ToNodes => self.inner.send(&stranger)?,
            }
        }
        Ok(())
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Ok(Some(frame));
            }
            match self.inner.recv(timeout)? {
                Some(frame) if self.is_bad(Way::ToController) => {
                    let arriving = self.suffer(frame);
                    self.ready.extend(arriving);
                }
                Some(frame) => return Ok(Some(frame)),
                // No frame came to overtake it.
                None if self.way == Way::ToController => return Ok(self.overtaken.take()),
                None => return Ok(None),
            }
        }
    }
}

/// Returns the frame with one bit flipped, or truncated.
fn corrupted(frame: &Frame, draws: &mut Draws) -> Frame {
    let mut payload = frame.payload().to_vec();
    if payload.is_empty() || draws.chance(0.2) {
        payload.truncate(draws.below(payload.len()));
    } else {
        let at = draws.below(payload.len());
        payload[at] ^= 1 << draws.below(8);
    }
    Frame::new(frame.id(), &payload).unwrap_or(*frame)
}

/// Returns a frame of a foreign node or program: no SYNC, no NMT command and no identifier of ours,
/// which would be another master.
fn foreign(draws: &mut Draws) -> Frame {
    let stranger = node(u8::try_from(20 + draws.below(100)).unwrap_or(20));
    let mut payload = [0; 8];
    payload.fill_with(|| draws.byte());
    let length = draws.below(9);
    let random = |id: u16| Frame::new(id + u16::from(stranger.get()), &payload[..length]);
    match draws.below(8) {
        0 => {
            let vendor = [payload[0], payload[1], payload[2], payload[3], payload[4]];
            Some(Emergency { node: stranger, code: 0x8130, register: 0x11, vendor }.encode())
        }
        1 => Some(Heartbeat { node: stranger, state: NmtState::PreOperational }.encode()),
        2 => random(0x580),
        3 => random(0x600),
        4 => random(0x180),
        5 => random(0x200),
        6 => Frame::new(0x100, &payload[..6]),
        _ => random(0x480),
    }
    .unwrap_or_else(sync::frame)
}
