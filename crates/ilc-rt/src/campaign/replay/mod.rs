//! Replay: the loop of a recording again, tick by tick, on what it read then; every value it makes is compared with the
//! recorded one.
//!
//! The same [`Cycle`](crate::servo::Cycle) is built from the recorded cell description, on a bus that hands out the
//! recorded frames. The law is run again as well, on the records that the replayed loop makes, where the
//! recording has all that it learned from.

mod compare;
mod line;
mod player;
mod relearned;

use std::io::Read;
use std::path::Path;

use serde::Serialize;

use crate::design::DesignError;
use crate::fieldbus::cia402::MapError;
use crate::record::{TEXT_MAX, printable};
use crate::recording::{AxisMessage, CycleMessage, FramesMessage, Item, Reader, RecordingError};
use player::Player;

/// Reason that a recording cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Its cell description cannot be planned.
    #[error("the recorded cell: {0}")]
    Design(#[from] DesignError),
    /// Its process data cannot be mapped.
    #[error("the recorded process data: {0}")]
    Map(#[from] MapError),
    /// This program plans other set points.
    #[error(
        "the recorded cell is planned otherwise by this program ({this}) than by the one that recorded it ({then}): \
         its set points differ"
    )]
    OtherSetPoints {
        /// Version of this program.
        this: &'static str,
        /// Version of the one that recorded.
        then: String,
    },
    /// Its parts contradict each other.
    #[error("{what}")]
    Contradiction {
        /// Sentence.
        what: String,
    },
}

/// The first difference between a recording and its replay.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// Cycle of the loop.
    pub cycle: u64,
    /// Axes that it concerns; all of them for a value of the whole loop.
    pub axes: Vec<String>,
    /// Field.
    pub field: String,
    /// Value in the recording.
    pub recorded: String,
    /// Value in the replay.
    pub replayed: String,
}

/// Result of a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Replayed {
    /// Cycles compared.
    pub cycles: u64,
    /// Frames sent and compared.
    pub frames: u64,
    /// Runs that ended.
    pub runs: u32,
    /// Inputs of the law compared.
    pub learned: u32,
    /// Reason why the law was not run again.
    pub law_is_not_run: Option<String>,
    /// Cycle from which records are lost: the rest could not be compared.
    pub lost_at: Option<u64>,
    /// True if the end of the file is cut off.
    pub cut: bool,
    /// First difference.
    pub difference: Option<Difference>,
}

/// The messages of one tick.
#[derive(Default)]
struct Tick {
    frames: FramesMessage,
    cycle: Option<CycleMessage>,
    axes: Vec<AxisMessage>,
}

/// Replays a recording.
///
/// # Errors
/// [`ReplayError`] for one that cannot be replayed. A difference is no error.
pub fn replay(path: &Path) -> Result<Replayed, ReplayError> {
    replay_read(Reader::open(path)?, path)
}

/// Replays a recording that is read from anywhere; `path` names it in errors.
///
/// # Errors
/// As [`replay`].
pub fn replay_read<R: Read>(mut reader: Reader<R>, path: &Path) -> Result<Replayed, ReplayError> {
    let mut player: Option<Player> = None;
    let mut tick = Tick::default();
    let mut lost_at = None;
    let contradiction = |what: String| ReplayError::Contradiction {
        what: format!("{}: {}", path.display(), printable(&what, TEXT_MAX)),
    };
    while let Some(item) = reader.next_item()? {
        match item {
            Item::Loop(parts) => {
                let (setup, cell) = *parts;
                player = Some(Player::new(setup, &cell)?);
                continue;
            }
            Item::Table(table) => {
                if let Some(player) = &mut player {
                    player.table(table);
                }
                continue;
            }
            Item::Frames(_, frames) => {
                tick.frames = frames;
                continue;
            }
            Item::Cycle(_, cycle) => (tick.cycle, tick.axes) = (Some(cycle), Vec::new()),
            Item::Axis(_, axis) => tick.axes.push(axis),
            Item::Timing(_) | Item::Event(_) => continue,
        }
        let Some(cycle) = &tick.cycle else {
            return Err(contradiction("an axis without a cycle".to_owned()));
        };
        let Some(player) = &mut player else {
            return Err(contradiction(format!("cycle {} of no loop", cycle.cycle)));
        };
        if tick.axes.len() < player.n_axes() {
            continue;
        }
        if cycle.lost > 0 || cycle.cycle != player.next_cycle() {
            lost_at = Some(cycle.cycle.min(player.next_cycle()));
            break;
        }
        let is_same = player.tick(&std::mem::take(&mut tick)).map_err(contradiction)?;
        if !is_same {
            break;
        }
    }
    let Some(player) = player else {
        return Err(contradiction("it holds no loop: nothing was moved".to_owned()));
    };
    // What is lost up to the end leaves no cycle behind that tells it.
    if lost_at.is_none() && reader.n_lost() > Some(0) {
        lost_at = Some(player.next_cycle());
    }
    Ok(Replayed { lost_at, cut: reader.was_cut(), ..player.end() })
}
