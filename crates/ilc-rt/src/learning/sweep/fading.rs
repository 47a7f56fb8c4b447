//! State and costate at a cut as sums over the samples near it. For [`super::varying`] only.

use nalgebra::{SMatrix, SVector};

use super::factor::Gains;
use super::lane_step::FORGOTTEN;
use super::record::Sizes;
use super::side_by_side::Rows;
use super::wide::LANES;

/// The factors of some sums, side by side.
#[derive(Debug)]
pub(super) struct Sums {
    factors: Rows,
    n_samples: usize,
    width: usize,
}

impl Sums {
    /// Takes over the factors of each lane that has some, `width` a sample; the shorter sums continue
    /// with zeros.
    pub(super) fn new(lanes: &[(usize, Vec<f64>)], width: usize) -> Self {
        let longest = lanes.iter().map(|(_, factors)| factors.len()).max().unwrap_or(0);
        // As many as whole tiles of samples may read.
        let mut rows = Rows::new(longest + LANES * width);
        for (lane, factors) in lanes {
            for (row, factor) in rows.at_mut(0).iter_mut().zip(factors) {
                row[*lane] = *factor;
            }
        }
        Self { factors: rows, n_samples: longest / width.max(1), width }
    }

    /// Returns the number of samples of the longest sum.
    pub(super) fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Returns the factors of a sample.
    #[inline]
    pub(super) fn factors(&self, sample: usize) -> &[[f64; LANES]] {
        &self.factors.at(sample * self.width)[..self.width]
    }
}

/// Returns the factors of error and input from sample `cut` on in the costate there: a column each.
///
/// `p_k = (A-BK)'p_{k+1} + (C-DK)'Q e_k + K'S u_k`. `None` if more than `reach` samples matter.
pub(super) fn after<const N: usize>(gains: &Gains, cut: usize, reach: usize) -> Option<Vec<f64>> {
    let Sizes { m, targets, held, .. } = gains.sizes();
    let end = gains.n_samples();
    fading::<N>(cut..end, reach, |power, k, factors| {
        for column in gains.at(k).back.chunks_exact(N + m).skip(N).take(targets + held) {
            let passed = power * SVector::<f64, N>::from_column_slice(&column[..N]);
            factors.extend(passed.iter());
        }
        power * transition::<N>(gains, k).transpose()
    })
}

/// Returns the factors of `kappa` before sample `cut` in the state there: a column each, the last
/// sample first.
///
/// `x_{k+1} = (A-BK) x_k + B kappa_k`. `None` if more than `reach` samples matter.
pub(super) fn before<const N: usize>(gains: &Gains, cut: usize, reach: usize) -> Option<Vec<f64>> {
    let m = gains.n_inputs();
    fading::<N>((0..cut).rev(), reach, |power, k, factors| {
        for column in gains.at(k).fore[N * (N + m)..].chunks_exact(N) {
            let passed = power * SVector::<f64, N>::from_column_slice(column);
            factors.extend(passed.iter());
        }
        power * transition(gains, k)
    })
}

/// Returns `A - B K` of a sample.
fn transition<const N: usize>(gains: &Gains, k: usize) -> SMatrix<f64, N, N> {
    let (fore, rows) = (gains.at(k).fore, N + gains.n_inputs());
    SMatrix::from_fn(|i, j| fore[j * rows + i])
}

/// Collects factors until the product of transitions, which `step` continues, has faded.
fn fading<const N: usize>(
    samples: impl Iterator<Item = usize>,
    reach: usize,
    mut step: impl FnMut(SMatrix<f64, N, N>, usize, &mut Vec<f64>) -> SMatrix<f64, N, N>,
) -> Option<Vec<f64>> {
    let mut factors = Vec::new();
    let mut power = SMatrix::<f64, N, N>::identity();
    let mut largest = 0.0_f64;
    for (count, k) in samples.enumerate() {
        // Relative to the largest so far, as the states may have different units.
        let size = power.amax();
        largest = largest.max(size);
        if size < FORGOTTEN * largest {
            return Some(factors);
        }
        if count == reach {
            return None;
        }
        power = step(power, k, &mut factors);
    }
    // The run begins or ends here.
    Some(factors)
}
