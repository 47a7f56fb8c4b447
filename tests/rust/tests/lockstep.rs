//! The whole campaign in lock-step: that it learns, from which measurement, how well, and that it
//! is bit-identical when repeated and over every transport.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures and what it skips"
)]

use std::net::{TcpListener, UdpSocket};
use std::time::Duration;

use ilc_rt::config::{Cell, Measure};
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport::{self, ZenohBus, ZenohSettings, loopback};
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::{self, Kept, machine, run, run_on};
use ilc_tests::far_side::FarSide;
use ilc_tests::{example, example_text, short};

/// Long enough for a loaded machine; a passing test never waits this long.
const PATIENCE: Duration = Duration::from_secs(20);
/// Runs of the campaigns that are compared between transports.
const COMPARED: u32 = 3;

fn describe(kept: &Kept) -> String {
    let microns: Vec<String> =
        kept.contour_m().iter().map(|contour| format!("{:.0}", contour * 1e6)).collect();
    format!("contour um: {}", microns.join(" "))
}

fn completed(kept: &Kept, runs: usize) {
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert_eq!((kept.outcome.runs.len(), kept.digests.len()), (runs, runs));
    for (_, figures) in &kept.outcome.runs {
        assert_eq!((figures.overruns, figures.missing_samples, figures.late_updates), (0, 0, 0));
    }
}

#[test]
fn the_contour_error_at_the_tool_falls_by_four_fifths_in_ten_runs() {
    let cell = example("01_gantry.toml");
    let tool = run(&cell, 10, Some(Measure::Tcp));
    let encoder = run(&cell, 10, Some(Measure::Encoder));
    println!("tool: {}\nencoder: {}", describe(&tool), describe(&encoder));
    completed(&tool, 10);
    completed(&encoder, 10);
    let (tool_fall, encoder_fall) = (tool.contour_fall(9), encoder.contour_fall(9));
    assert!(tool_fall >= 0.8, "{tool_fall}");
    // Errors that encoders do not see cannot be learned from them: orthogonality and the swinging
    // crossbeam.
    assert!(encoder_fall > 0.2 && encoder_fall < tool_fall - 0.2, "{encoder_fall}");
    // Each is best in the measurement it learns from.
    let last = |kept: &Kept| kept.outcome.runs[9].1.clone();
    assert!(last(&encoder).encoder_tracking_inf_m < last(&tool).encoder_tracking_inf_m);
    assert!(last(&tool).tool_tracking_inf_m < last(&encoder).tool_tracking_inf_m);
}

#[test]
fn the_first_run_is_the_same_whatever_is_learned() {
    let cell = example("01_gantry.toml");
    let first = |measure| run(&cell, 1, Some(measure)).contour_m()[0].to_bits();
    assert_eq!(first(Measure::Tcp), first(Measure::Encoder));
}

#[test]
fn parallel_learning_falls_by_four_fifths_and_stays_there() {
    let kept = run(&example("02_parallel.toml"), 20, None);
    println!("{}", describe(&kept));
    completed(&kept, 20);
    assert!(kept.contour_fall(9) >= 0.8, "{}", kept.contour_fall(9));
    for index in 9..20 {
        assert!(kept.contour_fall(index) >= 0.8, "run {index}: {}", describe(&kept));
    }
    assert!(kept.outcome.runs.iter().all(|(_, figures)| !figures.rolled_back));
}

/// The gantry with the PD law. The lead is the delay of its axes at low frequency: `2 d / w0`, 10
/// samples for y and 11 for x; the low-pass is below the frequency where that no longer holds.
fn pd_cell() -> Cell {
    let text = example_text("01_gantry.toml");
    let learning = text.find("[learning]").unwrap();
    let text = format!(
        "{}[learning]\nlaw = \"pd\"\nmeasure = \"tcp\"\ninput_max_m = 0.005\n[learning.pd]\n\
         kp = 0.5\nlead_samples = 10\norder = 2\ncutoff_hz = 8.0\n",
        &text[..learning]
    );
    Cell::parse(&text, "pd.toml").unwrap()
}

