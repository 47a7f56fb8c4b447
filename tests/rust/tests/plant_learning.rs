//! Convex-optimisation ILC on the simulated gantry, in lock-step and without a bus: plant,
//! trajectory and contour error together.
//!
//! The law is an independent implementation: the normal equations of Haas et al. (2016), eq. 9 and
//! 11, solved by conjugate gradients with nothing but model simulations.

#![expect(clippy::expect_used, reason = "a test may fail where the example is not as it should be")]

use ilc_rt::config::Cell;
use ilc_rt::trajectory::{AxisLimits, Interpolator, PathSegment, PathSpec, contour_error_m};
use ilc_sim::plant::{Demand, Gantry, Plant};

const RATE: f64 = 6.0;
const ITERATIONS: usize = 9;

fn cell() -> Cell {
    Cell::load(&ilc_tests::example_path("01_gantry.toml")).expect("the example is valid")
}

fn plan(cell: &Cell) -> Interpolator {
    let program = &cell.program;
    let segment = |segment: &ilc_rt::config::Segment| {
        PathSegment::line(segment.to_m.clone(), segment.feed_m_s.unwrap_or(program.feed_m_s))
    };
    let spec = PathSpec {
        start_m: program.start_m.clone(),
        segments: program.segments.iter().map(segment).collect(),
        blend_s: program.window_s(),
        dwell_before_s: program.dwell_before_s,
        dwell_after_s: program.dwell_after_s,
    };
    let limit = |axis: &ilc_rt::config::Axis| AxisLimits {
        velocity_max_m_s: axis.limits.velocity_max_m_s,
        acceleration_max_m_s2: axis.limits.acceleration_max_m_s2,
        jerk_max_m_s3: axis.limits.jerk_max_m_s3,
    };
    let limits: Vec<AxisLimits> = cell.axes.iter().map(limit).collect();
    Interpolator::plan(&spec, &limits, cell.cycle_s()).expect("the example is within its limits")
}

/// Impulse response of `w² / (s² + 2 d w s + w²)` under a zero-order hold, with a dead time of
/// whole cycles.
fn impulse_response(hz: f64, damping: f64, delay: usize, cycle_s: f64) -> Vec<f64> {
    let w = std::f64::consts::TAU * hz;
    let step = |k: usize| {
        let t = k as f64 * cycle_s;
        if damping < 1.0 {
            let wd = w * (1.0 - damping * damping).sqrt();
            1.0 - (-damping * w * t).exp() * ((wd * t).cos() + damping * w / wd * (wd * t).sin())
        } else {
            1.0 - (-w * t).exp() * (1.0 + w * t)
        }
    };
    let mut response = vec![0.0; delay + 1];
    response.extend((1..150).map(|k| step(k) - step(k - 1)));
    response
}

fn apply(h: &[f64], u: &[f64]) -> Vec<f64> {
    (0..u.len())
        .map(|k| h.iter().take(k + 1).enumerate().map(|(i, h)| h * u[k - i]).sum())
        .collect()
}

fn apply_transposed(h: &[f64], e: &[f64]) -> Vec<f64> {
    (0..e.len())
        .map(|k| h.iter().take(e.len() - k).enumerate().map(|(i, h)| h * e[k + i]).sum())
        .collect()
}

/// Solves `(P'P + d² D'D) v = P'e`.
fn update(h: &[f64], e: &[f64]) -> Vec<f64> {
    let n = e.len();
    let normal = |v: &[f64]| {
        let mut out = apply_transposed(h, &apply(h, v));
        for k in 1..n {
            let slope = RATE * RATE * (v[k] - v[k - 1]);
            out[k] += slope;
            out[k - 1] -= slope;
        }
        out
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut v = vec![0.0; n];
    let mut residual = apply_transposed(h, e);
    let mut direction = residual.clone();
    let mut square = dot(&residual, &residual);
    let small = 1e-12 * square;
    for _ in 0..300 {
        if square <= small {
            break;
        }
        let image = normal(&direction);
        let length = square / dot(&direction, &image);
        for k in 0..n {
            v[k] += length * direction[k];
            residual[k] -= length * image[k];
        }
        let next = dot(&residual, &residual);
        for k in 0..n {
            direction[k] = residual[k] + next / square * direction[k];
        }
        square = next;
    }
    v
}

/// Measurements of a run, time first.
#[derive(Default)]
struct Run {
    encoder_m: Vec<f64>,
    tool_m: Vec<f64>,
}

/// A run in lock-step: each SYNC measures and sends a target, which the drive approaches linearly
/// over the following cycle.
fn run(cell: &Cell, gantry: &mut Gantry, target_m: &[f64]) -> Run {
    let n_axes = cell.n_axes();
    let steps = cell.cell.cycle_us / cell.simulation.step_us;
    let dt_s = f64::from(cell.simulation.step_us) * 1e-6;
    let mut measured = Run::default();
    let mut from_m: Vec<f64> = target_m[..n_axes].to_vec();
    let mut demand = vec![Demand::Off; n_axes];
    for to_m in target_m.chunks(n_axes) {
        for axis in 0..n_axes {
            measured.encoder_m.push(gantry.encoder_m(axis));
            measured.tool_m.push(gantry.tool_m(axis));
        }
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            for axis in 0..n_axes {
                let position_m = from_m[axis] + share * (to_m[axis] - from_m[axis]);
                demand[axis] = Demand::Position { position_m, velocity_m_s: 0.0 };
            }
            gantry.step(&demand, dt_s);
        }
        from_m.copy_from_slice(to_m);
    }
    measured
}

