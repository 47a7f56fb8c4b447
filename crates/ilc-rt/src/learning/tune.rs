//! Tuning: proposes the weights of norm-optimal ILC.
//!
//! The guidelines s1 to s4 of \[barton2010\], Sec. 3.3.4, as a procedure that states the reason for
//! every step; the command line and the Python bindings import it.

use super::analysis::{Analysis, Question, Spectrum, Uncertainty, analyze, check_length};
use super::error::check;
use super::law::norm_optimal::{NormOptimal, Weights};
use super::{Law, LearningError, Result};
use crate::model::StateSpace;

/// Fluctuation that the choice of `r` accepts, relative to the measurement noise.
const FLUCTUATION: f64 = 1.05;
/// Start of `s` relative to the squared gain of the model.
const INPUT_START: f64 = 0.01;
/// Safety factor of `s`.
const SAFETY: f64 = 2.0;
/// Largest number of runs that a proposal of weights may be for.
pub const RUNS_MAX: usize = 10_000;

/// Known properties of the machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Knowledge {
    /// Uncertainty of the model.
    pub uncertainty: Option<Uncertainty>,
    /// Standard deviation of white measurement noise.
    pub noise_std: Option<f64>,
    /// Error of a run with input zero, `n_samples` x `n_outputs`.
    pub reference: Option<Vec<f64>>,
    /// Number of runs within which learning should be finished.
    pub n_runs: usize,
}

impl Default for Knowledge {
    fn default() -> Self {
        Self { uncertainty: None, noise_std: None, reference: None, n_runs: 10 }
    }
}

/// One step of the procedure.
#[derive(Debug, Clone, PartialEq)]
pub struct TuningStep {
    /// Name of the guideline: `s1` to `s4`, and `smoothing`.
    pub name: &'static str,
    /// Name of the quantity: `q`, `s`, `r`, `smoothing_hz` or `check`.
    pub what: &'static str,
    /// The value chosen.
    pub value: f64,
    /// The reason, with figures.
    pub why: String,
}

/// Proposed weights with reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuning {
    /// Weight of the error.
    pub q: f64,
    /// Weight of the input.
    pub s: f64,
    /// Weight of the input's change.
    pub r: f64,
    /// Bandwidth above which the learned input is mostly noise; `None` if there is none.
    pub smoothing_hz: Option<f64>,
    /// The steps in order.
    pub steps: Vec<TuningStep>,
    /// Analysis of the law with these weights.
    pub analysis: Analysis,
}

impl Tuning {
    /// Returns the weights as the law takes them.
    pub fn weights(&self) -> Weights {
        Weights { q: self.q, s: self.s, r: self.r, rate: 0.0 }
    }
}