#[test]
fn the_pd_law_learns_too() {
    let kept = run(&pd_cell(), 10, None);
    let rms_m = |index: usize| kept.outcome.runs[index].1.tracking_rms_m;
    println!("{}; tracking rms {} to {} m", describe(&kept), rms_m(0), rms_m(9));
    completed(&kept, 10);
    assert!(rms_m(9) < 0.1 * rms_m(0), "{} {}", rms_m(0), rms_m(9));
}

#[test]
fn two_campaigns_are_the_same_bit_by_bit() {
    for name in ["01_gantry.toml", "02_parallel.toml"] {
        let cell = example(name);
        let (first, second) = (run(&cell, 4, None), run(&cell, 4, None));
        completed(&first, 4);
        assert_eq!(first.digests, second.digests, "{name}");
        assert_eq!(first.course, second.course, "{name}");
        // A run is reported as kept before the next one begins.
        let told: Vec<&str> = first.course.iter().map(String::as_str).collect();
        let steps = [
            "Running 0",
            "kept 0",
            "Running 1",
            "kept 1",
            "Running 2",
            "kept 2",
            "Running 3",
            "kept 3",
        ];
        let wanted = |told: &&str| steps.contains(told);
        assert_eq!(told.into_iter().filter(wanted).collect::<Vec<_>>(), steps, "{name}");
        assert_ne!(first.outcome.campaign, second.outcome.campaign);
        assert_ne!(first.digests[0], first.digests[1]);
    }
}

#[test]
fn noise_with_a_seed_is_the_same_noise() {
    let mut cell = short("01_gantry.toml");
    cell.simulation.encoder_noise_m = 2e-6;
    let first = run(&cell, 3, None);
    assert_eq!(first.digests, run(&cell, 3, None).digests);
    cell.simulation.seed = 2;
    assert_ne!(first.digests, run(&cell, 3, None).digests);
}

/// Runs the campaign on a bus whose far end is served by another thread.
fn over(cell: &Cell, near: Box<dyn Bus>, far: Box<dyn Bus>) -> Vec<String> {
    let far_side = FarSide::serve(far, machine(cell));
    let kept = run_on(cell, near, COMPARED, None);
    drop(far_side);
    completed(&kept, COMPARED as usize);
    kept.digests
}

fn compare(name: &str, mut ends: impl FnMut() -> (Box<dyn Bus>, Box<dyn Bus>)) {
    for example in ["01_gantry.toml", "02_parallel.toml"] {
        let cell = short(example);
        let expected = campaign::run(&cell, COMPARED, None).digests;
        let (near, far) = ends();
        assert_eq!(over(&cell, near, far), expected, "{example} over {name}");
    }
}

#[test]
fn the_same_over_a_pair_of_threads() {
    compare("loopback", || {
        let (near, far) = loopback::pair(1024).unwrap();
        (Box::new(near), Box::new(far))
    });
}

#[test]
fn the_same_over_udp() {
    // Held until the end, so that the port stays reserved for this test.
    let holder = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udp:239.74.163.91:{}", holder.local_addr().unwrap().port());
    compare("udp", || (transport::open(&address).unwrap(), transport::open(&address).unwrap()));
}

#[test]
fn the_same_over_zenoh() {
    compare("zenoh", || {
        for _ in 0..10 {
            // Free when queried; if another process takes it before Zenoh does, the next one will
            // do.
            let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
            let open = |role: &str| {
                let address = format!("zenoh:test/cell?{role}=tcp/127.0.0.1:{port}&scouting=off");
                let settings: ZenohSettings = address.parse().unwrap();
                ZenohBus::open(&settings)
            };
            let (Ok(near), Ok(far)) = (open("listen"), open("connect")) else { continue };
            assert!(near.wait_for_peer(PATIENCE) && far.wait_for_peer(PATIENCE), "port {port}");
            return (Box::new(near), Box::new(far));
        }
        panic!("no free port in ten attempts");
    });
}

#[test]
fn the_same_over_can() {
    let Ok(interface) = std::env::var("ILC_TEST_CAN") else {
        eprintln!("SKIPPED: ILC_TEST_CAN is not set; see tests/vcan/run");
        return;
    };
    // One test at a time on the interface, across processes.
    let lock = std::fs::File::create(std::env::temp_dir().join("ilc-rt-can-test.lock")).unwrap();
    lock.lock().unwrap();
    let address = format!("can:{interface}");
    compare("can", || (transport::open(&address).unwrap(), transport::open(&address).unwrap()));
}
