//! Tests of the law: hand-checked runs, the listing's loops on random runs, and a motor whose
//! resistance depends on the temperature.

use proptest::prelude::*;

use super::*;
use crate::learning::law::flexible::{Flexible, TableShape};
use crate::learning::law::pd::{Pd, PdGains};
use crate::learning::law::q_filter::QFilter;
use crate::model::{Method, StateSpace, discretize, from_transfer_function};
use crate::signal::butterworth;

fn pd(kp: f64, kd: f64, n_samples: usize, n_channels: usize) -> Box<dyn Law> {
    let gains = PdGains { kp, kd, lead_samples: 1 };
    Box::new(Pd::new(gains, n_samples, n_channels, QFilter::None).unwrap())
}

fn shape(n_samples: usize, n_channels: usize, n_disturbances: usize) -> RunShape {
    let (n_inputs, n_outputs) = (n_channels, n_channels);
    RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s: 0.01 }
}

#[test]
fn three_runs_by_hand() {
    // One sample, no rate: sums are 1 e^2 + 1 (d - d_j)^2, epsilon 1; the core proposes u + e.
    let weights = RelevanceWeights {
        error: 1.0,
        error_rate: 0.0,
        disturbance: vec![1.0],
        ..Default::default()
    };
    let mut law = Relevance::new(pd(1.0, 0.0, 1, 1), shape(1, 1, 1), weights, None).unwrap();
    let mut next = [0.0];
    law.set_disturbance(&[0.0]);
    law.set_disturbance(&[1.0]);
    law.update(&[0.0], &[1.0], &mut next).unwrap();
    // A single run has all weight: its proposal 0 + 1.
    assert_eq!(next.to_vec(), [1.0]);
    law.set_disturbance(&[3.0]);
    law.update(&[1.0], &[2.0], &mut next).unwrap();
    // Run 0: 1 + 9 + 1 = 11, proposal 1. Run 1 under 1: 4 + 4 + 1 = 9, proposal 3.
    let expected = (1.0 / 11.0 + 3.0 / 9.0) / (1.0 / 11.0 + 1.0 / 9.0);
    assert!((next[0] - expected).abs() < 1e-14, "{} {expected}", next[0]);
    law.set_disturbance(&[1.0]);
    law.update(&[5.0], &[0.0], &mut next).unwrap();
    // At 1: run 0 has 1 + 1 + 1 = 3, run 1 has 4 + 0 + 1 = 5, run 2 under 3 has 0 + 4 + 1 = 5.
    let expected = (1.0 / 3.0 + 3.0 / 5.0 + 5.0 / 5.0) / (1.0 / 3.0 + 2.0 / 5.0);
    assert!((next[0] - expected).abs() < 1e-14, "{} {expected}", next[0]);
    let relevant = law.relevant(&[1.0]).unwrap();
    assert_eq!(relevant.iter().map(|(run, _)| *run).collect::<Vec<_>>(), [0, 1, 2]);
    assert!((relevant[0].1 - (1.0 / 3.0) / (1.0 / 3.0 + 2.0 / 5.0)).abs() < 1e-14);
    // Most relevant at 3: run 2 (0 + 0 + 1), then run 1 (9).
    assert_eq!(law.trim(2, &[3.0]).unwrap(), [1, 2]);
    assert_eq!(law.relevant(&[3.0]).unwrap()[0].0, 1);
}

/// One run as the listing stores it.
#[derive(Debug, Clone)]
struct Past {
    u: Vec<f64>,
    e: Vec<f64>,
    d: Vec<f64>,
}

