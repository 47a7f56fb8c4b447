//! Files as earlier versions wrote them, and files that no writer makes.

use mcap::records::{Record, op};

use super::Records;

/// Appends a record.
fn put(out: &mut Vec<u8>, kind: u8, content: &[u8]) {
    out.push(kind);
    out.extend_from_slice(&(content.len() as u64).to_le_bytes());
    out.extend_from_slice(content);
}

/// A text, or bytes, with their length.
fn block(bytes: &[u8]) -> Vec<u8> {
    let length = u32::try_from(bytes.len()).unwrap().to_le_bytes();
    [&length, bytes].concat()
}

fn message(channel: u16, text: &str) -> Vec<u8> {
    let mut content = channel.to_le_bytes().to_vec();
    content.extend_from_slice(&[0; 4]);
    content.extend_from_slice(&7_u64.to_le_bytes());
    content.extend_from_slice(&7_u64.to_le_bytes());
    content.extend_from_slice(text.as_bytes());
    content
}

fn chunk(compression: &str, records: &[u8], crc: u32) -> Vec<u8> {
    let mut content = vec![0; 16];
    content.extend_from_slice(&(records.len() as u64).to_le_bytes());
    content.extend_from_slice(&crc.to_le_bytes());
    content.extend_from_slice(&block(compression.as_bytes()));
    content.extend_from_slice(&(records.len() as u64).to_le_bytes());
    content.extend_from_slice(records);
    content
}

fn attachment(name: &str, data: &[u8]) -> Vec<u8> {
    let mut content = vec![0; 16];
    content.extend_from_slice(&block(name.as_bytes()));
    content.extend_from_slice(&block(b"text/plain"));
    content.extend_from_slice(&(data.len() as u64).to_le_bytes());
    content.extend_from_slice(data);
    let crc = crc32fast::hash(&content).to_le_bytes();
    content.extend_from_slice(&crc);
    content
}

fn begun() -> Vec<u8> {
    let mut bytes = b"\x89MCAP0\r\n".to_vec();
    put(&mut bytes, op::HEADER, &[block(b"ilc-rt"), block(b"ilc-rt 0.1.0")].concat());
    bytes
}

/// Returns the records that readers of recordings use, the refusal if there is one, and whether the file was cut.
fn read(bytes: &[u8]) -> (Vec<Record<'static>>, Option<String>, bool) {
    let mut records = Records::new(bytes);
    let mut all = Vec::new();
    let refusal = loop {
        match records.next_record() {
            Ok(Some(Record::Unknown { .. })) => {}
            Ok(Some(record)) => all.push(record),
            Ok(None) => break None,
            Err(what) => break Some(what),
        }
    };
    (all, refusal, records.was_cut())
}

/// A file in the layout of earlier versions: schemas and channels stand before the first chunk and count from 0.
fn earlier() -> Vec<u8> {
    let mut bytes = begun();
    let schema = [block(b"ilc.Cycle"), block(b"jsonschema"), block(b"{}")].concat();
    put(&mut bytes, op::SCHEMA, &[&1_u16.to_le_bytes()[..], &schema].concat());
    let channel = [block(b"/cycle"), block(b"json"), block(b"")].concat();
    put(&mut bytes, op::CHANNEL, &[&[0, 0, 1, 0][..], &channel].concat());
    put(&mut bytes, op::ATTACHMENT, &attachment("cell.toml", b"[cell]"));
    let mut inside = Vec::new();
    put(&mut inside, op::MESSAGE, &message(0, "{\"cycle\":0}"));
    put(&mut inside, op::MESSAGE, &message(0, "{\"cycle\":1}"));
    put(&mut bytes, op::CHUNK, &chunk("", &inside, crc32fast::hash(&inside)));
    put(&mut bytes, op::MESSAGE_INDEX, &[0; 6]);
    let fields = block(&[block(b"lost"), block(b"3")].concat());
    put(&mut bytes, op::METADATA, &[block(b"end"), fields].concat());
    put(&mut bytes, op::DATA_END, &[0; 4]);
    put(&mut bytes, op::FOOTER, &[0; 20]);
    bytes.extend_from_slice(b"\x89MCAP0\r\n");
    bytes
}

