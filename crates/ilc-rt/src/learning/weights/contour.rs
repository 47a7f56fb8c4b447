//! Contour weights: the error normal to the path counts more than the error along it.

use nalgebra::DMatrix;

use super::tangent::tangents;
use super::{Coupled, Gain, Weight};
use crate::learning::{LearningError, Result};

/// The geometry of a reference path, for a cost.
///
/// With the unit tangent `t_k` of the path, `I - t_k t_k'` projects an error onto the normal of the
/// path: to first order the contour error. For two axes it is `c_k c_k'` with the coupling gains
/// `c_k = (-sin theta, cos theta)`. Where the path rests the nearest tangent is used.
///
/// # Shapes
/// - of `n_outputs` channels only `axes` form the path (two, three or more); the others, e.g. a
///   rotary axis, are excluded
/// # Units
/// - the axes of the path in the same unit, e.g. metres
/// # Source
/// - \[barton2010\], Eq. (4.1) to (4.3), (5.9) to (5.11).
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    n_outputs: usize,
    axes: Vec<usize>,
    /// `n_samples` x `axes.len()`.
    tangents: Vec<f64>,
}

/// Terms of a contour weight: `Q_k = q I + contour (I - t t') + along t t'`.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourTerms {
    /// Weight of every individual channel.
    pub q: Weight,
    /// Weight of the error normal to the path.
    pub contour: Gain,
    /// Weight of the error along the path.
    pub along: Gain,
}

impl Contour {
    /// Creates the geometry of a path with every channel as an axis.
    ///
    /// # Errors
    /// - as [`Contour::of_axes`].
    pub fn new(reference: &[f64], n_outputs: usize) -> Result<Self> {
        let axes: Vec<usize> = (0..n_outputs).collect();
        Self::of_axes(reference, n_outputs, &axes)
    }

    /// Creates the geometry of a path formed by some of the channels.
    ///
    /// # Shapes
    /// - `reference`: `n_samples` x `n_outputs`, time first; `axes`: indices of the path's channels
    /// # Errors
    /// - [`LearningError::Length`] for a reference that is not a whole number of samples, or fewer
    ///   than two axes.
    /// - [`LearningError::NotFinite`] for a coordinate that is infinite or NaN.
    /// - [`LearningError::Weight`] for a path that never moves, or an axis that is repeated or does
    ///   not exist.
    pub fn of_axes(reference: &[f64], n_outputs: usize, axes: &[usize]) -> Result<Self> {
        for (place, axis) in axes.iter().enumerate() {
            if *axis >= n_outputs || axes[..place].contains(axis) {
                let reason = format!(
                    "axis {axis} of the path is given twice or not among {n_outputs} channels"
                );
                return Err(LearningError::Weight { what: "axes", sample: 0, reason });
            }
        }
        let found = reference.len();
        if n_outputs == 0 || found == 0 || !found.is_multiple_of(n_outputs) {
            let (n_samples, n_channels) = ((found / n_outputs.max(1)).max(1), n_outputs.max(1));
            return Err(LearningError::Length { what: "reference", found, n_samples, n_channels });
        }
        crate::learning::error::check("reference", reference, found / n_outputs, n_outputs)?;
        let path: Vec<f64> = reference
            .chunks(n_outputs)
            .flat_map(|sample| axes.iter().map(|axis| sample[*axis]))
            .collect();
        let tangents = tangents(&path, axes.len())?;
        Ok(Self { n_outputs, axes: axes.to_vec(), tangents })
    }

    /// Returns the number of samples of the reference.
    pub fn n_samples(&self) -> usize {
        self.tangents.len() / self.axes.len()
    }

    /// Returns the unit tangent at each sample, `n_samples` x number of axes of the path.
    pub fn tangents(&self) -> &[f64] {
        &self.tangents
    }

    /// Returns the coupling at sample `k`: the map from an error to the contour error.
    ///
    /// One row `c_k = (-sin theta, cos theta)` for two axes, whose sign gives the side of the path;
    /// the projection `I - t t'` for more. In both cases `C' C = I - t t'` on the axes of the path.
    ///
    /// # Panics
    /// If `k` is beyond the end of the run.
    pub fn coupling(&self, k: usize) -> DMatrix<f64> {
        let t = self.tangent(k);
        if let [cosine, sine] = *t {
            let mut row = DMatrix::zeros(1, self.n_outputs);
            row[(0, self.axes[0])] = -sine;
            row[(0, self.axes[1])] = cosine;
            return row;
        }
        self.on_axes(|i, j| f64::from(u8::from(i == j)) - t[i] * t[j])
    }

