//! The dependencies of the architecture point one way, and hot code is fenced.
//!
//! Reads the table of `ARCHITECTURE.md` and every `crate::…` path in the controller's source.

#![allow(clippy::unwrap_used, reason = "a test fails where a file is not there")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ilc_tests::root;
use ilc_tests::source::{code, module_of, rust_files, test_modules};

/// First line of every hot file.
const FENCE: &str =
    "#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]";

/// Files in hot modules that only set up, describe or refuse; none is called in a tick.
const COLD_FILES: [&str; 3] = [
    // Set up the loop's thread, or try to.
    "rt/processor.rs",
    "rt/readiness.rs",
    "rt/thread.rs",
];

struct Module {
    row: u32,
    is_hot: bool,
}

/// Parses `| 3 | `servo` | hot | the cycle … |` in the table of layers.
fn layers() -> BTreeMap<String, Module> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut modules = BTreeMap::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, row, name, heat, ..] = cells[..] else { continue };
        let (Ok(row), Some(name)) =
            (row.parse(), name.strip_prefix('`').and_then(|name| name.strip_suffix('`')))
        else {
            continue;
        };
        modules.insert(name.to_owned(), Module { row, is_hot: heat == "hot" });
    }
    assert!(modules.len() >= 10, "the table of layers is not where this test looks for it");
    modules
}

/// Returns the top-level modules that `code` names after `crate::`, also in braces.
fn imports(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        // `$crate::` and `other_crate::` are other paths.
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            None => found.extend(first_word(rest)),
            Some(group) => {
                let mut depth = 0;
                let mut begins = true;
                for (offset, c) in group.char_indices() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => begins = true,
                        c if begins && !c.is_whitespace() => {
                            found.extend(first_word(&group[offset..]));
                            begins = false;
                        }
                        _ => {}
                    }
                }
            }
        }
    }
    found
}

fn first_word(text: &str) -> Option<String> {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    (end > 0).then(|| text[..end].to_owned())
}

fn top_level(file: &Path, source: &Path) -> String {
    let inside = file.strip_prefix(source).unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_str().unwrap();
    first.strip_suffix(".rs").unwrap_or(first).to_owned()
}

#[test]
fn the_reader_of_imports_reads_what_rust_allows() {
    let code = code(
        "use crate::servo::Cycle; // crate::cli\nuse crate::{record::{Event, Meta}, rt};\n\
         fn f() { crate::model::g(); other_crate::signal::h() }\n#[cfg(test)]\n\
         #[allow(x)]\nmod tests {\n    use crate::cli;\n}\nfn k() { crate::library::l() }",
    );
    let expected = ["library", "model", "record", "rt", "servo"].map(str::to_owned);
    assert_eq!(imports(&code), BTreeSet::from(expected));
}

#[test]
fn a_module_imports_only_from_rows_above_its_own() {
    let (layers, source) = (layers(), root().join("crates/ilc-rt/src"));
    let mut wrong = Vec::new();
    let mut n_imports = 0;
    let mut seen = BTreeSet::new();
    for file in rust_files(&source) {
        let own = top_level(&file, &source);
        if own == "lib" || own == "main" {
            continue;
        }
        seen.insert(own.clone());
        let Some(layer) = layers.get(&own) else {
            wrong.push(format!("{own} is not in the table of ARCHITECTURE.md"));
            continue;
        };
        for name in imports(&code(&std::fs::read_to_string(&file).unwrap())) {
            // A name that is not a module is an item of the crate's root.
            let Some(other) = layers.get(&name).filter(|_| name != own) else { continue };
            n_imports += 1;
            if other.row >= layer.row {
                let file = file.strip_prefix(&source).unwrap().display();
                wrong.push(format!(
                    "{file} (row {}) imports crate::{name} (row {})",
                    layer.row, other.row
                ));
            }
        }
    }
    for name in layers.keys().filter(|name| !seen.contains(*name)) {
        wrong.push(format!("{name} is in the table, but there is no such module"));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_imports > 50, "only {n_imports} imports were found: the test reads the wrong files");
}

