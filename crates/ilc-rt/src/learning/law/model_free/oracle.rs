//! Gradient descent with a measured gradient, against dense matrices of the plant it runs on.

use super::*;
use crate::learning::analysis::{Question, analyze, divergence};
use crate::learning::gate::{Gate, GateRule};
use crate::learning::law::adjoint::Adjoint;
use crate::learning::law::q_filter::QFilter;
use crate::model::{Method, StateSpace, discretize, second_order};
use nalgebra::{DMatrix, DVector};

const N: usize = 60;
const DT_S: f64 = 2e-3;

fn axis(hz: f64, damping: f64) -> StateSpace {
    let model = second_order(std::f64::consts::TAU * hz, damping).unwrap();
    discretize(&model, DT_S, Method::ZeroOrderHold).unwrap()
}

/// Two unlike axes, one with dead time.
fn axes() -> StateSpace {
    axis(15.0, 0.7).append(&axis(30.0, 0.2).delayed(2).unwrap()).unwrap()
}

fn reference(n_channels: usize) -> Vec<f64> {
    let at = |k: usize, channel: usize| (0.11 * k as f64 * (1.0 + channel as f64)).sin();
    (0..N * n_channels).map(|i| at(i / n_channels, i % n_channels)).collect()
}

fn law(gain: Option<f64>, n_channels: usize) -> ModelFree {
    ModelFree::new(ModelFreeRule { gain, probe: 0.3 }, N, n_channels).unwrap()
}

/// Error of a run: that of the reference and a bias, e.g. by friction, which is the same in every run.
fn run(plant: &StateSpace, reference: &[f64], input: &[f64]) -> Vec<f64> {
    let y = plant.simulate(input, None).unwrap();
    reference.iter().zip(&y).map(|(r, y)| r - y - 0.1).collect()
}

/// Makes runs; returns purpose, input and error of each.
fn play(
    law: &mut dyn Law,
    plant: &StateSpace,
    n_runs: usize,
) -> Vec<(Purpose, Vec<f64>, Vec<f64>)> {
    let reference = reference(plant.n_outputs());
    let mut input = vec![0.0; reference.len()];
    (0..n_runs)
        .map(|_| {
            let error = run(plant, &reference, &input);
            let purpose = law.purpose();
            let mut next = vec![f64::NAN; input.len()];
            law.update(&input, &error, &mut next).unwrap();
            (purpose, std::mem::replace(&mut input, next), error)
        })
        .collect()
}

/// Returns the lifted system of one channel of a plant whose channels are decoupled.
fn lifted(plant: &StateSpace, channel: usize) -> DMatrix<f64> {
    let n = plant.n_inputs();
    let whole = plant.lifted(N).unwrap();
    DMatrix::from_fn(N, N, |i, j| whole[(i * n + channel, j * n + channel)])
}

fn channel(signal: &[f64], channel: usize, n: usize) -> DVector<f64> {
    DVector::from_iterator(N, signal.iter().skip(channel).step_by(n).copied())
}

#[test]
fn each_axis_follows_its_own_gradient_by_the_best_step() {
    use Purpose::{Learning, Probing, Searching};
    let plant = axes();
    let runs = play(&mut law(None, 2), &plant, 13);
    let purposes: Vec<Purpose> = runs.iter().map(|(purpose, ..)| *purpose).collect();
    assert_eq!(
        purposes[..7],
        [Learning, Probing, Searching, Learning, Probing, Searching, Learning]
    );
    for axis in 0..2 {
        let p = lifted(&plant, axis);
        let mut u = DVector::zeros(N);
        for (_, input, error) in runs.iter().step_by(3) {
            assert!((channel(input, axis, 2) - &u).amax() < 1e-10);
            let e = channel(error, axis, 2);
            let gradient = p.transpose() * &e;
            let along = &p * &gradient;
            u += &gradient * (e.dot(&along) / along.dot(&along));
        }
    }
}

#[test]
fn with_a_gain_two_runs_are_one_step_of_the_adjoint_of_this_plant() {
    let plant = axis(22.0, 0.4).delayed(1).unwrap();
    let gain = 0.4;
    let runs = play(&mut law(Some(gain), 1), &plant, 9);
    let mut adjoint = Adjoint::new(&plant, N, Some(gain), QFilter::None).unwrap();
    let reference = reference(1);
    let (mut u, mut next) = (vec![0.0; N], vec![0.0; N]);
    for (_, input, _) in runs.iter().step_by(2) {
        assert!(input.iter().zip(&u).all(|(a, b)| (a - b).abs() < 1e-12));
        adjoint.update(&u, &run(&plant, &reference, &u), &mut next).unwrap();
        u.copy_from_slice(&next);
    }
}

#[test]
fn no_run_exceeds_the_bound_and_a_smaller_probe_measures_the_same_gradient() {
    let plant = axis(22.0, 0.4);
    let free = play(&mut law(Some(0.4), 1), &plant, 3);
    let mut bounded = law(Some(0.4), 1).within(&[0.05]).unwrap();
    let runs = play(&mut bounded, &plant, 3);
    let largest = runs[1].1.iter().fold(0.0_f64, |max, value| max.max(value.abs()));
    assert!((largest - 0.05).abs() < 1e-15, "{largest}");
    for (found, expected) in runs[2].1.iter().zip(&free[2].1) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    // On its bound both ways there is no room: the input is kept, and it is said why.
    let mut full = law(None, 1).within(&[1.0]).unwrap();
    let input: Vec<f64> = (0..N).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let mut next = vec![0.0; N];
    full.update(&input, &[1.0; N], &mut next).unwrap();
    assert_eq!((next, full.purpose()), (input, Purpose::Learning));
    assert!(full.status().unwrap().contains("at its bound"));
}

