//! Meaning of words in every spelling, and refusals with their line.

use super::*;
use crate::interpolate::random::Random;
use crate::trajectory::PathSegment;

const SETTING: GcodeSetting = GcodeSetting {
    start_m: &[0.0, 0.0],
    feed_m_s: 0.05,
    rapid_m_s: 0.2,
    rotary: &[],
    exact_corners: true,
    block_delete: false,
};

fn read(text: impl AsRef<[u8]>) -> Result<GcodeProgram, GcodeError> {
    read_gcode(text.as_ref(), &SETTING)
}

fn good(text: impl AsRef<[u8]>) -> GcodeProgram {
    let shown = String::from_utf8_lossy(text.as_ref()).into_owned();
    read(text).unwrap_or_else(|error| panic!("{shown:?}: {error}"))
}

/// End of the last move in millimetres.
fn end_mm(text: impl AsRef<[u8]>) -> [f64; 2] {
    let program = good(text);
    program.segments.last().map_or([0.0; 2], |last| [last.to_m[0] * 1e3, last.to_m[1] * 1e3])
}

fn assert_ends(text: impl AsRef<[u8]> + Copy, wanted: [f64; 2]) {
    let found = end_mm(text);
    let shown = String::from_utf8_lossy(text.as_ref()).into_owned();
    assert!((found[0] - wanted[0]).hypot(found[1] - wanted[1]) < 1e-9, "{shown:?}: {found:?}");
}

fn assert_refused(text: impl AsRef<[u8]>, line: usize, word: &str) {
    let shown = String::from_utf8_lossy(text.as_ref()).into_owned();
    match read(text) {
        Ok(program) => panic!("{shown:?} is read: {program:?}"),
        Err(error) => {
            assert_eq!(error.line, line, "{shown:?} {error}");
            assert!(error.word.starts_with(word), "{shown:?} {error}");
            assert!(!error.to_string().contains(char::is_control), "{shown:?} {error:?}");
        }
    }
}

#[test]
fn lines_arcs_dwells_and_units() {
    let program = good(
        "%\n(a part) ; and more\nN10 G21 G90 G17\nG4 P0.5\nG0 X10 Y-5.5\nG1 X20 F600\nY5 (modal)\n\
         G3 X10 Y15 I-10 J0\nG4 P1.25\nG91 G2 X10 Y10 R10\nG20 G1 X1\nM30\nG1 X999\n",
    );
    assert!((program.dwell_before_s - 0.5).abs() < 1e-15);
    let s = &program.segments;
    assert_eq!(s.len(), 6, "{s:?}");
    let near = |i: usize, x: f64, y: f64| {
        assert!((s[i].to_m[0] - x).hypot(s[i].to_m[1] - y) < 1e-12, "{:?}", s[i]);
    };
    near(0, 0.01, -0.0055);
    near(1, 0.02, -0.0055);
    near(2, 0.02, 0.005);
    near(3, 0.01, 0.015);
    near(4, 0.02, 0.025);
    near(5, 0.0454, 0.025);
    assert!((s[0].feed_m_s - 0.2).abs() < 1e-15 && (s[1].feed_m_s - 0.01).abs() < 1e-15);
    let arc = s[3].arc.unwrap();
    assert!(!arc.clockwise && (arc.center_m[0] - 0.01).abs() < 1e-15);
    assert!((s[3].dwell_s - 1.25).abs() < 1e-15);
    let arc = s[4].arc.unwrap();
    assert!(arc.clockwise);
    assert!((arc.center_m[0] - 0.02).hypot(arc.center_m[1] - 0.015) < 1e-9, "{arc:?}");
    assert_eq!(program.lines, [5, 6, 7, 8, 10, 11]);
    assert_eq!(program.rapid, [true, false, false, false, false, false]);
}

#[test]
fn numbers_are_read_in_double_precision() {
    let program = good("G1 X123.4567891 F100");
    assert!((program.segments[0].to_m[0] - 0.123_456_789_1).abs() < 1e-16);
}