/// The listing's loops: relevance, its normalisation, and the two sums over the past.
fn listing(past: &[Past], coming: &[f64], w: &RelevanceWeights, kp: f64, kd: f64) -> Vec<f64> {
    let n = past[0].u.len();
    let relevance: Vec<f64> = past
        .iter()
        .map(|run| {
            let mut slow = 0.0;
            let mut sum = 0.0;
            for t in 0..n {
                let rate = (run.e[t] - slow) / w.rate_filter_s;
                slow += (1.0 - (-0.01 / w.rate_filter_s).exp()) * (run.e[t] - slow);
                let apart: f64 = (0..coming.len())
                    .map(|i| w.disturbance[i] * (coming[i] - run.d[i]).powi(2))
                    .sum();
                sum += w.error * run.e[t].powi(2) + w.error_rate * rate.powi(2) + apart;
            }
            1.0 / (sum + w.epsilon)
        })
        .collect();
    let total: f64 = relevance.iter().sum();
    (0..n)
        .map(|t| {
            let (mut star, mut double_star) = (0.0, 0.0);
            for (run, relevance) in past.iter().zip(&relevance) {
                let ahead = run.e[(t + 1).min(n - 1)];
                let now = if t + 1 < n { run.e[t] } else { ahead };
                double_star += relevance / total * (kp * ahead + kd * (ahead - now));
                star += relevance / total * run.u[t];
            }
            w.error_gain * double_star + w.input_gain * star
        })
        .collect()
}

fn runs(n_disturbances: usize) -> impl Strategy<Value = Vec<Past>> {
    let signal = || prop::collection::vec(-1.0..1.0_f64, 12);
    let disturbance = prop::collection::vec(-2.0..2.0_f64, n_disturbances);
    let run = (signal(), signal(), disturbance).prop_map(|(u, e, d)| Past { u, e, d });
    prop::collection::vec(run, 2..40)
}

fn agrees_with_the_listing(runs: &[Past], weights: &RelevanceWeights) {
    let (kp, kd) = (1.284, 0.7);
    let n_disturbances = runs[0].d.len();
    let mut all =
        Relevance::new(pd(kp, kd, 12, 1), shape(12, 1, n_disturbances), weights.clone(), None)
            .unwrap();
    let mut some =
        Relevance::new(pd(kp, kd, 12, 1), shape(12, 1, n_disturbances), weights.clone(), Some(5))
            .unwrap();
    let mut next = vec![0.0; 12];
    all.set_disturbance(&runs[0].d);
    some.set_disturbance(&runs[0].d);
    for (n, pair) in runs.windows(2).enumerate() {
        let (run, coming) = (&pair[0], &pair[1].d);
        all.set_disturbance(coming);
        all.update(&run.u, &run.e, &mut next).unwrap();
        close(&next, &listing(&runs[..=n], coming, &all.weights, kp, kd));
        some.set_disturbance(coming);
        some.update(&run.u, &run.e, &mut next).unwrap();
        let nearest: Vec<Past> =
            some.relevant(coming).unwrap().iter().map(|(run, _)| runs[*run].clone()).collect();
        assert_eq!(nearest.len(), 5.min(n + 1));
        close(&next, &listing(&nearest, coming, &all.weights, kp, kd));
    }
}