/// Proposes the weights of norm-optimal ILC.
///
/// - s1: `q = 1`, all errors alike.
/// - s2: the smallest `s` for which every plant `P (I + W Delta)` converges without `r` (robust
///   monotone convergence), `q |P|^2 |W| < q |P|^2 + s` at all frequencies, times 2. Without an
///   uncertainty `s = 0.01 |P|^2`, the guideline's starting value.
/// - s3: `r` grows from zero as long as that reduces the error: with a reference, to the smallest
///   expected error after `n_runs` runs; without one, to the first value with which past noise adds
///   less than 5 % to the measurement noise.
/// - s4: the figures of the result; `s` is doubled until it is robust.
///
/// # Shapes
/// - `knowledge.reference`: `n_samples` x `n_outputs`, time first
/// # Real Time
/// Cold path.
/// # Errors
/// - as [`analyze`]; [`LearningError::Empty`] for 0 runs.
/// # Source
/// - \[barton2010\], Sec. 3.3.4. There `S` is compared with `|P|`; here with `|P|^2`, its counterpart in
///   the cost, which is the same for an axis of gain 1.
pub fn tune(model: &StateSpace, n_samples: usize, knowledge: &Knowledge) -> Result<Tuning> {
    if knowledge.n_runs == 0 {
        return Err(LearningError::Empty { what: "n_runs" });
    }
    if knowledge.n_runs > RUNS_MAX {
        let (what, value, allowed) = ("n_runs", knowledge.n_runs, RUNS_MAX);
        return Err(LearningError::TooMany { what, value, allowed });
    }
    check_length(model, n_samples)?;
    if let Some(uncertainty) = &knowledge.uncertainty {
        uncertainty.check()?;
    }
    if let Some(reference) = &knowledge.reference {
        check("reference", reference, n_samples, model.n_outputs())?;
    }
    let step = |name, what, value, why: String| TuningStep { name, what, value, why };
    let q = 1.0;
    let mut steps =
        vec![step("s1", "q", q, "only ratios matter: every error counts alike".to_owned())];
    let unit = Weights { q, s: 1.0, r: 0.0, rate: 0.0 };
    let plant = Spectrum::optimal(model, unit)?;
    let (mut s, why) = input_weight(&plant, model, knowledge.uncertainty.as_ref());
    steps.push(step("s2", "s", s, why));
    let (mut r, why) = change_weight(&plant, model, n_samples, s, knowledge)?;
    steps.push(step("s3", "r", r, why));
    let question = Question {
        uncertainty: knowledge.uncertainty.clone(),
        reference: knowledge.reference.clone(),
        noise_std: knowledge.noise_std,
        n_runs: knowledge.n_runs + 1,
    };
    let mut doubled = 0;
    let analysis = loop {
        let weights = Weights { q, s, r, rate: 0.0 };
        let mut law = NormOptimal::new(model, n_samples, weights)?;
        let analysis = analyze(&mut law, model, n_samples, &question)?;
        if analysis.robust_factor.is_none_or(|factor| factor < 1.0) || doubled == 10 {
            break analysis;
        }
        s = if s > 0.0 { s * SAFETY } else { 1e-6 * largest(&plant.plant_gain()).powi(2) };
        doubled += 1;
        r = change_weight(&plant, model, n_samples, s, knowledge)?.0;
    };
    let smoothing_hz = smoothing(model, Weights { q, s, r, rate: 0.0 }, knowledge)?;
    if let Some(hz) = smoothing_hz {
        let why = format!(
            "above {hz:.2} Hz less than half of an error is learned in {} runs, or the model may be \
             wrong by all of it: a zero-phase low-pass loses nothing there",
            knowledge.n_runs
        );
        steps.push(step("smoothing", "smoothing_hz", hz, why));
    }
    let verdict = analysis.robust_factor.map_or_else(
        || analysis.why.clone(),
        |factor| format!("{}; with the uncertainty the worst factor is {factor:.6}", analysis.why),
    );
    let verdict =
        if doubled > 0 { format!("s doubled {doubled} times; {verdict}") } else { verdict };
    steps.push(step("s4", "check", analysis.robust_factor.unwrap_or(f64::NAN), verdict));
    Ok(Tuning { q, s, r, smoothing_hz, steps, analysis })
}

/// Step s2.
fn input_weight(
    plant: &Spectrum,
    model: &StateSpace,
    uncertainty: Option<&Uncertainty>,
) -> (f64, String) {
    let gains = plant.plant_gain();
    let start = INPUT_START * largest(&gains).powi(2);
    let Some(uncertainty) = uncertainty else {
        let why = format!(
            "nothing is known of the uncertainty: 1 % of the squared gain of the model, {:.6}",
            largest(&gains)
        );
        return (start, why);
    };
    let dt_s = model.dt_s().unwrap_or(1.0);
    let least = plant
        .bins
        .iter()
        .zip(&gains)
        .map(|(bin, gain)| gain * gain * (uncertainty.at(bin.frequency_hz, dt_s) - 1.0))
        .fold(0.0, f64::max);
    if least > 0.0 {
        let why = format!(
            "from {start:.3e} to {least:.3e}, below which some plant within the uncertainty diverges; \
             times {SAFETY} for safety"
        );
        return (SAFETY * least, why);
    }
    let why = format!(
        "the uncertainty stays below 100 % (at most {:.1} %): learning is robust without it, and s = 0 \
         leaves no error",
        100.0 * uncertainty.largest()
    );
    (0.0, why)
}

