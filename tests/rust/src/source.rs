//! The project's source for the tests of its structure: files, code without comments and tests, and
//! the imports of each module.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module, as the path of names from the crate's root.
pub type ModulePath = Vec<String>;

/// Returns the text of a file.
///
/// # Panics
/// If it cannot be read.
pub fn text(file: &Path) -> String {
    std::fs::read_to_string(file).expect("the file can be read")
}

/// Returns the Rust files of a folder and its subfolders, sorted.
///
/// # Panics
/// If the folder cannot be read.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the folder can be read").path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Returns the source without comments and test modules, which may import what they test with.
pub fn code(text: &str) -> String {
    let mut kept = String::new();
    let mut is_for_tests = false;
    let mut ends_with = None;
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or("");
        let indent = &line[..line.len() - line.trim_start().len()];
        if let Some(end) = &ends_with {
            // In formatted code, a module ends with the first closing brace at its own indentation.
            if line == end {
                ends_with = None;
            }
        } else if code.trim_start().starts_with("#[cfg(test)]") {
            is_for_tests = true;
        } else if is_for_tests && declared_module(code).is_some() {
            is_for_tests = false;
            if code.contains('{') && !code.contains('}') {
                ends_with = Some(format!("{indent}}}"));
            }
        } else {
            kept.push_str(code);
            kept.push('\n');
        }
    }
    kept
}

/// Returns the module that a line declares, whatever its visibility.
fn declared_module(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let line = match line.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => rest.split_once(')')?.1.trim_start(),
        Some(rest) => rest.trim_start(),
        None => line,
    };
    line.strip_prefix("mod ").map(|rest| rest.trim_end_matches([' ', '{', ';', '\n']))
}

/// Returns the module of a file below `source`.
pub fn module_of(file: &Path, source: &Path) -> ModulePath {
    let inside = file.strip_prefix(source).unwrap_or(file).with_extension("");
    let mut path: ModulePath =
        inside.iter().map(|name| name.to_string_lossy().into_owned()).collect();
    if path.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        path.pop();
    }
    path
}

/// Returns the test-only modules below `source`: those declared under `#[cfg(test)]`, and their
/// contents.
pub fn test_modules(source: &Path) -> BTreeSet<ModulePath> {
    let mut found = BTreeSet::new();
    for file in rust_files(source) {
        let text = text(&file);
        let mut is_for_tests = false;
        for line in text.lines() {
            if line.starts_with("#[cfg(test)]") {
                is_for_tests = true;
            } else if let (true, Some(name)) = (is_for_tests, declared_module(line)) {
                found.insert([module_of(&file, source), vec![name.to_owned()]].concat());
                is_for_tests = false;
            }
        }
    }
    found
}

/// Returns every path in `code` that begins at the crate's root, at a parent or at the module
/// itself, as its names: `use super::{a, b::c}` has two.
pub fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for head in ["crate", "super", "self"] {
        for (at, _) in code.match_indices(&format!("{head}::")) {
            // `$crate::`, `other_crate::` and `super::super::` do not begin a path.
            if code[..at].ends_with(|c: char| c.is_alphanumeric() || "_$:".contains(c)) {
                continue;
            }
            tree(&code[at..], &mut Vec::new(), &mut found);
        }
    }
    found
}

/// Parses `a::b::{c, d::e}` from the start of `text`; returns the length parsed.
fn tree(text: &str, before: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    let depth = before.len();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let word = word(rest);
        if rest.starts_with('{') {
            at += 1;
            loop {
                at += blank(&text[at..]);
                match text[at..].chars().next() {
                    None => break,
                    Some('}') => {
                        at += 1;
                        break;
                    }
                    Some(',') => at += 1,
                    Some(_) => {
                        let read = tree(&text[at..], before, found);
                        at += read.max(1);
                        // Aliases are skipped.
                        at += text[at..].find([',', '}']).unwrap_or(text.len() - at);
                    }
                }
            }
            before.truncate(depth);
            return at;
        }
        if word.is_empty() {
            break;
        }
        before.push(word.to_owned());
        at += word.len();
        if !text[at..].starts_with("::") {
            break;
        }
        at += 2;
    }
    if before.len() > depth {
        found.push(before.clone());
    }
    before.truncate(depth);
    at
}

fn word(text: &str) -> &str {
    &text[..text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len())]
}

fn blank(text: &str) -> usize {
    text.len() - text.trim_start().len()
}

/// The modules of a crate, and the names that each imports from others.
#[derive(Debug)]
pub struct Crate {
    code: BTreeMap<ModulePath, String>,
    /// Names that a module imports by `use`: visible in it, and through it if they are public.
    brought_in: BTreeMap<ModulePath, BTreeMap<String, Vec<String>>>,
    families: Vec<Family>,
}

/// A paragraph `//! Family: …` at the head of a folder: rooms in it or below, in backticks, that may
/// import each other, and why; without names all rooms of the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Family {
    /// The folder's module.
    pub head: ModulePath,
    /// The last names of the rooms; empty for all of the folder.
    pub members: BTreeSet<String>,
}

