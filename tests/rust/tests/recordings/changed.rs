//! Recordings with one change each: it is found and named, or the recording is refused.

use std::path::{Path, PathBuf};

use ilc_rt::campaign::replay::replay;
use ilc_tests::{Scratch, short};
use serde_json::Value;

use crate::{record, the_same};

/// Kinds of records of the format that the tests change.
const CHUNK: u8 = 0x06;
const MESSAGE: u8 = 0x05;
const ATTACHMENT: u8 = 0x09;

/// Copies a recording with changes, and without the checksums that would tell them at once. `change` gets the content
/// of each message and attachment, until it returns true.
fn changed(path: &Path, mut change: impl FnMut(&mut Vec<u8>) -> bool) -> PathBuf {
    let bytes = std::fs::read(path).unwrap();
    let mut out = bytes[..8].to_vec();
    let mut is_done = false;
    let put = |out: &mut Vec<u8>, kind: u8, content: &[u8]| {
        out.push(kind);
        out.extend_from_slice(&(content.len() as u64).to_le_bytes());
        out.extend_from_slice(content);
    };
    for (kind, content) in records(&bytes[8..bytes.len() - 8]) {
        match kind {
            CHUNK => {
                let mut inside = Vec::new();
                for (kind, content) in records(&content[40..]) {
                    let mut content = content.to_vec();
                    if kind == MESSAGE && !is_done {
                        let mut data = content.split_off(22);
                        is_done = change(&mut data);
                        content.extend_from_slice(&data);
                    }
                    put(&mut inside, kind, &content);
                }
                let n_bytes = (inside.len() as u64).to_le_bytes();
                let mut head = content[..16].to_vec();
                head.extend_from_slice(&n_bytes);
                // No checksum, no compression.
                head.extend_from_slice(&[0; 8]);
                head.extend_from_slice(&n_bytes);
                head.extend_from_slice(&inside);
                put(&mut out, kind, &head);
            }
            ATTACHMENT => {
                let mut content = content[..content.len() - 4].to_vec();
                if !is_done {
                    is_done = change(&mut content);
                }
                content.extend_from_slice(&[0; 4]);
                put(&mut out, kind, &content);
            }
            _ => put(&mut out, kind, content),
        }
    }
    assert!(is_done, "nothing was changed");
    out.extend_from_slice(&bytes[bytes.len() - 8..]);
    let to = path.with_extension("changed.mcap");
    std::fs::write(&to, out).unwrap();
    to
}

fn records(mut bytes: &[u8]) -> Vec<(u8, &[u8])> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let n_bytes = usize::try_from(u64::from_le_bytes(bytes[1..9].try_into().unwrap())).unwrap();
        found.push((bytes[0], &bytes[9..9 + n_bytes]));
        bytes = &bytes[9 + n_bytes..];
    }
    found
}

/// Replaces the first place of some bytes by others of the same length.
fn swap(data: &mut [u8], from: &[u8], to: &[u8]) -> bool {
    let Some(at) = data.windows(from.len()).position(|part| part == from) else { return false };
    data[at..at + to.len()].copy_from_slice(to);
    true
}

/// Changes the message with these keys in a cycle.
fn in_cycle(
    cycle: u64,
    key: &'static str,
    mut change: impl FnMut(&mut Value),
) -> impl FnMut(&mut Vec<u8>) -> bool {
    move |data| {
        let Ok(mut message) = serde_json::from_slice::<Value>(data) else { return false };
        if message["cycle"] != cycle || message.get(key).is_none() {
            return false;
        }
        change(&mut message[key]);
        *data = serde_json::to_vec(&message).unwrap();
        true
    }
}

/// Flips the lowest bit of a byte of a frame as noted.
fn flip(frames: &mut Value, id: &str, byte: usize) {
    let place =
        frames.as_array().unwrap().iter().position(|text| text.as_str().unwrap().starts_with(id));
    let text = frames[place.unwrap()].as_str().unwrap().to_owned();
    let (head, data) = text.split_once('#').unwrap();
    let mut data: Vec<char> = data.chars().collect();
    let digit = data[2 * byte + 1].to_digit(16).unwrap() ^ 1;
    data[2 * byte + 1] = char::from_digit(digit, 16).unwrap().to_ascii_uppercase();
    frames[place.unwrap()] = format!("{head}#{}", data.iter().collect::<String>()).into();
}

/// The first difference: cycle, axes, field.
fn found(path: &Path) -> (u64, Vec<String>, String) {
    let difference = replay(path).unwrap().difference.expect("a difference");
    assert_ne!(difference.recorded, difference.replayed);
    (difference.cycle, difference.axes, difference.field)
}

