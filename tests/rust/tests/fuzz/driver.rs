//! Runs a target on the corpus, then on mutations of it, up to their number or the time limit.
//!
//! `make test` replays the corpus, `tests/fuzz/corpus`, and draws a fixed number of mutations from
//! a fixed seed; `make fuzz` draws from another seed for some time (`ILC_FUZZ_S`). An input that
//! panics or takes too long is written to the corpus, from which later runs try it first.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ilc_tests::faulty::Draws;

/// Environment variable with the seconds per target under `make fuzz`.
const SECONDS_VARIABLE: &str = "ILC_FUZZ_S";
/// An input that takes longer is a hang.
const HANG: Duration = Duration::from_secs(45);
/// Longest input.
const LENGTH_MAX: usize = 1 << 16;

/// Numbers that often break parsers.
const NUMBERS: [&str; 16] = [
    "0",
    "-0",
    "-1",
    "1e-320",
    "1e308",
    "1e309",
    "-1e308",
    "nan",
    "inf",
    "4294967297",
    "20.",
    "0.0000001",
    "99999999999999999999",
    "1_000",
    "0x10",
    "127",
];

fn corpus(target: &str) -> PathBuf {
    ilc_tests::root().join("tests/fuzz/corpus").join(target)
}

fn kept(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let Ok(entries) = std::fs::read_dir(corpus(target)) else { return Vec::new() };
    let mut found: Vec<(PathBuf, Vec<u8>)> = entries
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.clone(), std::fs::read(path).unwrap()))
        .collect();
    found.sort();
    found
}

/// Writes an input to the corpus, and prints what to do with it.
fn keep(target: &str, input: &[u8], what: &str) -> String {
    let hash = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let path = corpus(target).join(format!("found-{hash:016x}"));
    let written =
        std::fs::create_dir_all(corpus(target)).and_then(|()| std::fs::write(&path, input));
    let place = match written {
        Ok(()) => format!(
            "kept as {}: give the file a name that says what it shows, and make test tries it first",
            path.display()
        ),
        Err(error) => format!("cannot be kept as {}: {error}", path.display()),
    };
    format!("{target}, seed {}: {what}; the input is {place}", ilc_cases::seed())
}

/// Reports a hanging input from its own thread, and aborts the test.
struct Watchdog(Arc<Mutex<Option<Trial>>>);

/// Start time and input.
type Trial = (Instant, Vec<u8>);

impl Watchdog {
    fn new(target: &'static str) -> Self {
        let now = Arc::new(Mutex::new(None::<Trial>));
        let watched = Arc::clone(&now);
        std::thread::spawn(move || {
            // Ends with the test's last reference.
            while Arc::strong_count(&watched) > 1 {
                std::thread::sleep(Duration::from_millis(500));
                let running = watched.lock().unwrap().clone();
                if let Some((since, input)) = running
                    && since.elapsed() > HANG
                {
                    eprintln!("{}", keep(target, &input, "hangs"));
                    std::process::exit(101);
                }
            }
        });
        Self(now)
    }

    fn run(&self, input: &[u8], target: &dyn Fn(&[u8])) -> Result<(), String> {
        *self.0.lock().unwrap() = Some((Instant::now(), input.to_vec()));
        let done = catch_unwind(AssertUnwindSafe(|| target(input)));
        *self.0.lock().unwrap() = None;
        done.map_err(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic").to_owned()
        })
    }
}

/// Runs a target on the corpus and on `n` mutations of it and of `seeds`.
pub(crate) fn fuzz(name: &'static str, seeds: &[Vec<u8>], n: usize, target: impl Fn(&[u8])) {
    let watchdog = Watchdog::new(name);
    let kept = kept(name);
    for (path, input) in &kept {
        if let Err(what) = watchdog.run(input, &target) {
            panic!("{}: {what}", path.display());
        }
    }
    let pool: Vec<&[u8]> =
        seeds.iter().map(Vec::as_slice).chain(kept.iter().map(|one| one.1.as_slice())).collect();
    let until = std::env::var(SECONDS_VARIABLE)
        .ok()
        .map(|text| Instant::now() + Duration::from_secs_f64(text.parse().expect("seconds")));
    let mut draws = Draws::new(ilc_cases::seed());
    let mut tried = 0;
    while until.map_or(tried < n, |until| Instant::now() < until) {
        let input = mutated(&pool, &mut draws);
        tried += 1;
        if let Err(what) = watchdog.run(&input, &target) {
            panic!("{}", keep(name, &input, &what));
        }
    }
    println!("{name}: {} kept, {tried} drawn from seed {}", kept.len(), ilc_cases::seed());
}

/// Returns a member of the pool after a few mutations, or random bytes.
fn mutated(pool: &[&[u8]], draws: &mut Draws) -> Vec<u8> {
    if pool.is_empty() || draws.chance(0.05) {
        return (0..draws.below(64)).map(|_| draws.byte()).collect();
    }
    let mut bytes = pool[draws.below(pool.len())].to_vec();
    for _ in 0..=draws.below(4) {
        change(&mut bytes, pool, draws);
    }
    bytes.truncate(LENGTH_MAX);
    bytes
}

fn change(bytes: &mut Vec<u8>, pool: &[&[u8]], draws: &mut Draws) {
    let at = draws.below(bytes.len());
    let end = (at + 1 + draws.below(16)).min(bytes.len());
    match draws.below(9) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << draws.below(8),
        1 if !bytes.is_empty() => bytes[at] = [0, 0xFF, 0x7F, 0x80, b'\n', 0x1B][draws.below(6)],
        2 => bytes.insert(at, draws.byte()),
        3 if !bytes.is_empty() => drop(bytes.drain(at..end)),
        4 if !bytes.is_empty() => {
            let copy: Vec<u8> = bytes[at..end].to_vec();
            bytes.splice(at..at, copy);
        }
        5 => {
            let other = pool[draws.below(pool.len())];
            let from = draws.below(other.len());
            let until = (from + 1 + draws.below(64)).min(other.len());
            bytes.splice(at..at, other[from..until].iter().copied());
        }
        6 => exchange_lines(bytes, draws),
        _ => exchange_number(bytes, at, draws),
    }
}

/// Replaces the first number after `at`.
fn exchange_number(bytes: &mut Vec<u8>, at: usize, draws: &mut Draws) {
    let Some(begin) = bytes.iter().skip(at).position(u8::is_ascii_digit).map(|n| n + at) else {
        return;
    };
    let is_part = |byte: &&u8| byte.is_ascii_digit() || b".e-+".contains(byte);
    let end = begin + bytes[begin..].iter().take_while(is_part).count();
    bytes.splice(begin..end, NUMBERS[draws.below(NUMBERS.len())].bytes());
}

/// Swaps two lines, or duplicates one.
fn exchange_lines(bytes: &mut Vec<u8>, draws: &mut Draws) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let (a, b) = (draws.below(lines.len()), draws.below(lines.len()));
    if draws.chance(0.5) {
        lines.swap(a, b);
    } else {
        let line = lines[a].clone();
        lines.insert(b, line);
    }
    *bytes = lines.join(&b'\n');
}