impl Family {
    /// True if all of these rooms belong to it.
    pub fn holds(&self, rooms: &[ModulePath]) -> bool {
        rooms.iter().all(|room| {
            let named = room.last().is_some_and(|last| self.members.contains(last));
            room.starts_with(&self.head) && (named || self.members.is_empty())
        })
    }
}

impl Crate {
    /// Reads the files below a folder, except those for tests.
    ///
    /// # Panics
    /// If a file cannot be read.
    pub fn read(source: &Path) -> Self {
        let tests = test_modules(source);
        let mut modules = BTreeMap::new();
        let mut families = Vec::new();
        for file in rust_files(source) {
            let (head, text) = (module_of(&file, source), text(&file));
            if !tests.iter().any(|test| head.starts_with(test)) {
                families.extend(families_of(&head, &text));
                modules.entry(head).or_insert_with(String::new).push_str(&code(&text));
            }
        }
        let mut all = Self { code: modules, brought_in: BTreeMap::new(), families };
        let brought_in = |(path, code): (&ModulePath, &String)| {
            let mut names = BTreeMap::new();
            for statement in code.split("use ").skip(1) {
                let statement = statement.split(';').next().unwrap_or("");
                let mut found = Vec::new();
                tree(statement, &mut Vec::new(), &mut found);
                for path in found {
                    if let Some(name) = path.last() {
                        names.insert(name.clone(), path.clone());
                    }
                }
            }
            (path.clone(), names)
        };
        all.brought_in = all.code.iter().map(brought_in).collect();
        all
    }

    /// Returns the module that defines the item of a path, seen from a module.
    fn resolve(&self, from: &ModulePath, path: &[String], depth: usize) -> Option<ModulePath> {
        let mut at = from.clone();
        let mut rest = path;
        if rest.first().is_some_and(|first| first == "crate") {
            (at, rest) = (Vec::new(), &rest[1..]);
        }
        while let Some(first) = rest.first().filter(|first| *first == "super" || *first == "self") {
            if first == "super" {
                at.pop()?;
            }
            rest = &rest[1..];
        }
        for (index, name) in rest.iter().enumerate() {
            at.push(name.clone());
            if self.code.contains_key(&at) {
                continue;
            }
            at.pop();
            let through = self.brought_in.get(&at).and_then(|names| names.get(name));
            let Some(through) = through.filter(|_| depth > 0) else { break };
            let on: Vec<String> = through.iter().chain(&rest[index + 1..]).cloned().collect();
            return self.resolve(&at, &on, depth - 1).or(Some(at));
        }
        self.code.contains_key(&at).then_some(at)
    }

    /// Returns the families declared in folders' heads.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// Returns the groups of rooms that import each other in a circle. A room is a folder, or a
    /// file beside others in a folder; a folder's head may name its rooms, and they may name items
    /// of the head.
    pub fn circles(&self) -> Vec<Vec<ModulePath>> {
        let mut arrows: BTreeMap<ModulePath, BTreeSet<ModulePath>> = BTreeMap::new();
        for (from, code) in &self.code {
            for path in paths(code) {
                let Some(to) = self.resolve(from, &path, 8) else { continue };
                let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
                if shared < from.len() && shared < to.len() {
                    let room = |module: &ModulePath| module[..=shared].to_vec();
                    arrows.entry(room(from)).or_default().insert(room(&to));
                }
            }
        }
        let reached: BTreeMap<&ModulePath, BTreeSet<&ModulePath>> =
            arrows.keys().map(|room| (room, reach(room, &arrows))).collect();
        let mut circles = BTreeSet::new();
        for (room, far) in &reached {
            let back = |other: &&ModulePath| reached.get(other).is_some_and(|r| r.contains(room));
            let circle: Vec<ModulePath> =
                far.iter().copied().filter(back).map(Clone::clone).collect();
            if circle.len() > 1 {
                circles.insert(circle);
            }
        }
        circles.into_iter().collect()
    }
}

fn reach<'a>(
    room: &'a ModulePath,
    arrows: &'a BTreeMap<ModulePath, BTreeSet<ModulePath>>,
) -> BTreeSet<&'a ModulePath> {
    let mut seen = BTreeSet::new();
    let mut open = vec![room];
    while let Some(next) = open.pop() {
        for to in arrows.get(next).into_iter().flatten() {
            if seen.insert(to) {
                open.push(to);
            }
        }
    }
    seen
}

/// Parses the paragraphs `//! Family: …` of a folder's head.
fn families_of(head: &ModulePath, text: &str) -> Vec<Family> {
    let doc: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//!")).collect();
    let paragraph = |from: usize| {
        let lines = doc[from..].iter().take_while(|line| !line.trim().is_empty());
        lines.copied().collect::<String>()
    };
    let begins = (0..doc.len()).filter(|&at| doc[at].starts_with(" Family: "));
    begins
        .map(|at| {
            let members = paragraph(at).split('`').skip(1).step_by(2).map(str::to_owned).collect();
            Family { head: head.clone(), members }
        })
        .collect()
}
