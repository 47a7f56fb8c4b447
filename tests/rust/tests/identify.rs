//! Identification with the whole loop in lock-step: the parameters of a simulated axis are
//! recovered, and nothing moves beyond its limits.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use ilc_rt::campaign;
use ilc_rt::config::Cell;
use ilc_rt::identification::{Experiment, Identified, Signals};
use ilc_rt::library::Library;
use ilc_rt::model::identify::{Excitation, Waveform};
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example};

/// The gantry of the first example without friction and flexible mode, with encoder noise.
fn bench() -> Cell {
    let mut cell = example("01_gantry.toml");
    cell.cell.cycle_us = 1000;
    cell.tcp_encoder = None;
    cell.learning.measure = ilc_rt::config::Measure::Encoder;
    cell.simulation.encoder_noise_m = 2e-7;
    for axis in &mut cell.axes {
        let s = &mut axis.simulation;
        (s.coulomb_n, s.static_n, s.mode_mass_kg) = (0.0, 0.0, 0.0);
        (s.integral_time_s, s.natural_frequency_hz, s.damping) = (1000.0, 12.0, 0.5);
        (s.mass_kg, s.force_max_n) = (20.0, 20_000.0);
    }
    cell
}

fn experiment(waveform: Waveform, amplitude: f64) -> Experiment {
    Experiment {
        axis: "y".to_owned(),
        excitation: Excitation {
            waveform,
            amplitude,
            from_hz: 1.0,
            to_hz: 20.0,
            period_s: 6.0,
            periods: 3,
        },
        at_m: Some(0.02),
    }
}

#[test]
fn a_simulated_axis_is_found_again_within_two_percent() {
    let cell = bench();
    for waveform in [Waveform::Multisine, Waveform::LogarithmicSweep] {
        let scratch = Scratch::new();
        let library = scratch.file("library.db");
        let experiment = experiment(waveform, 1.0).with_default_amplitude(&cell).unwrap();
        let options = options(library.clone(), 1);
        let outcome = campaign::identify(
            &cell,
            &experiment,
            &options.session,
            in_process(&cell),
            &mut |_| {},
        )
        .unwrap();
        assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
        let library = Library::open(&library).unwrap();
        let rows = library.list(Some(&outcome.campaign)).unwrap();
        let kept = library.load(rows[0].id).unwrap();
        assert_eq!(kept.meta.law, "excitation");
        // The other axis is at rest, apart from its encoder's noise.
        let still = kept.record.encoder_m.iter().step_by(2);
        assert!(still.map(|x| (x - cell.program.start_m[0]).abs()).fold(0.0, f64::max) < 3e-6);

        let record = kept.record;
        let signals = Signals { input: record.input, error_m: record.error_m };
        let found = Identified::new(&cell, &experiment, &signals).unwrap();
        let model = found.fit.model;
        println!("{waveform:?}: {:?}\n{}", found.fit, found.section());
        assert!((model.gain - 1.0).abs() < 0.02, "{model:?}");
        assert!((model.natural_frequency_hz / 12.0 - 1.0).abs() < 0.02, "{model:?}");
        assert!((model.damping / 0.5 - 1.0).abs() < 0.02, "{model:?}");
        assert!(found.measured.coherence.iter().all(|gamma2| (0.9..1.0).contains(gamma2)));
        assert!(found.uncertainty.bound.iter().all(|bound| *bound < 0.2));
        assert!(found.section().starts_with("[axis.model]\nnatural_frequency_hz = 1"));
    }
}

/// So slow that only the size of the input is excessive.
fn slow_and_large() -> Experiment {
    let mut large = experiment(Waveform::Multisine, 0.006);
    large.excitation.to_hz = 2.0;
    large
}

#[test]
fn what_is_beyond_a_limit_is_refused_with_the_amplitude_that_would_do() {
    let cell = bench();
    let refused = |experiment: &Experiment| {
        let scratch = Scratch::new();
        let options = options(scratch.file("library.db"), 1);
        let mut heard = 0;
        let refusal =
            campaign::identify(&cell, experiment, &options.session, in_process(&cell), &mut |_| {
                heard += 1;
            });
        assert_eq!(heard, 0, "nothing may begin");
        refusal.unwrap_err().to_string()
    };
    let text = refused(&experiment(Waveform::LogarithmicSweep, 0.003));
    assert!(text.contains("axis y") && text.contains("limits.acceleration_max_m_s2"), "{text}");
    assert!(text.contains("which is an amplitude of"), "{text}");
    let text = refused(&slow_and_large());
    assert!(text.contains("learning.input_max_m = 0.006"), "{text}");
    let mut elsewhere = experiment(Waveform::Multisine, 1e-4);
    elsewhere.at_m = Some(-0.02);
    assert!(refused(&elsewhere).contains("way to the end of the axis = 0.0001"));
    elsewhere.axis = "z".to_owned();
    assert!(refused(&elsewhere).contains("axis z"));
    let mut slow = experiment(Waveform::Multisine, 1e-4);
    slow.excitation.from_hz = 0.1;
    assert!(refused(&slow).contains("5 cycles"));
}