    /// Returns the coupling at all samples.
    pub fn couplings(&self) -> Vec<DMatrix<f64>> {
        (0..self.n_samples()).map(|k| self.coupling(k)).collect()
    }

    /// Returns `Q_k = q I + contour (I - t t') + along t t'`.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a weight that is negative, not finite or of another length.
    pub fn weight(&self, terms: &ContourTerms) -> Result<Weight> {
        let (n, p) = (self.n_samples(), self.n_outputs);
        terms.q.check("q", n, p)?;
        terms.contour.check("contour", n, f64::INFINITY)?;
        terms.along.check("along", n, f64::INFINITY)?;
        let at = |k: usize| {
            let t = self.tangent(k);
            let (across, along) = (terms.contour.at(k), terms.along.at(k));
            let path = self.on_axes(|i, j| {
                across * f64::from(u8::from(i == j)) + (along - across) * (t[i] * t[j])
            });
            terms.q.at(k, p) + path
        };
        Ok(Weight::Blocks((0..n).map(at).collect()))
    }

    /// Returns `Q_k = sigma (gamma I + (1 - gamma) C' C)`.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a gain out of range or of another length.
    /// # Source
    /// - \[barton2010\], Eq. (5.2).
    pub fn coupled(&self, shares: &Coupled) -> Result<Weight> {
        shares.weight(self.n_samples(), &self.couplings())
    }

    fn tangent(&self, k: usize) -> &[f64] {
        let n = self.axes.len();
        &self.tangents[k * n..(k + 1) * n]
    }

    /// Returns a matrix over all channels that is zero outside the axes of the path.
    fn on_axes(&self, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.n_outputs, self.n_outputs);
        for (i, row) in self.axes.iter().enumerate() {
            for (j, col) in self.axes.iter().enumerate() {
                matrix[(*row, *col)] = entry(i, j);
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use proptest::prelude::*;

    fn terms(q: f64, contour: f64, along: f64) -> ContourTerms {
        ContourTerms { q: Weight::Scalar(q), contour: contour.into(), along: along.into() }
    }

    #[test]
    fn on_a_line_at_45_degrees_only_the_difference_of_the_errors_counts() {
        let path: Vec<f64> = (0..5).flat_map(|k| [f64::from(k), f64::from(k)]).collect();
        let contour = Contour::new(&path, 2).unwrap();
        let half = 0.5_f64.sqrt();
        let expected = DMatrix::from_row_slice(1, 2, &[-half, half]);
        assert!((contour.coupling(2) - expected).amax() < 1e-15);
        let q = contour.weight(&terms(0.0, 8.0, 0.0)).unwrap().at(3, 2);
        let expected = DMatrix::from_row_slice(2, 2, &[4.0, -4.0, -4.0, 4.0]);
        assert!((q - expected).amax() < 1e-14);
        let q = contour.weight(&terms(1.0, 8.0, 2.0)).unwrap().at(3, 2);
        let expected = DMatrix::from_row_slice(2, 2, &[6.0, -3.0, -3.0, 6.0]);
        assert!((q - expected).amax() < 1e-14);
    }

    #[test]
    fn channels_outside_the_path_keep_their_own_weight() {
        // Channel 1 is a rotary axis; the path lies in channels 2 and 0, along channel 0.
        let path: Vec<f64> = (0..4).flat_map(|k| [f64::from(k), 0.3 * f64::from(k), 7.0]).collect();
        let contour = Contour::of_axes(&path, 3, &[2, 0]).unwrap();
        let q = contour.weight(&terms(0.5, 4.0, 1.0)).unwrap().at(0, 3);
        let expected = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.5, 0.5, 4.5]));
        assert!((q - expected).amax() < 1e-15);
        // The tangent is (0, 1) in (channel 2, channel 0): c = (-1, 0).
        let expected = DMatrix::from_row_slice(1, 3, &[0.0, 0.0, -1.0]);
        assert!((contour.coupling(1) - expected).amax() < 1e-15);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let path = [0.0, 0.0, 1.0, 0.0, 2.0, 1.0];
        let told = |path: &[f64], n, axes: &[usize]| {
            Contour::of_axes(path, n, axes).unwrap_err().to_string()
        };
        assert!(told(&path, 2, &[0, 2]).contains("axis 2"));
        assert!(told(&path, 2, &[1, 1]).contains("axis 1"));
        assert!(told(&path, 2, &[1]).contains("reference"));
        assert!(told(&path, 4, &[0, 1]).contains("reference holds 6"));
        assert!(told(&path, 0, &[]).contains("reference holds 6"));
        let contour = Contour::new(&path, 2).unwrap();
        let told = |terms: &ContourTerms| contour.weight(terms).unwrap_err().to_string();
        assert!(told(&terms(-1.0, 1.0, 0.0)).starts_with("q at"));
        assert!(told(&terms(1.0, f64::NAN, 0.0)).starts_with("contour at"));
        assert!(told(&terms(1.0, 1.0, -1.0)).starts_with("along at"));
        let long = ContourTerms { contour: vec![1.0; 4].into(), ..terms(1.0, 1.0, 0.0) };
        assert!(told(&long).contains("4 samples"));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        /// As printed: theta from the angle of the tangent, `C'C` from sines and cosines.
        #[test]
        fn two_axes_give_the_printed_coupling(
            angles in prop::collection::vec(-3.1..3.1_f64, 3..20),
            (q, across, along) in (0.0..3.0_f64, 0.0..50.0_f64, 0.0..2.0_f64),
        ) {
            let mut path = vec![0.0, 0.0];
            for angle in &angles {
                let (x, y) = (path[path.len() - 2], path[path.len() - 1]);
                path.extend([x + angle.cos(), y + angle.sin()]);
            }
            let contour = Contour::new(&path, 2).unwrap();
            let weight = contour.weight(&terms(q, across, along)).unwrap();
            prop_assert!(weight.check("q", angles.len() + 1, 2).is_ok());
            for k in 1..angles.len() {
                let theta = (path[2 * k + 3] - path[2 * k - 1]).atan2(path[2 * k + 2] - path[2 * k - 2]);
                let (sine, cosine) = theta.sin_cos();
                let printed = DMatrix::from_row_slice(2, 2, &[
                    sine * sine, -sine * cosine, -sine * cosine, cosine * cosine,
                ]);
                let c = contour.coupling(k);
                prop_assert!((c.transpose() * &c - &printed).amax() < 1e-10);
                let t = DMatrix::from_row_slice(2, 1, &[cosine, sine]);
                let dense = DMatrix::identity(2, 2) * q + printed * across
                    + &t * t.transpose() * along;
                prop_assert!((weight.at(k, 2) - dense).amax() < 1e-10);
            }
        }