#[test]
fn a_run_that_was_not_made_as_asked_is_made_again() {
    let (plant, reference) = (axis(22.0, 0.4), reference(1));
    let mut law = law(None, 1);
    let expected = play(&mut law.clone(), &plant, 4);
    let base = vec![0.0; N];
    let mut next = vec![0.0; N];
    law.update(&base, &run(&plant, &reference, &base), &mut next).unwrap();
    let probing = next.clone();
    // The update was late, so that the run repeated the old input: asked for again, as it was.
    law.update(&base, &run(&plant, &reference, &base), &mut next).unwrap();
    assert_eq!((&next, law.purpose()), (&probing, Purpose::Probing));
    // The loop limited some of it: half of it is asked for.
    let mut cut = probing.clone();
    cut[0] *= 0.2;
    cut[1] *= 0.5;
    law.update(&cut, &run(&plant, &reference, &cut), &mut next).unwrap();
    assert!(next.iter().zip(&probing).all(|(half, whole)| (half - 0.5 * whole).abs() < 1e-15));
    let (mut input, mut error);
    for _ in 0..2 {
        input = next.clone();
        error = run(&plant, &reference, &input);
        law.update(&input, &error, &mut next).unwrap();
    }
    assert_eq!(law.purpose(), Purpose::Learning);
    for (found, expected) in next.iter().zip(&expected[3].1) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // One that never comes as asked is given up, and the input kept.
    law.update(&base, &run(&plant, &reference, &base), &mut next).unwrap();
    for _ in 0..ATTEMPTS_MAX {
        assert_eq!(law.purpose(), Purpose::Probing);
        law.update(&base, &run(&plant, &reference, &base), &mut next).unwrap();
    }
    assert_eq!((&next, law.purpose()), (&base, Purpose::Learning));
    assert!(law.status().unwrap().contains("not applied as asked"));
}

#[test]
fn an_input_taken_back_begins_a_new_iteration() {
    let mut law = law(None, 1);
    play(&mut law, &axis(22.0, 0.4), 2);
    assert_eq!(law.purpose(), Purpose::Searching);
    law.on_rollback();
    assert_eq!(law.purpose(), Purpose::Learning);
    let (u, mut next) = (vec![0.3; N], vec![0.0; N]);
    law.update(&u, &[0.0; N], &mut next).unwrap();
    assert_eq!((next, law.purpose()), (u, Purpose::Learning), "without an error nothing is probed");
}

#[test]
fn a_gate_judges_learning_runs_alone() {
    let plant = axis(22.0, 0.4);
    let rule = GateRule { patience: 1, growth: 1.0, ..GateRule::default() };
    // A probe so large that the error of the probing runs is many times that of the first one.
    let wild = ModelFree::new(ModelFreeRule { gain: None, probe: 30.0 }, N, 1).unwrap();
    let alone = play(&mut wild.clone(), &plant, 13);
    let square = |error: &[f64]| -> f64 { error.iter().map(|e| e * e).sum() };
    assert!(square(&alone[1].2) > 50.0 * square(&alone[0].2));
    assert!(square(&alone[12].2) < 0.5 * square(&alone[0].2));
    assert_eq!(play(&mut Gate::new(wild, rule).unwrap(), &plant, 13), alone);
    // Within the tolerance the gate holds, and nothing is probed.
    let rule = GateRule { tolerance: 1e3, ..GateRule::default() };
    let held = play(&mut Gate::new(law(None, 1), rule).unwrap(), &plant, 5);
    assert!(held.iter().all(|(purpose, input, _)| {
        *purpose == Purpose::Learning && input.iter().all(|value| *value == 0.0)
    }));
}

#[test]
fn the_analysis_is_that_of_gradient_descent_on_the_plant_in_question() {
    for plant in [axis(22.0, 0.4), axis(9.0, 0.1).delayed(3).unwrap()] {
        let question = Question::default();
        let mut adjoint = Adjoint::new(&plant, N, None, QFilter::None).unwrap();
        let expected = analyze(&mut adjoint, &plant, N, &question).unwrap();
        let found = analyze(&mut law(None, 1), &plant, N, &question).unwrap();
        assert_eq!(found.monotonic_factor, expected.monotonic_factor);
        assert!(found.why.starts_with("as gradient descent on this model"), "{}", found.why);
        let verdict = divergence(&mut law(None, 1), &plant, N).unwrap().unwrap();
        assert!(verdict.converges && verdict.why.contains("between learning runs"));
        let limit = adjoint.gain_limit();
        let line = divergence(&mut law(Some(1.1 * limit), 1), &plant, N).unwrap_err().to_string();
        assert!(line.contains("gain"), "{line}");
    }
}

#[test]
fn parameters_out_of_range_are_refused() {
    for (gain, probe) in [(Some(0.0), 0.1), (Some(f64::NAN), 0.1), (None, 0.0), (None, f64::NAN)] {
        assert!(ModelFree::new(ModelFreeRule { gain, probe }, N, 1).is_err(), "{gain:?} {probe}");
    }
    assert!(ModelFree::new(ModelFreeRule::default(), 0, 1).is_err());
    assert!(law(None, 1).within(&[-1.0]).is_err() && law(None, 1).within(&[1.0; 2]).is_err());
}
