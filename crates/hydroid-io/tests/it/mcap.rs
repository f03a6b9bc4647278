//! MCAP: the samples, written files, and damage.

use std::io::Write;

use hydroid_io::{IoError, Summary};
use proptest::prelude::*;

use crate::recorder::{Recorder, assert_part_of, flipped, survives, truncated};
use crate::ros::{assert_sample, cdr, expected, numbers};
use crate::sample;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&u32::try_from(text.len()).expect("short").to_le_bytes()[..], text.as_bytes()].concat()
}

fn schema(id: u16, name: &str, encoding: &str, definition: &str) -> Vec<u8> {
    record(3, &[&id.to_le_bytes()[..], &text(name), &text(encoding), &text(definition)].concat())
}

fn channel(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let ids = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    record(4, &[&ids[..], &text(topic), &text(encoding), &[0; 4]].concat())
}

fn message(channel: u16, log: u64, publish: u64, data: &[u8]) -> Vec<u8> {
    let head = [&channel.to_le_bytes()[..], &[0; 4], &log.to_le_bytes(), &publish.to_le_bytes()].concat();
    record(5, &[&head[..], data].concat())
}

fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    let packed = match compression {
        "zstd" => ruzstd::encoding::compress_to_vec(records, ruzstd::encoding::CompressionLevel::Fastest),
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::with_frame_info(
                lz4_flex::frame::FrameInfo::new().block_size(lz4_flex::frame::BlockSize::Max64KB),
                Vec::new(),
            );
            encoder.write_all(records).expect("packed");
            encoder.finish().expect("packed")
        }
        _ => records.to_vec(),
    };
    let size = records.len() as u64;
    let head = [&[0; 8][..], &[1; 8], &size.to_le_bytes(), &crc32fast::hash(records).to_le_bytes()].concat();
    record(6, &[&head[..], &text(compression), &(packed.len() as u64).to_le_bytes(), &packed].concat())
}

fn file(records: &[Vec<u8>]) -> Vec<u8> {
    [MAGIC, &records.concat(), &record(0x0f, &[0; 4]), &record(2, &[0; 20]), MAGIC].concat()
}

fn read(records: &[Vec<u8>]) -> Recorder {
    Recorder::of_bytes(&file(records)).expect("read")
}

/// A topic of `float64 x` with values 0, 1, 2, ... in chunks of ten.
fn counting(compression: &str, chunks: u64) -> Vec<Vec<u8>> {
    let chunk_of = |i: u64| {
        let head = if i == 0 {
            [schema(1, "p/msg/X", "ros2msg", "float64 x"), channel(1, 1, "/x", "cdr")].concat()
        } else {
            Vec::new()
        };
        let numbers =
            (10 * i..10 * i + 10).flat_map(|n| message(1, 1000 + n, n, &cdr(&[&(n as f64).to_le_bytes()])));
        chunk(compression, &[head, numbers.collect()].concat())
    };
    (0..chunks).map(chunk_of).collect()
}

#[test]
fn samples_have_the_stated_messages() {
    let Some(expected) = expected() else { return };
    let mut files = Vec::new();
    for name in ["otter_zstd.mcap", "otter_lz4.mcap"] {
        let all = Recorder::of(&sample::file(name).expect("a sample")).expect("read");
        assert_sample(&all, &expected, true);
        assert_eq!(all.topics.len(), 5);
        assert_eq!(all.summary.losses, []);
        assert_eq!(all.summary.notes, [""; 0]);
        files.push(all.topics);
    }
    assert_eq!(files[0], files[1]);
}

#[test]
fn cut_sample_gives_the_messages_of_its_whole_chunks() {
    let Some(path) = sample::file("otter_truncated.mcap") else { return };
    let whole = Recorder::of(&sample::file("otter_zstd.mcap").expect("a sample")).expect("read");
    let all = Recorder::of(&path).expect("read");
    assert_part_of(&all, &whole);
    assert_eq!(all.all(), 4482);
    assert_eq!(all.summary.lost_parts, 1);
    assert!(all.summary.losses[0].reason.contains("cut"), "{:?}", all.summary);
    assert!(all.summary.notes[0].contains("no footer"), "{:?}", all.summary);
}

