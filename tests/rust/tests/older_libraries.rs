//! Campaigns of libraries that older versions wrote go on, and what they learned is the same to the last
//! bit: fingerprints and digests of the second run come from version 0.1 (`legacy_campaigns.json`). Those of
//! `norm_optimal` are newer: its sums are in another order.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign::{self, CampaignError, Options};
use ilc_rt::config::Cell;
use ilc_rt::record::EndStatus;

use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example_text};
use serde_json::Value;

const OLDER: &str = include_str!("../../golden/legacy_campaigns.json");

/// A cell of the fixture, with another number in its learning if it is to be another campaign.
fn cell(campaign: &Value, change: &dyn Fn(&mut Cell)) -> Cell {
    let text = example_text(campaign["cell"].as_str().unwrap());
    let end = text.find("[learning]").unwrap();
    let learning = campaign["learning"].as_str().unwrap();
    let mut cell =
        Cell::parse(&format!("{}[learning]\n{learning}\n", &text[..end]), "cell.toml").unwrap();
    change(&mut cell);
    cell
}

#[test]
fn campaigns_of_version_0_1_go_on() {
    let campaigns: Vec<Value> = serde_json::from_str(OLDER).unwrap();
    assert_eq!(campaigns.len(), 8);
    let mut changed = Vec::new();
    for campaign in &campaigns {
        let (whole, scratch) = (cell(campaign, &|_| {}), Scratch::new());
        let path = scratch.file("library.db");
        let run = |cell: &Cell, resume: bool, iterations: u32| {
            let options = Options { resume, ..options(path.clone(), iterations) };
            campaign::run(cell, &options, in_process(cell), None, &mut |_| {})
        };
        run(&whole, false, 2).unwrap();
        let connection = rusqlite::Connection::open(&path).unwrap();
        let digest: String = connection
            .query_row("SELECT digest FROM iteration WHERE iteration = 1", [], |row| row.get(0))
            .unwrap();
        let learning = &campaign["learning"];
        if digest != campaign["digest"].as_str().unwrap() {
            changed.push(format!("{learning}: {digest}"));
        }
        let fingerprint = campaign["fingerprint"].as_str().unwrap();
        connection.execute("UPDATE iteration SET fingerprint = ?1", [fingerprint]).unwrap();
        drop(connection);

        let narrower = cell(campaign, &|cell| cell.axes[1].limits.following_error_max_m *= 0.5);
        let refused = run(&narrower, true, 3).unwrap_err();
        assert!(matches!(refused, CampaignError::Resume(_)), "{learning}: {refused}");
        let outcome = run(&whole, true, 3).unwrap();
        assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Completed, 3), "{learning}");
        assert_eq!(run(&whole, true, 4).unwrap().runs.len(), 4, "{learning}: once more");
    }
    assert!(changed.is_empty(), "other digests:\n{}", changed.join("\n"));
}
