//! ROS 1 bags: the sample, written files, and damage.

use std::io::Write;

use hydroid_io::IoError;
use proptest::prelude::*;

use crate::recorder::{Recorder, flipped, survives, truncated};
use crate::ros::{assert_sample, expected, numbers};
use crate::sample;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let length = u32::try_from(name.len() + 1 + value.len()).expect("short");
        [&length.to_le_bytes()[..], name.as_bytes(), b"=", value].concat()
    };
    fields.iter().flat_map(field).collect()
}

fn record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header = fields(header);
    let length = |bytes: &[u8]| u32::try_from(bytes.len()).expect("short").to_le_bytes();
    [&length(&header)[..], &header, &length(data), data].concat()
}

fn connection(id: u32, topic: &str, type_name: &str, definition: &str) -> Vec<u8> {
    let data = fields(&[("type", type_name.as_bytes()), ("message_definition", definition.as_bytes())]);
    record(&[("op", &[7]), ("conn", &id.to_le_bytes()), ("topic", topic.as_bytes())], &data)
}

fn message(id: u32, seconds: u32, data: &[u8]) -> Vec<u8> {
    let time = [seconds.to_le_bytes(), 5u32.to_le_bytes()].concat();
    record(&[("op", &[2]), ("conn", &id.to_le_bytes()), ("time", &time)], data)
}

fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    let packed = match compression {
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(records).expect("packed");
            encoder.finish().expect("packed")
        }
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(records).expect("packed");
            encoder.finish().expect("packed")
        }
        _ => records.to_vec(),
    };
    let size = u32::try_from(records.len()).expect("short").to_le_bytes();
    record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &packed)
}

fn read(records: &[Vec<u8>]) -> Recorder {
    Recorder::of_bytes(&[MAGIC, &records.concat()].concat()).expect("read")
}

fn counting(compression: &str, chunks: u32) -> Vec<Vec<u8>> {
    let chunk_of = |i: u32| {
        let head = if i == 0 { connection(0, "/x", "p/X", "float64 x") } else { Vec::new() };
        let numbers = (10 * i..10 * i + 10).flat_map(|n| message(0, n, &f64::from(n).to_le_bytes()));
        chunk(compression, &[head, numbers.collect()].concat())
    };
    (0..chunks).map(chunk_of).collect()
}

#[test]
fn sample_has_the_stated_messages() {
    let Some(expected) = expected() else { return };
    let all = Recorder::of(&sample::file("otter_ros1.bag").expect("a sample")).expect("read");
    assert_sample(&all, &expected, true);
    assert_eq!(all.topics.len(), 5);
    assert_eq!(all.summary.losses, []);
    assert_eq!(all.summary.notes, [""; 0]);
    // ROS 1 numbers the messages of a publisher.
    let odom = all.get("/odom");
    assert_eq!(odom.value(1, "header.seq") - odom.value(0, "header.seq"), 1.0);
}

#[test]
fn sample_cut_anywhere_gives_a_part_of_it() {
    let Some(path) = sample::file("otter_ros1.bag") else { return };
    let parts = truncated(&std::fs::read(path).expect("a sample"), 1000);
    assert_eq!(parts.last().expect("parts").0, 7746, "the index at the end is not needed");
}