#[test]
fn every_spelling_of_a_word_is_that_word() {
    for units in ["G20", "G20.", "G20.0", "g20", "G 20", "G2 0", "G020", "G+20", "G20.00"] {
        assert_ends(&format!("{units}\nG1 X1 F60"), [25.4, 0.0]);
    }
    for incremental in ["G91", "G91.", "g91.0", "G 9 1", "G0091"] {
        assert_ends(&format!("{incremental}\nG1 X1 F60\nX1"), [2.0, 0.0]);
    }
    for line in ["G1", "G01", "g1.", "G1.0", "G 1", "G0001", "G1.000"] {
        let program = good(format!("G0 X1\n{line} X2 F60"));
        assert!((program.segments[1].feed_m_s - 1e-3).abs() < 1e-15, "{line}");
        assert!(!program.rapid[1]);
    }
    for (number, is) in [("1.5", 1.5), ("+1.5", 1.5), (".5", 0.5), ("5.", 5.0), ("-.5", -0.5)] {
        assert_ends(&format!("G1 X{number}"), [is, 0.0]);
        assert_ends(&format!("g1x {number}"), [is, 0.0]);
    }
    assert_ends("G0 x +0. 12 34y 7", [0.1234, 7.0]);
    assert_ends("N5G1X1Y2", [1.0, 2.0]);
    for end in ["M2", "M02", "m30.", "M 30", "M2.0"] {
        assert_ends(&format!("G1 X1\n{end}\nG1 X2"), [1.0, 0.0]);
    }
}

#[test]
fn words_that_ask_for_what_is_so_anyway_are_read() {
    let head =
        "G8 G17 G21 G40 G49 G54 G61 G80 G90 G91.1 G92.1 G94 G97 G99 M5 M9 M48 S1000 T1 F60\n";
    assert_ends(&format!("{head}G92.2 G98 G61.1 M49\nG1 X1"), [1.0, 0.0]);
    assert_ends("G2 X10 I5 J0 K0", [10.0, 0.0]);
    assert_refused("G64\nG1 X1", 1, "G64");
    let blended = GcodeSetting { exact_corners: false, ..SETTING };
    assert!(read_gcode(b"G64\nG1 X1", &blended).is_ok());
    for refused in ["G61", "G61.1", "G64 P0.1"] {
        assert!(read_gcode(format!("{refused}\nG1 X1").as_bytes(), &blended).is_err(), "{refused}");
    }
}

