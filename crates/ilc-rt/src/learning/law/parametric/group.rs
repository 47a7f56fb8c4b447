//! Group of axes that the model couples, with the least squares of their parameters.

use nalgebra::{DMatrix, DVector};

use super::answer::Answer;
use super::fit::Fit;
use super::terms::Term;
use crate::learning::error::MAX_VALUES;
use crate::learning::{LearningError, Result};

/// Largest number of values of a pseudo-inverse.
const VALUES_MAX: usize = 5 * MAX_VALUES;

/// Place of a row in the signals of the machine.
#[derive(Debug, Clone, Copy)]
enum Row {
    Error(usize),
    Change(usize),
}

/// A group of axes that the model couples.
#[derive(Debug)]
pub(super) struct Group {
    /// Indices of its terms.
    terms: Vec<usize>,
    rows: Vec<Row>,
    fit: Fit,
    /// Part of the parameters that the run does not determine.
    left: DVector<f64>,
    right: DVector<f64>,
    found: DVector<f64>,
}

impl Group {
    /// Factorises the least squares: one column per term, the rows error, change and next input.
    pub(super) fn new(
        answer: &mut Answer,
        all: &[Term],
        (inputs, outputs): (Vec<usize>, Vec<usize>),
        [q, s, r]: [&[f64]; 3],
        [n_inputs, n_outputs]: [usize; 2],
    ) -> Result<Self> {
        let terms: Vec<usize> =
            (0..all.len()).filter(|i| inputs.contains(&all[*i].input)).collect();
        let n_samples = q.len() / n_outputs;
        let is_used = |weight: &[f64]| weight.iter().any(|each| *each > 0.0);
        let places = |channels: &[usize], n_all: usize| -> Vec<usize> {
            (0..n_samples).flat_map(|k| channels.iter().map(move |i| k * n_all + i)).collect()
        };
        let errors = places(&outputs, n_outputs);
        let changes = if is_used(r) { places(&inputs, n_inputs) } else { Vec::new() };
        let inputs_at = if is_used(s) { places(&inputs, n_inputs) } else { Vec::new() };
        let n_used = errors.len() + changes.len();
        let n_rows = n_used + inputs_at.len();
        let allowed = VALUES_MAX / n_rows.max(1);
        if terms.len() > allowed {
            let what = "parameters of an axis";
            return Err(LearningError::TooMany { what, value: terms.len(), allowed });
        }
        let mut matrix = DMatrix::zeros(n_rows, terms.len());
        let (m, p) = (inputs.len(), outputs.len());
        let (mut u, mut y) = (vec![0.0; n_samples * m], vec![0.0; n_samples * p]);
        for (mut column, term) in matrix.column_iter_mut().zip(terms.iter().map(|i| &all[*i])) {
            let own = inputs.iter().position(|i| *i == term.input).unwrap_or(0);
            u.fill(0.0);
            u.iter_mut().skip(own).step_by(m).zip(&term.signal).for_each(|(u, psi)| *u = *psi);
            if p > 0 {
                answer.forward(&u, &mut y);
            }
            let weighed = errors.iter().zip(&y).map(|(at, y)| q[*at] * y);
            let weighed = weighed.chain(changes.iter().zip(&u).map(|(at, u)| r[*at] * u));
            let weighed = weighed.chain(inputs_at.iter().zip(&u).map(|(at, u)| s[*at] * u));
            column.iter_mut().zip(weighed).for_each(|(place, value)| *place = value);
        }
        let mut fit = Fit::new(matrix);
        // The next input has zero as its aim: its rows never count on the right.
        fit.inverse = fit.inverse.columns(0, n_used).into_owned();
        let rows = errors.into_iter().map(Row::Error).chain(changes.into_iter().map(Row::Change));
        let n = terms.len();
        let (left, found) = (DVector::zeros(n), DVector::zeros(n));
        Ok(Self { terms, rows: rows.collect(), fit, left, right: DVector::zeros(n_used), found })
    }

    /// Sets the parameters that stay where a run does not determine them.
    pub(super) fn begin_with(&mut self, start: &[f64]) {
        let own = self.terms.iter().map(|i| start[*i]);
        self.left = self.fit.left(&DVector::from_iterator(self.terms.len(), own));
    }

    /// Writes the parameters of the group, of what its answer should have been.
    pub(super) fn solve(
        &mut self,
        wanted: &[f64],
        input: &[f64],
        [q, r]: [&[f64]; 2],
        theta: &mut [f64],
    ) {
        for (right, row) in self.right.iter_mut().zip(&self.rows) {
            *right = match *row {
                Row::Error(at) => q[at] * wanted[at],
                Row::Change(at) => r[at] * input[at],
            };
        }
        self.found.copy_from(&self.left);
        self.found.gemv(1.0, &self.fit.inverse, &self.right, 1.0);
        for (place, term) in self.terms.iter().enumerate() {
            theta[*term] = self.found[place];
        }
    }

    /// Adds the transpose of [`Group::solve`].
    pub(super) fn transposed(
        &self,
        weighed: &[f64],
        [q, r]: [&[f64]; 2],
        to_wanted: &mut [f64],
        to_input: &mut [f64],
    ) {
        let own = self.terms.iter().map(|i| weighed[*i]);
        let own = DVector::from_iterator(self.terms.len(), own);
        let right = self.fit.inverse.tr_mul(&own);
        for (right, row) in right.iter().zip(&self.rows) {
            match *row {
                Row::Error(at) => to_wanted[at] += q[at] * right,
                Row::Change(at) => to_input[at] += r[at] * right,
            }
        }
    }
}
