//! Planning time of a move, kind by kind: between two ticks, or before a run.

use criterion::{Criterion, criterion_group, criterion_main};
use ilc_rt::trajectory::curve::{Butterfly, Run, RunLimits};
use ilc_rt::trajectory::{
    AxisLimits, ExponentialSigmoid, JerkLimited, Linear, LinearSetting, ModulatedSegment,
    points_program,
};

const LIMITS: AxisLimits =
    AxisLimits { velocity_max_m_s: 0.5, acceleration_max_m_s2: 10.0, jerk_max_m_s3: 800.0 };

fn leg() -> ModulatedSegment {
    ModulatedSegment { to_m: vec![0.1], feed_m_s: 0.02, amplitude_m: 0.001, frequency_hz: 5.0 }
}

fn moves(criterion: &mut Criterion) {
    criterion.bench_function("jerk-limited move: plan", |bench| {
        bench.iter(|| JerkLimited::plan(std::hint::black_box(0.1), 0.5, 10.0, 800.0));
    });
    let plan = JerkLimited::plan(0.1, 0.5, 10.0, 800.0).ok();
    criterion.bench_function("jerk-limited move: one tick", |bench| {
        bench.iter(|| plan.map(|plan| plan.at(std::hint::black_box(0.1))));
    });
    let program = points_program(&[0.0], &leg(), 6).unwrap_or_default();
    criterion.bench_function("six-point sine of 150 moves, on time: plan", |bench| {
        bench.iter(|| Linear::plan(&[0.0], &program, &[LIMITS], LinearSetting::StartOnTime));
    });
    criterion.bench_function("E/S move: plan", |bench| {
        bench.iter(|| ExponentialSigmoid::plan(&[0.0], &[leg()], &[LIMITS]));
    });
    let plan = ExponentialSigmoid::plan(&[0.0], &[leg()], &[LIMITS]).ok();
    criterion.bench_function("E/S move: one tick", |bench| {
        bench.iter(|| plan.as_ref().map(|plan| plan.at(std::hint::black_box(1.0))));
    });
}

fn curves(criterion: &mut Criterion) {
    let limits =
        RunLimits { feed_m_s: 0.004, curvature_acceleration_max_m_s2: 0.02, axes: vec![LIMITS; 2] };
    let mut group = criterion.benchmark_group("curve");
    group.sample_size(10);
    group.bench_function("butterfly: plan", |bench| {
        bench.iter(|| {
            Butterfly::new(0.001_85, 1.0, [0.0; 2])
                .and_then(|butterfly| Run::plan(&butterfly, &limits, 0.002))
        });
    });
    group.finish();
}

criterion_group!(benches, moves, curves);
criterion_main!(benches);
