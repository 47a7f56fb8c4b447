//! A run at another feed: on its path, within its limits, and at the whole feed bit for bit as before.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::interpolate::{MAX_AXES, Playback};
use ilc_tests::{example, short};

fn cells() -> Vec<Cell> {
    let mut blended = short("01_gantry.toml");
    blended.program.corner = ilc_rt::config::Corner::Blend;
    let mut exact = short("01_gantry.toml");
    exact.program.corner = ilc_rt::config::Corner::ExactStop;
    vec![blended, exact, example("02_parallel.toml"), example("04_gcode.toml")]
}

#[test]
fn at_the_whole_feed_no_bit_differs() {
    for cell in cells() {
        let mut run = Plan::new(&cell, None, true).unwrap().interpolator;
        let mut playback = Playback::new(run.clone());
        run.restart();
        for sample in 0..run.n_samples() {
            assert_eq!(playback.place(), (sample, 0.0));
            let (expected, found) = (run.next(), playback.setpoint(1.0));
            let bits = |values: [f64; MAX_AXES]| values.map(f64::to_bits);
            assert_eq!(bits(found.position_m), bits(expected.position_m), "sample {sample}");
            assert_eq!(bits(found.velocity_m_s), bits(expected.velocity_m_s), "sample {sample}");
            assert_eq!(found.done, expected.done);
            playback.advance(1.0);
        }
        assert!(playback.setpoint(1.0).done, "the last one is held");
    }
}

/// Distance of a point from the line between two others.
fn from_line(point: &[f64], from: &[f64], to: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let minus = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>();
    let (way, at) = (minus(to, from), minus(point, from));
    let share = (dot(&at, &way) / dot(&way, &way).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let off: Vec<f64> = at.iter().zip(&way).map(|(at, way)| at - share * way).collect();
    dot(&off, &off).sqrt()
}

#[test]
fn at_any_feed_the_set_points_are_on_the_path() {
    for cell in cells() {
        let plan = Plan::new(&cell, None, true).unwrap();
        let (n_axes, n_samples) = (cell.n_axes(), plan.n_samples());
        let path: Vec<&[f64]> = plan.reference_m.chunks_exact(n_axes).collect();
        // The bend of the path within a tick bounds its distance from the chord.
        let bend_m = path
            .windows(3)
            .flat_map(|p| (0..n_axes).map(|i| (p[2][i] - 2.0 * p[1][i] + p[0][i]).abs()))
            .fold(0.0, f64::max);
        let mut playback = Playback::new(plan.interpolator.clone());
        for step in 0..3 * n_samples {
            // Between 0 and 1, without a pattern that fits the grid.
            let scale = 0.5 + 0.5 * (0.37 * step as f64).sin();
            playback.advance(scale);
            let (sample, fraction) = playback.place();
            let point = playback.setpoint(scale);
            let (from, to) = (path[sample], path[(sample + 1).min(n_samples - 1)]);
            let off_m = from_line(&point.position_m[..n_axes], from, to);
            assert!(off_m <= 0.5 * bend_m + 1e-12, "{off_m} of {bend_m} at {sample} + {fraction}");
        }
        assert!(playback.setpoint(1.0).done);
    }
}