#[test]
fn sample_cut_anywhere_gives_a_part_of_it() {
    for name in ["otter_zstd.mcap", "otter_lz4.mcap"] {
        let Some(path) = sample::file(name) else { return };
        let parts = truncated(&std::fs::read(path).expect("a sample"), 1000);
        assert_eq!(parts.last().expect("parts").0, 7746, "the summary at the end is not needed");
        let partial =
            |summary: &Summary| summary.losses.iter().any(|loss| loss.reason.contains("have been read"));
        let partial = parts.iter().filter(|(_, summary)| partial(summary)).count();
        assert!(partial > 100, "{name}: most cuts are in a chunk");
    }
}

#[test]
fn kinds_arrays_and_texts_are_read_from_the_definition() {
    let definition = "# a comment\nint8 MINUS=-1\nstring NAME=\"a # b\"\nbool flag\nint8 a\nuint16[2] b\nint64 c 7\nInner[2] d\n\
        string<=10 name\nfloat32[<=3] e\nInner[] f\nuint8[65] long\nuint64 last\n\
        ================================================================================\nMSG: p/Inner\nfloat64 x\nint32[] y\n";
    let mut body =
        cdr(&[&[2, 0xff], &5u16.to_le_bytes(), &6u16.to_le_bytes(), &[0; 2], &(-7i64).to_le_bytes()]);
    let inner = |x: f64, y: &[i32]| {
        let count = u32::try_from(y.len()).expect("short").to_le_bytes();
        [&x.to_le_bytes()[..], &count, &y.iter().flat_map(|y| y.to_le_bytes()).collect::<Vec<_>>()].concat()
    };
    body.extend(inner(1.5, &[10]));
    body.extend(inner(2.5, &[20, 21, 22]));
    body.extend([&3u32.to_le_bytes()[..], b"ab\0\0"].concat());
    body.extend([&1u32.to_le_bytes()[..], &0.5f32.to_le_bytes()].concat());
    let mut other = body.clone();
    body.extend(0u32.to_le_bytes());
    body.extend([7; 65]);
    while !(body.len() - 4).is_multiple_of(8) {
        body.push(0);
    }
    body.extend(u64::MAX.to_le_bytes());
    // The second message has an element of `f`.
    other.extend(1u32.to_le_bytes());
    while !(other.len() - 4).is_multiple_of(8) {
        other.push(0);
    }
    other.extend(inner(3.5, &[]));
    other.extend([7; 65]);
    while !(other.len() - 4).is_multiple_of(8) {
        other.push(0);
    }
    other.extend(8u64.to_le_bytes());
    let all = read(&[
        schema(1, "p/msg/T", "ros2msg", definition),
        channel(1, 1, "/t", "cdr"),
        message(1, 11, 10, &body),
        message(1, 21, 20, &other),
    ]);
    let rows = all.get("/t");
    let names: Vec<&str> = rows.topic.fields.iter().map(|field| field.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "flag",
            "a",
            "b[0]",
            "b[1]",
            "c",
            "d[0].x",
            "d[1].x",
            "last",
            "d[0].y[0]",
            "d[1].y[0]",
            "d[1].y[1]",
            "d[1].y[2]",
            "e[0]",
            "f[0].x"
        ]
    );
    let values = |row: usize| rows.rows[row].2.iter().map(|&bits| f64::from_bits(bits)).collect::<Vec<_>>();
    let expected = [1.0, -1.0, 5.0, 6.0, -7.0, 1.5, 2.5, u64::MAX as f64, 10.0, 20.0, 21.0, 22.0, 0.5];
    assert_eq!(values(0), expected, "{:?}", all.summary);
    assert_eq!(values(1)[12..], [0.5, 3.5], "{:?}", all.summary);
    assert_eq!(rows.value(1, "last"), 8.0);
    assert_eq!(rows.topic.texts, [("name".to_owned(), "ab".to_owned())]);
    assert_eq!(
        (rows.rows[0].0, rows.rows[0].1),
        (10, Some(11)),
        "without a header the stamp is that of publishing"
    );
    assert_eq!(all.summary.notes, ["/t: long has more than 64 elements and is left out"]);
}

