//! Speed of the law with bounds, at the length of a campaign's run: one axis, two uncoupled axes
//! and two coupled ones; cold start and warm start from the last solution.

use std::error::Error;
use std::hint::black_box;

use criterion::Criterion;
use ilc_rt::learning::Law;
use ilc_rt::learning::law::constrained::{Bound, Bounds, Constrained};
use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};
use ilc_rt::model::{Method, StateSpace, discretize, second_order};
use nalgebra::DMatrix;

const N_SAMPLES: usize = 1300;
const DT_S: f64 = 0.001;
const WEIGHTS: Weights = Weights { q: 1.0, s: 0.0, r: 0.0, rate: 3.0 };

#[expect(clippy::unnecessary_wraps, reason = "bounds are optional wherever it is called")]
fn within(size: f64) -> Option<Bound> {
    Some(Bound::within(-size, size))
}

/// Largest magnitude of a difference of the given order.
fn largest(values: &[f64], width: usize, order: usize) -> f64 {
    let mut values = values.to_vec();
    for _ in 0..order {
        values = (width..values.len()).map(|i| values[i] - values[i - width]).collect();
    }
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

fn bench(criterion: &mut Criterion, name: &str, model: &StateSpace) -> Result<(), Box<dyn Error>> {
    let m = model.n_inputs();
    let error: Vec<f64> =
        (0..N_SAMPLES * m).map(|k| 1e-3 * ((k / m) as f64 * 0.03 + (k % m) as f64).sin()).collect();
    let input = vec![0.0; error.len()];
    let mut free = input.clone();
    NormOptimal::new(model, N_SAMPLES, WEIGHTS)?.update(&input, &error, &mut free)?;
    let box_only = Bounds { input: within(0.6 * largest(&free, m, 0)), ..Bounds::default() };
    let three_kinds = Bounds {
        input: within(0.8 * largest(&free, m, 0)),
        step: within(0.6 * largest(&free, m, 1)),
        acceleration: within(0.5 * largest(&free, m, 2) / (DT_S * DT_S)),
        reference: Some(input.clone()),
        ..Bounds::default()
    };
    for (kind, bounds) in [("box", box_only), ("box, step, acceleration", three_kinds)] {
        let mut law = Constrained::new(model, N_SAMPLES, WEIGHTS, bounds)?;
        let mut next = input.clone();
        law.update(&input, &error, &mut next)?;
        let label = format!("{name}, {kind}, {} iterations", law.iterations());
        let mut group = criterion.benchmark_group("constrained");
        group.sample_size(20);
        group.bench_function(format!("{label}, from scratch"), |bencher| {
            bencher.iter(|| {
                law.reset();
                black_box(law.update(&input, &error, &mut next))
            });
        });
        group.bench_function(format!("{label}, from the last solution"), |bencher| {
            bencher.iter(|| black_box(law.update(&input, &error, &mut next)));
        });
        group.finish();
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut criterion = Criterion::default().configure_from_args();
    let axis = discretize(&second_order(157.0, 0.5)?, DT_S, Method::ZeroOrderHold)?;
    let two = axis.append(&axis)?;
    let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.1, -0.1, 1.0]);
    let coupled = two.series(&StateSpace::static_gain(skew, Some(DT_S))?)?;
    bench(&mut criterion, "one axis", &axis)?;
    bench(&mut criterion, "two axes", &two)?;
    bench(&mut criterion, "two coupled axes", &coupled)?;
    criterion.final_summary();
    Ok(())
}
