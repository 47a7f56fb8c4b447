//! Other drives on the bus: looked for before these ones boot, as two with one number disturb each other.

use std::time::{Duration, Instant};

use ilc_rt::fieldbus::canopen::{NodeId, cob_id};
use ilc_rt::fieldbus::{Bus, BusError, Frame};

/// How long to listen: longer than the period of a node's heartbeat.
const LISTEN: Duration = Duration::from_millis(120);
/// How long to wait for answers.
const WAIT: Duration = Duration::from_millis(60);
/// An upload of the device type, 0x1000:00, which every node answers and which changes nothing.
const ASK: [u8; 8] = [0x40, 0x00, 0x10, 0x00, 0x00, 0x00, 0x00, 0x00];

/// The first of `nodes` that is on the bus already. Where a campaign is going on it is heard, and nothing
/// is sent that would disturb it; where all is quiet each node is asked who it is.
pub(crate) fn first_present(
    bus: &mut dyn Bus,
    nodes: &[NodeId],
) -> Result<Option<NodeId>, BusError> {
    if let Some(node) = listen(bus, nodes, LISTEN)? {
        return Ok(Some(node));
    }
    for node in nodes {
        if let Some(frame) = Frame::new(cob_id::of(cob_id::SDO_REQUEST, *node), &ASK) {
            match bus.send(&frame) {
                Ok(()) | Err(BusError::Full) => {}
                Err(error) => return Err(error),
            }
        }
    }
    listen(bus, nodes, WAIT)
}

fn listen(bus: &mut dyn Bus, nodes: &[NodeId], span: Duration) -> Result<Option<NodeId>, BusError> {
    let end = Instant::now() + span;
    while let Some(left) = end.checked_duration_since(Instant::now()) {
        if let Some(frame) = bus.recv(left)?
            && let Some(node) = nodes.iter().find(|node| is_from(&frame, **node))
        {
            return Ok(Some(*node));
        }
    }
    Ok(None)
}

/// Whether a frame is one that only this node sends: a TPDO, an answer, a heartbeat.
fn is_from(frame: &Frame, node: NodeId) -> bool {
    const SENT: [u16; 4] =
        [cob_id::TPDO1, cob_id::TPDO1 + 0x100, cob_id::SDO_RESPONSE, cob_id::HEARTBEAT];
    SENT.iter().any(|function| frame.id() == cob_id::of(*function, node))
}