#[test]
fn sequences_grow_the_fields_and_too_long_ones_are_left_out() {
    let sequence = |n: u32| {
        cdr(&[&n.to_le_bytes(), &(0..n).flat_map(u32::to_le_bytes).collect::<Vec<_>>(), &9u32.to_le_bytes()])
    };
    let mut records =
        vec![schema(1, "p/msg/S", "ros2msg", "uint32[] s\nuint32 z"), channel(1, 1, "/s", "cdr")];
    records.extend([0, 2, 64, 65, 1].map(|n| message(1, u64::from(n) + 1, 0, &sequence(n))));
    let all = read(&records);
    let rows = all.get("/s");
    assert_eq!(rows.rows.iter().map(|row| row.2.len()).collect::<Vec<_>>(), [1, 3, 65, 65, 65]);
    assert!((0..5).all(|row| rows.value(row, "z") == 9.0));
    assert_eq!(rows.value(2, "s[63]"), 63.0);
    assert!(rows.value(3, "s[0]").is_nan());
    assert_eq!(rows.value(4, "s[0]"), 0.0);
    assert!(rows.value(4, "s[1]").is_nan());
    assert_eq!(all.summary.notes, ["/s: s has more than 64 elements and is left out"]);
}

#[test]
fn header_stamp_is_the_stamp_unless_it_is_zero() {
    let definition = "std_msgs/Header header\nfloat32 v";
    let body = |sec: i32, nanosec: u32| {
        cdr(&[
            &sec.to_le_bytes(),
            &nanosec.to_le_bytes(),
            &2u32.to_le_bytes(),
            b"a\0\0\0",
            &1.5f32.to_le_bytes(),
        ])
    };
    let all = read(&[
        schema(1, "p/msg/T", "ros2msg", definition),
        channel(1, 1, "/t", "cdr"),
        message(1, 30, 20, &body(5, 6)),
        message(1, 31, 21, &body(0, 0)),
        message(1, 32, 0, &body(0, 0)),
    ]);
    let rows = all.get("/t");
    let stamps: Vec<_> = rows.rows.iter().map(|row| (row.0, row.1)).collect();
    assert_eq!(stamps, [(5_000_000_006, Some(30)), (21, Some(31)), (32, Some(32))], "{:?}", all.summary);
    assert_eq!(rows.topic.fields.len(), 1);
    assert_eq!(rows.topic.texts, [("header.frame_id".to_owned(), "a".to_owned())]);
}

/// Stamps are unsigned in the file.
#[test]
fn stamps_beyond_2_to_the_63_are_lost_and_do_not_wrap() {
    let value = cdr(&[&1f64.to_le_bytes()]);
    let largest = i64::MAX.cast_unsigned();
    let all = read(&[
        schema(1, "p/msg/X", "ros2msg", "float64 x"),
        channel(1, 1, "/x", "cdr"),
        message(1, 5, u64::MAX, &value),
        message(1, 1 << 63, 7, &value),
        message(1, largest, largest, &value),
    ]);
    let stamps: Vec<_> = all.get("/x").rows.iter().map(|row| (row.0, row.1)).collect();
    assert_eq!(stamps, [(5, Some(5)), (i64::MAX, Some(i64::MAX))]);
    assert_eq!(all.summary.lost_parts, 1);
    assert!(all.summary.losses[0].reason.contains("2^63 ns"), "{:?}", all.summary);
}

#[test]
fn idl_is_read() {
    let definition = r#"================================================================================
IDL: p/msg/T
// a comment
#include "p/msg/Inner.idl"
module p { module msg {
  typedef double double__3[3];
  module T_Constants { const int32 N = 2; const string S = "};"; };
  @verbatim (language="comment", text="see http://example.org" "; struct")
  struct T {
    p::msg::Inner inner;
    @unit (value="m") double__3 a;
    sequence<p::msg::Inner, 4> s;
    sequence<double__3> t;
    unsigned long long big; long x, y[N]; /* struct */ boolean ok; string<5> name; Mode mode;
  };
  enum Mode { ONE, TWO };
}; };
================================================================================
IDL: p/msg/Inner
module p { module msg { struct Inner { float f; octet o; }; }; };
"#;
    let body = cdr(&[
        &0.5f32.to_le_bytes(),
        &[7, 0, 0, 0],
        &1f64.to_le_bytes(),
        &2f64.to_le_bytes(),
        &3f64.to_le_bytes(),
        &1u32.to_le_bytes(),
        &1.5f32.to_le_bytes(),
        &[8, 0, 0, 0],
        &1u32.to_le_bytes(),
        &4f64.to_le_bytes(),
        &5f64.to_le_bytes(),
        &6f64.to_le_bytes(),
        &9u64.to_le_bytes(),
        &(-1i32).to_le_bytes(),
        &2i32.to_le_bytes(),
        &3i32.to_le_bytes(),
        &[1, 0, 0, 0],
        &3u32.to_le_bytes(),
        b"hi\0\0",
        &1u32.to_le_bytes(),
    ]);
    let all = read(&[
        schema(1, "p/msg/T", "ros2idl", definition),
        channel(1, 1, "/t", "cdr"),
        message(1, 1, 1, &body),
    ]);
    assert_eq!(all.summary.notes, [""; 0]);
    assert_eq!(all.summary.losses, []);
    let rows = all.get("/t");
    let expected = [
        ("inner.f", 0.5),
        ("inner.o", 7.0),
        ("a[2]", 3.0),
        ("s[0].f", 1.5),
        ("s[0].o", 8.0),
        ("t[0][1]", 5.0),
        ("big", 9.0),
        ("x", -1.0),
        ("y[1]", 3.0),
        ("ok", 1.0),
        ("mode", 1.0),
    ];
    for (name, value) in expected {
        assert_eq!(rows.value(0, name), value, "{name}");
    }
    assert_eq!(rows.topic.texts, [("name".to_owned(), "hi".to_owned())]);
}

