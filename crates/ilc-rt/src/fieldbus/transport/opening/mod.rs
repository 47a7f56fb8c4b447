//! Cold: addresses of buses, and the opening of the bus that one names.
//!
//! For `supervisor`, the programs and the Python bindings, which know the address and nothing else of a
//! transport. Imports the endpoints beside it; they import [`OpenError`] alone.

mod address;
mod error;
mod zenoh_link;
pub(crate) mod zenoh_reach;

pub use address::Address;
pub use error::OpenError;
pub use zenoh_link::Settings as ZenohSettings;
pub(super) use zenoh_link::{Ends, Link};
