//! CANopen services: NMT, SYNC, SDO, PDO, heartbeat and EMCY.
//!
//! Codecs shared by the controller and the simulated nodes, so that both agree on every byte;
//! imported by `cia402`, `servo`, `bring_up` and the simulator. All files are hot: values in,
//! values out.

pub mod cob_id;
pub mod emcy;
pub mod nmt;
pub mod node_id;
pub mod pdo;
pub mod sdo;
pub mod sdo_abort;
pub mod sync;

pub use emcy::Emergency;
pub use nmt::{Heartbeat, NmtCommand, NmtState};
pub use node_id::NodeId;
pub use sdo::ObjectAddress;
pub use sdo_abort::AbortCode;