#[test]
fn refusals_name_line_word_and_what_is_allowed() {
    for (text, line, word) in [
        ("G1 X1\nG5 X2\n", 2, "G5"),
        ("G21\n\nG18\n", 3, "G18"),
        ("G1 X1 Z2\n", 1, "Z2"),
        ("X5\n", 1, "X5"),
        ("G1 X1 X2\n", 1, "X2"),
        ("G1 X1 F0\n", 1, "F0"),
        ("G1 X1 F-5\n", 1, "F-5"),
        ("G2 X10 Y0\n", 1, "G2"),
        ("G2 X10 Y0 R1\n", 1, "R1"),
        ("G2 X10 Y0 I4 J0\n", 1, "G2"),
        ("G2 X10 Y0 I5 R5\n", 1, "G2"),
        ("G2 X10 Y0 I5 K1\n", 1, "K1"),
        ("G2 I0 J0\n", 1, "G2"),
        ("G2 X0 Y0 R5\n", 1, "R5"),
        ("G1 X1 I3\n", 1, "I3"),
        ("G4\n", 1, "G4"),
        ("N5 G4\n", 1, "G4"),
        ("G4 P-1\n", 1, "P-1"),
        ("G1 X#1\n", 1, "X"),
        ("#1=5\n", 1, "#"),
        ("G1 X[1+2]\n", 1, "X"),
        ("o100 sub\n", 1, "o100"),
        ("O1000\nG1 X1", 1, "O1000"),
        ("G0 G1 X1\n", 1, "G1"),
        ("G20 G21\n", 1, "G21"),
        ("G90 G90\n", 1, "G90"),
        ("G90 G91 X1\n", 1, "G91"),
        ("M2 M30\n", 1, "M30"),
        ("G1 F1 F2\n", 1, "F2"),
        ("M6 T1\n", 1, "M6"),
        ("M3 S100\n", 1, "M3"),
        ("M0\n", 1, "M0"),
        ("G1 X1 P3\n", 1, "P3"),
        ("G1 X1 N5\n", 1, "N5"),
        ("N5.5 G1\n", 1, "N5.5"),
        ("G90.1\n", 1, "G90.1"),
        ("G90.10\n", 1, "G90.10"),
        ("G91.10\n", 1, "G91.10"),
        ("G-1 X1\n", 1, "G-1"),
        ("G4294967297 X1\n", 1, "G4294967297"),
        ("G1.5\n", 1, "G1.5"),
        ("G\n", 1, "G"),
        ("G1 X\n", 1, "X"),
        ("G1 X-\n", 1, "X-"),
        ("G1 X.\n", 1, "X."),
        ("G1 X--5\n", 1, "X-"),
        ("G1 X1-5\n", 1, "-"),
        ("G1 X1.2.3\n", 1, "."),
        ("G1 X1e3\n", 1, "e3"),
        ("G1 X 5 5.5.5\n", 1, "."),
        ("G1 12 X1\nG5", 1, "G1 12"),
        ("5 X1\n", 1, "5"),
        ("G1 X99999999999999999999\n", 1, "X99999999999999999999"),
        ("G1 X5e9\n", 1, "e9"),
        ("G1 X5000000\n", 1, "X5000000"),
        ("G1 U1\n", 1, "U1"),
        ("G1 X1 D1\n", 1, "D1"),
        ("G43 H1\n", 1, "G43"),
        ("G54\nG55\n", 2, "G55"),
        ("G1 X1\nG80\nX2\n", 3, "X2"),
        ("G1 X1 G80\n", 1, "G80"),
        ("G1 X1 \u{a0}Y1\n", 1, ""),
        ("G1 X1\nG1 Y!\n", 2, "Y"),
        ("G1 X1 \x1b[31m\n", 1, "\\u{1b}"),
        ("G1 X1\r\nG1 X2\rG5\n", 3, "G5"),
    ] {
        assert_refused(text, line, word);
    }
}

#[test]
fn comments_stay_in_their_line() {
    assert_refused("G1 X5 F600 (oops\nG1 Y5\nG1 X10 (ok)\nG1 X20", 1, "(oops");
    assert_refused("G1 X10 F600 (no end\nG1 Y10\nG1 X20", 1, "(no end");
    assert_refused("G1 X1\n(a (b) c)\nG1 X2", 2, "(a (");
    assert_refused("G1 X1 ) Y2", 1, ")");
    assert_refused("G1 X(one)5", 1, "X");
    assert_refused("G1 X1 (last line", 1, "(last line");
    assert_ends("G1 (a; b) X1 (c)Y2;(d\nX3 ; )(", [3.0, 2.0]);
    assert_ends("()\n;\n\n  \t\n(only)(comments)\nG1 X1", [1.0, 0.0]);
    assert_ends(b"G1 X1 (sp\xe4t) ; \xb5m \xff\0\nY2", [1.0, 2.0]);
    assert_refused(b"G1 X1 (c)\nG1 \xe4 X2", 2, "\u{fffd}");
}

#[test]
fn percent_signs_and_ends_end_a_program() {
    assert_ends("%\nG1 X10 F600\n%\nG1 X50", [10.0, 0.0]);
    assert_ends("%\nG1 X1 F60\nM30\n%\nsome text", [1.0, 0.0]);
    assert_ends("\n \r\n % \t\r\nG1 X1\r\n%some text (", [1.0, 0.0]);
    assert_ends("G1 X1 M2\nsome text (", [1.0, 0.0]);
    assert_ends("M2 G1 X1\n(", [1.0, 0.0]);
    assert_refused("G1 X1\n%\nG1 X50", 2, "%");
    assert_refused("%\nG1 X1\nG1 X50", 3, "end of the text");
    assert_refused("% G1 X1\n%", 1, "G1");
    assert_refused("%\nG1 X1 %\n", 2, "%");
    assert_refused("%%\nG1 X1\n", 1, "%");
    for empty in ["", "\n\n", "%\n%\nG1 X5", "(nothing)", "M30\nG1 X5", "G21 G90\n"] {
        assert!(good(empty).segments.is_empty(), "{empty:?}");
    }
}