/// Step s3.
fn change_weight(
    plant: &Spectrum,
    model: &StateSpace,
    n_samples: usize,
    s: f64,
    knowledge: &Knowledge,
) -> Result<(f64, String)> {
    let square = largest(&plant.plant_gain()).powi(2);
    let weights = |r: f64| Weights { q: 1.0, s, r, rate: 0.0 };
    let smallest = 1e-6 * square;
    let noise_std = knowledge.noise_std.filter(|noise| *noise > 0.0);
    let Some(noise_std) = noise_std else {
        if NormOptimal::new(model, n_samples, weights(0.0)).is_ok() {
            let why = "no noise is known: learning may take the whole step at once".to_owned();
            return Ok((0.0, why));
        }
        let why = format!(
            "no noise is known, but without r the input is not bounded: 1e-6 of the squared gain, \
             {smallest:.3e}"
        );
        return Ok((smallest, why));
    };
    let floor = noise_std * (model.n_outputs() as f64).sqrt();
    let mut best: Option<(f64, f64)> = None;
    let mut tried = 0;
    for exponent in -12..=12 {
        crate::interrupt::point();
        let r = square * 10.0_f64.powf(f64::from(exponent) / 2.0);
        let Ok(mut law) = NormOptimal::new(model, n_samples, weights(r)) else { continue };
        tried += 1;
        let spectrum = plant.with(model, weights(r));
        let (shares, limit) = spectrum.noise(knowledge.n_runs + 1);
        if let Some(reference) = &knowledge.reference {
            let repeated = repeated_rms(&mut law, model, reference, n_samples, knowledge.n_runs)?;
            let share = shares.last().copied().unwrap_or(0.0);
            let rms = (repeated.powi(2) + noise_std.powi(2) * share + floor.powi(2)).sqrt();
            if best.is_none_or(|(_, least)| rms < least) {
                best = Some((r, rms));
            }
        } else {
            let Some(limit) = limit else { continue };
            let rms = (noise_std.powi(2) * limit + floor.powi(2)).sqrt();
            best = Some((r, rms));
            if rms <= FLUCTUATION * floor {
                break;
            }
        }
    }
    let Some((r, rms)) = best else { return Ok((smallest, "no weight could be tried".to_owned())) };
    let why = if knowledge.reference.is_some() {
        format!(
            "of {tried} weights this one leaves the least expected RMS error after {} runs: {rms:.4e}, \
             the noise alone being {floor:.4e}",
            knowledge.n_runs
        )
    } else {
        format!(
            "the smallest of {tried} weights with which past noise adds little: RMS fluctuation \
             {rms:.4e}, the noise alone being {floor:.4e}"
        )
    };
    Ok((r, why))
}

/// RMS of the repeatable error after some runs without noise.
fn repeated_rms(
    law: &mut NormOptimal,
    model: &StateSpace,
    reference: &[f64],
    n_samples: usize,
    n_runs: usize,
) -> Result<f64> {
    let n_u = n_samples * model.n_inputs();
    let (mut input, mut next) = (vec![0.0; n_u], vec![0.0; n_u]);
    let mut error = reference.to_vec();
    for _ in 0..n_runs {
        crate::interrupt::point();
        law.update(&input, &error, &mut next)?;
        std::mem::swap(&mut input, &mut next);
        let y = model.simulate(&input, None)?;
        for ((e, r), y) in error.iter_mut().zip(reference).zip(&y) {
            *e = r - y;
        }
    }
    Ok((error.iter().map(|e| e * e).sum::<f64>() / n_samples as f64).sqrt())
}

/// The frequency above which the law learns less than half of an error, or the model uncertainty
/// exceeds 100 %.
fn smoothing(model: &StateSpace, weights: Weights, knowledge: &Knowledge) -> Result<Option<f64>> {
    let spectrum = Spectrum::optimal(model, weights)?;
    let dt_s = model.dt_s().unwrap_or(1.0);
    let slow = 0.5_f64.powf(1.0 / knowledge.n_runs as f64);
    let useless = spectrum.bins.iter().zip(spectrum.contraction()).find(|(bin, contraction)| {
        let wrong = knowledge
            .uncertainty
            .as_ref()
            .is_some_and(|uncertainty| uncertainty.at(bin.frequency_hz, dt_s) >= 1.0);
        bin.frequency_hz > 0.0 && (*contraction > slow || wrong)
    });
    Ok(useless.map(|(bin, _)| bin.frequency_hz))
}

