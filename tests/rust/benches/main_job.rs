//! Speed of the main job, as ratios measured in one run: the learning update relative to the dense
//! solution, and a campaign in lock-step relative to the machine time it represents.

#![expect(clippy::print_stdout, reason = "a benchmark tells what it measured")]

use std::error::Error;
use std::time::{Duration, Instant};

use ilc_rt::campaign::{self, Options};
use ilc_rt::cli::parse;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::transport::loopback::InProcess;
use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};
use ilc_rt::model::{Method, StateSpace, discretize, second_order};
use ilc_sim::{ClockMode, Machine};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

const N_SAMPLES: usize = 1300;
const DT_S: f64 = 0.001;
const RATE: f64 = 3.0;
const REPEATS: usize = 21;

fn main() -> Result<(), Box<dyn Error>> {
    update_against_dense()?;
    for (n_axes, n_runs) in [(2, 10), (2, 100), (6, 20), (12, 20)] {
        lockstep_against_real_time(n_axes, n_runs)?;
    }
    Ok(())
}

/// The example gantry, its pair of axes repeated; with more than one pair it learns from the drives.
fn gantry(n_pairs: usize) -> Result<Cell, Box<dyn Error>> {
    let text = std::fs::read_to_string(ilc_tests::root().join("examples/01_gantry.toml"))?;
    let first = text.find("[[axis]]").ok_or("no axes")?;
    let (pair, rest) = text[first..].split_once("[tcp_encoder]").ok_or("no encoder")?;
    if n_pairs == 1 {
        return Ok(Cell::parse(&text, "gantry.toml")?);
    }
    let (_, rest) = rest.split_once("[program]").ok_or("no program")?;
    let mut cell = text[..first].to_owned();
    for i in 0..n_pairs {
        let names =
            pair.replace("\"x\"", &format!("\"x{i}\"")).replace("\"y\"", &format!("\"y{i}\""));
        let nodes = names.replace("node = 2", &format!("node = {}", 2 * i + 2));
        cell += &nodes.replace("node = 1", &format!("node = {}", 2 * i + 1));
    }
    let points = rest.lines().map(|line| match line.split_once(" = [") {
        Some((key, point)) => {
            format!("{key} = [{}]", vec![point.trim_end_matches(']'); n_pairs].join(", "))
        }
        None => line.replace("\"tcp\"", "\"encoder\""),
    });
    cell += "[program]";
    cell += &points.collect::<Vec<_>>().join("\n");
    Ok(Cell::parse(&cell, "gantry.toml")?)
}

/// Median time of `work`.
fn median(mut work: impl FnMut()) -> Duration {
    let mut times: Vec<Duration> = (0..REPEATS)
        .map(|_| {
            let began = Instant::now();
            work();
            began.elapsed()
        })
        .collect();
    times.sort();
    times[REPEATS / 2]
}

fn update_against_dense() -> Result<(), Box<dyn Error>> {
    let axis = discretize(&second_order(157.0, 0.5)?, DT_S, Method::ZeroOrderHold)?;
    let weights = Weights { q: 1.0, s: 0.0, r: 0.0, rate: RATE };
    let one = time_update(&axis, weights, 1)?;
    let two = time_update(&axis.append(&axis)?, weights, 2)?;
    println!("update, N = {N_SAMPLES}: {one:.1?} for one axis, {two:.1?} for two");

    // The textbook method: H = P'P + d^2 D'D factorised once, then one solution per update.
    let plant = axis.lifted(N_SAMPLES + 1)?.view((1, 0), (N_SAMPLES, N_SAMPLES)).into_owned();
    let difference = DMatrix::from_fn(N_SAMPLES - 1, N_SAMPLES, |row, column| match column {
        _ if column == row => -1.0,
        _ if column == row + 1 => 1.0,
        _ => 0.0,
    });
    let h = plant.tr_mul(&plant) + RATE * RATE * difference.tr_mul(&difference);
    let factor: Cholesky<f64, Dyn> = h.cholesky().ok_or("H is not positive definite")?;
    let error = DVector::from_fn(N_SAMPLES, |k, _| (k as f64 * 0.01).sin());
    let dense = median(|| {
        std::hint::black_box(factor.solve(&plant.tr_mul(&error)));
    });
    println!(
        "dense solution with its factor kept: {dense:.1?}, {:.0} times as long",
        dense.as_secs_f64() / one.as_secs_f64()
    );
    Ok(())
}

fn time_update(
    model: &StateSpace,
    weights: Weights,
    n_axes: usize,
) -> Result<Duration, Box<dyn Error>> {
    let mut law = NormOptimal::new(model, N_SAMPLES, weights)?;
    let error: Vec<f64> = (0..N_SAMPLES * n_axes).map(|k| (k as f64 * 0.01).sin()).collect();
    let input = vec![0.0; error.len()];
    let mut next = input.clone();
    law.update(&input, &error, &mut next)?;
    Ok(median(|| {
        // Fails only for wrong lengths and non-finite numbers, which the update above has ruled
        // out.
        let _ = law.update(&input, &error, &mut next);
        std::hint::black_box(&next);
    }))
}

fn lockstep_against_real_time(n_axes: usize, n_runs: u32) -> Result<(), Box<dyn Error>> {
    let cell = gantry(n_axes / 2)?;
    let drives = Machine::from_cell(&cell, ClockMode::LockStep)?;
    let library = std::env::temp_dir().join(format!("ilc-bench-{}.db", std::process::id()));
    let mut options: Options = parse(&["--lockstep".to_owned(), "--no-telemetry".to_owned()])?;
    (options.iterations, options.session.library) = (n_runs, library.clone());
    let bus = Box::new(InProcess::new(drives, 1024));
    let began = Instant::now();
    let mut n_samples = 0;
    campaign::run(&cell, &options, bus, None, &mut |event| {
        if let ilc_rt::record::Event::Start { n_samples: n, .. } = event {
            n_samples = *n;
        }
    })?;
    let took = began.elapsed();
    std::fs::remove_file(&library)?;
    let a_run_s = n_samples as f64 * cell.cycle_s() + cell.program.settle_s;
    let stands_for_s = f64::from(n_runs) * a_run_s;
    println!(
        "lock-step, in process, every run kept on disk: {n_axes} axes, {n_runs} runs in {took:.3?}, \
         {:.0} times faster than real time",
        stands_for_s / took.as_secs_f64()
    );
    Ok(())
}