#[test]
fn block_delete_is_off_unless_it_is_asked_for() {
    let text = "G1 X1\n/ G1 X2\n/N10 Y5\n / (c) ;d\n";
    assert_ends(text, [2.0, 5.0]);
    let deleted = GcodeSetting { block_delete: true, ..SETTING };
    let program = read_gcode(text.as_bytes(), &deleted).unwrap();
    assert_eq!(program.segments.len(), 1);
    assert!(read_gcode(b"G1 X1\n/ what [is] this\nM2", &deleted).is_ok());
    assert!(read_gcode(b"G1 X1\n/ (unclosed\nM2", &deleted).is_err());
    assert_refused("G1 / X1\n", 1, "/");
    assert_refused("//G1 X1\n", 1, "/");
    assert_refused("/1 G1 X1\n", 1, "1");
}

#[test]
fn marks_line_ends_and_other_encodings() {
    assert_ends(b"\xef\xbb\xbfG1 X1\r\nY2\r\n", [1.0, 2.0]);
    assert_ends(b"\xef\xbb\xbf%\r\nG1 X1\r\n%\r\n", [1.0, 0.0]);
    assert_ends("G1 X1\rY2\r", [1.0, 2.0]);
    assert_ends("\tG1\tX1\x0b\x0c\n", [1.0, 0.0]);
    assert_refused(b"\xff\xfeG\x001\0", 1, "its encoding");
    assert_refused(b"G\x001\0 \0X\x001\0", 1, "its encoding");
    assert_refused(b"G1 X1\n\0", 2, "\\0");
}

#[test]
fn units_switch_for_every_length_and_feeds_stay_what_they_are() {
    let program =
        good("G21 F600\nG20\nG1 X1\nF60\nX2\nG21\nX60\nG2 X70 Y0 R5\nG20 G91 G2 X0.2 I0.1");
    let s = &program.segments;
    assert!((s[0].feed_m_s - 0.01).abs() < 1e-15, "600 mm/min, whatever the units are since");
    assert!((s[1].feed_m_s - 0.0254).abs() < 1e-15, "60 in/min");
    assert!((s[2].feed_m_s - 0.0254).abs() < 1e-15 && (s[2].to_m[0] - 0.06).abs() < 1e-15);
    assert!((s[3].arc.unwrap().center_m[0] - 0.065).abs() < 1e-12);
    let last = s[4].arc.unwrap();
    assert!((last.center_m[0] - (0.07 + 0.00254)).abs() < 1e-12);
    // F is read before the units of its own block, as LinuxCNC does.
    let same = good("G20 G1 X1 F60");
    assert!((same.segments[0].feed_m_s - 1e-3).abs() < 1e-15);
    assert!((same.segments[0].to_m[0] - 0.0254).abs() < 1e-15);
}

#[test]
fn rotary_axes_are_in_degrees_whatever_the_units_are() {
    let setting =
        GcodeSetting { start_m: &[0.0; 4], rotary: &[false, false, false, true], ..SETTING };
    let program = read_gcode(b"G20 F60\nG1 A180\nX1 A90\nG21\nG2 X35.4 I5 A0", &setting).unwrap();
    let s = &program.segments;
    let half = std::f64::consts::PI;
    assert!((s[0].to_m[3] - half).abs() < 1e-15, "degrees");
    assert!((s[0].feed_m_s - 1.0_f64.to_radians()).abs() < 1e-15, "60 degrees a minute");
    assert!((s[1].to_m[0] - 0.0254).abs() < 1e-15 && (s[1].to_m[3] - 0.5 * half).abs() < 1e-15);
    // 25.4 mm at 1 mm/s, independent of the rotary axis.
    let lasts_s = 0.0254_f64.hypot(0.5 * half) / s[1].feed_m_s;
    assert!((lasts_s - 25.4).abs() < 1e-9, "{lasts_s}");
    let lasts_s = (0.005 * half).hypot(0.5 * half) / s[2].feed_m_s;
    assert!((lasts_s - 5.0 * half).abs() < 1e-9, "{lasts_s}");
    let turned = GcodeSetting { rotary: &[true, false], ..SETTING };
    assert!(read_gcode(b"G2 X10 I5", &turned).is_err());
}

