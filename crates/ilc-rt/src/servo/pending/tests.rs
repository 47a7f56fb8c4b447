//! Answers in time, late, lost, duplicated.

use std::collections::BTreeSet;

use super::*;

/// Both PDOs of an axis.
fn answer(pending: &mut PendingCycles, axis: usize, value: f64) {
    pending.answer(Part::Status(axis), [value, 0.0]);
    pending.answer(Part::DriveMotion(axis), [0.0; 2]);
}

#[test]
fn a_late_answer_lands_in_its_own_cycle() {
    let mut pending = PendingCycles::new(&[[true; 2]; 2], false);
    pending.send(Sample::default(), [0.0; MAX_AXES], false);
    answer(&mut pending, 0, 10.0);
    pending.watch_lag();
    assert!(pending.take().is_none(), "node 1 has not answered");
    pending.send(Sample::default(), [0.0; MAX_AXES], true);
    answer(&mut pending, 1, 20.0);
    answer(&mut pending, 1, 21.0);
    answer(&mut pending, 0, 11.0);
    pending.watch_lag();
    let (first, last) = pending.take().unwrap();
    assert_eq!((first.encoder_m[0], first.encoder_m[1], last), (10.0, 20.0, false));
    let (second, last) = pending.take().unwrap();
    assert_eq!((second.encoder_m[0], second.encoder_m[1], last), (11.0, 21.0, true));
    assert!(pending.all_answered());
}

/// Lets `n` cycles pass; `deliver` selects the answers of PDO 1 in the tick after each SYNC.
fn pass(n: u64, mut deliver: impl FnMut(u64, &mut Vec<u64>)) -> Vec<Sample> {
    let mut pending = PendingCycles::new(&[[true; 2]], false);
    let mut out = Vec::new();
    let mut coming = Vec::new();
    for sync in 0..n {
        pending.send(Sample::default(), [0.0; MAX_AXES], false);
        deliver(sync, &mut coming);
        for of in coming.drain(..) {
            pending.answer(Part::Status(0), [of as f64, 0.0]);
        }
        pending.answer(Part::DriveMotion(0), [0.0; 2]);
        pending.watch_lag();
        while let Some((sample, _)) = pending.take() {
            out.push(sample);
        }
    }
    out
}

/// Returns the cycles with missing measurements; no other may be wrong.
fn missing(samples: &[Sample]) -> BTreeSet<u64> {
    for sample in samples.iter().filter(|sample| !sample.missing) {
        assert_eq!(sample.encoder_m[0], sample.sync as f64, "in the wrong cycle");
    }
    samples.iter().filter(|sample| sample.missing).map(|sample| sample.sync).collect()
}

#[test]
fn lost_answers_are_missing_and_shift_nothing() {
    for n_lost in [1, 2, 10, 19] {
        let out = pass(200, |sync, coming| {
            if !(50..50 + n_lost).contains(&sync) {
                coming.push(sync);
            }
        });
        assert_eq!(missing(&out), (50..50 + n_lost).collect(), "{n_lost}");
        assert!(out.len() > 190);
    }
}

#[test]
fn late_answers_are_not_missing() {
    for n_late in [1, 2, 10, 19] {
        let out = pass(200, |sync, coming| {
            if !(50..50 + n_late).contains(&sync) {
                coming.extend((50..50 + n_late).filter(|_| sync == 50 + n_late));
                coming.push(sync);
            }
        });
        assert_eq!(missing(&out), BTreeSet::new(), "{n_late}");
    }
}

#[test]
fn a_doubled_answer_makes_its_cycle_missing() {
    let out = pass(100, |sync, coming| {
        coming.push(sync);
        if sync == 50 {
            coming.push(sync);
        }
    });
    assert_eq!(missing(&out), BTreeSet::from([50]));
}

#[test]
fn whatever_comes_and_does_not_nothing_is_put_in_the_wrong_cycle_for_long() {
    let mut state = 7_u64;
    let mut random = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    // Losses far enough apart to be distinguished.
    let lost: BTreeSet<u64> = (1..40).map(|n| n * 50 + random() % 20).collect();
    let out = pass(2100, |sync, coming| {
        if !lost.contains(&sync) {
            coming.push(sync);
        }
    });
    assert_eq!(missing(&out), lost);
    // Random losses, close to each other: at least marked as missing, never taken for valid.
    let out = pass(5000, |sync, coming| {
        if random() % 12 > 0 {
            coming.push(sync);
        }
    });
    assert!(missing(&out).len() > 300);
}

#[test]
fn a_late_position_belongs_to_the_command_that_it_answers() {
    let mut pending = PendingCycles::new(&[[true; 2]], false);
    assert_eq!(pending.answered_command_m(0), None);
    for n in 0..4 {
        pending.send(Sample::default(), [f64::from(n); MAX_AXES], false);
    }
    answer(&mut pending, 0, 0.0);
    assert_eq!(pending.answered_command_m(0), Some(0.0));
    for n in 1..4 {
        answer(&mut pending, 0, f64::from(n));
        assert_eq!(pending.answered_command_m(0), Some(f64::from(n)));
    }
}

#[test]
fn one_pdo_of_two_is_not_enough() {
    let mut pending = PendingCycles::new(&[[true; 2]], true);
    for _ in 0..60 {
        pending.send(
            Sample { encoder_m: [7.0; MAX_AXES], ..Default::default() },
            [0.0; MAX_AXES],
            false,
        );
        pending.answer(Part::DriveMotion(0), [0.0; 2]);
        pending.answer(Part::Tool, [1.0, 2.0]);
        pending.watch_lag();
    }
    assert_eq!((pending.lag(Part::Status(0)), pending.silence(Part::Status(0))), (60, 60));
    assert_eq!((pending.lag(Part::DriveMotion(0)), pending.lag(Part::Tool)), (0, 0));
    let (sample, _) = pending.take().unwrap();
    assert!(sample.missing && (sample.encoder_m[0] - 7.0).abs() < 1e-15);
    assert_eq!(sample.tool_m[..2], [1.0, 2.0]);
}
