//! Learning on many linear plants at once: the trial loop of each, on all processors.
//!
//! For studies of robustness: thousands of plants that differ from the model. Eight plants of the same order are
//! simulated side by side (`lanes`), groups of them go to threads as these become free (`threads`), and each
//! plant's runs depend on that plant, its law and its seed alone (`trials`): the results are the same bit by bit for any
//! number of threads, and those of `ilc_rt.simulate` in Python. The Python bindings import it.

mod figures;
mod lanes;
mod laws;
mod task;
mod threads;
mod trials;

pub use laws::Laws;
pub use task::{BatchError, Figures, Task};
pub use threads::learn;
