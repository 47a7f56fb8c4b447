//! Data sheets of drives: what is read of them, the section that they become, and the drives that they
//! refuse.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::data_sheet::{
    DataSheet, DataSheetError, Imported, import, section, with_section,
};
use ilc_rt::config::{Cell, Mode};
use ilc_rt::fieldbus::canopen::ObjectAddress;
use ilc_sim::eds;
use ilc_tests::campaign::machine;
use ilc_tests::{Scratch, example_text, rig, short};

/// The data sheet of the simulated drive.
fn simulated() -> String {
    let machine = machine(&short("01_gantry.toml"));
    eds::write(machine.dictionary(rig::node(1)).unwrap(), "CiA 402 drive")
}

fn read(text: &str) -> Result<DataSheet, DataSheetError> {
    DataSheet::parse(text.as_bytes(), "servo.eds", None)
}

fn imported(text: &str) -> Result<Imported, DataSheetError> {
    import(&read(text)?, Mode::Csp)
}

/// Appends a value of the configuration to the section of an object.
fn configured(text: &str, section: &str, value: &str) -> String {
    let head = format!("[{section}]\n");
    assert!(text.contains(&head), "{section}");
    text.replace(&head, &format!("{head}ParameterValue={value}\n"))
}

/// Returns a data sheet without the sections of an object.
fn without(text: &str, index: &str) -> String {
    let parts = text.split("\n[").filter(|part| !part.starts_with(index));
    parts.collect::<Vec<_>>().join("\n[")
}

#[test]
fn the_sheet_of_the_simulated_drive_becomes_a_section() {
    let found = imported(&simulated()).unwrap();
    assert_eq!((found.drive.product, found.drive.revision), (Some(402), Some(1)));
    assert_eq!(found.drive.vendor, None, "0 is no vendor");
    assert!(found.drive.start_up.is_empty(), "{:?}", found.drive.start_up);
    let text = section(&found);
    assert!(text.contains("[axis.drive]\n") && text.contains("product = 0x00000192\n"), "{text}");
    assert!(text.contains("command = [\"0x6040\", \"0x607A\"]"), "{text}");
    assert!(text.contains("status = [\"0x6041\", \"0x6064\"]"), "{text}");
}

#[test]
fn the_section_goes_into_a_cell_description_and_leaves_the_rest() {
    let found = imported(&simulated()).unwrap();
    let before = format!("# A machine.\n{}", example_text("01_gantry.toml"));
    let text = with_section(&before, "cell.toml", "x", &found).unwrap();
    let cell = Cell::parse(&text, "cell.toml").unwrap();
    assert_eq!((&cell.axes[0].drive, cell.axes[1].drive.product), (&found.drive, None));
    assert!(before.lines().all(|line| text.contains(line)), "{text}");
    let twice = with_section(&text, "cell.toml", "x", &found).unwrap();
    assert_eq!(twice, text, "it is replaced, not repeated");
    let error = with_section(&before, "cell.toml", "z", &found).unwrap_err();
    assert_eq!(error.to_string(), "cell.toml: it has no [[axis]] with name = \"z\"");
}