/// Moves from the current positions to the start, and settles.
fn settle(cell: &Cell, gantry: &mut Gantry, from_m: &[f64], to_m: &[f64]) {
    let mut targets = Vec::new();
    for k in 0..=500_u32 {
        let share = (f64::from(k) / 250.0).min(1.0);
        let smooth = share * share * (3.0 - 2.0 * share);
        targets.extend(from_m.iter().zip(to_m).map(|(from, to)| from + smooth * (to - from)));
    }
    run(cell, gantry, &targets);
}

/// Returns the largest contour and tracking error at the tool for each iteration, the first without
/// learning.
fn campaign(cell: &Cell, from_tool: bool, delay: usize, iterations: usize) -> Vec<[f64; 2]> {
    let n_axes = cell.n_axes();
    let reference = plan(cell).reference();
    let n = reference.len() / n_axes;
    let mut input = vec![vec![0.0; n]; n_axes];
    let response = |axis: &ilc_rt::config::Axis| {
        let model = axis.model.expect("a model");
        let (hz, damping) = (model.natural_frequency_hz.expect("csp"), model.damping.expect("csp"));
        impulse_response(hz, damping, delay, cell.cycle_s())
    };
    let responses: Vec<Vec<f64>> = cell.axes.iter().map(response).collect();
    let mut gantry = Gantry::from_cell(cell);
    let mut at_m: Vec<f64> = (0..n_axes).map(|axis| gantry.encoder_m(axis)).collect();
    let mut norms = Vec::new();
    for _ in 0..=iterations {
        let target: Vec<f64> =
            (0..n * n_axes).map(|i| reference[i] + input[i % n_axes][i / n_axes]).collect();
        settle(cell, &mut gantry, &at_m, &target[..n_axes]);
        let measured = run(cell, &mut gantry, &target);
        at_m = target[(n - 1) * n_axes..].to_vec();
        let contour = contour_error_m(&reference, &measured.tool_m, n_axes, 200);
        let tracking = reference.iter().zip(&measured.tool_m).map(|(r, y)| (r - y).abs());
        norms.push([contour.iter().copied().fold(0.0, f64::max), tracking.fold(0.0, f64::max)]);
        let seen = if from_tool { &measured.tool_m } else { &measured.encoder_m };
        for axis in 0..n_axes {
            let error: Vec<f64> =
                (0..n).map(|k| reference[k * n_axes + axis] - seen[k * n_axes + axis]).collect();
            for (u, v) in input[axis].iter_mut().zip(update(&responses[axis], &error)) {
                *u += v;
            }
        }
    }
    norms
}

fn describe(norms: &[[f64; 2]]) -> String {
    let microns: Vec<String> = norms.iter().map(|[c, _]| format!("{:.0}", c * 1e6)).collect();
    microns.join(" ")
}

#[test]
fn learning_from_the_tool_beats_learning_from_the_encoder() {
    let cell = cell();
    let [tool, encoder] = [true, false].map(|from_tool| campaign(&cell, from_tool, 1, ITERATIONS));
    println!("contour um: tool {}, encoder {}", describe(&tool), describe(&encoder));
    let fall = |norms: &[[f64; 2]]| 1.0 - norms[ITERATIONS][0] / norms[0][0];
    assert!(fall(&tool) >= 0.8, "{}", fall(&tool));
    assert!(fall(&encoder) > 0.2 && fall(&encoder) < fall(&tool) - 0.1, "{}", fall(&encoder));
    let bits = |norms: &[[f64; 2]]| -> Vec<[u64; 2]> {
        norms.iter().map(|n| n.map(f64::to_bits)).collect()
    };
    assert_eq!(bits(&tool[..3]), bits(&campaign(&cell, true, 1, 2)), "the same bits again");
}

#[test]
#[ignore = "an experiment: prints how delay, friction and blending bear on the result"]
fn delay_friction_and_blending() {
    for (friction, blend_s) in [(1.0, 0.04), (1.0, 0.03), (1.0, 0.06), (0.0, 0.04), (2.0, 0.04)] {
        for delay in 0..=3 {
            let mut cell = cell();
            cell.program.blend_s = blend_s;
            for axis in &mut cell.axes {
                axis.simulation.coulomb_n *= friction;
                axis.simulation.static_n *= friction;
            }
            for (name, from_tool) in [("tool", true), ("encoder", false)] {
                let norms = campaign(&cell, from_tool, delay, ITERATIONS);
                let fall =
                    |which: usize| 100.0 * (1.0 - norms[ITERATIONS][which] / norms[0][which]);
                println!(
                    "friction x{friction} blend {blend_s} s delay {delay} {name}: contour -{:.1} % \
                     tracking -{:.1} % ({:.0} um at first): {}",
                    fall(0),
                    fall(1),
                    norms[0][1] * 1e6,
                    describe(&norms)
                );
            }
        }
    }
}
