//! Drives with settings of their own, `[axis.drive]`, `[axis.homing]` and `reversed`: checked, written,
//! or refused in one line.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::bring_up::{SdoClient, bring_up};
use ilc_rt::fieldbus::canopen::ObjectAddress;
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::library::Library;
use ilc_sim::Machine;
use ilc_tests::campaign::{machine, options};
use ilc_tests::{Scratch, example_text, rig};

/// The gantry with a program of two short moves.
fn short_text() -> String {
    let text = example_text("01_gantry.toml");
    let program = text.find("[[program.segment]]").unwrap();
    let learning = text.find("[learning]").unwrap();
    let moves =
        "[[program.segment]]\nto_m = [0.08, 0.02]\n[[program.segment]]\nto_m = [0.06, 0.04]\n\n";
    format!("{}{moves}{}", &text[..program], &text[learning..])
}

/// The gantry with keys of its first axis, and tables of it.
fn text(keys: &str, tables: &str) -> String {
    let text = short_text();
    let (head, rest) = text.split_once("node = 1\n").unwrap();
    let (axis, rest) = rest.split_once("[[axis]]").unwrap();
    format!("{head}node = 1\n{keys}\n{axis}\n{tables}\n[[axis]]{rest}")
}

fn cell(keys: &str, tables: &str) -> Cell {
    Cell::parse(&text(keys, tables), "cell.toml").unwrap()
}

fn refused(keys: &str, tables: &str) -> String {
    Cell::parse(&text(keys, tables), "cell.toml").unwrap_err().to_string()
}

/// Returns the digest of the only run and the machine's values of some objects, or the refusal.
fn run(cell: &Cell, machine: Machine) -> Result<String, String> {
    let scratch = Scratch::new();
    let library = scratch.file("library.db");
    let bus = Box::new(InProcess::new(machine, 256));
    let outcome = campaign::run(cell, &options(library.clone(), 1), bus, None, &mut |_| {})
        .map_err(|error| error.to_string())?;
    let library = Library::open(&library).unwrap();
    let rows = library.list(Some(&outcome.campaign)).unwrap();
    assert_eq!(rows.len(), 1, "{}", outcome.reason);
    Ok(library.load(rows[0].id).unwrap().digest)
}

#[test]
fn a_reversed_axis_runs_to_the_last_bit_as_the_other_way_round() {
    let clean = run(&cell("", ""), machine(&cell("", ""))).unwrap();
    let reversed = cell("reversed = true", "");
    assert_eq!(run(&reversed, machine(&reversed)).as_ref(), Ok(&clean));
    let limits = machine(&reversed);
    let dictionary = limits.dictionary(rig::node(1)).unwrap();
    let number = |sub| dictionary.number(dictionary.find(ObjectAddress::new(0x607D, sub)).unwrap());
    assert!(number(1) < number(2), "the ends of the axis change places");
}

#[test]
fn an_axis_whose_zero_is_elsewhere_runs_as_well() {
    let runs = |cell: &Cell| {
        let scratch = Scratch::new();
        let bus = Box::new(InProcess::new(machine(cell), 256));
        let options = options(scratch.file("library.db"), 1);
        let outcome = campaign::run(cell, &options, bus, None, &mut |_| {}).unwrap();
        outcome.runs.iter().map(|(_, figures)| figures.tracking_rms_m).collect::<Vec<_>>()
    };
    let plain = runs(&cell("", ""));
    let moved =
        runs(&cell("reversed = true", "[axis.homing]\nkind = \"absolute\"\noffset_m = 0.1234"));
    assert!(plain.len() == 1 && plain.len() == moved.len(), "{plain:?} {moved:?}");
    // One count of rounding.
    assert!((plain[0] - moved[0]).abs() < 1e-6, "{plain:?} {moved:?}");
}

