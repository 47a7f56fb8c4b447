//! Decoupling: groups of coupled axes, which are solved separately.

use nalgebra::DMatrix;

use super::cost::Cost;
use super::plant::{OwnPlant, Plant};
use crate::model::{ModelError, StateSpace, TimeVarying};

/// One group of coupled axes: its model, its cost, and the indices of its signals among those of
/// the machine.
#[derive(Debug)]
pub(in crate::learning::law) struct Part {
    pub(in crate::learning::law) plant: OwnPlant,
    pub(in crate::learning::law) cost: Cost,
    pub(in crate::learning::law) inputs: Vec<usize>,
    pub(in crate::learning::law) outputs: Vec<usize>,
}

/// Returns the groups that are decoupled at every sample by the zeros of `A`, `B`, `C`, `D` and of
/// the weights, each with an input.
///
/// Every input is in exactly one group. Outputs and states that no input affects do not take part
/// in learning.
pub(in crate::learning::law) fn parts(plant: Plant, cost: &Cost) -> Result<Vec<Part>, ModelError> {
    let first = plant.at(0);
    let (n, m, p) = (first.n_states(), first.n_inputs(), first.n_outputs());
    let (state, input, output) = (|i: usize| i, |i: usize| n + i, |i: usize| n + m + i);
    let mut group: Vec<usize> = (0..n + m + p).collect();
    let mut connect = |row: usize, col: usize| {
        let (keep, drop) = (group[row], group[col]);
        if keep != drop {
            for member in group.iter_mut().filter(|member| **member == drop) {
                *member = keep;
            }
        }
    };
    for model in plant.distinct() {
        each_entry(model.a(), |row, col| connect(state(row), state(col)));
        each_entry(model.b(), |row, col| connect(state(row), input(col)));
        each_entry(model.c(), |row, col| connect(output(row), state(col)));
        each_entry(model.d(), |row, col| connect(output(row), input(col)));
    }
    for row in 0..p {
        for col in (0..row).filter(|col| cost.q.couples(row, *col)) {
            connect(output(row), output(col));
        }
    }
    for row in 0..m {
        let coupled = |col: &usize| cost.s.couples(row, *col) || cost.r.couples(row, *col);
        for col in (0..row).filter(coupled) {
            connect(input(row), input(col));
        }
    }

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
        let select = |model: &StateSpace| {
            StateSpace::new(
                pick(model.a(), &states, &states),
                pick(model.b(), &states, &inputs),
                pick(model.c(), &outputs, &states),
                pick(model.d(), &outputs, &inputs),
                model.dt_s(),
            )
        };
        let plant = match plant {
            Plant::Invariant(model) => OwnPlant::Invariant(select(model)?),
            Plant::Varying(model) => {
                let samples: Result<_, _> = model.samples().iter().map(select).collect();
                OwnPlant::Varying(TimeVarying::new(samples?)?)
            }
        };
        parts.push(Part { plant, cost: cost.select(&inputs, &outputs), inputs, outputs });
    }
    Ok(parts)
}

/// Calls `found` with the position of each non-zero entry.
fn each_entry(matrix: &DMatrix<f64>, mut found: impl FnMut(usize, usize)) {
    for (index, value) in matrix.iter().enumerate() {
        if *value != 0.0 {
            found(index % matrix.nrows(), index / matrix.nrows());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Weights;
    use super::*;
    use crate::learning::weights::Weight;
    use crate::model::from_transfer_function;

    fn parts(model: &StateSpace) -> Result<Vec<Part>, ModelError> {
        super::parts(model.into(), &Weights::default().into())
    }

    #[test]
    fn axes_side_by_side_come_apart_and_a_coupled_pair_does_not() {
        let axis = from_transfer_function(&[1.0, 0.2], &[1.0, -0.5, 0.1], Some(1.0)).unwrap();
        let two = axis.append(&axis.delayed(1).unwrap()).unwrap();
        let split = parts(&two).unwrap();
        assert_eq!(split.len(), 2);
        assert_eq!((&split[1].inputs, &split[1].outputs), (&vec![1], &vec![1]));
        assert_eq!(split[1].plant.borrow().at(0).n_states(), 3);

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

    #[test]
    fn weights_across_axes_keep_them_together() {
        let axis = from_transfer_function(&[1.0, 0.2], &[1.0, -0.5, 0.1], Some(1.0)).unwrap();
        let two = axis.append(&axis).unwrap();
        let block = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let apart = Weight::Block(DMatrix::from_diagonal_element(2, 2, 2.0));
        let plain = Cost::from(Weights::default());
        for (cost, count) in [
            (Cost { q: apart.clone(), s: apart, ..plain.clone() }, 2),
            (Cost { q: Weight::Block(block.clone()), ..plain.clone() }, 1),
            (Cost { s: Weight::Block(block.clone()), ..plain.clone() }, 1),
            (Cost { r: Weight::Blocks(vec![block; 3]), ..plain }, 1),
        ] {
            assert_eq!(super::parts((&two).into(), &cost).unwrap().len(), count, "{cost:?}");
        }
    }

    #[test]
    fn axes_that_meet_at_one_sample_only_stay_together() {
        let axis = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
        let two = axis.append(&axis).unwrap();
        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0]);
        let skewed = two.series(&StateSpace::static_gain(skew, Some(1.0)).unwrap()).unwrap();
        let cost = Cost::from(Weights::default());
        let apart = TimeVarying::new(vec![two.clone(); 3]).unwrap();
        assert_eq!(super::parts((&apart).into(), &cost).unwrap().len(), 2);
        let met = TimeVarying::new(vec![two.clone(), skewed, two]).unwrap();
        assert_eq!(super::parts((&met).into(), &cost).unwrap().len(), 1);
    }
}