#[test]
fn encapsulations_are_distinguished() {
    let definition = "uint8 a\nfloat64 b\nuint16 c";
    let head = [schema(1, "p/msg/T", "ros2msg", definition), channel(1, 1, "/t", "cdr")];
    let (b, le) = (1.5f64, [0u8, 1, 0, 0]);
    let big = [&[0, 0, 0, 0, 3][..], &[0; 7], &b.to_be_bytes(), &4u16.to_be_bytes()].concat();
    let little = [&le[..], &[3], &[0; 7], &b.to_le_bytes(), &4u16.to_le_bytes()].concat();
    let second = [&[0, 7, 0, 0, 3][..], &[0; 3], &b.to_le_bytes(), &4u16.to_le_bytes()].concat();
    let packed = ruzstd::encoding::compress_to_vec(&little[..], ruzstd::encoding::CompressionLevel::Fastest);
    for body in [&big, &little, &second, &packed] {
        let all = read(&[&head[..], &[message(1, 1, 1, body)]].concat());
        assert_eq!(all.get("/t").rows[0].2, [3.0, 1.5, 4.0].map(f64::to_bits), "{:?}", all.summary);
    }
    let list = [&[0, 3, 0, 0][..], &little[4..]].concat();
    let all = read(&[&head[..], &[message(1, 1, 1, &list)]].concat());
    assert_eq!(all.topics, []);
    assert_eq!(all.summary.losses[0].reason, "a message of /t has an encapsulation other than plain CDR");
}

#[test]
fn topics_that_cannot_be_decoded_are_noted() {
    let all = read(&[
        schema(1, "p.T", "protobuf", "x"),
        schema(2, "p/msg/T", "ros2msg", "Missing m"),
        schema(3, "p/msg/W", "ros2msg", "float64 x\nwstring w\nfloat64 y"),
        channel(1, 1, "/a", "protobuf"),
        channel(2, 0, "/b", "json"),
        channel(3, 2, "/c", "cdr"),
        channel(4, 3, "/d", "cdr"),
        channel(5, 0, "/e", "cdr"),
        message(1, 1, 1, b""),
        message(2, 1, 1, b"{}"),
        message(3, 1, 1, &cdr(&[])),
        message(4, 1, 1, &cdr(&[&1.5f64.to_le_bytes(), &[0; 20]])),
        message(5, 1, 1, &cdr(&[])),
        message(5, 1, 1, &cdr(&[])),
    ]);
    assert_eq!(all.topics.len(), 1);
    assert_eq!(all.get("/d").value(0, "x"), 1.5);
    assert_eq!(all.get("/d").topic.fields.len(), 1);
    assert_eq!(
        all.summary.notes,
        [
            "/a (p.T) cannot be decoded: messages of the encoding 'protobuf' are not supported",
            "/b () cannot be decoded: messages of the encoding 'json' are not supported",
            "/c (p/msg/T) cannot be decoded: its definition does not contain the type Missing",
            "/d: w and all behind it are left out: wstring cannot be decoded",
            "/e () cannot be decoded: the file does not contain its definition, and it is none of the common types",
        ]
    );
}