fn close(found: &[f64], expected: &[f64]) {
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < 1e-12, "sample {k}: {found} {expected}");
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(60))]
    #[test]
    fn the_law_is_the_listing(
        (runs, epsilon) in (0_usize..=3).prop_flat_map(|n| (runs(n), 1e-6..2.0_f64)),
        error_gain in 0.2..1.5_f64,
        input_gain in 0.5..1.0_f64,
    ) {
        let weights = RelevanceWeights { epsilon, error_gain, input_gain, ..Default::default() };
        agrees_with_the_listing(&runs, &weights);
        agrees_with_the_listing(&runs, &RelevanceWeights { epsilon, ..Default::default() });
    }

    #[test]
    fn trimming_keeps_what_holds_most_weight(
        (runs, keep) in (runs(2), 1_usize..20),
    ) {
        let make = || {
            let mut law =
                Relevance::new(pd(1.0, 0.5, 12, 1), shape(12, 1, 2), RelevanceWeights::default(), None)
                    .unwrap();
            for run in &runs {
                law.remember(&run.u, &run.e, &run.d).unwrap();
            }
            law
        };
        // For one disturbance: the most relevant ones, and the law then weights these alone.
        let at = [0.3, -0.4];
        let mut law = make();
        let mut best: Vec<usize> =
            law.relevant(&at).unwrap().iter().take(keep).map(|(run, _)| *run).collect();
        best.sort_unstable();
        prop_assert_eq!(law.trim(keep, &at).unwrap(), best.clone());
        let left: Vec<Past> = best.iter().map(|&run| runs[run].clone()).collect();
        let mut next = vec![0.0; 12];
        law.set_disturbance(&at);
        law.weigh(&at, &mut next).unwrap();
        close(&next, &listing(&left, &at, &law.weights.clone(), 1.0, 0.5));
        // For all disturbances met: the sums of the weights decide.
        let mut law = make();
        let mut shares = vec![0.0; runs.len()];
        for run in &runs {
            for (number, weight) in law.relevant(&run.d).unwrap() {
                shares[number] += weight;
            }
        }
        let kept = law.trim(keep, &[]).unwrap();
        prop_assert_eq!(kept.len(), keep.min(runs.len()));
        let least = kept.iter().map(|&run| shares[run]).fold(f64::INFINITY, f64::min);
        for (number, share) in shares.iter().enumerate() {
            prop_assert!(kept.contains(&number) || *share <= least + 1e-12);
        }
    }
}

#[test]
fn channels_count_together_and_do_not_mix() {
    let weights = RelevanceWeights { error_rate: 0.0, ..Default::default() };
    let mut law = Relevance::new(pd(1.0, 0.0, 2, 2), shape(2, 2, 0), weights, None).unwrap();
    let mut next = [0.0; 4];
    law.update(&[0.0; 4], &[1.0, 2.0, 1.0, 2.0], &mut next).unwrap();
    assert_eq!(next.to_vec(), [1.0, 2.0, 1.0, 2.0]);
    law.update(&next.clone(), &[0.0; 4], &mut next).unwrap();
    // 10 (1 + 4 + 1 + 4) + 1 = 101 against 1; both propose the same.
    close(&next, &[1.0, 2.0, 1.0, 2.0]);
    assert!((law.relevant(&[]).unwrap()[0].1 - 101.0 / 102.0).abs() < 1e-14);
}

#[test]
fn the_first_input_is_the_weighted_mean_of_what_is_remembered() {
    let weights = RelevanceWeights { error_rate: 0.0, ..Default::default() };
    for top in [None, Some(1)] {
        let mut law =
            Relevance::new(pd(1.0, 0.0, 2, 1), shape(2, 1, 1), weights.clone(), top).unwrap();
        law.set_disturbance(&[21.0]);
        assert_eq!(law.first_input().unwrap(), None, "nothing is remembered");
        for (u, d) in [(1.0, 20.0), (2.0, 30.0)] {
            law.remember(&[u; 2], &[0.1; 2], &[d]).unwrap();
        }
        let shares = law.relevant(&[21.0]).unwrap();
        let expected: f64 = shares.iter().map(|(run, share)| share * [1.1, 2.1][*run]).sum();
        close(&law.first_input().unwrap().unwrap(), &[expected; 2]);
        assert_eq!(law.len(), 2);
        law.reset();
        law.remember(&[1.0; 2], &[0.1; 2], &[20.0]).unwrap();
        assert_eq!(law.first_input().unwrap(), None, "the disturbance is not known");
    }
}

#[test]
fn runs_that_pass_through_again_are_counted_once() {
    let mut law =
        Relevance::new(pd(1.0, 0.0, 2, 1), shape(2, 1, 1), RelevanceWeights::default(), None)
            .unwrap();
    let mut next = [0.0; 2];
    for (u, d) in [(1.0, 20.0), (2.0, 30.0)] {
        law.remember(&[u; 2], &[0.1; 2], &[d]).unwrap();
    }
    law.set_disturbance(&[20.0]);
    for (u, coming, kept) in [(1.0, 30.0, 2), (2.0, 40.0, 2), (3.0, 20.0, 3), (1.0, 20.0, 4)] {
        law.set_disturbance(&[coming]);
        law.update(&[u; 2], &[0.1; 2], &mut next).unwrap();
        assert_eq!(law.len(), kept);
    }
}

