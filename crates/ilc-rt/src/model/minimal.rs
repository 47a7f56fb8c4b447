//! Minimal realisations: transfer matrices, and removal of uncontrollable and unobservable states.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace, from_transfer_function};

/// Directions shorter than this, relative to the model's size, count as unreachable.
const REACHED: f64 = 1e-10;

/// Returns a minimal realisation of a matrix of transfer functions.
///
/// `y_i = sum_j (numerator_ij / denominator_ij) u_j`
///
/// # Shapes
/// - `entries`: one row per output, with one pair (numerator, denominator) per input, highest power
///   first
/// # Units
/// - `dt_s` in seconds
/// # Errors
/// - [`ModelError::Length`] unless every row has as many entries as the first.
/// - as [`from_transfer_function`] for each entry.
pub fn from_transfer_matrix(
    entries: &[Vec<(Vec<f64>, Vec<f64>)>],
    dt_s: Option<f64>,
) -> Result<StateSpace, ModelError> {
    let m = entries.first().map_or(0, Vec::len);
    if m == 0 {
        return Err(ModelError::Length {
            what: "entries",
            found: 0,
            allowed: "at least one output with one input is needed".to_owned(),
        });
    }
    let mut whole: Option<StateSpace> = None;
    for row in entries {
        if row.len() != m {
            return Err(ModelError::Length {
                what: "a row of entries",
                found: row.len(),
                allowed: format!("one for each of the {m} inputs of the first row is needed"),
            });
        }
        for (numerator, denominator) in row {
            let entry = from_transfer_function(numerator, denominator, dt_s)?;
            whole = Some(match whole {
                None => entry,
                Some(others) => others.append(&entry)?,
            });
        }
    }
    let Some(apart) = whole else {
        return StateSpace::static_gain(DMatrix::zeros(0, 0), dt_s);
    };
    // Entry (i, j) is channel i m + j of the block-diagonal model.
    let p = entries.len();
    let spread = DMatrix::from_fn(p * m, m, |row, col| f64::from(u8::from(row % m == col)));
    let gather = DMatrix::from_fn(p, p * m, |row, col| f64::from(u8::from(col / m == row)));
    StateSpace::new(
        apart.a,
        apart.b * &spread,
        &gather * apart.c,
        &gather * apart.d * &spread,
        dt_s,
    )?
    .minimal()
}

impl StateSpace {
    /// Returns a minimal realisation: keeps the controllable and observable states.
    ///
    /// The states are projected onto an orthonormal basis of the reachable, then of the observable
    /// subspace; directions less than 1e-10 times as strong as others are dropped.
    ///
    /// # Errors
    /// - [`ModelError::NotFinite`] if intermediate numbers overflow.
    pub fn minimal(&self) -> Result<Self, ModelError> {
        let q = reachable(&self.a, &self.b);
        let (a, b, c) = (q.transpose() * &self.a * &q, q.transpose() * &self.b, &self.c * &q);
        let q = reachable(&a.transpose(), &c.transpose());
        Self::new(q.transpose() * a * &q, q.transpose() * b, c * q, self.d.clone(), self.dt_s)
    }
}

/// Returns an orthonormal basis of the reachable (Krylov) subspace: the span of `B`, `A B`, `A^2
/// B`, ...
fn reachable(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut basis = DMatrix::zeros(n, 0);
    let (mut newest, mut size) = (b.clone(), b.norm());
    while basis.ncols() < n && size > 0.0 {
        // Orthogonalised twice, as the remainder of the first pass is small against what was
        // subtracted.
        for _ in 0..2 {
            newest -= &basis * (basis.transpose() * &newest);
        }
        if newest.ncols() == 0 {
            break;
        }
        let svd = newest.clone().svd(true, false);
        let Some(u) = svd.u else { break };
        let found: Vec<usize> = (0..svd.singular_values.len())
            .filter(|&i| svd.singular_values[i] > REACHED * size)
            .take(n - basis.ncols())
            .collect();
        if found.is_empty() {
            break;
        }
        let fresh = u.select_columns(&found);
        let from = basis.ncols();
        basis = basis.insert_columns(from, fresh.ncols(), 0.0);
        basis.view_mut((0, from), fresh.shape()).copy_from(&fresh);
        newest = a * fresh;
        size = newest.norm().max(f64::MIN_POSITIVE);
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_pole_disappears() {
        // (s + 2) / ((s + 1)(s + 2))
        let model = from_transfer_function(&[1.0, 2.0], &[1.0, 3.0, 2.0], None).unwrap();
        let minimal = model.minimal().unwrap();
        assert_eq!(minimal.n_states(), 1);
        assert!((minimal.a()[(0, 0)] + 1.0).abs() < 1e-12);
        assert!(((minimal.c() * minimal.b())[(0, 0)] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_transfer_matrix_answers_channel_by_channel() {
        let lag = (vec![1.0], vec![1.0, 1.0]);
        let fast = (vec![3.0], vec![1.0, 5.0]);
        let gain = (vec![2.0], vec![1.0]);
        let none = (vec![0.0], vec![1.0]);
        let entries = [vec![lag.clone(), fast.clone()], vec![gain, lag.clone()], vec![none, fast]];
        let model = from_transfer_matrix(&entries, None).unwrap();
        assert_eq!((model.n_outputs(), model.n_inputs()), (3, 2));
        let found = &model.frequency_response(&[0.7]).unwrap()[0];
        for (row, entries) in entries.iter().enumerate() {
            for (col, (num, den)) in entries.iter().enumerate() {
                let own = from_transfer_function(num, den, None).unwrap();
                let expected = own.frequency_response(&[0.7]).unwrap()[0][(0, 0)];
                assert!((found[(row, col)] - expected).norm() < 1e-12);
            }
        }
        // Within one row the inputs cannot share the repeated lag; within one column they can share
        // `fast`.
        assert_eq!(model.n_states(), 3);
        let ragged = from_transfer_matrix(&[vec![lag.clone(), lag.clone()], vec![lag]], None);
        assert!(ragged.is_err() && from_transfer_matrix(&[], None).is_err());
    }
}
