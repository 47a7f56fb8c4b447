//! A weight along the run.

use nalgebra::DMatrix;

use crate::learning::{LearningError, Result};

/// Largest number of entries of all matrices together: 0.8 GB.
const VALUES_MAX: usize = 100_000_000;

/// A symmetric, positive semidefinite weight of the channels of a signal, at each sample.
///
/// # Shapes
/// - for `p` channels and runs of `n` samples: `PerSample` `n` numbers, `Block` `(p, p)`, `Blocks` `n`
///   matrices `(p, p)`
#[derive(Debug, Clone, PartialEq)]
pub enum Weight {
    /// The same number for every channel and every sample.
    Scalar(f64),
    /// One number per sample, the same for every channel.
    PerSample(Vec<f64>),
    /// One matrix for all samples.
    Block(DMatrix<f64>),
    /// One matrix per sample.
    Blocks(Vec<DMatrix<f64>>),
}

impl Weight {
    /// Returns the weight at sample `k` of a signal with `p` channels.
    ///
    /// # Panics
    /// If `k` is beyond the end of the run; [`Weight::check`] rules this out.
    pub fn at(&self, k: usize, p: usize) -> DMatrix<f64> {
        match self {
            Self::Scalar(weight) => DMatrix::identity(p, p) * *weight,
            Self::PerSample(weights) => DMatrix::identity(p, p) * weights[k],
            Self::Block(block) => block.clone(),
            Self::Blocks(blocks) => blocks[k].clone(),
        }
    }

    /// Returns true if the weight is the same at every sample.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Scalar(_) | Self::Block(_))
    }

    /// Returns one entry of the weight at sample `k`.
    ///
    /// # Panics
    /// If `k` is beyond the end of the run; [`Weight::check`] rules this out.
    pub fn entry(&self, k: usize, row: usize, col: usize) -> f64 {
        match self {
            Self::Block(block) => block[(row, col)],
            Self::Blocks(blocks) => blocks[k][(row, col)],
            _ if row != col => 0.0,
            Self::Scalar(weight) => *weight,
            Self::PerSample(weights) => weights[k],
        }
    }

    /// Returns the weight of a signal with `p` channels at every sample: symmetric blocks, time first.
    ///
    /// # Shapes
    /// - `n_samples * p * p`
    /// # Errors
    /// - [`LearningError::TooMany`] beyond 0.8 GB; [`LearningError::Weight`] if a number is not finite.
    /// # Panics
    /// If the run is longer than the weight; [`Weight::check`] rules this out.
    pub fn values(&self, n_samples: usize, p: usize) -> Result<Vec<f64>> {
        let allowed = VALUES_MAX / (p * p).max(1);
        if n_samples > allowed {
            return Err(LearningError::TooMany { what: "n_samples", value: n_samples, allowed });
        }
        let mut values = Vec::with_capacity(n_samples * p * p);
        for k in 0..n_samples {
            // Symmetric: column-major equals row-major.
            values.extend_from_slice(self.at(k, p).as_slice());
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let (what, sample) = ("weight", at / (p * p));
            let reason = "what it is made of is so large that it is not finite".to_owned();
            return Err(LearningError::Weight { what, sample, reason });
        }
        Ok(values)
    }

    /// Returns the block-diagonal weight of several signals side by side, each given with its number of channels.
    ///
    /// # Panics
    /// If a weight does not match its signal or the run; [`Weight::check`] rules this out.
    #[must_use]
    pub fn beside(parts: &[(&Self, usize)], n_samples: usize) -> Self {
        if let [(only, _)] = parts {
            return (*only).clone();
        }
        let size = parts.iter().map(|(_, channels)| channels).sum();
        let at = |k: usize| {
            let (mut whole, mut place) = (DMatrix::zeros(size, size), 0);
            for (weight, channels) in parts {
                let mut block = whole.view_mut((place, place), (*channels, *channels));
                block.copy_from(&weight.at(k, *channels));
                place += channels;
            }
            whole
        };
        if parts.iter().all(|(weight, _)| weight.is_constant()) {
            return Self::Block(at(0));
        }
        Self::Blocks((0..n_samples).map(at).collect())
    }

    /// Returns the weight of a subset of the channels.
    #[must_use]
    pub fn select(&self, channels: &[usize]) -> Self {
        let pick = |block: &DMatrix<f64>| {
            let p = channels.len();
            DMatrix::from_fn(p, p, |row, col| block[(channels[row], channels[col])])
        };
        match self {
            Self::Block(block) => Self::Block(pick(block)),
            Self::Blocks(blocks) => Self::Blocks(blocks.iter().map(pick).collect()),
            _ => self.clone(),
        }
    }

    /// Returns true if the weight couples two channels at any sample.
    pub fn couples(&self, row: usize, col: usize) -> bool {
        match self {
            Self::Block(block) => block[(row, col)] != 0.0,
            Self::Blocks(blocks) => blocks.iter().any(|block| block[(row, col)] != 0.0),
            _ => false,
        }
    }

    /// Returns true if the weight is zero at every sample.
    pub fn is_zero(&self) -> bool {
        match self {
            Self::Scalar(weight) => *weight == 0.0,
            Self::PerSample(weights) => weights.iter().all(|weight| *weight == 0.0),
            Self::Block(block) => block.amax() == 0.0,
            Self::Blocks(blocks) => blocks.iter().all(|block| block.amax() == 0.0),
        }
    }

    /// Returns true if the weight couples any two of `p` channels.
    pub fn is_mixed(&self, p: usize) -> bool {
        (0..p).any(|row| (0..row).any(|col| self.couples(row, col)))
    }

    /// Refuses a weight of the wrong shape, or one that is not positive semidefinite.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] naming the weight `what`, the sample and the rule.
    pub fn check(&self, what: &'static str, n_samples: usize, p: usize) -> Result {
        let refused =
            |sample: usize, reason: String| Err(LearningError::Weight { what, sample, reason });
        let count = match self {
            Self::Scalar(_) | Self::Block(_) => n_samples,
            Self::PerSample(weights) => weights.len(),
            Self::Blocks(blocks) => blocks.len(),
        };
        if count != n_samples {
            return refused(0, format!("{count} samples given; {n_samples} are needed"));
        }
        let check_number = |sample: usize, weight: f64| {
            if weight.is_finite() && weight >= 0.0 {
                return Ok(());
            }
            refused(sample, format!("{weight}; a weight must be finite and not negative"))
        };
        match self {
            Self::Scalar(weight) => check_number(0, *weight),
            Self::PerSample(weights) => {
                weights.iter().enumerate().try_for_each(|(k, weight)| check_number(k, *weight))
            }
            Self::Block(block) => check_block(block, p).or_else(|reason| refused(0, reason)),
            Self::Blocks(blocks) => blocks.iter().enumerate().try_for_each(|(k, block)| {
                check_block(block, p).or_else(|reason| refused(k, reason))
            }),
        }
    }
}

