//! The cases that property tests draw: fixed ones, or new ones for `make fuzz`.
//!
//! A change is judged by fixed problems, so that a test that passed here passes everywhere. New
//! problems are searched for on purpose: `make fuzz` sets `ILC_FUZZ_SEED` to a different number
//! every time. A failing case is written, one line per case, to the regression file beside the
//! test; every later run tries it first.

use proptest::test_runner::{Config, FileFailurePersistence, RngSeed};

/// Environment variable with the seed of `make fuzz`.
pub const SEED_VARIABLE: &str = "ILC_FUZZ_SEED";

/// The seed of every property test.
const SEED: u64 = 20_261_128;

/// Default number of cases of a test.
pub const CASES: u32 = 256;

/// Returns the configuration of a property test with `cases` cases.
///
/// # Panics
/// If `ILC_FUZZ_SEED` is not a whole number from 0 to 2^64 - 1.
pub fn cases(cases: u32) -> Config {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(seed()),
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..Config::default()
    }
}

/// Returns the seed of this run: the fixed one, or that of `make fuzz`.
///
/// # Panics
/// If `ILC_FUZZ_SEED` is not a whole number from 0 to 2^64 - 1.
pub fn seed() -> u64 {
    match std::env::var(SEED_VARIABLE) {
        Err(_) => SEED,
        Ok(text) => text.parse().unwrap_or_else(|_| {
            panic!("{SEED_VARIABLE}={text}: a whole number from 0 to 2^64 - 1")
        }),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use proptest::prelude::any;
    use proptest::test_runner::TestRunner;

    use super::*;

    fn drawn() -> Vec<u64> {
        let seen = RefCell::new(Vec::new());
        TestRunner::new(cases(20))
            .run(&any::<u64>(), |value| {
                seen.borrow_mut().push(value);
                Ok(())
            })
            .unwrap();
        seen.into_inner()
    }

    #[test]
    fn two_runs_draw_the_same_cases() {
        let first = drawn();
        assert_eq!(first.len(), 20);
        assert_eq!(first, drawn());
    }
}
