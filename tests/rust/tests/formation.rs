//! Coordinated learning of several agents: the printed tables of [barton2010], Appendix I, and the
//! effect of each objective on the agents of that example.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal};
use ilc_rt::learning::weights::{Formation, Objective, Weight};
use ilc_rt::model::{Method, StateSpace, discretize, from_transfer_function};
use nalgebra::DMatrix;
use serde_json::Value;

const GOLDEN: &str = include_str!("../../golden/barton2010_appendix_i.json");
const N_SAMPLES: usize = 5;

fn golden() -> Value {
    serde_json::from_str(GOLDEN).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The six axes, block-diagonal, each `G / (1 + 0.425 G)` with `G = 1 / (m s^2 + b s)`.
fn agents(golden: &Value) -> StateSpace {
    let dt_s = golden["dt_s"].as_f64().unwrap();
    let gain = golden["controller_gain"].as_f64().unwrap();
    let controller =
        StateSpace::static_gain(DMatrix::from_element(1, 1, gain), Some(dt_s)).unwrap();
    let axes = numbers(&golden["mass"]).into_iter().zip(numbers(&golden["damping"]));
    axes.map(|(mass, damping)| {
        let axis = from_transfer_function(&[1.0], &[mass, damping, 0.0], None).unwrap();
        let axis = discretize(&axis, dt_s, Method::ZeroOrderHold).unwrap();
        axis.feedback(&controller).unwrap()
    })
    .reduce(|all, axis| all.append(&axis).unwrap())
    .unwrap()
}

/// References of the three agents, `N_SAMPLES` x 6.
fn reference(golden: &Value) -> Vec<f64> {
    let (x, y) = (numbers(&golden["reference_x"]), numbers(&golden["reference_y"]));
    let leader: Vec<f64> = x.into_iter().zip(y).flat_map(|(x, y)| [x, y]).collect();
    Formation::new(3, 2).unwrap().follow(&leader, &[0.0; 6]).unwrap()
}

struct Learned {
    input: Vec<f64>,
    error: Vec<f64>,
}

fn learn(golden: &Value, objective: &Objective, updates: usize) -> Learned {
    let (plant, reference) = (agents(golden), reference(golden));
    let formation = Formation::new(3, 2).unwrap();
    let number = |key: &str| golden[key].as_f64().unwrap();
    // The effort is weighted agent by agent, whatever the error's weight.
    let effort = formation.weight(N_SAMPLES, &Objective::individual()).unwrap().at(0, 6);
    let cost = Cost {
        q: formation.weight(N_SAMPLES, objective).unwrap(),
        s: Weight::Block(&effort * number("s")),
        r: Weight::Block(&effort * number("r")),
        rate: 0.0,
    };
    let mut law = NormOptimal::new(&plant, N_SAMPLES, cost).unwrap();
    let mut input = vec![0.0; reference.len()];
    let mut next = input.clone();
    let errors = |input: &[f64]| -> Vec<f64> {
        let output = plant.simulate(input, None).unwrap();
        reference.iter().zip(output).map(|(r, y)| r - y).collect()
    };
    for _ in 0..updates {
        law.update(&input, &errors(&input), &mut next).unwrap();
        std::mem::swap(&mut input, &mut next);
    }
    let error = errors(&input);
    Learned { input, error }
}

/// Compares one channel with a printed row, to half a unit of its last digit.
fn printed(what: &str, found: &[f64], channel: usize, expected: &Value, decimals: &Value) {
    let expected = numbers(expected);
    let n_channels = found.len() / expected.len();
    let tolerance = 0.500_000_1 * 10.0_f64.powf(-decimals.as_f64().unwrap());
    for (k, expected) in expected.into_iter().enumerate() {
        let found = found[k * n_channels + channel];
        assert!((found - expected).abs() <= tolerance, "{what}[{k}]: {found} is not {expected}");
    }
}

#[test]
fn the_printed_tables_come_out_to_the_last_digit() {
    let golden = golden();
    let updates = usize::try_from(golden["updates"].as_u64().unwrap()).unwrap();
    let learned = learn(&golden, &Objective::individual(), updates);
    for (channel, name) in ["x1", "y1", "x2", "y2", "x3", "y3"].into_iter().enumerate() {
        let (input, error) = (&golden["input"][name], &golden["error"][name]);
        printed(name, &learned.input, channel, input, &golden["input_decimals"]);
        printed(name, &learned.error, channel, error, &golden["error_decimals"]);
    }
    let shape = Formation::new(3, 2).unwrap().errors(&learned.error).unwrap();
    for (channel, name) in ["d1", "d2", "d3", "h1", "h2", "h3"].into_iter().enumerate() {
        let row = &golden["formation_error"][name];
        printed(name, &shape, channel, &row["values"], &row["decimals"]);
    }
}

/// Sums of squares of tracking errors, of the centre's error, and of formation errors.
fn sums(learned: &Learned) -> [f64; 3] {
    let formation = Formation::new(3, 2).unwrap();
    let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let centre: Vec<f64> = learned
        .error
        .chunks(6)
        .flat_map(|sample| {
            [0, 1].map(|axis| (sample[axis] + sample[axis + 2] + sample[axis + 4]) / 3.0)
        })
        .collect();
    [square(&learned.error), square(&centre), square(&formation.errors(&learned.error).unwrap())]
}

#[test]
fn each_objective_serves_what_it_weighs() {
    let golden = golden();
    let of = |objective: &Objective| sums(&learn(&golden, objective, 5));
    let none = sums(&learn(&golden, &Objective::individual(), 0));
    let individual = of(&Objective::individual());
    let shape = of(&Objective::shape());
    let centred = of(&Objective::centred());
    let both = of(&Objective::individual().with_tracking_share(0.5));
    // Equal references: doing nothing keeps the formation, which is all that the shape objective
    // asks for.
    assert!((shape[0] - none[0]).abs() < 1e-9 && shape[2] < 1e-20);
    // Each objective is best at its own term.
    assert!(individual[0] < 1e-3 * none[0] && individual[0] < centred[0]);
    assert!(centred[1] < 1e-3 * none[1]);
    // The mixture keeps the formation better than tracking alone, and still tracks.
    assert!(both[2] < individual[2] && both[0] < 1e-2 * none[0]);
}

#[test]
fn followers_come_along_with_a_leader_through_the_formation_alone() {
    let golden = golden();
    let led = Objective::led_by(3, &[0]).unwrap();
    let alone = learn(&golden, &led, 5);
    let input_of = |learned: &Learned, agent: usize| {
        learned.input.chunks(6).map(|u| u[2 * agent].abs() + u[2 * agent + 1].abs()).sum::<f64>()
    };
    assert!(input_of(&alone, 0) > 1.0 && input_of(&alone, 1) == 0.0 && input_of(&alone, 2) == 0.0);
    let together = sums(&learn(&golden, &led.with_tracking_share(0.5), 40));
    let none = sums(&learn(&golden, &Objective::individual(), 0));
    assert!(together[0] < 1e-2 * none[0], "{together:?} of {none:?}");
}