        #[test]
        fn three_axes_weigh_the_distance_from_the_tangent_line(
            steps in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..12),
            error in prop::array::uniform3(-1.0..1.0_f64),
        ) {
            let mut path = vec![0.0; 3];
            for step in &steps {
                let last = path.len() - 3;
                for (axis, change) in step.iter().enumerate() {
                    path.push(path[last + axis] + change);
                }
            }
            let contour = Contour::new(&path, 3).unwrap();
            let weight = contour.weight(&terms(0.0, 2.0, 0.0)).unwrap();
            prop_assert!(weight.check("q", steps.len() + 1, 3).is_ok());
            let e = DVector::from_row_slice(&error);
            for k in 0..=steps.len() {
                let t = DVector::from_row_slice(&contour.tangents()[3 * k..3 * k + 3]);
                // Distance of a point from a line: the length of the cross product.
                let distance = e.cross(&t).norm();
                let cost = (e.transpose() * weight.at(k, 3) * &e)[0];
                prop_assert!((cost - 2.0 * distance * distance).abs() < 1e-10);
                let c = contour.coupling(k);
                prop_assert!(((&c * &e).norm() - distance).abs() < 1e-10);
            }
        }

        #[test]
        fn shares_divide_between_axes_and_contour(
            angles in prop::collection::vec(-3.1..3.1_f64, 3..12), gamma in 0.0..1.0_f64,
        ) {
            let path: Vec<f64> = angles.iter().scan([0.0, 0.0], |at, angle| {
                at[0] += angle.cos();
                at[1] += angle.sin();
                Some(*at)
            }).flatten().collect();
            let contour = Contour::new(&path, 2).unwrap();
            let shares = Coupled { sigma: 3.0.into(), gamma: gamma.into() };
            let coupled = contour.coupled(&shares).unwrap();
            let terms = terms(3.0 * gamma, 3.0 * (1.0 - gamma), 0.0);
            let weight = contour.weight(&terms).unwrap();
            for k in 0..angles.len() {
                prop_assert!((coupled.at(k, 2) - weight.at(k, 2)).amax() < 1e-12);
            }
        }
    }
}
