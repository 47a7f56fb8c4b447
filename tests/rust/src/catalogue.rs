//! Every law of the catalogue, as a campaign would build it from its examples.

use ilc_rt::config::{Cell, LawName, Learning};
use ilc_rt::design::Plan;
use ilc_rt::learning::Law;
use ilc_rt::learning::law::LawTables;

use crate::example_text;

/// A law in a cell in which it learns.
#[expect(missing_debug_implementations, reason = "a law has none")]
pub struct Built {
    /// Text of its `[learning]`.
    pub learning: &'static str,
    /// The law, for runs of `n_values` inputs and as many errors.
    pub law: Box<dyn Law>,
    /// Samples times axes of a run.
    pub n_values: usize,
}

/// Returns the cells of all examples of the catalogue, each with the text of its `[learning]`.
///
/// # Panics
/// If a law has no example, or one that is invalid.
pub fn every_cell() -> Vec<(&'static str, Cell)> {
    let tables = Learning::default();
    let examples = LawName::ALL.iter().flat_map(|law| {
        let examples = tables.parameters(*law).expect("a law has parameters").examples();
        assert!(!examples.is_empty(), "{law:?} has no example");
        examples
    });
    let cells = examples.map(|example| {
        let name = if example.is_parallel { "02_parallel.toml" } else { "01_gantry.toml" };
        let text = example_text(name);
        let before = text.split("[learning]").next().unwrap_or_default();
        let text = format!("{before}[learning]\n{}\n", example.learning);
        (example.learning, Cell::parse(&text, name).expect("an example is valid"))
    });
    cells.collect()
}

/// Returns the laws of all examples of the catalogue.
///
/// # Panics
/// If a law has no example, or one that cannot be built.
pub fn every_law() -> Vec<Built> {
    let built = every_cell().into_iter().map(|(learning, cell)| {
        let plan = Plan::new(&cell, None, true).expect("an example can be planned");
        let law = plan.law(&cell).expect("the law of an example can be built").law;
        let law = law.expect("an example learns");
        Built { learning, law, n_values: plan.reference_m.len() }
    });
    built.collect()
}