#[test]
fn channels_of_one_name_are_one_topic_if_their_definitions_are_equal() {
    let x = cdr(&[&1f64.to_le_bytes()]);
    let all = read(&[
        schema(1, "p/msg/A", "ros2msg", "float64 a"),
        schema(2, "p/msg/B", "ros2msg", "float64 b"),
        channel(1, 1, "/t", "cdr"),
        channel(2, 2, "/t", "cdr"),
        channel(3, 1, "/t", "cdr"),
        message(1, 1, 1, &x),
        message(2, 1, 1, &x),
        message(3, 1, 1, &x),
    ]);
    let rows: Vec<_> = all.topics.iter().map(|rows| (rows.topic.name.as_str(), rows.rows.len())).collect();
    assert_eq!(rows, [("/t", 2), ("/t (p/msg/B)", 1)]);
}

#[test]
fn unwanted_rows_are_not_given() {
    let Some(path) = sample::file("otter_zstd.mcap") else { return };
    let log = Recorder::without(&path, &["/imu/data", "/actuators"]).expect("read");
    assert_eq!(log.topics.len(), 5);
    assert_eq!((log.count("/fix"), log.count("/actuators")), (556, 0));
    assert!(log.get("/actuators").topic.fields.iter().any(|field| field.name == "pwm_us[1]"));
}

#[test]
fn damaged_chunk_is_left_out_and_stated() {
    for compression in ["", "lz4", "zstd"] {
        let mut chunks = counting(compression, 4);
        let place = MAGIC.len() + chunks[0].len();
        let at = chunks[1].len() - 12;
        chunks[1][at] ^= 0x10;
        let all = read(&chunks);
        assert_eq!(
            numbers(&all),
            [(0..10).collect::<Vec<u64>>(), (20..40).collect()].concat(),
            "{compression}"
        );
        assert_eq!(all.summary.lost_parts, 1);
        assert_eq!(
            (all.summary.losses[0].offset, all.summary.losses[0].bytes),
            (place as u64, chunks[1].len() as u64)
        );
    }
}

#[test]
fn wrong_lengths_do_not_hide_what_follows() {
    for length in [1u64 << 63, u64::MAX, u64::from(u32::MAX), 3_000] {
        for compression in ["", "lz4", "zstd"] {
            let mut chunks = counting(compression, 4);
            chunks[1][1..9].copy_from_slice(&length.to_le_bytes());
            let all = read(&chunks);
            let found = numbers(&all);
            assert!(found.starts_with(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]), "{length} {compression} {found:?}");
            assert!(length == 3_000 || found.ends_with(&[37, 38, 39]), "{length} {compression} {found:?}");
            assert!(all.summary.lost_parts > 0 && all.summary.lost_bytes > 0);
        }
    }
    // Without chunks the next message is found.
    let mut records: Vec<_> = (0..10).map(|n| message(1, n, n, &cdr(&[&(n as f64).to_le_bytes()]))).collect();
    records[4][1..9].copy_from_slice(&u64::MAX.to_le_bytes());
    records.insert(0, [schema(1, "p/msg/X", "ros2msg", "float64 x"), channel(1, 1, "/x", "cdr")].concat());
    let all = read(&records);
    assert_eq!(numbers(&all), [0, 1, 2, 3, 5, 6, 7, 8, 9]);
    assert_eq!((all.summary.lost_parts, all.summary.lost_bytes), (1, records[5].len() as u64));
}

#[test]
fn chunk_that_was_not_closed_gives_its_whole_messages() {
    for compression in ["", "lz4", "zstd"] {
        let records: Vec<u8> =
            (0..20_000u64).flat_map(|n| message(1, n, n, &cdr(&[&(n as f64).to_le_bytes()]))).collect();
        let head = [schema(1, "p/msg/X", "ros2msg", "float64 x"), channel(1, 1, "/x", "cdr")].concat();
        let mut chunk = chunk(compression, &[head, records].concat());
        chunk[1..9].copy_from_slice(&u64::MAX.to_le_bytes());
        let records = 9 + 28 + 4 + compression.len();
        chunk[records..records + 8].copy_from_slice(&u64::MAX.to_le_bytes());
        chunk.truncate(chunk.len() * 3 / 4);
        let bytes = [MAGIC, &chunk].concat();
        let all = Recorder::of_bytes(&bytes).unwrap_or_else(|error| panic!("{compression} {error}"));
        let found = numbers(&all);
        assert!((8_000..20_000).contains(&found.len()), "{compression}: {}", found.len());
        assert_eq!(found, (0..found.len() as u64).collect::<Vec<_>>());
        assert!(all.summary.losses[0].reason.contains("middle"), "{:?}", all.summary);
    }
}