fn largest(gains: &[f64]) -> f64 {
    gains.iter().copied().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        discretize(&second_order(94.2, 0.7).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    /// 20 % at frequency zero, 300 % at the Nyquist frequency.
    fn growing() -> Uncertainty {
        Uncertainty::Shaped((0..=100).map(|k| 0.2 + 2.8 * f64::from(k) / 100.0).collect())
    }

    #[test]
    fn the_smallest_robust_input_weight_is_doubled() {
        let knowledge = Knowledge { uncertainty: Some(growing()), ..Knowledge::default() };
        let model = axis();
        let found = tune(&model, 300, &knowledge).unwrap();
        // s_min = max |P|^2 (|W| - 1), from the impulse response.
        let parameters = model.markov(600).unwrap();
        let gain = |hz: f64| {
            let turn = std::f64::consts::TAU * hz * 2e-3;
            let (re, im) = parameters.iter().enumerate().fold((0.0, 0.0), |(re, im), (k, h)| {
                let (sin, cos) = (turn * k as f64).sin_cos();
                (re + h[(0, 0)] * cos, im - h[(0, 0)] * sin)
            });
            re * re + im * im
        };
        let least = (0..=2500)
            .map(|k| 0.1 * f64::from(k))
            .map(|hz| gain(hz) * (growing().at(hz, 2e-3) - 1.0))
            .fold(0.0, f64::max);
        assert!(least > 0.0 && (found.s - 2.0 * least).abs() < 1e-2 * least, "{} {least}", found.s);
        assert!(found.analysis.robust_factor.unwrap() < 1.0);
        assert!(found.smoothing_hz.unwrap() < 0.8 / 2.8 * 250.0 + 1.0);
        let names: Vec<_> = found.steps.iter().map(|step| step.name).collect();
        assert_eq!(names, ["s1", "s2", "s3", "smoothing", "s4"]);
    }

    #[test]
    fn a_model_that_is_nearly_right_needs_no_weight_of_the_input() {
        let knowledge =
            Knowledge { uncertainty: Some(Uncertainty::Scalar(0.3)), ..Knowledge::default() };
        let found = tune(&axis(), 300, &knowledge).unwrap();
        assert_eq!(found.s.to_bits(), 0.0_f64.to_bits());
        assert!(found.analysis.converges);
    }

    #[test]
    fn noise_asks_for_a_weight_of_the_change_and_haste_against_it() {
        let reference: Vec<f64> =
            (0..300).map(|k| 0.01 * (1.0 - (f64::from(k) / 40.0).cos())).collect();
        let knowledge = |noise_std: f64, n_runs: usize| Knowledge {
            uncertainty: Some(Uncertainty::Scalar(0.3)),
            noise_std: Some(noise_std),
            reference: Some(reference.clone()),
            n_runs,
        };
        let r = |noise_std, n_runs| tune(&axis(), 300, &knowledge(noise_std, n_runs)).unwrap().r;
        assert!(r(1e-3, 10) > r(1e-6, 10), "more noise, slower learning");
        assert!(r(1e-4, 40) >= r(1e-4, 4), "more runs, more time to learn in");
        // The choice is optimal: with ten times more or less the expected error is not smaller.
        let found = tune(&axis(), 300, &knowledge(1e-4, 10)).unwrap();
        let expected = |r: f64| {
            let w = Weights { r, ..found.weights() };
            let mut law = NormOptimal::new(&axis(), 300, w).unwrap();
            let question = Question {
                reference: Some(reference.clone()),
                noise_std: Some(1e-4),
                n_runs: 11,
                ..Question::default()
            };
            analyze(&mut law, &axis(), 300, &question).unwrap().expected_rms[10]
        };
        assert!(expected(found.r) <= expected(10.0 * found.r) * 1.001);
        assert!(expected(found.r) <= expected(0.1 * found.r) * 1.001);
    }

    #[test]
    fn without_knowledge_the_weights_are_still_bounded() {
        let found = tune(&axis(), 200, &Knowledge::default()).unwrap();
        assert!(found.s > 0.0 && found.analysis.monotonic);
        let outside = from_transfer_function(&[0.5, -0.65], &[1.0, -1.1, 0.3], Some(1e-3)).unwrap();
        let sure =
            Knowledge { uncertainty: Some(Uncertainty::Scalar(0.1)), ..Knowledge::default() };
        let found = tune(&outside, 300, &sure).unwrap();
        assert!(found.r > 0.0 && found.steps[2].why.contains("not bounded"), "{:?}", found.steps);
        let many = Knowledge { n_runs: 10_001, ..Knowledge::default() };
        let refused = tune(&axis(), 200, &many);
        assert!(matches!(refused, Err(LearningError::TooMany { what: "n_runs", .. })));
        let none = Knowledge { n_runs: 0, ..Knowledge::default() };
        assert!(matches!(tune(&axis(), 200, &none), Err(LearningError::Empty { what: "n_runs" })));
    }
}
