//! Tests of the library as a whole: stored data are read back.

use std::path::PathBuf;

use super::*;
use crate::record::{Figures, IterationRecord, Meta};

pub(super) fn meta(campaign: &str) -> Meta {
    Meta {
        cell: "gantry".into(),
        campaign: campaign.into(),
        fingerprint: "f".into(),
        law: "norm_optimal".into(),
        law_parameters: "{}".into(),
        measure: "tcp".into(),
        program: "[]".into(),
        cycle_s: 0.002,
        n_axes: 2,
        axis_names: vec!["x".into(), "y".into()],
        input_units: vec!["m".into(), "m/s".into()],
    }
}

pub(super) fn record(index: u32) -> IterationRecord {
    IterationRecord {
        index,
        reference_m: vec![1.0, 2.0, 3.0, 4.0],
        input: vec![0.0, -0.0, f64::MIN_POSITIVE, 1e300],
        encoder_m: vec![0.1; 4],
        tool_m: vec![0.2; 4],
        error_m: vec![0.3; 4],
        contour_m: vec![0.4; 2],
        disturbance: vec![0.1 + 0.2, -1e300],
        figures: Figures {
            update_ms: 0.5,
            rolled_back: true,
            axes_tracking_inf_m: vec![0.3, 0.3],
            axes_tracking_rms_m: vec![0.3, 0.3],
            contour_inf_m: Some(0.4),
            learning_off: true,
            remark: Some("the error grew".into()),
            ..Default::default()
        },
    }
}

#[test]
fn what_was_appended_is_read_back_bit_by_bit() {
    let library = Library::in_memory().unwrap();
    let id = library.append(&meta("a"), &record(0)).unwrap();
    let row = library.load(id).unwrap();
    assert_eq!(row.record, record(0));
    assert_eq!(row.meta, meta("a"));
    assert_eq!(row.n_samples, 2);
}

#[test]
fn a_value_that_cannot_be_read_is_named_with_its_run() {
    for (column, value) in [
        ("tracking_rms_m", "9e999"),
        ("tracking_rms_m", "'0.1 m'"),
        ("axes_tracking_inf_m", "'[null]'"),
        ("update_ms", "-9e999"),
        ("overruns", "-1"),
        ("iteration", "-5"),
        ("cell", "x'00ff'"),
        ("n_axes", "'two'"),
    ] {
        let library = Library::in_memory().unwrap();
        for index in 0..3 {
            library.append(&meta("a"), &record(index)).unwrap();
        }
        let damage = format!("UPDATE iteration SET {column} = {value} WHERE id = 2");
        library.connection.execute(&damage, []).unwrap();
        let wanted = Unreadable { id: 2, column: column.to_owned() };
        let errors = [library.load(2).map(drop), library.list(None).map(drop)];
        for error in errors.map(Result::unwrap_err) {
            let LibraryError::Unreadable { found, .. } = error else { panic!("{error}") };
            assert_eq!(found, wanted, "{value}");
        }
        assert!(library.load(1).is_ok() && library.load(3).is_ok());
    }
}

#[test]
fn a_run_cannot_be_kept_twice() {
    let library = Library::in_memory().unwrap();
    library.append(&meta("a"), &record(0)).unwrap();
    assert!(library.append(&meta("a"), &record(0)).is_err());
    assert_eq!(library.list(Some("a")).unwrap().len(), 1);
    assert!(library.list(Some("b")).unwrap().is_empty());
}

#[test]
fn a_flipped_bit_is_noticed() {
    let library = Library::in_memory().unwrap();
    let id = library.append(&meta("a"), &record(0)).unwrap();
    library.connection.execute("UPDATE signals SET input = zeroblob(32)", []).unwrap();
    assert!(matches!(library.load(id), Err(LibraryError::Damaged { .. })));
}

#[test]
fn the_newest_campaign_is_found_by_fingerprint() {
    let library = Library::in_memory().unwrap();
    library.append(&meta("a"), &record(0)).unwrap();
    library.append(&meta("b"), &record(0)).unwrap();
    assert_eq!(library.newest_campaign("f").unwrap().as_deref(), Some("b"));
    assert_eq!(library.newest_campaign("g").unwrap(), None);
}

#[test]
fn what_a_law_decides_later_is_added() {
    let library = Library::in_memory().unwrap();
    let mut run = record(0);
    (run.figures.rolled_back, run.figures.learning_off, run.figures.remark) = (false, false, None);
    let id = library.append(&meta("a"), &run).unwrap();
    run.figures.rolled_back = true;
    run.figures.remark = Some("it grew".into());
    library.judge(id, &run.figures).unwrap();
    assert_eq!(library.load(id).unwrap().record, run);
}

#[test]
fn a_file_that_is_no_library_is_refused() {
    let path = std::env::temp_dir().join(format!("ilc-not-a-library-{}", std::process::id()));
    std::fs::write(&path, "this is no database, it only looks like a file").unwrap();
    let refused = Library::open(&path);
    std::fs::remove_file(&path).unwrap();
    assert!(refused.unwrap_err().to_string().contains("not a database"));
}

/// A temporary folder, deleted when dropped.
pub(super) struct Folder(pub(super) PathBuf);

impl Folder {
    pub(super) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("ilc-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub(super) fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<String> =
            entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