#[test]
fn a_file_of_an_earlier_version_is_read() {
    let (records, refusal, was_cut) = read(&earlier());
    assert_eq!((refusal, was_cut), (None, false));
    let [
        Record::Channel(channel),
        Record::Attachment { header: attached, data: cell, .. },
        Record::Message { header, data },
        Record::Message { .. },
        Record::Metadata(end),
    ] = &records[..]
    else {
        panic!("{records:?}");
    };
    assert_eq!((channel.id, channel.topic.as_str()), (0, "/cycle"));
    assert_eq!((attached.name.as_str(), &cell[..]), ("cell.toml", &b"[cell]"[..]));
    assert_eq!((header.log_time, &data[..]), (7, &b"{\"cycle\":0}"[..]));
    assert_eq!(end.metadata["lost"], "3");
}

#[test]
fn a_file_is_read_up_to_any_cut() {
    let whole = earlier();
    let texts = |records: &[Record<'_>]| -> Vec<String> {
        records.iter().map(|record| format!("{record:?}")).collect()
    };
    let all = texts(&read(&whole).0);
    let mut most = 0;
    for n_bytes in 0..whole.len() - 8 {
        let (records, refusal, was_cut) = read(&whole[..n_bytes]);
        if n_bytes < 8 {
            let said = refusal.unwrap();
            assert!(said.contains("does not begin as an MCAP file"), "{said}");
            continue;
        }
        assert_eq!((refusal, was_cut), (None, true), "{n_bytes}");
        assert!(all.starts_with(&texts(&records)) && records.len() >= most, "{n_bytes}");
        most = records.len();
    }
    assert_eq!(most, all.len());
}

#[test]
fn what_no_writer_makes_is_refused() {
    let mut inside = Vec::new();
    put(&mut inside, op::MESSAGE, &message(0, "{}"));
    let mut longer = inside.clone();
    // Its first record is longer than the chunk, and ends beyond it in the file.
    longer[1] += 40;
    let mut long = message(0, "{}");
    long.truncate(20);
    let mut short = Vec::new();
    put(&mut short, op::MESSAGE, &long);
    let mut cut = attachment("cell.toml", b"");
    cut.truncate(cut.len() - 2);
    let crc = crc32fast::hash(&inside);
    for (kind, content, expected) in [
        (op::CHUNK, chunk("zstd", &inside, 0), "compressed by zstd"),
        (op::CHUNK, chunk("", &inside, crc ^ 1), "checksum differs"),
        (op::CHUNK, chunk("", &longer, 0), "within a record"),
        (op::CHUNK, chunk("", &short, 0), "parse failed"),
        (op::ATTACHMENT, cut, "ends too early"),
    ] {
        let mut bytes = begun();
        put(&mut bytes, kind, &content);
        bytes.extend_from_slice(&earlier()[8..]);
        let (_, refusal, _) = read(&bytes);
        let said = refusal.expect(expected);
        assert!(said.contains(expected), "{said}");
    }
    let mut damaged = attachment("cell.toml", b"[cell]");
    damaged[20] ^= 1;
    let mut bytes = begun();
    put(&mut bytes, op::ATTACHMENT, &damaged);
    assert!(read(&bytes).1.unwrap().contains("checksum differs"));
}

#[test]
fn memory_follows_what_a_file_has() {
    let mut bytes = begun();
    bytes.push(op::ATTACHMENT);
    bytes.extend_from_slice(&u64::MAX.to_le_bytes());
    let said = read(&bytes).1.unwrap();
    assert!(said.contains("at most 268435456 are read"), "{said}");
}
