//! Cold: the kinds of bus there are, their addresses, and the opening of the bus that an address names.
//!
//! For `campaign`, the programs and the Python bindings, which know the address and nothing else of a
//! transport. A new transport is an endpoint beside this folder, a file in it that describes and opens
//! it, and a line in [`SCHEMES`].
//!
//! Family: `address`, `error` and `scheme`: an address is read by its scheme, and refused with the list of them.

mod address;
mod can;
mod error;
mod loopback;
mod scheme;
mod udp;
mod zenoh;
mod zenoh_link;
pub(crate) mod zenoh_reach;

pub use address::{Address, scheme_of, syntaxes};
pub use error::OpenError;
pub use scheme::Scheme;
pub use zenoh::ZenohSettings;
pub(super) use zenoh_link::{Ends, Link};

/// All kinds of bus, in the order in which help texts and documents name them.
pub static SCHEMES: [&Scheme; 4] = [&can::SCHEME, &udp::SCHEME, &zenoh::SCHEME, &loopback::SCHEME];

/// Opens the bus that an address names.
///
/// # Errors
/// [`OpenError`]: one line with the address, what is wrong with it and what is allowed.
pub fn open(address: &str) -> Result<Box<dyn crate::fieldbus::Bus>, OpenError> {
    address.parse::<Address>()?.open()
}
