//! Connection of models: block-diagonal, series, delay (dead time), feedback.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace};

/// Largest number of states of a delayed model: the size of its matrix is their square.
const MAX_STATES: usize = 2000;

impl StateSpace {
    /// Returns the block-diagonal model of two sets of axes (parallel, not coupled).
    ///
    /// # Errors
    /// - [`ModelError::TimeMismatch`] unless both have the same sample time.
    pub fn append(&self, other: &Self) -> Result<Self, ModelError> {
        let dt_s = self.same_time("append", other)?;
        Self::new(
            block_diagonal(&self.a, &other.a),
            block_diagonal(&self.b, &other.b),
            block_diagonal(&self.c, &other.c),
            block_diagonal(&self.d, &other.d),
            dt_s,
        )
    }

    /// Returns the series connection: `y = next(self(u))`.
    ///
    /// # Errors
    /// - [`ModelError::TimeMismatch`] unless both have the same sample time.
    /// - [`ModelError::SignalMismatch`] unless `next` has one input per output of this model.
    pub fn series(&self, next: &Self) -> Result<Self, ModelError> {
        let dt_s = self.same_time("connect in series", next)?;
        if self.n_outputs() != next.n_inputs() {
            return Err(ModelError::SignalMismatch {
                action: "connect in series",
                first: self.n_outputs(),
                second: next.n_inputs(),
            });
        }
        let a = [[self.a.clone(), zeros(self, next)], [&next.b * &self.c, next.a.clone()]];
        Self::new(
            blocks(a),
            stack(&self.b, &(&next.b * &self.d)),
            beside(&(&next.d * &self.c), &next.c),
            &next.d * &self.d,
            dt_s,
        )
    }

    /// Returns the model with every input delayed by `n_delay` samples, e.g. the dead time of a
    /// bus.
    ///
    /// # Errors
    /// - [`ModelError::Continuous`] for a continuous model.
    /// - [`ModelError::TooMany`] if the result would have more than 2000 states.
    pub fn delayed(&self, n_delay: usize) -> Result<Self, ModelError> {
        let dt_s = self.sampled("delayed")?;
        let (n, m) = (self.n_states(), self.n_inputs());
        let allowed = MAX_STATES.saturating_sub(n) / m.max(1);
        if n_delay > allowed && m > 0 {
            return Err(ModelError::TooMany { what: "n_delay", value: n_delay, allowed });
        }
        if n_delay == 0 || m == 0 {
            return Ok(self.clone());
        }
        // A chain of unit delays, first the one fed by the input; the model follows the last.
        let (held, whole) = (n_delay * m, n_delay * m + n);
        let (mut a, mut b) = (DMatrix::zeros(whole, whole), DMatrix::zeros(whole, m));
        let mut c = DMatrix::zeros(self.n_outputs(), whole);
        for i in 0..held - m {
            a[(m + i, i)] = 1.0;
        }
        for i in 0..m {
            b[(i, i)] = 1.0;
        }
        a.view_mut((held, held - m), (n, m)).copy_from(&self.b);
        a.view_mut((held, held), (n, n)).copy_from(&self.a);
        c.view_mut((0, held - m), (self.n_outputs(), m)).copy_from(&self.d);
        c.view_mut((0, held), (self.n_outputs(), n)).copy_from(&self.c);
        Self::discrete(a, b, c, DMatrix::zeros(self.n_outputs(), m), dt_s)
    }

