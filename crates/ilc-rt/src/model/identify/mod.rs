//! Identification: from an excitation and what an axis made of it to a model and what is left over.
//!
//! One file a step: [`Excitation`] lays out the input, [`frequency_response`] compares output with
//! input and says how far it can be trusted, [`fit_second_order`] and [`fit_rational`] find a model,
//! and [`uncertainty`] bounds what the model does not explain. Cold, for set-up only; `identification`,
//! `cli` and the Python bindings may import it.
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
pub use response::{FrequencyResponse, frequency_response};
pub use second_order::{Known, SecondOrder, SecondOrderFit, fit_second_order};
pub use spectra::Averaging;
pub use swept_sine::{Spacing, swept_sine};
pub use uncertainty::{Uncertainty, uncertainty};
pub use velocity_loop::{VelocityLoop, VelocityLoopFit, fit_velocity_loop};