#[test]
fn a_homing_is_written_to_the_drive() {
    let described = cell(
        "",
        "[axis.homing]\nkind = \"drive\"\nmethod = 17\nspeed_switch_m_s = 0.01\nspeed_zero_m_s = 0.002\nacceleration_m_s2 = 0.5",
    );
    let mut setup = campaign::drive_setup(&described, &described.axes[0], true).unwrap();
    let mut bus = InProcess::new(machine(&described), 256);
    let line = bring_up(&mut bus, &setup).unwrap_err().to_string();
    assert!(line.contains("node 1: not homed: its homing method (0x6098) is 0"), "{line}");
    setup.is_to_be_homed = true;
    bring_up(&mut bus, &setup).unwrap();
    // The settings alone are no evidence.
    setup.is_to_be_homed = false;
    let line = bring_up(&mut bus, &setup).unwrap_err().to_string();
    assert!(line.contains("it has found no home since power-on"), "{line}");
    let client = SdoClient::new(rig::node(1), std::time::Duration::from_secs(2));
    let mut number = |index, sub| client.upload_u32(&mut bus, index, sub).unwrap();
    let found = [number(0x6098, 0), number(0x6099, 1), number(0x6099, 2), number(0x609A, 0)];
    assert_eq!(found, [17, 1_000_000, 200_000, 50_000_000]);
    assert_eq!(number(0x607C, 0), 0);
}

#[test]
fn an_axis_that_is_not_homed_does_not_run() {
    let needed = cell("", "[axis.homing]\nkind = \"drive\"\nmethod = 35");
    let line = run(&needed, machine(&needed)).unwrap_err();
    assert!(
        line.contains("cell.toml: axis x (node 1) is not homed:")
            && line.contains("nothing has moved; `ilc-rt home cell.toml --axis x` homes it"),
        "{line}"
    );
    let absolute = cell("", "[axis.homing]\nkind = \"absolute\"");
    assert!(run(&absolute, machine(&absolute)).is_ok());
}

#[test]
fn the_drive_of_another_maker_is_refused() {
    let good = cell("", "[axis.drive]\nproduct = 402\nrevision = 1");
    assert!(run(&good, machine(&good)).is_ok());
    let other = cell("", "[axis.drive]\nvendor = 0x5A\nproduct = 402");
    let line = run(&other, machine(&other)).unwrap_err();
    assert!(
        line.contains(
            "node 1: object 0x1018:01 (vendor): found 0x00000000, [axis.drive] vendor requires 0x0000005A"
        ),
        "{line}"
    );
}

#[test]
fn start_up_objects_are_written_or_refused() {
    let clean = run(&cell("", ""), machine(&cell("", ""))).unwrap();
    let limited = cell(
        "",
        "[axis.drive]\nkeep = [\"0x6072\"]\n[[axis.drive.start_up]]\nobject = \"0x6072\"\ntype = \"u16\"\nvalue = 900",
    );
    assert!(run(&limited, machine(&limited)).is_ok());
    let start_up = |object: &str, kind: &str, value: i64| {
        cell(
            "",
            &format!(
                "[[axis.drive.start_up]]\nobject = \"{object}\"\ntype = \"{kind}\"\nvalue = {value}"
            ),
        )
    };
    let kept = start_up("0x6502", "u32", 1);
    let line = run(&kept, machine(&kept)).unwrap_err();
    assert!(line.contains("object 0x6502:00") && line.contains("needed 1"), "{line}");
    let absent = start_up("0x5FFF", "u8", 1);
    let line = run(&absent, machine(&absent)).unwrap_err();
    assert!(
        line.contains("0x5FFF:00") && line.contains("as [[axis.drive.start_up]] sets it"),
        "{line}"
    );
    assert_ne!(clean, "");
}

#[test]
fn ratios_are_written_where_they_are_stated() {
    let stated =
        "[axis.drive]\nencoder_resolution = [2, 1]\ngear_ratio = [1, 2]\nfeed_constant = [1, 1]";
    let stated = cell("", stated);
    let clean = run(&cell("", ""), machine(&cell("", ""))).unwrap();
    // 1 / (2 * 1/2) = 1: the same counts from another gear.
    assert_eq!(run(&stated, machine(&stated)).as_ref(), Ok(&clean));
    let half = cell("", "[axis.drive]\ngear_ratio = [1, 1]");
    let line = run(&half, machine(&half)).unwrap_err();
    assert!(line.contains("0x608F") && line.contains("stated in [axis.drive]"), "{line}");
}