#[test]
fn values_of_a_configuration_become_keys_and_start_up_objects() {
    let mut text = simulated();
    text.push_str(
        "[2010]\nParameterName=Gains\nObjectType=0x9\nSubNumber=3\n\n\
         [2010Sub1]\nDataType=0x0003\nAccessType=RW\nDefaultValue=5\nParameterValue=0xFFFE\n\n\
         [2010sub2]\nDataType=0x0006\nAccessType=wo\nParameterValue=$NodeId + 0x200\n\n\
         [2011]\nDataType=0x0005\nAccessType=ro\nDefaultValue=1\nParameterValue=2\n\n\
         [2012]\nDataType=0x0009\nAccessType=rw\nParameterValue=7\n\n\
         [DeviceComissioning]\nNodeID=0x05\n",
    );
    for (section, value) in [
        ("6072", "600"),
        ("605A", "5"),
        ("605E", "0"),
        ("6091sub1", "10"),
        ("607C", "-200"),
        ("6083", "4"),
    ] {
        text = configured(&text, section, value);
    }
    let found = imported(&text).unwrap();
    let drive = &found.drive;
    let start_up: Vec<_> =
        drive.start_up.iter().map(|o| (o.object.to_string(), o.value, o.read_back)).collect();
    let expected = [("0x2010:01", -2, true), ("0x2010:02", 0x205, false), ("0x6072", 600, true)];
    assert_eq!(start_up, expected.map(|(name, value, back)| (name.to_owned(), value, back)));
    assert_eq!(drive.keep, ["0x6072".parse().unwrap()], "bring-up would raise it");
    assert_eq!((drive.quick_stop_option, drive.fault_reaction_option), (Some(5), None));
    assert_eq!((drive.gear_ratio, drive.encoder_resolution), (Some([10, 1]), Some([1, 1])));
    assert_eq!(drive.home_offset, Some(-200));
    let remarks = found.remarks.join("\n");
    for left_out in ["0x2011:00 = 2", "0x2012:00 = 7", "0x605E:00 = 0", "0x6083:00 = 4"] {
        assert!(remarks.contains(left_out), "{left_out}: {remarks}");
    }
    let cell = with_section(&example_text("01_gantry.toml"), "cell.toml", "y", &found).unwrap();
    assert_eq!(&Cell::parse(&cell, "cell.toml").unwrap().axes[1].drive, drive);
}

#[test]
fn a_value_of_the_node_needs_its_number() {
    let text =
        format!("{}[2010]\nDataType=7\nAccessType=rw\nParameterValue=$NODEID+1\n", simulated());
    let error = imported(&text).unwrap_err();
    assert_eq!(
        error.to_string(),
        "servo.eds: object 0x2010:00 = $NODEID+0x1: give the node number with --node"
    );
    let sheet = DataSheet::parse(text.as_bytes(), "servo.eds", Some(9)).unwrap();
    assert_eq!(import(&sheet, Mode::Csp).unwrap().drive.start_up[0].value, 10);
}

#[test]
fn a_drive_that_cannot_run_is_refused_with_the_object() {
    let text = simulated();
    for (changed, expected) in [
        (without(&text, "6040]"), "the drive has no object 0x6040:00 (Controlword), which is needed to enable it"),
        (without(&text, "607A]"), "0x607A:00 (Target position), which is needed for the command"),
        (
            without(&without(&text, "1400sub5]"), "1016sub1]"),
            "0x1400:05 (RPDO communication parameter), which is needed to stop",
        ),
        (text.replace("131474", "131473"), "0x1000:00 (Device type) = 0x00020191"),
        (configured(&text, "6502", "1"), "object 0x6502:00 (Supported drive modes) = 0x00000001: it lacks cyclic"),
        (
            text.replacen("ParameterName=Target position\nObjectType=0x7\nDataType=0x0004\nAccessType=rw\nDefaultValue=0\nPDOMapping=1", "DataType=0x0004\nAccessType=rw\nPDOMapping=0", 1),
            "object 0x607A:00 (Target position) = not mappable: it must be allowed in process data",
        ),
    ] {
        let line = imported(&changed).unwrap_err().to_string();
        assert!(line.contains(expected) && !line.contains('\n'), "{expected}: {line}");
    }
}

#[test]
fn what_a_drive_lacks_is_said() {
    let text = without(&without(&simulated(), "605A]"), "60B2]");
    let lacks: Vec<String> =
        imported(&text).unwrap().lacks.iter().map(ToString::to_string).collect();
    assert!(lacks.contains(&"lacks 0x60B2:00 (Torque offset): no torque feed-forward".to_owned()));
    assert!(lacks.iter().any(|lack| lack.starts_with("lacks 0x605A:00 (Quick stop option code)")));
}

#[test]
fn a_drive_without_a_timeout_of_commands_watches_the_heartbeat() {
    let found = imported(&without(&simulated(), "1400sub5]")).unwrap();
    let lacks: Vec<String> = found.lacks.iter().map(ToString::to_string).collect();
    let line = lacks.iter().find(|lack| lack.starts_with("lacks 0x1400:05")).unwrap();
    assert!(line.contains("the heartbeat of the controller"), "{line}");
}

