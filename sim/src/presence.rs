//! Detection of nodes on the bus before they are simulated: by listening, then by requests.
//!
//! A second node of the same number makes every answer on the bus ambiguous, and its boot-up stops
//! a running campaign. So nothing is sent while any of the nodes is heard; only idle nodes are
//! asked.

use std::time::{Duration, Instant};

use ilc_rt::fieldbus::bring_up::listen;
use ilc_rt::fieldbus::canopen::sdo::{SdoRequest, Turn};
use ilc_rt::fieldbus::canopen::{NodeId, ObjectAddress, cob_id};
use ilc_rt::fieldbus::cia402::objects;
use ilc_rt::fieldbus::{Bus, BusError, Frame};

/// Listening time: running drives send in every cycle, and a heartbeat every 100 ms.
const LISTEN: Duration = Duration::from_millis(150);
/// Listening time for a master: the longest servo cycle, with a margin.
const MASTER: Duration = Duration::from_millis(120);
/// Time-out of an idle node.
const ANSWER: Duration = Duration::from_millis(150);

/// Returns the first of `nodes` that exists.
///
/// # Errors
/// [`BusError`] if the bus fails.
pub(crate) fn find(bus: &mut dyn Bus, nodes: &[NodeId]) -> Result<Option<NodeId>, BusError> {
    if let Some(node) = listen::present(bus, nodes, LISTEN)? {
        return Ok(Some(node));
    }
    if listen::other_master(bus, nodes, MASTER)?.is_some() {
        return Ok(None);
    }
    let question = SdoRequest::Upload(Turn::Initiate(ObjectAddress::new(objects::DEVICE_TYPE, 0)));
    for &node in nodes {
        let id = cob_id::of(cob_id::SDO_REQUEST, node);
        if let Some(frame) = Frame::new(id, &question.encode()) {
            bus.send(&frame)?;
        }
    }
    let asked = Instant::now();
    listen::present(bus, nodes, ANSWER.saturating_sub(asked.elapsed()))
}