#[test]
fn messages_are_packed_and_have_times() {
    let definition = "Header header\nbyte a\nchar b\nfloat64 c\ntime t\nduration d\nstring s\nI[] i\nI[2] j\nbool ok\n\
        ================================================================================\nMSG: p/I\nuint16 x\n\
        ================================================================================\n\
        MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
    let body = |seconds: u32| {
        [
            &7u32.to_le_bytes()[..],
            &seconds.to_le_bytes(),
            &if seconds == 0 { 0 } else { 9u32 }.to_le_bytes(),
            &1u32.to_le_bytes(),
            b"f",
            &[0xff, 0xfe],
            &1.5f64.to_le_bytes(),
            &3_000_000_000u32.to_le_bytes(),
            &4u32.to_le_bytes(),
            &(-5i32).to_le_bytes(),
            &6u32.to_le_bytes(),
            &2u32.to_le_bytes(),
            b"hi",
            &1u32.to_le_bytes(),
            &11u16.to_le_bytes(),
            &12u16.to_le_bytes(),
            &13u16.to_le_bytes(),
            &[1],
        ]
        .concat()
    };
    let records =
        [connection(3, "/t", "p/T", definition), message(3, 100, &body(50)), message(3, 101, &body(0))];
    for compression in ["none", "lz4", "bz2"] {
        let all = read(&[chunk(compression, &records.concat())]);
        assert_eq!((all.summary.losses.len(), all.summary.notes.len()), (0, 0), "{:?}", all.summary);
        let rows = all.get("/t");
        let expected = [
            ("header.seq", 7.0),
            ("a", -1.0),
            ("b", 254.0),
            ("c", 1.5),
            ("t.sec", 3e9),
            ("t.nanosec", 4.0),
            ("d.sec", -5.0),
            ("d.nanosec", 6.0),
            ("i[0].x", 11.0),
            ("j[0].x", 12.0),
            ("j[1].x", 13.0),
            ("ok", 1.0),
        ];
        for (name, value) in expected {
            assert_eq!(rows.value(0, name), value, "{name}");
        }
        assert_eq!(rows.topic.fields.len(), expected.len());
        assert_eq!((rows.rows[0].0, rows.rows[0].1), (50_000_000_009, Some(100_000_000_005)));
        assert_eq!((rows.rows[1].0, rows.rows[1].1), (101_000_000_005, Some(101_000_000_005)));
        let texts =
            [("header.frame_id", "f"), ("s", "hi")].map(|(name, text)| (name.to_owned(), text.to_owned()));
        assert_eq!(rows.topic.texts, texts);
    }
}

#[test]
fn message_without_header_has_one_stamp() {
    let all = read(&counting("none", 1));
    assert_eq!((all.topics[0].rows[3].0, all.topics[0].rows[3].1), (3_000_000_005, None));
}

#[test]
fn empty_messages_and_large_arrays_are_skipped() {
    let definition = "p/E e\np/E[4294967295] f\nuint8[] data\nfloat64 x\n================\nMSG: p/E\n";
    let body = [&100u32.to_le_bytes()[..], &[0; 100], &2.5f64.to_le_bytes()].concat();
    let all =
        read(&[chunk("none", &[connection(0, "/t", "p/T", definition), message(0, 1, &body)].concat())]);
    assert_eq!(all.get("/t").value(0, "x"), 2.5, "{:?}", all.summary);
}

#[test]
fn damage_is_stated_and_what_follows_is_read() {
    for compression in ["none", "lz4", "bz2"] {
        // The name of the operation, the length of the header, and the length of the data.
        for (place, byte) in [(8, 0x10), (2, 0xff), (usize::MAX, 0x7f)] {
            let mut chunks = counting(compression, 4);
            let header = u32::from_le_bytes(chunks[1][..4].try_into().expect("four")) as usize;
            let place = if place == usize::MAX { header + 7 } else { place };
            chunks[1][place] ^= byte;
            let all = read(&chunks);
            let found = numbers(&all);
            assert!(found.starts_with(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]), "{compression} {place} {found:?}");
            assert!(
                found.ends_with(&[30, 31, 32, 33, 34, 35, 36, 37, 38, 39]),
                "{compression} {place} {found:?}"
            );
            if compression != "none" || place != header + 7 {
                assert!(all.summary.lost_parts > 0, "{compression} {place}");
                assert!(found.len() < 40);
            }
        }
    }
}

#[test]
fn packed_bombs_do_not_fill_the_memory() {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(&vec![0; 50 << 20]).expect("packed");
    // Streams of bzip2 may follow each other.
    let packed = encoder.finish().expect("packed").repeat(6);
    let bomb = record(&[("op", &[5]), ("compression", b"bz2"), ("size", &[0xff; 4])], &packed);
    let mut records = counting("bz2", 2);
    records.insert(1, bomb);
    let all = read(&records);
    assert_eq!(numbers(&all).len(), 20);
    assert!(all.summary.losses.iter().any(|loss| loss.reason.contains("too big")), "{:?}", all.summary);
}