#[test]
fn process_data_that_the_drive_has_fixed_are_taken() {
    let fixed = |entries: &str| {
        let mut text = without(&simulated(), "1600");
        text.push_str(
            "\n[1600]\nObjectType=9\n\n[1600sub0]\nDataType=5\nAccessType=const\nDefaultValue=3\n",
        );
        text + entries
    };
    let entry = |sub: u8, value: &str| {
        format!("\n[1600sub{sub}]\nDataType=7\nAccessType=const\nDefaultValue={value}\n")
    };
    let good = fixed(&(entry(1, "0x60400010") + &entry(2, "0x60600008") + &entry(3, "0x607A0020")));
    let command = imported(&good).unwrap().drive.pdo.command.unwrap();
    let names: Vec<String> = command.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["0x6040", "0x6060", "0x607A"]);
    let poor = fixed(&(entry(1, "0x60400010") + &entry(2, "0x60600008") + &entry(3, "0x60FF0020")));
    let line = imported(&poor).unwrap_err().to_string();
    assert!(
        line.contains("0x1600:00") && line.contains("lacks 0x607A (Target position)"),
        "{line}"
    );
}

#[test]
fn the_ways_of_vendors_are_understood() {
    // Decimal, capitals, blanks, comments, CR LF, Latin-1, a table of data types, compact arrays, noise.
    let text = "\u{FEFF}; a comment\r\n[FileInfo]\r\nDescription=Antrieb f\u{FC}r alles\r\n\
        [0005]\r\nParameterName=UNSIGNED8\r\nObjectType=0x5\r\nDataType=0x0005\r\nAccessType=RW\r\n\
        [1000]\r\n DataType = 7 \r\nAccessType=RO\r\nDefaultValue= 131474 ; servo\r\n\
        [1018SUB1]\r\nDataType=0x7\r\nAccessType=ro\r\nDefaultValue=77\r\n\
        [1a00]\r\nObjectType=0x9\r\nDataType=0x0007\r\nAccessType=rw\r\nCompactSubObj=4\r\n\
        [1A00Value]\r\nNrOfEntries=1\r\n2=0x60640020\r\n\
        [6064]\r\nDataType=4\r\nAccessType=ro\r\nDefaultValue=-0x10\r\nPDOMapping=1\r\n\
        [6065]\r\nDataType=4\r\nDefaultValue=4294967295\r\n\
        noise\r\n=\r\n[broken\r\n[ZZZZ]\r\nDataType=7\r\n[6066subXX]\r\nDataType=7\r\n";
    let latin: Vec<u8> = text.trim_start_matches('\u{FEFF}').chars().map(|c| c as u8).collect();
    for bytes in [text.as_bytes(), &latin[..]] {
        let sheet = DataSheet::parse(bytes, "servo.eds", None).unwrap();
        let value = |index, sub| sheet.value(index, sub);
        assert_eq!((value(0x1000, 0), value(0x1018, 1)), (Some(0x20192), Some(77)));
        assert_eq!((value(0x1A00, 0), value(0x1A00, 1)), (Some(4), None));
        assert_eq!((value(0x1A00, 2), value(0x6064, 0)), (Some(0x6064_0020), Some(-16)));
        assert_eq!(value(0x6065, 0), Some(-1), "the bits of a signed number");
        assert!(sheet.get(0x0005, 0).is_none(), "a data type is no object");
        let first = sheet.objects().next().unwrap().0;
        assert_eq!(first, ObjectAddress::new(0x1000, 0));
    }
}

#[test]
fn other_files_are_refused_in_one_line() {
    let scratch = Scratch::new();
    let empty = scratch.file("empty.eds");
    std::fs::write(&empty, "[FileInfo]\nFileName=x\n").unwrap();
    let line = DataSheet::load(&empty, None).unwrap_err().to_string();
    assert!(line.contains("empty.eds: no data sheet: it describes no object"), "{line}");
    let folder = DataSheet::load(empty.parent().unwrap(), None).unwrap_err().to_string();
    assert!(folder.contains("cannot be read: not a regular file"), "{folder}");
    let large = scratch.file("large.eds");
    std::fs::File::create(&large).unwrap().set_len(9 << 20).unwrap();
    let line = DataSheet::load(&large, None).unwrap_err().to_string();
    assert!(line.contains("more than 8388608 bytes"), "{line}");
}
