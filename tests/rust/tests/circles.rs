//! The rooms of a crate have no import cycles, except families that give a reason.

use std::collections::BTreeSet;
use std::path::Path;

use ilc_tests::root;
use ilc_tests::source::{Crate, paths};

#[test]
fn the_reader_of_paths_reads_what_rust_allows() {
    let code =
        "use super::{a, b::{C, d as e}};\nfn f() { crate::g::h(); self::i::J; super::super::k() }
        use other::crate_name::super_thing;";
    let found: BTreeSet<String> = paths(code).into_iter().map(|path| path.join("::")).collect();
    let expected = ["super::a", "super::b::C", "super::b::d", "crate::g::h", "self::i::J"];
    let mut expected: BTreeSet<String> = expected.into_iter().map(str::to_owned).collect();
    expected.insert("super::super::k".to_owned());
    assert_eq!(found, expected);
}

#[test]
fn a_circle_is_found_also_through_a_re_export() {
    let folder = std::env::temp_dir().join(format!("ilc-circles-{}", std::process::id()));
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        std::fs::create_dir_all(file.parent().unwrap_or(Path::new("."))).expect("a folder");
        std::fs::write(file, text).expect("a file");
    };
    write("lib.rs", "mod a;\nmod b;\nmod c;\npub use c::Thing;\n#[cfg(test)]\nmod tests;\n");
    write("a.rs", "use super::Thing;\nfn f(_: Thing) {}\n");
    write("b.rs", "use crate::a::f;\n");
    write("c/mod.rs", "mod d;\npub struct Thing;\n");
    write("c/d.rs", "use super::Thing;\n");
    write("tests.rs", "use crate::{a, b, c};\n");
    assert_eq!(Crate::read(&folder).circles(), Vec::<Vec<Vec<String>>>::new());
    write("c/d.rs", "use crate::b;\n#[cfg(test)]\nmod tests {\n    use crate::a;\n}\n");
    let circle = vec![vec![vec!["a".to_owned()], vec!["b".to_owned()], vec!["c".to_owned()]]];
    assert_eq!(Crate::read(&folder).circles(), circle);
    std::fs::remove_dir_all(&folder).expect("it was made above");
}

#[test]
fn rooms_do_not_import_each_other_in_a_circle() {
    let mut wrong = Vec::new();
    for name in ["crates/ilc-numerics", "crates/ilc-rt", "crates/ilc-py", "sim"] {
        let source = Crate::read(&root().join(name).join("src"));
        let mut used = BTreeSet::new();
        for circle in source.circles() {
            let family = source.families().iter().position(|family| family.holds(&circle));
            if let Some(index) = family {
                used.insert(index);
            } else {
                let rooms: Vec<String> = circle.iter().map(|room| room.join("::")).collect();
                wrong.push(format!("{name}: {} import each other", rooms.join(", ")));
            }
        }
        for (index, family) in source.families().iter().enumerate() {
            if !used.contains(&index) {
                let (head, members) = (family.head.join("::"), &family.members);
                wrong.push(format!("{name}: {head} has a family {members:?} without a circle"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "break the circle, or say why at the folder's head:\n{}",
        wrong.join("\n")
    );
}
