//! Scan of a bus: which nodes answer, and what they are. Only reads.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::Serialize;

use super::company::{Company, collect, every_node};
use super::error::CommissioningError;
use super::faults::{find, low_word};
use super::words::{mode_name, mode_names};
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::canopen::sdo::{SdoRequest, Turn};
use crate::fieldbus::canopen::{NmtState, NodeId, ObjectAddress, cob_id};
use crate::fieldbus::cia402::{Statusword, objects};
use crate::fieldbus::{Bus, BusError, Frame};

/// Time between two questions, so that cyclic traffic of a running controller is not pushed aside.
const BETWEEN: Duration = Duration::from_millis(2);
/// Time for the last node to answer.
const PATIENCE: Duration = Duration::from_millis(300);
/// Attempts at a frame that a full queue refuses.
const TRIES: u32 = 50;

/// A node that answered, or reported its state.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FoundNode {
    /// Its number.
    pub node: u8,
    /// NMT state from its heartbeat, if it sends one.
    pub nmt: Option<String>,
    /// Device type, object 0x1000; `None` if it answers no question.
    pub device_type: Option<u32>,
    /// Vendor, product, revision and serial number, object 0x1018.
    pub identity: [Option<u32>; 4],
    /// Device name, object 0x1008.
    pub name: Option<String>,
    /// State of a CiA 402 drive.
    pub drive: Option<FoundDrive>,
    /// Reason that it could not be asked to the end.
    pub trouble: Option<String>,
}

/// State of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FoundDrive {
    /// Statusword, object 0x6041.
    pub statusword: u16,
    /// Its state in words.
    pub state: String,
    /// Mode of operation, object 0x6061.
    pub mode: Option<String>,
    /// Supported modes, object 0x6502.
    pub supported: Vec<&'static str>,
}

/// Asks every number once, then every node that answered for its identity; `company` is what was heard before.
///
/// # Errors
/// [`CommissioningError`] if another master exchanges objects, or the bus fails.
pub fn scan(
    bus: &mut dyn Bus,
    company: &Company,
    timeout: Duration,
) -> Result<Vec<FoundNode>, CommissioningError> {
    company.lets_read()?;
    let mut heard = company.clone();
    let mut answered = BTreeSet::new();
    let mut take = |frame: &Frame| {
        answered.extend(cob_id::node_of(cob_id::SDO_RESPONSE, frame.id()).map(NodeId::get));
        heard.note(frame);
    };
    for node in every_node() {
        ask(bus, node)?;
        collect(bus, BETWEEN, &mut take)?;
    }
    collect(bus, PATIENCE, &mut take)?;
    // Of another master, as no transport returns own frames.
    heard.lets_read()?;
    let numbers: BTreeSet<u8> =
        answered.iter().copied().chain(heard.states.keys().copied()).collect();
    let states = heard.states;
    Ok(numbers
        .into_iter()
        .filter_map(NodeId::new)
        .map(|node| {
            let nmt = states.get(&node.get()).copied();
            describe(bus, node, nmt, answered.contains(&node.get()).then_some(timeout))
        })
        .collect())
}

/// Sends one question: the device type.
fn ask(bus: &mut dyn Bus, node: NodeId) -> Result<(), CommissioningError> {
    let request = SdoRequest::Upload(Turn::Initiate(ObjectAddress::new(objects::DEVICE_TYPE, 0)));
    let frame = Frame::new(cob_id::of(cob_id::SDO_REQUEST, node), &request.encode());
    let frame = frame.unwrap_or_default();
    for _ in 1..TRIES {
        match bus.send(&frame) {
            Err(BusError::Full) => std::thread::sleep(BETWEEN),
            sent => return Ok(sent?),
        }
    }
    Ok(bus.send(&frame)?)
}

fn describe(
    bus: &mut dyn Bus,
    node: NodeId,
    nmt: Option<NmtState>,
    timeout: Option<Duration>,
) -> FoundNode {
    let mut found = FoundNode {
        node: node.get(),
        nmt: nmt.map(|state| state.to_string()),
        device_type: None,
        identity: [None; 4],
        name: None,
        drive: None,
        trouble: None,
    };
    found.trouble = match timeout {
        None => Some("it answers no SDO request".to_owned()),
        Some(timeout) => {
            let client = SdoClient::new(node, timeout);
            interview(bus, &client, &mut found).err().map(|error| error.to_string())
        }
    };
    found
}

fn interview(
    bus: &mut dyn Bus,
    client: &SdoClient,
    found: &mut FoundNode,
) -> Result<(), CommissioningError> {
    found.device_type = find(bus, client, objects::DEVICE_TYPE, 0)?;
    for (value, sub) in found.identity.iter_mut().zip(1..) {
        *value = find(bus, client, objects::IDENTITY, sub)?;
    }
    found.name = client
        .upload(bus, objects::DEVICE_NAME, 0)
        .ok()
        .map(|bytes| String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_owned());
    if found.device_type.map(low_word) != Some(objects::PROFILE_DRIVE) {
        return Ok(());
    }
    let Some(statusword) = find(bus, client, objects::STATUSWORD, 0)?.map(low_word) else {
        return Ok(());
    };
    let supported = find(bus, client, objects::SUPPORTED_MODES, 0)?.unwrap_or(0);
    let mode = find(bus, client, objects::MODE_DISPLAY, 0)?
        .map(|code| mode_name(code.to_le_bytes()[0].cast_signed()));
    found.drive = Some(FoundDrive {
        statusword,
        state: Statusword(statusword)
            .state()
            .map_or_else(|| "no known state".to_owned(), |state| state.to_string()),
        mode,
        supported: mode_names(supported),
    });
    Ok(())
}