#[test]
fn packed_bombs_do_not_fill_the_memory() {
    // 1 GB of zeros in blocks that repeat a byte (RFC 8878, section 3.1.1.2.2).
    let mut packed = [&[0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x58][..]].concat();
    for _ in 0..8192 {
        packed.extend([0x02, 0x00, 0x10, 0x00]);
    }
    let head = [&[0; 16][..], &u64::MAX.to_le_bytes(), &[0; 4], &text("zstd")].concat();
    let bomb = record(6, &[&head[..], &(packed.len() as u64).to_le_bytes(), &packed].concat());
    let mut records = counting("zstd", 2);
    records.insert(1, bomb);
    let all = read(&records);
    assert_eq!(numbers(&all).len(), 20);
    assert!(all.summary.losses[0].reason.contains("too big"), "{:?}", all.summary);
}

#[test]
fn definitions_that_explode_are_refused() {
    // Each type has 64 of the next one.
    use std::fmt::Write as _;
    let separator = "=".repeat(80);
    let mut definition = "T0[64] a\nT0[64] b".to_owned();
    for i in 0..40 {
        let _ = write!(definition, "\n{separator}\nMSG: p/T{i}\nT{}[64] a\nT{}[] b", i + 1, i + 1);
    }
    let _ = write!(
        definition,
        "\n{separator}\nMSG: p/T40\nfloat64 x\nR r\n{separator}\nMSG: p/R\nR[] r\nfloat64 y"
    );
    for (name, definition) in [
        ("p/msg/T", definition.as_str()),
        ("p/msg/R", "R[] r\nfloat64 y"),
        ("p/msg/L", "uint8[4294967295] a\nfloat64[4294967295] b\nL l"),
    ] {
        let all = read(&[
            schema(1, name, "ros2msg", definition),
            channel(1, 1, "/t", "cdr"),
            message(1, 1, 1, &cdr(&[&[1; 1000]])),
        ]);
        assert_eq!(all.topics, []);
        assert!(all.summary.notes[0].contains("cannot be decoded"), "{:?}", all.summary);
    }
}

#[test]
fn messages_shorter_than_their_definition_are_lost() {
    let head = [
        schema(1, "p/msg/T", "ros2msg", "float64[] x\nstring[] s\np/I[] i\n===========\nMSG: p/I\nfloat64 y"),
        channel(1, 1, "/t", "cdr"),
    ];
    for count in [u32::MAX, 1 << 31, 100] {
        for place in 0..3 {
            let mut counts = [0u32; 3];
            counts[place] = count;
            let body = cdr(&[&counts.map(u32::to_le_bytes).concat(), &[0; 16]]);
            let all = read(&[&head[..], &[message(1, 1, 1, &body)]].concat());
            assert_eq!(all.topics.len(), 0);
            assert_eq!(all.summary.losses[0].reason, "a message of /t is shorter than its definition");
        }
    }
}

#[test]
fn files_without_content_are_errors_with_a_place() {
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    for bytes in [MAGIC.to_vec(), [MAGIC, &[0; 100]].concat(), [MAGIC, &[5, 1, 2]].concat()] {
        let error = Recorder::of_bytes(&bytes).expect_err("an error");
        assert!(matches!(error, IoError::Damaged { offset: 8, .. }), "{error}");
    }
    let all = Recorder::of_bytes(&file(&[])).expect("an empty recording");
    assert_eq!((all.topics.len(), all.summary.losses.len(), all.summary.notes.len()), (0, 0, 0));
}

#[test]
fn flipped_bytes_of_a_sample_are_survived() {
    for name in ["otter_zstd.mcap", "otter_lz4.mcap"] {
        let Some(path) = sample::file(name) else { return };
        flipped(&std::fs::read(path).expect("a sample"), MAGIC.len(), Some(0)..=Some(7746));
    }
}

#[test]
fn flipped_bytes_without_checksum_are_survived() {
    let definition = "std_msgs/Header header\nstring[] s\nfloat64[] x\np/I[2] i\n===========\nMSG: p/I\nfloat32[] y\nuint8[] z";
    let body = cdr(&[&[1, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0], &[0; 24]]);
    let messages = message(1, 1, 1, &body).repeat(2);
    let records = [schema(1, "p/msg/T", "ros2msg", definition), channel(1, 1, "/t", "cdr"), messages];
    flipped(&file(&records), MAGIC.len(), ..);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_record_is_survived(bytes in prop::collection::vec(any::<u8>(), 0..3000), opcode in 0u8..17) {
        survives(&[MAGIC, &record(opcode, &bytes)].concat());
    }
}