#[test]
fn process_data_are_those_that_the_cell_states() {
    let stated = cell(
        "",
        "[axis.drive.pdo]\ncommand = [\"0x6040\", \"0x607A\"]\nstatus = [\"0x6041\", \"0x6064\", \"0x603F\"]",
    );
    let clean = run(&cell("", ""), machine(&cell("", ""))).unwrap();
    assert_eq!(
        run(&stated, machine(&stated)).as_ref(),
        Ok(&clean),
        "the measurements are the same"
    );
    let setup = campaign::drive_setup(&stated, &stated.axes[0], true).unwrap();
    let mut bus = InProcess::new(machine(&stated), 256);
    bring_up(&mut bus, &setup).unwrap();
    let client = SdoClient::new(rig::node(1), std::time::Duration::from_secs(2));
    let mut number = |index, sub| client.upload_u32(&mut bus, index, sub).unwrap();
    assert_eq!([number(0x1600, 0), number(0x1600, 2)], [2, 0x607A_0020]);
    assert_eq!([number(0x1A00, 0), number(0x1A00, 3)], [3, 0x603F_0010]);
}

#[test]
fn contradictions_are_refused_with_what_is_allowed() {
    for (keys, tables, expected) in [
        (
            "",
            "[axis.drive]\nkeep = [\"0x6085\"]",
            "drive.keep = 0x6085: the quick stop depends on it",
        ),
        (
            "",
            "[axis.drive]\nkeep = [\"0x605A\"]",
            "drive.keep = 0x605A: an object on which neither a stop",
        ),
        (
            "",
            "[axis.drive]\nkeep = [\"0x2000\"]",
            "drive.keep = 0x2000: an object that bring-up sets",
        ),
        ("", "[axis.drive]\nkeep = [\"6085\"]", "is not an object: 0x and a hexadecimal index"),
        (
            "",
            "[axis.drive]\nquick_stop_option = 0",
            "drive.quick_stop_option = 0: a reaction that brakes",
        ),
        ("", "[axis.drive]\npolarity = 128", "drive.polarity = 128: 0, or 192"),
        (
            "",
            "[axis.drive.pdo]\ncommand = [\"0x6040\"]",
            "drive.pdo.command = a list: the map has no object 0x607A:00, which every RPDO1 needs",
        ),
        (
            "",
            "[[axis.drive.start_up]]\nobject = \"0x6065\"\ntype = \"u32\"\nvalue = 1",
            "drive.start_up 0x6065 = 1: bring-up sets this object itself",
        ),
        (
            "",
            "[[axis.drive.start_up]]\nobject = \"0x2000\"\ntype = \"u8\"\nvalue = 256",
            "drive.start_up 0x2000 = 256: allowed 0 to 255 in this type",
        ),
        ("", "[axis.homing]\noffset_m = 0.1", "homing.offset_m = 0.1: 0 with kind = \"none\""),
        ("", "[axis.homing]\nkind = \"drive\"", "homing.method = missing: one of 1, 2, 17"),
        ("", "[axis.homing]\nkind = \"drive\"\nmethod = 3", "homing.method = 3: one of 1, 2, 17"),
        (
            "",
            "[axis.homing]\nkind = \"drive\"\nmethod = 33",
            "homing.speed_zero_m_s = missing: needed by method 33",
        ),
        (
            "",
            "[axis.homing]\nkind = \"drive\"\nmethod = 35\nspeed_zero_m_s = 0.01",
            "homing.speed_zero_m_s = 0.01: not used by method 35",
        ),
        (
            "",
            "[axis.homing]\nkind = \"absolute\"\nmethod = 35",
            "homing.method = 35: for kind = \"drive\" only",
        ),
    ] {
        let line = refused(keys, tables);
        assert!(line.contains(expected) && !line.contains('\n'), "{tables}: {line}");
    }
    let ramp =
        "[axis.drive]\nkeep = [\"0x6085\"]\nquick_stop_option = 5\nfault_reaction_option = 1";
    assert!(cell("", ramp).axes[0].drive.keeps(0x6085, 0));
}

#[test]
fn an_axis_without_a_model_runs_where_nothing_is_learned() {
    let source = short_text();
    let mut document: String = String::new();
    let mut is_model = false;
    for line in source.lines() {
        if line.starts_with('[') {
            is_model = line.starts_with("[axis.model]");
        }
        if !is_model {
            document.push_str(line);
            document.push('\n');
        }
    }
    let learning = Cell::parse(&document, "cell.toml").unwrap();
    let line = run(&learning, machine(&learning)).unwrap_err();
    assert!(
        line.contains("[[axis]] x: model = missing: law = \"norm_optimal\" needs [axis.model]")
            && line.contains("ilc-rt identify cell.toml --axis x"),
        "{line}"
    );
    let mut plain = learning;
    plain.learning.law = ilc_rt::config::LawName::None;
    assert!(run(&plain, machine(&plain)).is_ok());
}