/// Blocks of LZ4 are 64 KiB: some of these ends are between two of them.
#[test]
fn a_packed_chunk_that_is_cut_is_stated() {
    let head = connection(0, "/x", "p/X", "float64 x");
    let messages = (0..4000).flat_map(|n| message(0, n, &f64::from(n).to_le_bytes()));
    let records = [head, messages.collect()].concat();
    let frame = lz4_flex::frame::FrameInfo::new().block_size(lz4_flex::frame::BlockSize::Max64KB);
    let mut lz4 = lz4_flex::frame::FrameEncoder::with_frame_info(frame, Vec::new());
    lz4.write_all(&records).expect("packed");
    let lz4 = lz4.finish().expect("packed");
    // Behind the header of 7 bytes, each block has its length in front; the highest bit is set if it is not packed.
    let mut ends = vec![7];
    while let Some(length) = lz4[ends[ends.len() - 1]..].first_chunk() {
        ends.push(ends[ends.len() - 1] + 4 + (u32::from_le_bytes(*length) & (u32::MAX >> 1)) as usize);
    }
    assert!(ends.len() > 3 && ends.pop() == Some(lz4.len()), "{ends:?}");
    let mut bz2 = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    bz2.write_all(&records).expect("packed");
    for (compression, packed) in [("lz4", lz4), ("bz2", bz2.finish().expect("packed"))] {
        // The header does not state the size of the content, which would show that it is cut.
        let bag = |packed: &[u8]| {
            let header: [(&str, &[u8]); 2] = [("op", &[5]), ("compression", compression.as_bytes())];
            let all = read(&[record(&header, packed)]);
            (numbers(&all).len(), all.summary.lost_parts)
        };
        assert_eq!(bag(&packed), (4000, 0), "{compression}");
        assert_eq!(bag(&packed.repeat(2)), (8000, 0), "frames of {compression} may follow each other");
        let some = (1..packed.len()).step_by(packed.len() / 50);
        for length in some.chain(ends.iter().copied().filter(|&end| end < packed.len())) {
            assert!(bag(&packed[..length]).1 > 0, "{compression}, {length} of {} bytes", packed.len());
        }
    }
}

/// Headers that are as long as they may be, where the search for a chunk looks for one: 4 MB that took minutes when
/// each of them was parsed.
#[test]
fn search_for_a_chunk_is_linear() {
    // Each field ends with the length of a header, which consists of the fields behind it.
    let field = [&[16, 0, 0, 0][..], b"compression=", &(1u32 << 20).to_le_bytes()].concat();
    let hostile = [&[0xff; 4][..], &field.repeat((4 << 20) / field.len())].concat();
    let mut records = counting("lz4", 2);
    records.insert(1, hostile);
    let all = read(&records);
    assert_eq!(numbers(&all).len(), 20);
    assert_eq!(all.summary.lost_parts, 1, "{:?}", all.summary);
}

#[test]
fn files_without_content_are_errors_with_a_place() {
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    for bytes in [MAGIC.to_vec(), [MAGIC, &[0xff; 100]].concat(), [MAGIC, &[1, 2]].concat()] {
        let error = Recorder::of_bytes(&bytes).expect_err("an error");
        assert!(matches!(error, IoError::Damaged { offset: 13, .. }), "{error}");
    }
}

/// 2^32 elements without bytes in a message without bytes: a loop over them would take years.
#[test]
fn arrays_of_empty_structs_end() {
    let line = "=".repeat(80);
    let definition = format!("O[4294967295] f\n{line}\nMSG: p/O\nE[2] e\n{line}\nMSG: p/E\n");
    let records = [connection(1, "/empty", "p/Root", &definition), message(1, 1, &[])].concat();
    let all = read(&[chunk("none", &records)]);
    assert!(all.topics.iter().all(|topic| topic.rows.is_empty()));
    assert!(all.summary.lost_parts > 0 || !all.summary.notes.is_empty(), "{:?}", all.summary);
}

#[test]
fn flipped_bytes_of_a_sample_are_survived() {
    let Some(path) = sample::file("otter_ros1.bag") else { return };
    flipped(&std::fs::read(path).expect("a sample"), MAGIC.len(), ..=Some(7746));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_record_is_survived(bytes in prop::collection::vec(any::<u8>(), 0..3000), op in 0u8..9) {
        survives(&[MAGIC, &record(&[("op", &[op]), ("compression", b"none")], &bytes)].concat());
    }
}
