//! From a cell description to laws, programs and predictions, before anything moves.
//!
//! Checks and refuses; touches neither a bus nor a library. `identification`, `campaign`, `cli` and the
//! Python bindings may import it. Cold.
//!
//! Family: `forecast`, `law` and `plan` evaluate one cell description together.

mod error;
mod fingerprint;
mod forecast;
mod law;
mod plan;
mod program;
mod traffic;

pub use error::DesignError;
pub use forecast::{first_error, learning_model, perturbed_axis};
pub use law::Prepared;
pub use plan::Plan;
pub(crate) use plan::{axis_scale, input_unit, node};
pub(crate) use program::text as program_text;
pub use traffic::{BusTraffic, pdo_map};
