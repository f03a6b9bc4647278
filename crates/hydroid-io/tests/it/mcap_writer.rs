//! Written MCAP files have the messages that were given, also if they were not closed.

use std::path::Path;

use hydroid_io::{McapChannel, McapWriter};
use proptest::prelude::*;
use tempfile::TempDir;

use crate::recorder::Recorder;

const DEFINITION: &str = "float64 x\nfloat64 pulse";
const UNITS: [(&str, &str); 1] = [("pulse", "us")];

fn channel(topic: &str) -> McapChannel<'_> {
    McapChannel {
        topic,
        encoding: "cdr",
        schema: "p/msg/X",
        schema_encoding: "ros2msg",
        definition: DEFINITION,
        units: &UNITS,
    }
}

fn cdr(values: [f64; 2]) -> Vec<u8> {
    [&[0, 1, 0, 0][..], &values[0].to_le_bytes(), &values[1].to_le_bytes()].concat()
}

fn read(path: &Path) -> Recorder {
    Recorder::of(path.to_str().expect("a path")).expect("read")
}

#[test]
fn units_and_both_stamps_are_read_back() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("a.mcap");
    let mut writer = McapWriter::create(&path, "test").expect("created");
    let x = writer.channel(&channel("X")).expect("a channel");
    writer.message(x, 2_000, 1_000, &cdr([1.5, 1500.0])).expect("a message");
    writer.attach("memory", "application/octet-stream", 3_000, b"12345").expect("an attachment");
    writer.finish().expect("closed");
    let read = read(&path);
    assert_eq!(read.names(), ["X"]);
    assert_eq!(read.get("X").rows, [(1_000, Some(2_000), vec![1.5_f64.to_bits(), 1500_f64.to_bits()])]);
    assert_eq!((read.unit("X", "pulse"), read.unit("X", "x")), (Some("us"), None));
    assert_eq!((read.summary.lost_parts, read.summary.notes.len()), (0, 0), "{:?}", read.summary);
    let again = McapWriter::create(&path, "test").expect_err("a file is not overwritten");
    assert_eq!(again.kind(), std::io::ErrorKind::AlreadyExists);
}

#[test]
fn what_was_flushed_is_in_a_file_that_was_not_closed() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("a.mcap");
    let mut writer = McapWriter::create(&path, "test").expect("created");
    let x = writer.channel(&channel("X")).expect("a channel");
    for second in 0..10_u32 {
        for part in 0..100_u32 {
            let time = u64::from(100 * second + part);
            writer.message(x, time, time + 1, &cdr([f64::from(part), 0.0])).expect("a message");
        }
        writer.flush().expect("flushed");
        assert_eq!(read(&path).count("X"), 100 * (second as usize + 1));
    }
    writer.message(x, 2_000, 2_000, &cdr([0.0, 0.0])).expect("a message");
    drop(writer);
    let read = read(&path);
    assert_eq!(read.count("X"), 1_000);
    assert_eq!(read.summary.lost_parts, 0);
    assert!(read.summary.notes[0].contains("no footer"), "{:?}", read.summary.notes);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Channel, times, values, and whether the chunk is closed behind the message.
    #[test]
    fn messages_are_read_back(
        messages in prop::collection::vec(
            (0_usize..4, any::<[u32; 2]>(), any::<[f64; 2]>(), prop::bool::weighted(0.1)),
            0..200,
        ),
    ) {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join("a.mcap");
        let mut writer = McapWriter::create(&path, "test").expect("created");
        let names = ["A", "/b", "c.d", "X é"];
        let channels = names.map(|name| writer.channel(&channel(name)).expect("a channel"));
        let mut expected = vec![Vec::new(); 4];
        for (of, [logged, sent], values, flush) in messages {
            let (logged, sent) = (u64::from(logged), 1 + u64::from(sent));
            writer.message(channels[of], logged, sent, &cdr(values)).expect("a message");
            let (logged, sent) = (i64::try_from(logged).expect("small"), i64::try_from(sent).expect("small"));
            expected[of].push((sent, Some(logged), values.map(f64::to_bits).to_vec()));
            if flush {
                writer.flush().expect("flushed");
            }
        }
        writer.finish().expect("closed");
        let read = read(&path);
        for (name, rows) in names.iter().zip(expected) {
            if rows.is_empty() {
                prop_assert!(!read.names().contains(name));
            } else {
                prop_assert_eq!(&read.get(name).rows, &rows);
            }
        }
        prop_assert_eq!((read.summary.lost_parts, read.summary.notes.len()), (0, 0));
    }
}
