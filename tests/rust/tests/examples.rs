//! The examples in Rust run, and learn.

use std::process::Command;

#[test]
fn the_gantry_learns_its_contour() {
    // Cargo puts examples beside the folder of this test's binary.
    let test = std::env::current_exe().unwrap();
    let release = test.parent().and_then(|deps| deps.parent()).unwrap();
    let output = Command::new(release.join("examples/01_gantry")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let contours_um: Vec<f64> = text
        .lines()
        .filter_map(|line| {
            let columns: Vec<&str> = line.split_whitespace().collect();
            columns.first()?.parse::<u32>().ok()?;
            columns.get(2)?.parse().ok()
        })
        .collect();
    assert_eq!(contours_um.len(), 10, "{text}");
    assert!(contours_um[9] < 0.2 * contours_um[0], "{text}");
}
