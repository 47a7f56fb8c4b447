//! Property tests draw fixed cases: each one must use `ilc_cases::cases`.

#![allow(clippy::unwrap_used, reason = "a test fails where a file is not there")]

use std::path::{Path, PathBuf};

/// Folders with Rust sources.
const FOLDERS: [&str; 3] = ["crates", "sim", "tests"];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn every_property_test_names_its_cases() {
    // Read at run time: the target folder may have been filled by another checkout.
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap()).join("../..");
    let mut files = Vec::new();
    for folder in FOLDERS {
        sources(&root.join(folder), &mut files);
    }
    let mut blocks = 0;
    for file in files.iter().filter(|file| !file.ends_with("tests/fixed.rs")) {
        let text = std::fs::read_to_string(file).unwrap();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        for (number, line) in lines.iter().enumerate() {
            if *line == "proptest! {" {
                blocks += 1;
                assert!(
                    lines[number + 1].starts_with("#![proptest_config(ilc_cases::cases("),
                    "{}:{}: begin the block with #![proptest_config(ilc_cases::cases(…))], so that \
                     it draws the same cases in every run and others for make fuzz",
                    file.display(),
                    number + 2,
                );
            }
        }
    }
    assert!(blocks > 15, "only {blocks} blocks of property tests were found");
}