    /// Returns the closed loop from set-point to output under negative feedback.
    ///
    /// `y = P (r - K y)`, that is `P / (1 + P K)`, with `P` this model and `K` the controller.
    ///
    /// # Errors
    /// - [`ModelError::TimeMismatch`] unless both have the same sample time.
    /// - [`ModelError::SignalMismatch`] unless the controller maps outputs to inputs.
    /// - [`ModelError::AlgebraicLoop`] if `I + D_K D_P` is singular.
    pub fn feedback(&self, controller: &Self) -> Result<Self, ModelError> {
        let action = "close the loop";
        let dt_s = self.same_time(action, controller)?;
        for (first, second) in
            [(self.n_outputs(), controller.n_inputs()), (controller.n_outputs(), self.n_inputs())]
        {
            if first != second {
                return Err(ModelError::SignalMismatch { action, first, second });
            }
        }
        let m = self.n_inputs();
        let loop_gain = DMatrix::identity(m, m) + &controller.d * &self.d;
        let e = loop_gain.try_inverse().ok_or(ModelError::AlgebraicLoop)?;
        // u = E (r - C_k x_k - D_k C x)  and  y = C x + D u
        let u_x = -(&e * &controller.d * &self.c);
        let u_k = -(&e * &controller.c);
        let y_x = &self.c + &self.d * &u_x;
        let y_k = &self.d * &u_k;
        let y_r = &self.d * &e;
        Self::new(
            blocks([
                [&self.a + &self.b * &u_x, &self.b * &u_k],
                [&controller.b * &y_x, &controller.a + &controller.b * &y_k],
            ]),
            stack(&(&self.b * &e), &(&controller.b * &y_r)),
            beside(&y_x, &y_k),
            y_r,
            dt_s,
        )
    }

    pub(super) fn same_time(
        &self,
        action: &'static str,
        other: &Self,
    ) -> Result<Option<f64>, ModelError> {
        // Compared as a ratio, because sample times are often computed (1.0 / 1000.0) on one side
        // only.
        let same = match (self.dt_s, other.dt_s) {
            (None, None) => true,
            (Some(first), Some(second)) => (first - second).abs() <= 1e-9 * first,
            _ => false,
        };
        if same {
            Ok(self.dt_s)
        } else {
            let name = |dt_s: Option<f64>| {
                dt_s.map_or_else(|| "continuous".to_owned(), |dt_s| format!("dt_s = {dt_s} s"))
            };
            Err(ModelError::TimeMismatch {
                action,
                first: name(self.dt_s),
                second: name(other.dt_s),
            })
        }
    }
}

fn zeros(rows: &StateSpace, cols: &StateSpace) -> DMatrix<f64> {
    DMatrix::zeros(rows.n_states(), cols.n_states())
}

pub(super) fn stack(top: &DMatrix<f64>, bottom: &DMatrix<f64>) -> DMatrix<f64> {
    let mut stacked = DMatrix::zeros(top.nrows() + bottom.nrows(), top.ncols());
    stacked.view_mut((0, 0), top.shape()).copy_from(top);
    stacked.view_mut((top.nrows(), 0), bottom.shape()).copy_from(bottom);
    stacked
}

pub(super) fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut joined = DMatrix::zeros(left.nrows(), left.ncols() + right.ncols());
    joined.view_mut((0, 0), left.shape()).copy_from(left);
    joined.view_mut((0, left.ncols()), right.shape()).copy_from(right);
    joined
}

fn blocks([[a, b], [c, d]]: [[DMatrix<f64>; 2]; 2]) -> DMatrix<f64> {
    stack(&beside(&a, &b), &beside(&c, &d))
}

