//! Groups of axes that act on each other; separate groups are solved separately.

use nalgebra::DMatrix;

use crate::model::{ModelError, StateSpace};

/// One group of coupled axes: its model, and where its signals lie among those of the machine.
#[derive(Debug)]
pub(in crate::learning::law) struct Part {
    pub(in crate::learning::law) model: StateSpace,
    pub(in crate::learning::law) inputs: Vec<usize>,
    pub(in crate::learning::law) outputs: Vec<usize>,
}

/// Returns the groups that the zeros of `A`, `B`, `C` and `D` leave unconnected, each with an input.
///
/// Every input is in exactly one group. Outputs and states that no input can be connected to have no
/// part in learning.
pub(in crate::learning::law) fn parts(model: &StateSpace) -> Result<Vec<Part>, ModelError> {
    let (n, m, p) = (model.n_states(), model.n_inputs(), model.n_outputs());
    let (state, input, output) = (|i: usize| i, |i: usize| n + i, |i: usize| n + m + i);
    let mut group: Vec<usize> = (0..n + m + p).collect();
    let connect = |matrix: &DMatrix<f64>,
                   rows: &dyn Fn(usize) -> usize,
                   cols: &dyn Fn(usize) -> usize,
                   group: &mut Vec<usize>| {
        for row in 0..matrix.nrows() {
            for col in 0..matrix.ncols() {
                if matrix[(row, col)] != 0.0 {
                    let (keep, drop) = (group[rows(row)], group[cols(col)]);
                    for member in group.iter_mut().filter(|member| **member == drop) {
                        *member = keep;
                    }
                }
            }
        }
    };
    connect(model.a(), &state, &state, &mut group);
    connect(model.b(), &state, &input, &mut group);
    connect(model.c(), &output, &state, &mut group);
    connect(model.d(), &output, &input, &mut group);

    let mut parts: Vec<Part> = Vec::new();
    for first in 0..m {
        let id = group[input(first)];
        if (0..first).any(|earlier| group[input(earlier)] == id) {
            continue;
        }
        let members = |count: usize, node: &dyn Fn(usize) -> usize| -> Vec<usize> {
            (0..count).filter(|i| group[node(*i)] == id).collect()
        };
        let states = members(n, &state);
        let inputs = members(m, &input);
        let outputs = members(p, &output);
        let pick = |matrix: &DMatrix<f64>, rows: &[usize], cols: &[usize]| {
            DMatrix::from_fn(rows.len(), cols.len(), |row, col| matrix[(rows[row], cols[col])])
        };
        let model = StateSpace::new(
            pick(model.a(), &states, &states),
            pick(model.b(), &states, &inputs),
            pick(model.c(), &outputs, &states),
            pick(model.d(), &outputs, &inputs),
            model.dt_s(),
        )?;
        parts.push(Part { model, inputs, outputs });
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::from_transfer_function;

    #[test]
    fn axes_side_by_side_come_apart_and_a_coupled_pair_does_not() {
        let axis = from_transfer_function(&[1.0, 0.2], &[1.0, -0.5, 0.1], Some(1.0)).unwrap();
        let two = axis.append(&axis.delayed(1).unwrap()).unwrap();
        let split = parts(&two).unwrap();
        assert_eq!(split.len(), 2);
        assert_eq!((&split[1].inputs, &split[1].outputs), (&vec![1], &vec![1]));
        assert_eq!(split[1].model.n_states(), 3);

        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 2.5e-3, 0.0, 1.0]);
        let skewed = two.series(&StateSpace::static_gain(skew, Some(1.0)).unwrap()).unwrap();
        let whole = parts(&skewed).unwrap();
        assert_eq!(whole.len(), 1);
        assert_eq!(whole[0].inputs, [0, 1]);
    }

    #[test]
    fn an_input_without_effect_is_a_group_of_its_own() {
        let gain = DMatrix::from_row_slice(1, 2, &[2.0, 0.0]);
        let split = parts(&StateSpace::static_gain(gain, Some(1.0)).unwrap()).unwrap();
        assert_eq!(split.len(), 2);
        assert_eq!((&split[1].inputs, split[1].outputs.len()), (&vec![1], 0));
    }
}
