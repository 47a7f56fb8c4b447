//! Refusals: divergent laws, laws that are not linear, laws of unknown structure, wrong questions.

use super::*;

#[test]
fn divergent_laws_are_refused_and_sound_ones_are_not() {
    let model = axis(2e-3).delayed(2).unwrap();
    let n = 1300;
    let pd = |kp: f64, lead: usize, cutoff_hz: f64| {
        let filter = QFilter::ZeroPhase(butterworth(2, cutoff_hz, 2e-3).unwrap());
        Pd::new(PdGains { kp, kd: 0.0, lead_samples: lead }, n, 1, filter).unwrap()
    };
    for (kp, lead, cutoff_hz) in [(0.5, 1, 10.0), (0.5, 8, 10.0), (0.9, 10, 10.0)] {
        let verdict = divergence(&mut pd(kp, lead, cutoff_hz), &model, n).unwrap().unwrap();
        assert!(verdict.converges, "{kp} {lead} {cutoff_hz}: {verdict:?}");
    }
    let line = refuse_divergent(&mut pd(0.5, 1, 100.0), &model, n).unwrap_err().to_string();
    assert!(line.contains("this law will not converge"), "{line}");
    let line = refuse_divergent(&mut pd(2.5, 8, 10.0), &model, n).unwrap_err().to_string();
    assert!(line.contains("allow_divergent"), "{line}");
    let mut optimal = NormOptimal::new(&model, n, weights(1.0, 0.0, 0.0, 6.0)).unwrap();
    assert!(refuse_divergent(&mut optimal, &model, n).is_ok());
    // A model of the wrong sign: nothing of the law's own certainty holds.
    let gain = StateSpace::static_gain(nalgebra::dmatrix![-1.0], model.dt_s()).unwrap();
    let reversed = model.series(&gain).unwrap();
    assert!(refuse_divergent(&mut optimal, &reversed, n).is_err());
}

/// A law that is not linear.
#[derive(Debug)]
struct Clipped;

impl Law for Clipped {
    fn update(&mut self, u: &[f64], e: &[f64], next: &mut [f64]) -> Result {
        for (i, value) in next.iter_mut().enumerate() {
            *value = (u[i] + e[i]).clamp(-0.1, 0.1);
        }
        Ok(())
    }
    fn reset(&mut self) {}
    fn describe(&self) -> String {
        "{}".to_owned()
    }
}

/// A law that says nothing of itself.
#[derive(Debug)]
struct Silent(Pd);

impl Law for Silent {
    fn update(&mut self, u: &[f64], e: &[f64], next: &mut [f64]) -> Result {
        self.0.update(u, e, next)
    }
    fn reset(&mut self) {}
    fn describe(&self) -> String {
        "{}".to_owned()
    }
}

#[test]
fn laws_that_say_nothing_are_tried() {
    let (model, n) = (axis(2e-3), 100);
    let question = Question::default();
    let line = analyze(&mut Clipped, &model, n, &question).unwrap_err().to_string();
    assert!(line.contains("the law is not linear"), "{line}");
    assert!(refuse_divergent(&mut Clipped, &model, n).is_ok());
    let gains = PdGains { kp: 0.5, kd: 0.3, lead_samples: 4 };
    let filter = || QFilter::ZeroPhase(butterworth(2, 20.0, 2e-3).unwrap());
    let pd = || Pd::new(gains, n, 1, filter()).unwrap();
    let open = analyze(&mut pd(), &model, n, &question).unwrap();
    let silent = analyze(&mut Silent(pd()), &model, n, &question).unwrap();
    assert_eq!(open.monotonic_factor, silent.monotonic_factor);
    assert_eq!(open.spectral_radius, silent.spectral_radius);
    // Beyond whole matrices column by column, and beyond that not at all.
    let long = |n| Pd::new(gains, n, 1, filter()).unwrap();
    let open = analyze(&mut long(1000), &model, 1000, &question).unwrap();
    let silent = analyze(&mut Silent(long(1000)), &model, 1000, &question).unwrap();
    let (open, silent) = (open.monotonic_factor.unwrap(), silent.monotonic_factor.unwrap());
    assert!(close(open.value, silent.value, 1e-8), "{open:?} {silent:?}");
    let found = analyze(&mut Silent(long(3001)), &model, 3001, &question).unwrap();
    assert!(found.monotonic_factor.is_none() && !found.contraction.is_empty());
    assert!(!found.monotonic, "{}", found.why);
    assert!(!found.converges || found.why.contains("is not known"), "{}", found.why);
}

#[test]
fn wrong_questions_are_refused_one_at_a_time() {
    let (model, n) = (axis(2e-3), 50);
    let mut law = NormOptimal::new(&model, n, weights(1.0, 0.0, 0.1, 0.0)).unwrap();
    let mut line =
        |question: Question| analyze(&mut law, &model, n, &question).unwrap_err().to_string();
    let plain = Question::default;
    let found = line(Question { reference: Some(vec![0.0; 49]), ..plain() });
    assert!(found.contains("reference holds 49 values"), "{found}");
    let found = line(Question { noise_std: Some(-1.0), ..plain() });
    assert!(found.contains("noise_std = -1"), "{found}");
    let found = line(Question { uncertainty: Some(Uncertainty::Scalar(f64::NAN)), ..plain() });
    assert!(found.contains("uncertainty = NaN"), "{found}");
    let found = line(Question { uncertainty: Some(Uncertainty::Shaped(vec![])), ..plain() });
    assert!(found.contains("uncertainty = 0"), "{found}");
    let continuous = second_order(94.2, 0.7).unwrap();
    assert!(analyze(&mut law, &continuous, n, &plain()).is_err());
}

proptest! {
    #![proptest_config(ilc_cases::cases(48))]

    #[test]
    fn an_optimal_law_with_a_true_model_falls_in_every_run(
        seed in any::<u64>(),
        n_states in 1..4_usize,
        n in 4..50_usize,
        r in prop::sample::select(vec![1e-3, 0.1, 10.0]),
        s in prop::sample::select(vec![0.0, 0.01, 1.0]),
    ) {
        let draw = |rows: usize, cols: usize, salt: u64| {
            DMatrix::from_row_slice(rows, cols, &noise(rows * cols, seed ^ salt))
        };
        let a = draw(n_states, n_states, 1) * (0.9 / n_states as f64);
        let (b, c) = (draw(n_states, 1, 2), draw(1, n_states, 3));
        let model =
            StateSpace::discrete(a, b, c, DMatrix::from_element(1, 1, 1.0), 1e-3).unwrap();
        let w = weights(1.0, s, r, 0.0);
        let mut law = NormOptimal::new(&model, n, w).unwrap();
        let found = analyze(&mut law, &model, n, &Question::default()).unwrap();
        let factor = found.monotonic_factor.unwrap().value;
        prop_assert!(found.converges && found.monotonic);
        let [keep, learn, p] = lifted_optimal(&model, n, w);
        // T = r (P'P + s + r)^-1, whose largest eigenvalue belongs to the weakest direction of P. A
        // zero far outside the unit circle leaves directions so weak that the factor rounds to 1.
        let weakest = smallest_singular(&p).powi(2);
        prop_assert!(close(factor, r / (weakest + s + r), 1e-9));
        prop_assert!(factor < 1.0 + 1e-12 && found.spectral_radius.value <= factor * (1.0 + 1e-9));
        let t = keep - learn * p;
        prop_assert!(close(factor, largest_singular(&t), 1e-9));
        prop_assert!(close(found.spectral_radius.value, largest_eigenvalue(&t), 1e-9));
    }
}