#[test]
fn python_and_the_simulator_stay_outside_the_controller() {
    let root = root();
    let mut wrong = Vec::new();
    for folder in ["crates/ilc-rt", "sim", "tests/rust"] {
        let manifest = std::fs::read_to_string(root.join(folder).join("Cargo.toml")).unwrap();
        let dependencies = manifest.lines().map(|line| line.split('#').next().unwrap_or("").trim());
        for line in dependencies {
            let name = line.split(['.', '=', ' ']).next().unwrap_or("");
            let is_forbidden = match name {
                "pyo3" | "numpy" => true,
                "ilc-sim" => folder == "crates/ilc-rt",
                "ilc-numerics" => folder != "crates/ilc-rt",
                _ => false,
            };
            // The crate's own name is `name = "…"`, so a line that begins with a name is a
            // dependency.
            if is_forbidden {
                wrong.push(format!("{folder}/Cargo.toml: {line}"));
            }
        }
        for file in rust_files(&root.join(folder)) {
            if file.ends_with("tests/layers.rs") {
                continue;
            }
            let code = code(&std::fs::read_to_string(&file).unwrap());
            if code.contains("pyo3::") {
                wrong.push(format!("{} uses pyo3", file.display()));
            }
            if folder == "crates/ilc-rt" && code.contains("ilc_sim") {
                wrong.push(format!("{} uses ilc_sim", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_hot_file_is_fenced() {
    let (layers, source) = (layers(), root().join("crates/ilc-rt/src"));
    let fenced = |file: &Path| {
        let text = std::fs::read_to_string(file).unwrap();
        let code: Vec<&str> =
            text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        // Before any item: a later inner attribute would not compile.
        code.join("\n").trim_start().starts_with(FENCE)
    };
    let mut wrong = Vec::new();
    let tests = test_modules(&source);
    let mut n_fenced = 0;
    for file in rust_files(&source) {
        let own = top_level(&file, &source);
        if !layers.get(&own).is_some_and(|layer| layer.is_hot) {
            continue;
        }
        let inside = file.strip_prefix(&source).unwrap().to_str().unwrap();
        // The fence in a folder's head covers the folder.
        let covers = file.ancestors().skip(1).take_while(|folder| *folder != source);
        let mut heads = covers.map(|folder| folder.join("mod.rs")).filter(|head| head.is_file());
        let is_fenced = fenced(&file) || heads.any(|head| fenced(&head));
        let is_listed = COLD_FILES.contains(&inside);
        let is_cold = inside_of_cold_folder(&file, &source);
        let is_head = is_only_declarations(&std::fs::read_to_string(&file).unwrap());
        let module = module_of(&file, &source);
        let is_test = tests.iter().any(|test| module.starts_with(test));
        n_fenced += u32::from(is_fenced);
        if is_fenced && is_listed {
            wrong.push(format!("{inside} is fenced: take it off the list of cold files"));
        }
        if !is_fenced && !is_listed && !is_cold && !is_head && !is_test {
            wrong.push(format!("{inside} is hot and does not start with the fence"));
        }
    }
    let stale = COLD_FILES.iter().filter(|file| !source.join(file).is_file());
    wrong.extend(stale.map(|file| format!("{file} is on the list of cold files, but not there")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_fenced > 30, "only {n_fenced} fenced files were found");
}

/// Returns true if a file is in a folder whose head declares it cold in its first line.
fn inside_of_cold_folder(file: &Path, source: &Path) -> bool {
    file.ancestors().skip(1).take_while(|folder| *folder != source).any(|folder| {
        std::fs::read_to_string(folder.join("mod.rs"))
            .is_ok_and(|text| text.starts_with("//! Cold:"))
    })
}

/// Returns true if a file only contains module declarations, re-exports and constants.
fn is_only_declarations(text: &str) -> bool {
    let code = code(text);
    !["fn ", "struct ", "impl ", "enum "].iter().any(|item| code.contains(item))
}
