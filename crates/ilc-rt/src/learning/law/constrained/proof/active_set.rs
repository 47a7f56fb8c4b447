//! Non-negative least squares.

use nalgebra::{DMatrix, DVector};

/// Returns the `x >= 0` that minimises `|A x - b|`, by the active-set method of Lawson and Hanson.
pub(super) fn non_negative(a: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = a.ncols();
    let mut x = DVector::zeros(n);
    let mut passive: Vec<usize> = Vec::new();
    for _ in 0..3 * n + 10 {
        let pull = a.tr_mul(&(b - a * &x));
        let best = (0..n)
            .filter(|i| !passive.contains(i))
            .max_by(|i, j| pull[*i].total_cmp(&pull[*j]))
            .filter(|i| pull[*i] > 1e-13 * b.norm());
        let Some(best) = best else { break };
        passive.push(best);
        loop {
            let columns: Vec<_> = passive.iter().map(|i| a.column(*i).into_owned()).collect();
            let qr = DMatrix::from_columns(&columns).qr();
            let right = qr.q().tr_mul(b);
            let Some(found) = qr.r().solve_upper_triangular(&right) else {
                // Linearly dependent on the others: it adds nothing.
                passive.pop();
                return x;
            };
            if found.iter().all(|value| *value > 0.0) {
                x.fill(0.0);
                for (i, value) in passive.iter().zip(found.iter()) {
                    x[*i] = *value;
                }
                break;
            }
            let mut length = 1.0_f64;
            for (i, value) in passive.iter().zip(found.iter()) {
                if *value <= 0.0 {
                    length = length.min(x[*i] / (x[*i] - value));
                }
            }
            for (i, value) in passive.iter().zip(found.iter()) {
                x[*i] += length * (value - x[*i]);
            }
            passive.retain(|i| x[*i] > 1e-14);
            for i in 0..n {
                if !passive.contains(&i) {
                    x[i] = 0.0;
                }
            }
            if passive.is_empty() {
                break;
            }
        }
    }
    x
}
