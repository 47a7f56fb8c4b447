//! Speed of the learning kernel, each figure relative to its bound.
//!
//! `update` relative to `memcpy` of the same signals; the time-varying sweep relative to a `triad`
//! over as many bytes; the dense solution with its factor kept relative to the sweep.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use faer::linalg::solvers::Solve;
use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal, Paired, Weights};
use ilc_rt::learning::sweep::{Form, Gains};
use ilc_rt::learning::weights::Weight;
use ilc_rt::model::{Method, ModelError, StateSpace, TimeVarying, discretize, second_order};
use nalgebra::DMatrix;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .configure_from_args();
    invariant(&mut criterion)?;
    sizes(&mut criterion)?;
    varying(&mut criterion)?;
    dense(&mut criterion)?;
    criterion.final_summary();
    Ok(())
}

fn axis() -> Result<StateSpace, ModelError> {
    discretize(&second_order(157.0, 0.5)?, 1e-3, Method::ZeroOrderHold)
}

fn wave(count: usize) -> Vec<f64> {
    (0..count).map(|k| (k as f64 * 0.01).sin()).collect()
}

const fn r(r: f64) -> Weights {
    Weights { q: 1.0, s: 0.0, r, rate: 0.0 }
}

/// One axis, constant weights: bound by the latency of the recursion, then by memory.
fn invariant(criterion: &mut Criterion) -> Outcome {
    let model = axis()?;
    let mut group = criterion.benchmark_group("one axis");
    for n_samples in [1000, 1300, 10_000, 100_000, 1_000_000] {
        group.throughput(Throughput::Elements(n_samples as u64));
        let (input, error) = (wave(n_samples), wave(n_samples));
        let mut next = input.clone();
        for (name, weights) in
            [("update, 2 states", r(1e-2)), ("update, rate", Weights { rate: 3.0, ..r(0.0) })]
        {
            let mut law = NormOptimal::new(&model, n_samples, weights)?;
            law.update(&input, &error, &mut next)?;
            group.bench_function(BenchmarkId::new(name, n_samples), |bencher| {
                bencher.iter(|| black_box(law.update(&input, &error, &mut next).is_ok()));
            });
        }
        let mut copies = [input.clone(), input.clone(), input.clone()];
        group.bench_function(BenchmarkId::new("memcpy of e, u, v", n_samples), |bencher| {
            bencher.iter(|| {
                for (copy, signal) in copies.iter_mut().zip([&input, &error, &next]) {
                    copy.copy_from_slice(signal);
                }
                black_box(&copies);
            });
        });
    }
    for n_samples in [1300, 1_000_000] {
        group.bench_function(BenchmarkId::new("factorisation", n_samples), |bencher| {
            bencher.iter(|| black_box(NormOptimal::new(&model, n_samples, r(1e-2)).is_ok()));
        });
    }
    group.finish();
    Ok(())
}

/// Many states and coupled axes, with code of their own up to 8 and 3, and beyond.
fn sizes(criterion: &mut Criterion) -> Outcome {
    const N_SAMPLES: usize = 1300;
    let mut group = criterion.benchmark_group("sizes, 1300 samples");
    let mut update = |name: BenchmarkId, model: &StateSpace| -> Outcome {
        let mut law = NormOptimal::new(model, N_SAMPLES, r(1e-2))?;
        let signal = wave(N_SAMPLES * model.n_inputs());
        let mut next = signal.clone();
        group.bench_function(name, |bencher| {
            bencher.iter(|| black_box(law.update(&signal, &signal, &mut next).is_ok()));
        });
        Ok(())
    };
    for in_series in [4, 6, 8] {
        let mut model = axis()?;
        for _ in 1..in_series {
            model = model.series(&axis()?)?;
        }
        update(BenchmarkId::new("states of one axis", model.n_states()), &model)?;
    }
    for n_axes in [3, 4, 6] {
        let mut model = axis()?;
        for _ in 1..n_axes {
            model = model.append(&axis()?)?;
        }
        let skew = DMatrix::from_fn(n_axes, n_axes, |i, j| if i == j { 1.0 } else { 0.1 });
        let model = model.series(&StateSpace::static_gain(skew, model.dt_s())?)?;
        update(BenchmarkId::new("coupled axes", n_axes), &model)?;
    }
    group.finish();
    Ok(())
}

