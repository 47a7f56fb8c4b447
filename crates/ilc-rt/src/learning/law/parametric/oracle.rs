//! The law against dense normal equations, on plants that differ from the model, and from program to program.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::model::{Method, StateSpace, TimeVarying, discretize, second_order};

const N: usize = 120;
const DT_S: f64 = 2e-3;

fn axis(omega: f64, damping: f64, delay: usize) -> StateSpace {
    let model = second_order(omega, damping).unwrap();
    discretize(&model, DT_S, Method::ZeroOrderHold).unwrap().delayed(delay).unwrap()
}

/// Smooth programs of two axes.
fn program(n: usize, size: f64) -> Vec<f64> {
    let bump = |k: usize, turn: f64| (turn * k as f64 / n as f64).sin().powi(4);
    (0..n).flat_map(|k| [size * bump(k, 3.1), -0.6 * size * bump(k, 6.2)]).collect()
}

fn noise(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|k| 1e-3 * ((k as f64 * seed).sin() + (k as f64 * 1.7 * seed).cos())).collect()
}

fn terms(reference: &[f64], functions: &[Function], lead: usize) -> Vec<Term> {
    let of =
        |input: usize| -> Vec<f64> { reference.iter().skip(input).step_by(2).copied().collect() };
    let term = |input: usize, function: Function| Term {
        input,
        name: function.name(),
        signal: function.signal(&of(input), DT_S, lead),
        function: Some((function, lead)),
    };
    (0..2)
        .flat_map(|input| functions.iter().map(move |f| (input, *f)))
        .map(|(i, f)| term(i, f))
        .collect()
}

fn motion(names: &[MotionFunction]) -> Vec<Function> {
    names.iter().map(|name| Function::Motion(*name)).collect()
}

fn told() -> Told {
    ("basis_functions", serde_json::json!({}))
}

use MotionFunction::{Acceleration, Coulomb, Position, Velocity};

/// Axes that are coupled, and axes that are not.
fn models() -> [StateSpace; 2] {
    let apart = axis(94.0, 0.7, 2).append(&axis(70.0, 0.9, 1)).unwrap();
    let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.2, 0.1, 1.0]);
    let skew = StateSpace::static_gain(skew, Some(DT_S)).unwrap();
    [apart.clone(), apart.series(&skew).unwrap()]
}

#[test]
fn an_update_is_that_of_the_dense_normal_equations() {
    let reference = program(N, 0.02);
    let functions = motion(&[Position, Velocity, Acceleration]);
    let terms = terms(&reference, &functions, 3);
    let psi = DMatrix::from_fn(2 * N, 6, |row, column| {
        let term = &terms[column];
        if row % 2 == term.input { term.signal[row / 2] } else { 0.0 }
    });
    let q: Vec<f64> = (0..2 * N).map(|k| 1.0 + 0.5 * (k as f64 * 0.3).sin()).collect();
    for model in models() {
        for (s, r) in [(0.0, 0.0), (0.02, 0.0), (0.0, 0.3), (0.01, 0.1)] {
            let weights = Diagonal { q: q.clone(), s: vec![s; 2], r: vec![r; 2] };
            let mut law = Parametric::new(told(), &model, terms.clone(), N, &weights).unwrap();
            let (u, e) = (noise(2 * N, 0.7), noise(2 * N, 1.3));
            let mut next = vec![f64::NAN; 2 * N];
            law.update(&u, &e, &mut next).unwrap();

            let (u, e) = (DVector::from_vec(u), DVector::from_vec(e));
            let lifted = model.lifted(N).unwrap();
            let predicted = &lifted * &psi;
            let weigh = DMatrix::from_diagonal(&DVector::from_column_slice(&q));
            let left = predicted.tr_mul(&weigh) * &predicted + psi.tr_mul(&psi) * (s + r);
            let right = predicted.tr_mul(&weigh) * (e + &lifted * &u) + psi.tr_mul(&u) * r;
            let expected = &psi * left.lu().solve(&right).unwrap();
            for (found, expected) in next.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-7 * expected.abs().max(1e-3), "{s} {r}");
            }
        }
    }
}

