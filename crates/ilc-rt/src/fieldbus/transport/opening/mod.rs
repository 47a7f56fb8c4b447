//! Cold: the kinds of bus, their addresses, and the opening of a bus by its address.
//!
//! For `campaign`, the programs and the Python bindings, which know nothing but the address. A new
//! transport is an endpoint beside this folder, a file in it that describes and opens it, and a
//! line in [`SCHEMES`].
//!
//! Family: `address`, `error`, `format` and `scheme`: an address is parsed by its scheme, and rejected with
//! the list of schemes.

mod address;
mod can;
mod error;
mod format;
mod loopback;
mod scheme;
mod udp;
mod zenoh;
mod zenoh_link;
pub(crate) mod zenoh_reach;

pub use address::{Address, format_of, scheme_of, syntaxes};
pub use error::OpenError;
pub use format::Format;
pub use scheme::Scheme;
pub use zenoh::ZenohSettings;
pub(super) use zenoh_link::{Ends, Link};

/// All kinds of bus, in the order of help texts and documents.
pub static SCHEMES: [&Scheme; 4] = [&can::SCHEME, &udp::SCHEME, &zenoh::SCHEME, &loopback::SCHEME];

/// Opens a bus by its address.
///
/// # Errors
/// [`OpenError`]: one line with the address, what is wrong with it and what is allowed.
pub fn open(address: &str) -> Result<Box<dyn crate::fieldbus::Bus>, OpenError> {
    address.parse::<Address>()?.open()
}