pub(super) fn block_diagonal(first: &DMatrix<f64>, second: &DMatrix<f64>) -> DMatrix<f64> {
    let right = DMatrix::zeros(first.nrows(), second.ncols());
    let left = DMatrix::zeros(second.nrows(), first.ncols());
    blocks([[first.clone(), right], [left, second.clone()]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(a: f64, b: f64, c: f64, d: f64) -> StateSpace {
        let e = |v| DMatrix::from_element(1, 1, v);
        StateSpace::discrete(e(a), e(b), e(c), e(d), 0.5).unwrap()
    }

    fn close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-14, "{found:?} is not {expected:?}");
        }
    }

    const U: [f64; 5] = [1.0, -2.0, 0.5, 3.0, 0.0];

    #[test]
    fn series_is_one_after_the_other() {
        let (first, second) = (scalar(0.5, 1.0, 2.0, 0.1), scalar(-0.3, 1.0, 1.0, 0.7));
        let both = first.series(&second).unwrap().simulate(&U, None).unwrap();
        close(&both, &second.simulate(&first.simulate(&U, None).unwrap(), None).unwrap());
    }

    #[test]
    fn a_delay_shifts_the_output() {
        let axis = scalar(0.5, 1.0, 2.0, 0.1);
        let now = axis.simulate(&U, None).unwrap();
        let late = axis.delayed(2).unwrap().simulate(&U, None).unwrap();
        close(&late[..2], &[0.0, 0.0]);
        close(&late[2..], &now[..3]);
    }

    #[test]
    fn a_delay_of_several_inputs_is_one_hold_after_the_other() {
        let (x, y) = (scalar(0.5, 1.0, 2.0, 0.1), scalar(-0.3, 1.0, 1.0, 0.7));
        let both = x.append(&y).unwrap();
        let once = both.delayed(1).unwrap();
        assert_eq!(once.delayed(2).unwrap(), both.delayed(3).unwrap());
        let hold = StateSpace::static_gain(DMatrix::identity(2, 2), Some(0.5)).unwrap();
        assert_eq!(hold.delayed(1).unwrap().series(&both).unwrap(), once);
        let u: Vec<f64> = U.iter().flat_map(|u| [*u, 2.0 * u]).collect();
        let now = both.simulate(&u, None).unwrap();
        close(&both.delayed(3).unwrap().simulate(&u, None).unwrap()[6..], &now[..4]);
    }

    #[test]
    fn a_delay_beyond_all_memory_is_refused_at_once() {
        let axis = scalar(0.5, 1.0, 2.0, 0.1);
        assert_eq!(axis.delayed(1999).unwrap().n_states(), 2000);
        for n_delay in [2000, 1 << 31, usize::MAX] {
            let line = axis.delayed(n_delay).unwrap_err().to_string();
            assert!(
                line.contains(&format!("n_delay = {n_delay}")) && line.contains("1999"),
                "{line}"
            );
        }
    }

    #[test]
    fn axes_side_by_side_do_not_touch() {
        let (x, y) = (scalar(0.5, 1.0, 2.0, 0.1), scalar(-0.3, 1.0, 1.0, 0.7));
        let both: Vec<f64> = U.iter().flat_map(|u| [*u, 2.0 * u]).collect();
        let out = x.append(&y).unwrap().simulate(&both, None).unwrap();
        let only = |i: usize| out.iter().skip(i).step_by(2).copied().collect::<Vec<_>>();
        close(&only(0), &x.simulate(&U, None).unwrap());
        close(&only(1), &y.simulate(&U.map(|u| 2.0 * u), None).unwrap());
    }

    #[test]
    fn feedback_solves_its_loop_equation() {
        let (plant, controller) = (scalar(0.5, 1.0, 2.0, 0.1), scalar(-0.3, 1.0, 0.2, 0.4));
        let y = plant.feedback(&controller).unwrap().simulate(&U, None).unwrap();
        let back = controller.simulate(&y, None).unwrap();
        let u: Vec<f64> = U.iter().zip(&back).map(|(r, b)| r - b).collect();
        close(&y, &plant.simulate(&u, None).unwrap());
    }

    #[test]
    fn misfits_are_refused() {
        let axis = scalar(0.5, 1.0, 2.0, -1.0);
        let unit = StateSpace::static_gain(DMatrix::identity(1, 1), Some(0.5)).unwrap();
        assert_eq!(axis.feedback(&unit), Err(ModelError::AlgebraicLoop));
        let two = StateSpace::static_gain(DMatrix::identity(2, 2), Some(0.5)).unwrap();
        assert!(matches!(axis.series(&two), Err(ModelError::SignalMismatch { .. })));
        let other = StateSpace::static_gain(DMatrix::identity(1, 1), None).unwrap();
        let line = axis.append(&other).unwrap_err().to_string();
        assert!(line.contains("dt_s = 0.5 s") && line.contains("continuous"), "{line}");
    }
}