#[test]
fn wrong_use_is_refused_one_thing_at_a_time() {
    let make =
        |shape, top| Relevance::new(pd(1.0, 1.0, 4, 1), shape, RelevanceWeights::default(), top);
    assert!(make(RunShape { n_samples: 0, ..shape(4, 1, 1) }, None).is_err());
    assert!(make(RunShape { dt_s: 0.0, ..shape(4, 1, 1) }, None).is_err());
    assert!(make(shape(4, 1, 8), None).is_err());
    assert!(make(shape(4, 1, 1), Some(0)).is_err());
    let mut law = make(shape(4, 1, 1), Some(3)).unwrap();
    let mut next = [0.0; 4];
    let line = law.update(&[0.0; 4], &[0.0; 4], &mut next).unwrap_err().to_string();
    assert_eq!(line, "the disturbance of a run holds 0 numbers; 1 needed");
    law.set_disturbance(&[20.0]);
    assert!(law.update(&[0.0; 3], &[0.0; 4], &mut next).is_err());
    assert!(law.update(&[0.0; 4], &[f64::NAN; 4], &mut next).is_err());
    assert!(law.update(&[0.0; 4], &[0.0; 4], &mut next[..3]).is_err());
    assert!(law.remember(&[0.0; 4], &[0.0; 4], &[]).is_err());
    assert!(law.remember(&[0.0; 4], &[0.0; 4], &[f64::INFINITY]).is_err());
    assert!(law.is_empty());
    law.update(&[0.0; 4], &[1.0; 4], &mut next).unwrap();
    assert!(law.is_empty(), "nobody said under which disturbance that run was made");
    law.update(&[0.0; 4], &[1.0; 4], &mut next).unwrap();
    assert_eq!(law.len(), 1);
    assert!(law.trim(1, &[f64::NAN]).is_err());
    let text: serde_json::Value = serde_json::from_str(&law.describe()).unwrap();
    assert_eq!((&text["core"]["law"], &text["top"]), (&"pd".into(), &3.into()));
    law.reset();
    assert!(law.is_empty());
}

/// The motor of Case I in the thesis, closed loop, discretised: from the reference to the position.
fn motor(temperature_c: f64) -> StateSpace {
    let resistance = 1.0 + 3.9e-3 * temperature_c;
    let (inertia, friction, constant, inductance) = (0.01, 1.0, 1.0, 0.005);
    let den = [
        inertia * inductance,
        inertia * resistance + friction * inductance,
        friction * resistance + constant * constant,
        0.0,
    ];
    let plant = from_transfer_function(&[constant], &den, None).unwrap();
    let plant = discretize(&plant, 0.01, Method::ZeroOrderHold).unwrap();
    // PD 10 and 1 with a filter of 0.01 s on both: C = (10 + s) / (0.01 s + 1).
    let controller = from_transfer_function(&[1.0, 10.0], &[0.01, 1.0], None).unwrap();
    let controller = discretize(&controller, 0.01, Method::ZeroOrderHold).unwrap();
    let open = controller.series(&plant).unwrap();
    let one = StateSpace::static_gain(nalgebra::DMatrix::identity(1, 1), Some(0.01)).unwrap();
    open.feedback(&one).unwrap()
}

/// The temperature of each run: random, low-pass filtered, within 100 K of 0 degrees.
fn temperatures(seed: u64, n_runs: usize) -> Vec<f64> {
    let mut state = seed;
    // A linear congruential generator, its high bits: uniform from -1 to 1.
    let mut random = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut slow = 0.0;
    (0..n_runs)
        .map(|_| {
            slow = 0.7 * slow + 0.3 * 300.0 * random();
            f64::clamp(slow, -100.0, 100.0)
        })
        .collect()
}