/// Two axes coupled by a weight: different gains at every sample.
fn varying(criterion: &mut Criterion) -> Outcome {
    let model = axis()?.append(&axis()?)?;
    let mut group = criterion.benchmark_group("contour weight, two axes");
    for n_samples in [10_000, 200_000] {
        group.throughput(Throughput::Elements(n_samples as u64));
        let block = |k: usize| {
            let (s, c) = (k as f64 * 1e-3).sin_cos();
            DMatrix::from_row_slice(2, 2, &[c * c + 0.01, c * s, c * s, s * s + 0.01])
        };
        let q = Weight::Blocks((0..n_samples).map(block).collect());
        let cost = Cost { q, ..r(1e-2).into() };
        let mut law = NormOptimal::new(&model, n_samples, cost.clone())?;
        let (input, error) = (wave(2 * n_samples), wave(2 * n_samples));
        let mut next = input.clone();
        group.bench_function(BenchmarkId::new("update", n_samples), |bencher| {
            bencher.iter(|| black_box(law.update(&input, &error, &mut next).is_ok()));
        });
        drop(law);
        let paired = Paired::new(&model, n_samples, cost)?;
        for form in [Form::Joseph, Form::Cholesky, Form::SquareRoot] {
            let mut gains = Gains::with_form(&paired, paired.free_samples(), form)?;
            let name = BenchmarkId::new(format!("factorisation, {form:?}"), n_samples);
            group.bench_function(name, |bencher| {
                bencher.iter(|| black_box(gains.refactor(&paired).is_ok()));
            });
        }
    }
    let samples = vec![model; 20_000];
    let model = TimeVarying::new(samples)?;
    group.throughput(Throughput::Elements(20_000));
    group.bench_function("first, varying model/20000", |bencher| {
        bencher.iter(|| black_box(NormOptimal::new(&model, 20_000, r(1e-2)).is_ok()));
    });
    let (left, right) = (wave(8_000_000), wave(8_000_000));
    let mut sum = left.clone();
    group.throughput(Throughput::Bytes(24 * 8_000_000));
    group.bench_function("triad, 192 MB", |bencher| {
        bencher.iter(|| {
            for (sum, (left, right)) in sum.iter_mut().zip(left.iter().zip(&right)) {
                *sum = left + 3.0 * right;
            }
            black_box(&sum);
        });
    });
    group.finish();
    Ok(())
}

/// The textbook method: the normal equations factorised once, then one solution per update.
fn dense(criterion: &mut Criterion) -> Outcome {
    let model = axis()?;
    let mut group = criterion.benchmark_group("dense");
    for n_samples in [1300, 4000] {
        let markov = model.markov(n_samples + 1)?;
        let plant = faer::Mat::from_fn(n_samples, n_samples, |row, col| {
            if row >= col { markov[row - col + 1][(0, 0)] } else { 0.0 }
        });
        let weight = faer::Mat::<f64>::identity(n_samples, n_samples) * faer::Scale(1e-2);
        let h = plant.transpose() * &plant + weight;
        let factor = h.llt(faer::Side::Lower).map_err(|_| "not positive definite")?;
        let error = faer::Mat::from_fn(n_samples, 1, |k, _| (k as f64 * 0.01).sin());
        group.bench_function(BenchmarkId::new("update, factor kept", n_samples), |bencher| {
            bencher.iter(|| black_box(factor.solve(plant.transpose() * &error)));
        });
    }
    group.finish();
    Ok(())
}
