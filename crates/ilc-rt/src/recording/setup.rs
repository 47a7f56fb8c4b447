//! Description of a recorded loop: with the cell description, all that is needed to build it again.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::canopen::pdo::MappedObject;
use crate::fieldbus::cia402::{MapError, PdoLayout, PdoMap, Supervision};

/// Version of the recordings. A reader refuses a higher one.
pub const VERSION: u32 = 1;

/// The loop of a recording; the attachment `loop.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub struct LoopSetup {
    /// Version of the recording.
    pub version: u32,
    /// Version of the program.
    pub program_version: String,
    /// Campaign in the library.
    pub campaign: String,
    /// True in lock-step.
    pub lockstep: bool,
    /// True for simulated drives.
    pub simulated: bool,
    /// `encoder` or `tcp`.
    pub measure: String,
    /// Samples of an experiment, whose set points rest; absent for the program of the cell.
    pub hold_samples: Option<usize>,
    /// Numbers of the runs.
    pub runs: Range<u32>,
    /// First run that counts.
    pub first: u32,
    /// Faults of drives are reset.
    pub resets_faults: bool,
    /// A press of a button starts a run.
    pub starts_on_input: bool,
    /// Cycles for which the loop pauses when nodes stop answering.
    pub hold_cycles_max: u32,
    /// Consecutive overruns that stop the axes.
    pub overrun_cycles_max: u32,
    /// Process data of each axis.
    pub maps: Vec<MapText>,
    /// Names of the axes.
    pub axes: Vec<String>,
    /// SHA-256 of the cell description, and of its program's file.
    pub cell_digest: String,
    /// SHA-256 of the planned set points.
    pub set_points_digest: String,
    /// Growth of the error at which the best input is restored.
    #[serde(with = "super::exact")]
    pub growth_allowed: f64,
    /// Overruns do not disturb a run.
    pub forgives_overruns: bool,
    /// Reason why a replay cannot run the law again; absent if it can.
    pub law_is_not_run: Option<String>,
}

/// Process data of an axis: index, sub-index and bits of each object.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapText {
    command: Vec<(u16, u8, u8)>,
    offset: Vec<(u16, u8, u8)>,
    answers: [Vec<(u16, u8, u8)>; 2],
    heartbeat: bool,
}

impl From<&PdoMap> for MapText {
    fn from(map: &PdoMap) -> Self {
        let objects = |layout: &PdoLayout| {
            let object =
                |object: &MappedObject| (object.address.index, object.address.sub, object.bits);
            layout.objects().iter().map(object).collect()
        };
        Self {
            command: objects(&map.command),
            offset: objects(&map.offset),
            answers: [objects(&map.answers[0]), objects(&map.answers[1])],
            heartbeat: map.supervision == Supervision::Heartbeat,
        }
    }
}

impl TryFrom<&MapText> for PdoMap {
    type Error = MapError;

    fn try_from(text: &MapText) -> Result<Self, MapError> {
        let layout = |objects: &[(u16, u8, u8)]| {
            let object = |&(index, sub, bits): &(u16, u8, u8)| MappedObject {
                address: ObjectAddress::new(index, sub),
                bits,
            };
            PdoLayout::new(&objects.iter().map(object).collect::<Vec<_>>())
        };
        Ok(Self {
            command: layout(&text.command)?,
            offset: layout(&text.offset)?,
            answers: [layout(&text.answers[0])?, layout(&text.answers[1])?],
            supervision: if text.heartbeat {
                Supervision::Heartbeat
            } else {
                Supervision::Commands
            },
        })
    }
}