/// Returns the RMS error of every run.
fn campaign(law: &mut dyn Law, temperatures: &[f64]) -> Vec<f64> {
    // A modulated move: half a turn with a ripple of 1.6 Hz.
    let reference: Vec<f64> = (0..N)
        .map(|k| {
            let t = k as f64 * 0.01;
            let ramp = 1.0 - (-5.0 * t * t).exp();
            ramp * (t + 0.2 * (10.0 * t).sin())
        })
        .collect();
    let mut input = vec![0.0; N];
    let mut next = vec![0.0; N];
    law.set_disturbance(&temperatures[..1]);
    temperatures
        .iter()
        .enumerate()
        .map(|(run, &temperature_c)| {
            let command: Vec<f64> = reference.iter().zip(&input).map(|(r, u)| r + u).collect();
            let measured = motor(temperature_c).simulate(&command, None).unwrap();
            let error: Vec<f64> = reference.iter().zip(&measured).map(|(r, y)| r - y).collect();
            if let Some(coming) = temperatures.get(run + 1..run + 2) {
                law.set_disturbance(coming);
                law.update(&input, &error, &mut next).unwrap();
                input.copy_from_slice(&next);
            }
            (error.iter().map(|e| e * e).sum::<f64>() / N as f64).sqrt()
        })
        .collect()
}

const N: usize = 300;

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn a_motor_whose_resistance_follows_the_temperature_is_learned_where_pd_alone_is_not() {
    let core = || {
        let gains = PdGains { kp: 1.284, kd: 1.284, lead_samples: 1 };
        let filter = QFilter::ZeroPhase(butterworth(2, 10.0, 0.01).unwrap());
        Box::new(Pd::new(gains, N, 1, filter).unwrap())
    };
    let n_runs = 120;
    let (mut without, mut alone, mut all, mut top, mut table) =
        (vec![], vec![], vec![], vec![], vec![]);
    let (mut early, mut late) = (vec![], vec![]);
    let weights = RelevanceWeights::default;
    for seed in 1..=5 {
        let t = temperatures(seed, n_runs);
        let last = |errors: &[f64]| median(&mut errors[n_runs - 20..].to_vec());
        let gains = PdGains { kp: 0.0, kd: 0.0, lead_samples: 1 };
        without.push(last(&campaign(&mut Pd::new(gains, N, 1, QFilter::None).unwrap(), &t)));
        alone.push(last(&campaign(core().as_mut(), &t)));
        let mut law = Relevance::new(core(), shape(N, 1, 1), weights(), None).unwrap();
        let errors = campaign(&mut law, &t);
        all.push(last(&errors));
        early.push(median(&mut errors[20..40].to_vec()));
        late.push(last(&errors));
        let mut law = Relevance::new(core(), shape(N, 1, 1), weights(), Some(30)).unwrap();
        top.push(last(&campaign(&mut law, &t)));
        let table_shape = TableShape {
            n_samples: N,
            n_inputs: 1,
            n_outputs: 1,
            n_disturbances: 1,
            tolerance: 0.0,
        };
        table.push(last(&campaign(&mut Flexible::new(core(), table_shape).unwrap(), &t)));
    }
    let [without, alone, all, top, table, early, late] =
        [without, alone, all, top, table, early, late].map(|mut values| median(&mut values));
    let found = format!(
        "PD {without:.1e}, PD-ILC {alone:.1e}, DPW {all:.1e}, of the 30 most relevant {top:.1e}, \
         flexible {table:.1e}; DPW from {early:.1e} to {late:.1e}"
    );
    assert!(alone < 0.2 * without, "{found}");
    assert!(all < 0.2 * alone && top < 1.1 * all && table < 0.2 * alone, "{found}");
    assert!(late < 0.6 * early, "{found}");
}
