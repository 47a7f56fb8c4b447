//! Files as they are written, through a pipe.

use std::io::Read;
use std::os::fd::OwnedFd;

use mcap::read::{LinearReader, Options};
use mcap::records::Record;

use super::*;
use crate::recording::records::Records;

/// Returns the bytes of a file that is written; they are read meanwhile.
fn written(write: impl FnOnce(RecordFile)) -> Vec<u8> {
    let (mut end, into) = std::io::pipe().unwrap();
    let reading = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        end.read_to_end(&mut bytes).map(|_| bytes)
    });
    write(RecordFile::begin(File::from(OwnedFd::from(into)), &["x".to_owned()]).unwrap());
    reading.join().unwrap().unwrap()
}

fn some(mut file: RecordFile) -> RecordFile {
    file.attach(CELL, "application/toml", b"[cell]").unwrap();
    file.flush().unwrap();
    file.write(Topic::Axis(0), Nanos(5), &[1]).unwrap();
    file.write(Topic::Cycle, Nanos(6), &[2]).unwrap();
    file.flush().unwrap();
    file.attach(SETUP, "application/json", b"{}").unwrap();
    file.write(Topic::Events, Nanos(7), &[3]).unwrap();
    file
}

/// Returns topics and texts, and whether the file is cut.
fn read(bytes: &[u8]) -> (Vec<(String, String)>, bool) {
    let mut records = Records::new(bytes);
    let (mut topics, mut all) = (BTreeMap::new(), Vec::new());
    let text = |data: &[u8]| String::from_utf8(data.to_vec()).unwrap();
    while let Some(record) = records.next_record().unwrap() {
        match record {
            Record::Channel(channel) => {
                assert_eq!(channel.message_encoding, "json");
                topics.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                assert_eq!(header.log_time, header.publish_time);
                all.push((topics[&header.channel_id].clone(), text(&data)));
            }
            Record::Attachment { header, data, .. } => all.push((header.name, text(&data))),
            Record::Metadata(end) => all.push((end.name, end.metadata["lost"].clone())),
            _ => {}
        }
    }
    (all, records.was_cut())
}

/// Returns the first records of the test's file.
fn first(n_records: usize) -> Vec<(String, String)> {
    let all = [
        (CELL, "[cell]"),
        ("/axes/x", "[1]"),
        ("/cycle", "[2]"),
        (SETUP, "{}"),
        ("/events", "[3]"),
        ("end", "9"),
    ];
    all[..n_records].iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect()
}

#[test]
fn a_file_reads_back_in_its_order_and_no_chunk_is_without_a_time() {
    let bytes = written(|file| some(file).end(9).unwrap());
    assert_eq!(read(&bytes), (first(6), false));
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let chunks = summary.chunk_indexes.iter();
    let spans: Vec<(u64, u64)> =
        chunks.map(|chunk| (chunk.message_start_time, chunk.message_end_time)).collect();
    assert_eq!(spans, [(5, 6), (7, 7)]);
    let mut topics: Vec<&str> =
        summary.channels.values().map(|channel| channel.topic.as_str()).collect();
    topics.sort_unstable();
    let expected = ["/axes/x", "/cycle", "/events", "/frames", "/iterations", "/tables", "/timing"];
    assert_eq!(topics, expected);
    for channel in summary.channels.values() {
        assert_eq!(channel.schema.as_ref().unwrap().encoding, "jsonschema");
    }
}

#[test]
fn what_was_flushed_is_there_in_whole_records_and_an_abandoned_file_has_no_end() {
    let bytes = written(|file| some(file).abandon());
    // The last message waited for its chunk.
    assert_eq!(read(&bytes), (first(4), true));
    let mut whole = LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into()).unwrap();
    assert!(whole.all(|record| record.is_ok()));
}

#[test]
fn a_large_chunk_does_not_wait_for_a_flush() {
    let text = "x".repeat(usize::try_from(CHUNK_BYTES).unwrap());
    let bytes = written(|mut file| {
        for at in 0..4 {
            file.write(Topic::Cycle, Nanos(at), &text).unwrap();
        }
        assert!(file.n_bytes() > 4 * CHUNK_BYTES);
        file.abandon();
    });
    let (all, was_cut) = read(&bytes);
    // The last of them waits for a next one.
    assert_eq!((all.len(), was_cut), (3, true));
}
