//! Properties of every law of the catalogue, as a campaign builds it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_tests::catalogue::{Built, every_law};

fn signal(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|k| 1e-9 * ((k as f64 * 0.7 + seed).sin() + (k as f64 * seed).cos())).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Laws whose update is not linear, or whose adjoint the analysis derives from their cost.
const WITHOUT: [&str; 10] = [
    "constrained",
    "norm_optimal",
    "dynamic",
    "formation",
    "through_jacobian",
    "relevance",
    "flexible",
    "higher_order",
    "filtered",
    "model_free",
];

#[test]
fn adjoints_are_those_of_the_updates() {
    let mut without = Vec::new();
    for Built { learning, mut law, n_values } in every_law() {
        let name = learning.split('"').nth(1).unwrap();
        let (u, e) = (signal(n_values, 0.3), signal(n_values, 1.1));
        let (dual, zero) = (signal(n_values, 2.3), vec![0.0; n_values]);
        let (mut to_u, mut to_e) = (vec![0.0; n_values], vec![0.0; n_values]);
        if !law.apply_adjoint(&dual, &mut to_u, &mut to_e).unwrap() {
            without.push(name);
            continue;
        }
        law.set_disturbance(&[20.0]);
        let (mut next, mut offset) = (vec![0.0; n_values], vec![0.0; n_values]);
        law.update(&u, &e, &mut next).unwrap();
        law.reset();
        law.update(&zero, &zero, &mut offset).unwrap();
        let (forward, back) =
            (dot(&next, &dual) - dot(&offset, &dual), dot(&u, &to_u) + dot(&e, &to_e));
        let scale = dot(&next, &next).sqrt() * dot(&dual, &dual).sqrt();
        assert!((forward - back).abs() < 1e-10 * scale, "{learning}: {forward} {back}");
    }
    assert!(without.iter().all(|name| WITHOUT.contains(name)), "without an adjoint: {without:?}");
}