#[test]
fn arcs_by_radius_go_the_short_or_the_long_way() {
    let center = |text: &str| good(text).segments[0].arc.unwrap().center_m;
    let h = 75.0_f64.sqrt() * 1e-3;
    assert!((center("G3 X10 Y0 R10")[1] - h).abs() < 1e-12, "left of the chord");
    assert!((center("G2 X10 Y0 R10")[1] + h).abs() < 1e-12);
    assert!((center("G3 X10 Y0 R-10")[1] + h).abs() < 1e-12, "the long way");
    let half = center("G3 X10 Y0 R5");
    assert!((half[0] - 0.005).hypot(half[1]) < 1e-12);
}

#[test]
fn a_semicircle_by_a_rounded_radius_is_one() {
    let center = |text: &str| good(text).segments.last().unwrap().arc.unwrap().center_m;
    let found = center("G2 X20.003 Y0 R10.001");
    assert!((found[0] - 0.010_001_5).hypot(found[1]) < 1e-12, "{found:?}");
    center("G0 X18.845 Y38.170\nG3 X41.155 Y21.830 R13.826");
    center("G2 X20.03 Y0 R10.01");
    center("G20\nG2 X2.0002 Y0 R1.0000");
    // Rounding of decimals does not explain these.
    assert_refused("G2 X20.003 Y0 R10.000", 1, "R10.000");
    assert_refused("G2 X20 Y0 R9.9", 1, "R9.9");
    assert_refused("G2 X20 Y0 R9", 1, "R9");
    assert_refused("G2 X20.0003 Y0 R9.9950", 1, "R9.9950");
    // Random semicircles, ends and radius rounded to three decimals.
    let mut random = Random(41);
    for _ in 0..2_000 {
        let [x, y, to_x, to_y] = std::array::from_fn(|_| (50e3 * random.signed()).round() / 1e3);
        let radius = (500.0 * (to_x - x).hypot(to_y - y)).round() / 1e3;
        if radius > 0.01 {
            center(&format!("G0 X{x:.3} Y{y:.3}\nG2 X{to_x:.3} Y{to_y:.3} R{radius:.3}"));
        }
    }
}

#[test]
fn programs_are_bounded() {
    let mut text = String::from("G1\n");
    for round in 0..250_001 {
        text.push_str(if round % 2 == 0 { "X1\n" } else { "X0\n" });
    }
    assert_refused(&text, 250_002, "X1");
}

#[test]
fn no_bytes_make_it_panic() {
    let mut random = Random(43);
    let pieces = [
        "G0",
        "G1",
        "G2",
        "G3 ",
        "X1",
        "Y-2.5",
        "I1",
        "J0",
        "R5",
        "F60",
        "G4 P1",
        "G20",
        "G91",
        "%",
        "\n",
        "\r\n",
        "/",
        "(c)",
        "(",
        ")",
        ";",
        " ",
        "N1",
        "M2",
        "G80",
        "#",
        "[",
        "\u{fe}",
        ".",
        "-",
        "9999999999999999",
        "e5",
        "\0",
        "K0",
        "Z",
        "S1",
    ];
    let (mut read_well, mut refused) = (0, 0);
    for round in 0..20_000 {
        let n_pieces = 1 + round % 12;
        let text: String = (0..n_pieces).map(|_| pieces[random.below(pieces.len())]).collect();
        match read(&text) {
            Ok(program) => {
                read_well += 1;
                let finite = |segment: &PathSegment| segment.to_m.iter().all(|x| x.is_finite());
                assert!(program.segments.iter().all(finite), "{text:?}");
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains(char::is_control), "{text:?} {error:?}");
            }
        }
    }
    assert!(read_well > 500 && refused > 500, "{read_well} {refused}");
}