/// Tolerance below zero of the smallest eigenvalue, relative to the largest entry: rounding.
const SEMIDEFINITE: f64 = 1e-10;

fn check_block(block: &DMatrix<f64>, p: usize) -> Result<(), String> {
    if block.shape() != (p, p) {
        return Err(format!(
            "a block of {} x {}; {p} x {p} is needed",
            block.nrows(),
            block.ncols()
        ));
    }
    if let Some(entry) = block.iter().find(|entry| !entry.is_finite()) {
        return Err(format!("an entry is {entry}; only finite values are allowed"));
    }
    let scale = block.amax();
    let skew = (block - block.transpose()).amax();
    if skew > SEMIDEFINITE * scale {
        return Err(format!("a block differs from its transpose by {skew}; it must be symmetric"));
    }
    let lowest = block.symmetric_eigenvalues().iter().copied().fold(f64::INFINITY, f64::min);
    if lowest < -SEMIDEFINITE * scale {
        return Err(format!("an eigenvalue is {lowest}; a weight must be positive semidefinite"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_the_blocks_of_all_samples() {
        let weight = Weight::PerSample(vec![1.0, 4.0]);
        assert_eq!(weight.values(2, 2).unwrap(), [1.0, 0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 4.0]);
        let many = Weight::Scalar(1.0).values(VALUES_MAX / 4 + 1, 2).unwrap_err();
        assert!(matches!(many, LearningError::TooMany { allowed: 25_000_000, .. }), "{many}");
        let large = Weight::PerSample(vec![1.0, f64::INFINITY]).values(2, 1).unwrap_err();
        assert!(matches!(large, LearningError::Weight { sample: 1, .. }), "{large}");
    }

    #[test]
    fn each_form_gives_its_matrix() {
        let block = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 3.0]);
        assert_eq!(Weight::Scalar(3.0).at(4, 2), DMatrix::identity(2, 2) * 3.0);
        assert_eq!(Weight::PerSample(vec![1.0, 4.0]).at(1, 2), DMatrix::identity(2, 2) * 4.0);
        assert_eq!(Weight::Blocks(vec![block.clone(), block.clone() * 2.0]).at(1, 2), block * 2.0);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 1.0]);
        let indefinite = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        for (weight, word) in [
            (Weight::Scalar(-1.0), "negative"),
            (Weight::Scalar(f64::NAN), "finite"),
            (Weight::PerSample(vec![1.0; 4]), "4 samples"),
            (Weight::Block(DMatrix::identity(3, 3)), "3 x 3"),
            (Weight::Block(skew), "symmetric"),
            (Weight::Blocks(vec![indefinite; 5]), "semidefinite"),
        ] {
            let told = weight.check("q", 5, 2).unwrap_err().to_string();
            assert!(told.starts_with("q at sample") && told.contains(word), "{told}");
        }
        assert!(Weight::Scalar(0.0).check("q", 5, 2).is_ok());
    }
}
