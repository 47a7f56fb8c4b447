//! Identification: from an excitation and the response of an axis to a model and its residual.
//!
//! One file per step: [`Excitation`] makes the input, [`frequency_response`] estimates the response
//! and its coherence, [`fit_second_order`] and [`fit_rational`] fit a model, and [`uncertainty`]
//! bounds the residual. Cold, for set-up only; `identification`, `cli` and the Python bindings may
//! import it.
//!
//! Family: `excitation` is a `multisine` or a `swept_sine`, which share its checks.

mod doubt;
mod excitation;
mod fraction_start;
mod least_squares;
mod multisine;
mod rational;
mod response;
mod second_order;
mod spectra;
mod swept_sine;
mod uncertainty;
mod velocity_loop;

pub use doubt::{Doubt, doubt};
pub use excitation::{Excitation, ExcitationSignal, Waveform};
pub use multisine::multisine;
pub use rational::{RationalFit, fit_rational};
pub use response::{FrequencyResponse, ResponseError, frequency_response};
pub use second_order::{Known, SecondOrder, SecondOrderFit, fit_second_order};
pub use spectra::Averaging;
pub use swept_sine::{Spacing, swept_sine};
pub use uncertainty::{Uncertainty, uncertainty};
pub use velocity_loop::{VelocityLoop, VelocityLoopFit, fit_velocity_loop};
