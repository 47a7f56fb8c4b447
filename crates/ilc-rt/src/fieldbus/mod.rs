//! The fieldbus: CAN frames, CANopen, CiA 402 drives and their transports.
//!
//! For the servo loop (hot: frames, PDOs, statusword) and for set-up (cold: `bring_up`,
//! `transport::opening`). Imports nothing above row 0 of the layer table; `servo`, `campaign` and the
//! simulator import it.

pub mod bring_up;
pub mod bus;
pub mod can_fact;
pub mod canopen;
pub mod cia402;
pub mod frame;
pub mod load;
pub mod network;
pub mod transport;

pub use bus::{Bus, BusError};
pub use can_fact::CanFact;
pub use frame::Frame;
pub use network::{AxisNetwork, CanopenAxes, Station};