#[test]
fn one_bit_that_was_changed_is_found_and_named() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let (path, _) = record(&cell, 3, &folder, "whole.mcap");
    let (x, y, both) =
        (vec!["x".to_owned()], vec!["y".to_owned()], vec!["x".to_owned(), "y".to_owned()]);

    // The lowest bit of the position that the drive of y reports.
    let planted = changed(&path, in_cycle(300, "received", |frames| flip(frames, "182#", 2)));
    assert_eq!(found(&planted), (300, y.clone(), "position_m".to_owned()));
    // The lowest bit of the torque that it reports, which the loop does not use.
    let planted = changed(&path, in_cycle(301, "received", |frames| flip(frames, "182#", 6)));
    assert_eq!(found(&planted), (301, y.clone(), "drive_torque".to_owned()));
    // The target that the loop sent to x.
    let planted = changed(&path, in_cycle(302, "sent", |frames| flip(frames, "201#", 2)));
    assert_eq!(found(&planted), (302, x.clone(), "RPDO1, target position 0x607A:00".to_owned()));
    // A frame of the loop that is not there.
    let planted = changed(
        &path,
        in_cycle(303, "sent", |frames| {
            frames.as_array_mut().unwrap().remove(0);
        }),
    );
    assert_eq!(found(&planted), (303, both.clone(), "frame sent".to_owned()));
    // An answer twice.
    let planted = changed(
        &path,
        in_cycle(304, "received", |frames| {
            let first = frames[0].clone();
            frames.as_array_mut().unwrap().insert(0, first);
        }),
    );
    assert_eq!(found(&planted).0, 304);
    // Number of missed cycles: a value of the whole loop.
    let planted = changed(&path, in_cycle(305, "missed", |missed| *missed = 1.into()));
    assert_eq!(found(&planted), (305, both.clone(), "overruns".to_owned()));
    // A request to stop.
    let planted = changed(&path, in_cycle(306, "asked", |asked| *asked = 2.into()));
    assert_eq!(found(&planted).0, 306);
    // The feed override.
    let planted = changed(&path, in_cycle(700, "feed_percent", |feed| *feed = 99.into()));
    assert!(found(&planted).0 >= 700);
    // The lowest bit of what was recorded to be plotted.
    let planted = changed(
        &path,
        in_cycle(307, "correction", |value| {
            *value = f64::from_bits(value.as_f64().unwrap().to_bits() ^ 1).into();
        }),
    );
    assert_eq!(found(&planted), (307, x, "correction".to_owned()));
    // The lowest bit of one sample of the learned input of y.
    let planted = changed(&path, |data| {
        let Ok(mut message) = serde_json::from_slice::<Value>(data) else { return false };
        let Some(entry) = message.get_mut("input").and_then(|input| input.get_mut(401)) else {
            return false;
        };
        *entry = f64::from_bits(entry.as_f64().unwrap().to_bits() ^ 1).into();
        *data = serde_json::to_vec(&message).unwrap();
        true
    });
    let (_, axes, field) = found(&planted);
    assert_eq!((axes, field.as_str()), (y, "learned input in table 1, sample 200"));
}

#[test]
fn without_its_law_a_changed_input_is_found_where_it_is_applied() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let (path, _) = record(&cell, 2, &folder, "whole.mcap");
    // As a recording of a law written in Python.
    let foreign =
        changed(&path, |data| swap(data, b"\"law_is_not_run\":null", b"\"law_is_not_run\":\"it\""));
    assert_eq!(the_same(&foreign).learned, 0);
    let planted = changed(&foreign, |data| {
        let Ok(mut message) = serde_json::from_slice::<Value>(data) else { return false };
        let Some(entry) = message.get_mut("input").and_then(|input| input.get_mut(400)) else {
            return false;
        };
        *entry = f64::from_bits(entry.as_f64().unwrap().to_bits() ^ 1).into();
        *data = serde_json::to_vec(&message).unwrap();
        true
    });
    let (_, axes, field) = found(&planted);
    assert_eq!((axes, field.as_str()), (vec!["x".to_owned()], "correction"));
}

#[test]
fn what_was_changed_by_hand_is_refused() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let (path, _) = record(&cell, 1, &folder, "whole.mcap");
    let said = |path: &Path| replay(path).unwrap_err().to_string();

    // The cell description, with its checksum and without.
    let edited = changed(&path, |data| swap(data, b"position_max_m = 0", b"position_max_m = 1"));
    assert!(said(&edited).contains("its cell description was changed"), "{}", said(&edited));
    // A text that is no frame, with letters that no terminal may get.
    let odd = changed(&path, in_cycle(3, "sent", |frames| frames[0] = "201#\u{7f}\u{1b}".into()));
    assert!(said(&odd).ends_with("cycle 3: `201#\\x7f\\x1b` is no frame"), "{}", said(&odd));
    // A byte in a chunk, with its checksum.
    let mut bytes = std::fs::read(&path).unwrap();
    assert!(swap(&mut bytes, b"\"cycle\":3,", b"\"Cycle\":3,"));
    let damaged = folder.file("damaged.mcap");
    std::fs::write(&damaged, bytes).unwrap();
    assert!(said(&damaged).contains("checksum differs"), "{}", said(&damaged));
    // No recording at all.
    std::fs::write(&damaged, "cycle,x,y\n").unwrap();
    assert!(said(&damaged).contains("not a recording"), "{}", said(&damaged));
}

#[test]
fn behind_lost_records_nothing_is_compared() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let (path, _) = record(&cell, 1, &folder, "whole.mcap");
    let lossy = changed(&path, in_cycle(400, "lost", |lost| *lost = 3.into()));
    let replayed = replay(&lossy).unwrap();
    assert_eq!((replayed.lost_at, replayed.cycles), (Some(400), 400));
    assert_eq!(replayed.difference, None);
}
