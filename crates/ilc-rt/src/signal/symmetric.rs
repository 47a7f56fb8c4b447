//! Convolution of a whole signal with symmetric weights: zero-phase, with a finite reach.

use super::SignalError;
use super::channel::check_channel;

/// Extension of a signal beyond its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ends {
    /// Holds the first and last value.
    Held,
    /// Mirrored between two samples: `.. x[1] x[0] | x[0] x[1] ..`.
    Mirrored,
}

impl Ends {
    /// Returns the samples that the `i`-th ones before the first and after the last are made of.
    fn of(self, i: usize, last: usize) -> (usize, usize) {
        match self {
            Self::Held => (0, last),
            Self::Mirrored => (i, last - i),
        }
    }
}

/// A symmetric (zero-phase) FIR filter with its workspace.
///
/// `y[k] = w[0] x[k] + sum_{i=1}^{r} w[i] (x[k+i] + x[k-i])`
///
/// # Shapes
/// - one channel of a signal of fixed length, possibly interleaved with others
/// # Real Time
/// Allocates at creation, never in [`Symmetric::apply`]; `O(n_samples r)`.
#[derive(Debug, Clone)]
pub struct Symmetric {
    /// From the centre outwards.
    weights: Vec<f64>,
    ends: Ends,
    extended: Vec<f64>,
}

impl Symmetric {
    pub(super) fn new(
        weights: Vec<f64>,
        ends: Ends,
        n_samples: usize,
    ) -> Result<Self, SignalError> {
        let reach = weights.len().saturating_sub(1);
        // The mirrored extension cannot be longer than the signal.
        if n_samples == 0 || ends == Ends::Mirrored && n_samples < reach {
            return Err(SignalError::TooShort { n_samples, padding: reach.saturating_sub(1) });
        }
        Ok(Self { weights, ends, extended: vec![0.0; n_samples + 2 * reach] })
    }

    /// Returns the number of samples the filter was set up for.
    pub fn n_samples(&self) -> usize {
        self.extended.len() - 2 * self.reach()
    }

    /// Filters one channel in place.
    ///
    /// # Shapes
    /// - `signal`: time first, `n_samples` x `n_channels`; only `channel` is read and written
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    pub fn apply(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        let (n_samples, reach) = (self.n_samples(), self.reach());
        check_channel(signal, channel, n_channels, n_samples)?;
        let at = |sample: usize| sample * n_channels + channel;
        let last = n_samples - 1;
        for k in 0..n_samples {
            self.extended[reach + k] = signal[at(k)];
        }
        for i in 0..reach {
            let (before, after) = self.ends.of(i, last);
            self.extended[reach - 1 - i] = signal[at(before)];
            self.extended[reach + n_samples + i] = signal[at(after)];
        }
        for k in 0..n_samples {
            let middle = reach + k;
            let sides = self.weights.iter().enumerate().skip(1).map(|(i, weight)| {
                weight * (self.extended[middle + i] + self.extended[middle - i])
            });
            signal[at(k)] = self.weights[0] * self.extended[middle] + sides.sum::<f64>();
        }
        Ok(())
    }

    /// Applies the transpose (adjoint) of [`Symmetric::apply`], extension included: the samples
    /// that an end was extended from collect its share.
    ///
    /// # Shapes
    /// - as [`Symmetric::apply`]
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    pub fn apply_transposed(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        let (n_samples, reach) = (self.n_samples(), self.reach());
        check_channel(signal, channel, n_channels, n_samples)?;
        let at = |sample: usize| sample * n_channels + channel;
        let last = n_samples - 1;
        self.extended.fill(0.0);
        for k in 0..n_samples {
            let (middle, value) = (reach + k, signal[at(k)]);
            self.extended[middle] += self.weights[0] * value;
            for (i, weight) in self.weights.iter().enumerate().skip(1) {
                self.extended[middle + i] += weight * value;
                self.extended[middle - i] += weight * value;
            }
        }
        for k in 0..n_samples {
            signal[at(k)] = self.extended[reach + k];
        }
        for i in 0..reach {
            let (before, after) = self.ends.of(i, last);
            signal[at(before)] += self.extended[reach - 1 - i];
            signal[at(after)] += self.extended[reach + n_samples + i];
        }
        Ok(())
    }

    fn reach(&self) -> usize {
        self.weights.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_held_or_mirrored_as_by_hand() {
        let x = [1.0, 2.0, 4.0];
        // Weights 1, 10, 100: the digits of a sum show which samples were added.
        let weights = vec![0.0, 1.0, 10.0];
        let mut held = x;
        Symmetric::new(weights.clone(), Ends::Held, 3).unwrap().apply(&mut held, 0, 1).unwrap();
        assert_eq!(held.to_vec(), [1.0 + 2.0 + 10.0 * 5.0, 1.0 + 4.0 + 10.0 * 5.0, 56.0]);
        let mut mirrored = x;
        Symmetric::new(weights, Ends::Mirrored, 3).unwrap().apply(&mut mirrored, 0, 1).unwrap();
        // Left of 1 come 1, 2; right of 4 come 4, 2.
        assert_eq!(mirrored.to_vec(), [1.0 + 2.0 + 10.0 * 6.0, 5.0 + 10.0 * 5.0, 6.0 + 10.0 * 3.0]);
    }

    #[test]
    fn channels_are_filtered_one_by_one() {
        let mut both = [1.0, 10.0, 3.0, 20.0, 8.0, 30.0];
        let mut filter = Symmetric::new(vec![0.5, 0.25], Ends::Held, 3).unwrap();
        filter.apply(&mut both, 0, 2).unwrap();
        assert_eq!(both.to_vec(), [1.5, 10.0, 3.75, 20.0, 6.75, 30.0]);
        assert!(filter.apply(&mut both, 2, 2).is_err());
        assert!(filter.apply(&mut both, 0, 0).is_err());
        assert!(filter.apply(&mut both[..4], 0, 2).is_err());
    }
}
