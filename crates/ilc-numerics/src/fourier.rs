//! Plans of fast Fourier transforms of any length, in place and without scaling.

use std::sync::Arc;

use rustfft::FftPlanner;
pub use rustfft::{Fft, num_complex::Complex};

/// Returns the transform `X_k = sum_i x_i exp(-2 pi j i k / n)`.
pub fn forward(n: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_forward(n)
}

/// Returns the transform `x_i = sum_k X_k exp(2 pi j i k / n)`, `n` times the inverse of [`forward`].
pub fn inverse(n: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_inverse(n)
}