#[test]
fn the_adjoint_is_the_transpose_and_a_model_for_each_sample_the_same() {
    let reference = program(N, 0.02);
    let terms = terms(&reference, &motion(&[Velocity, Acceleration, Coulomb]), 2);
    let weights = Diagonal::uniform([1.0, 0.01, 0.2], 2, 2);
    for model in models() {
        let mut law = Parametric::new(told(), &model, terms.clone(), N, &weights).unwrap();
        let varying = TimeVarying::new(vec![model.clone(); N]).unwrap();
        let mut other = Parametric::new(told(), &varying, terms.clone(), N, &weights).unwrap();
        let (u, e, dual) = (noise(2 * N, 0.7), noise(2 * N, 1.3), noise(2 * N, 0.4));
        let (mut next, mut same) = (vec![0.0; 2 * N], vec![0.0; 2 * N]);
        law.update(&u, &e, &mut next).unwrap();
        other.update(&u, &e, &mut same).unwrap();
        assert!(next.iter().zip(&same).all(|(a, b)| (a - b).abs() < 1e-12));
        let (mut to_u, mut to_e) = (vec![0.0; 2 * N], vec![0.0; 2 * N]);
        assert!(law.apply_adjoint(&dual, &mut to_u, &mut to_e).unwrap());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (forward, back) = (dot(&next, &dual), dot(&u, &to_u) + dot(&e, &to_e));
        assert!((forward - back).abs() < 1e-9 * forward.abs(), "{forward} {back}");
    }
}

/// Runs the law on a plant with an error of its own, and returns the RMS error of each run.
fn learn(law: &mut Parametric, plant: &StateSpace, reference: &[f64], runs: usize) -> Vec<f64> {
    let n = reference.len() / 2;
    let lifted = plant.lifted(n).unwrap();
    let mut u = vec![0.0; 2 * n];
    let mut rms = Vec::new();
    for _ in 0..runs {
        let y = &lifted * DVector::from_column_slice(&u);
        let e: Vec<f64> = reference.iter().zip(&y).map(|(r, y)| r - y).collect();
        rms.push((e.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt());
        let mut next = vec![0.0; 2 * n];
        law.update(&u, &e, &mut next).unwrap();
        u = next;
    }
    rms
}

#[test]
fn what_is_learned_on_another_plant_is_taken_over_to_another_program() {
    let model = axis(94.0, 0.7, 0).append(&axis(80.0, 0.6, 0)).unwrap();
    let plant = axis(80.0, 0.5, 1).append(&axis(70.0, 0.8, 1)).unwrap();
    let functions = motion(&[Position, Velocity, Acceleration]);
    let law_of = |reference: &[f64]| {
        let n = reference.len() / 2;
        let weights = Diagonal::uniform([1.0, 0.0, 0.0], 2, 2);
        Parametric::new(told(), &model, terms(reference, &functions, 1), n, &weights).unwrap()
    };
    let here = program(N, 0.02);
    let mut law = law_of(&here);
    let rms = learn(&mut law, &plant, &here, 8);
    assert!(rms[7] < 0.02 * rms[0] && rms.windows(2).take(3).all(|w| w[1] < w[0]), "{rms:?}");
    let mut learned = vec![0.0; 2 * N];
    law.input_of(&law.theta, &mut learned);

    let there = program(2 * N, -0.05);
    let mut other = law_of(&there);
    assert!(other.first_input().unwrap().is_none());
    assert!(other.take_over(&here, &learned).unwrap());
    for (found, expected) in other.parameters().iter().zip(law.parameters()) {
        assert!((found - expected).abs() < 1e-6 * expected.abs().max(1e-3), "{found} {expected}");
    }
    let u = other.first_input().unwrap().unwrap();
    let y = plant.lifted(2 * N).unwrap() * DVector::from_vec(u);
    let largest = |x: &[f64]| x.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    let e: Vec<f64> = there.iter().zip(&y).map(|(r, y)| r - y).collect();
    assert!(largest(&e) < 0.02 * largest(&there), "{}", largest(&e));
    // A reset goes back to what was taken over.
    let before = other.parameters().to_vec();
    learn(&mut other, &plant, &there, 2);
    assert_ne!(other.parameters(), before);
    other.reset();
    assert_eq!(other.parameters(), before);
}

#[test]
fn what_the_program_does_not_excite_stays() {
    let model = axis(94.0, 0.7, 0).append(&axis(80.0, 0.6, 0)).unwrap();
    // The second axis rests.
    let reference: Vec<f64> = program(N, 0.02).chunks(2).flat_map(|both| [both[0], 0.01]).collect();
    let weights = Diagonal::uniform([1.0, 0.0, 0.0], 2, 2);
    let terms = terms(&reference, &motion(&[Velocity]), 1);
    let law = Parametric::new(told(), &model, terms.clone(), N, &weights).unwrap();
    let mut law = law.starting_with(&[0.3, 0.4], true).unwrap();
    let mut next = vec![0.0; 2 * N];
    law.update(&vec![0.0; 2 * N], &noise(2 * N, 0.5), &mut next).unwrap();
    let bits: Vec<u64> = law.parameters().iter().map(|value| value.to_bits()).collect();
    assert!(bits[0] != 0.3_f64.to_bits() && bits[1] == 0.4_f64.to_bits());
    let law = Parametric::new(told(), &model, terms, N, &weights).unwrap();
    let mut law = law.starting_with(&[0.3, 0.4], false).unwrap();
    law.update(&vec![0.0; 2 * N], &noise(2 * N, 0.5), &mut next).unwrap();
    let first = law.first_input().unwrap();
    assert_eq!((law.parameters(), Some(next)), ([0.3, 0.4].as_slice(), first));
}

#[test]
fn a_table_learns_cogging_at_one_speed_for_another() {
    let model = axis(94.0, 0.7, 0).append(&axis(80.0, 0.6, 0)).unwrap();
    let pitch_m = 0.02;
    let wave = |r: f64| 1e-4 * (std::f64::consts::TAU * r / pitch_m + 0.4).sin();
    let sweep = |n: usize| -> Vec<f64> {
        let there = |k: usize| 0.05 * (1.0 - (std::f64::consts::TAU * k as f64 / n as f64).cos());
        (0..n).flat_map(|k| [there(k), 0.5 * there(k)]).collect()
    };
    let cogging = |reference: &[f64]| -> Vec<f64> { reference.iter().map(|r| -wave(*r)).collect() };
    let entry = |place: i32| Function::Entry {
        at_m: f64::from(place) * 0.0025,
        spacing_m: 0.0025,
        travel: Travel::Both,
    };
    let table: Vec<Function> = (-1..=41).map(entry).collect();
    let weights = Diagonal::uniform([1.0, 0.0, 1e-6], 2, 2);
    let (slow, fast) = (sweep(2400), sweep(1600));
    let law_of = |reference: &[f64]| {
        let n = reference.len() / 2;
        Parametric::new(told(), &model, terms(reference, &table, 1), n, &weights).unwrap()
    };
    let (mut law, mut learned) = (law_of(&slow), vec![0.0; slow.len()]);
    law.update(&vec![0.0; slow.len()], &cogging(&slow), &mut learned).unwrap();
    let mut other = law_of(&fast);
    assert!(other.take_over(&slow, &learned).unwrap());
    let u = other.first_input().unwrap().unwrap();
    let mut y = vec![0.0; u.len()];
    Answer::new(OwnPlant::Invariant(model)).forward(&u, &mut y);
    let square = |signal: &[f64]| signal.iter().map(|e| e * e).sum::<f64>();
    let before = cogging(&fast);
    let after: Vec<f64> = before.iter().zip(&y).map(|(e, y)| e - y).collect();
    // Apart from the start, where the model is still at rest. The lag of the axis is that of the speed, and of
    // both directions: a part is left.
    let left = square(&after[160..]) / square(&before[160..]);
    assert!(left < 0.3, "{left}");
}
