//! ROS 2 bags in SQLite: the sample, written files, and damage.
#![allow(clippy::cast_possible_truncation, reason = "the files of the tests are small")]

use std::collections::HashSet;

use hydroid_io::IoError;
use proptest::prelude::*;

use crate::recorder::{Recorder, flipped, survives};
use crate::ros::{assert_sample, cdr, expected, numbers};
use crate::sample;

const SAMPLE: &str = "otter_ros2_sqlite/otter_ros2_sqlite.db3";

const PAGE: usize = 512;

/// A value of a row.
enum V<'a> {
    Null,
    Int(i64),
    Text(&'a str),
    Blob(&'a [u8]),
}

fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = vec![(number & 0x7f) as u8];
    number >>= 7;
    while number > 0 {
        bytes.insert(0, (number & 0x7f) as u8 | 0x80);
        number >>= 7;
    }
    bytes
}

fn row(values: &[V]) -> Vec<u8> {
    let (mut header, mut body) = (Vec::new(), Vec::new());
    for value in values {
        let (serial, bytes) = match value {
            V::Null => (0, Vec::new()),
            V::Int(number) => (6, number.to_be_bytes().to_vec()),
            V::Text(text) => (13 + 2 * text.len(), text.as_bytes().to_vec()),
            V::Blob(bytes) => (12 + 2 * bytes.len(), bytes.to_vec()),
        };
        header.extend(varint(serial as u64));
        body.extend(bytes);
    }
    let size = varint(header.len() as u64 + if header.len() < 127 { 1 } else { 2 });
    [size, header, body].concat()
}

/// Pages of a file.
struct Writer(Vec<Vec<u8>>);

impl Writer {
    /// A leaf page, perhaps with overflow pages behind all others; the answer is its number.
    fn leaf(&mut self, rows: &[(u64, Vec<u8>)]) -> u32 {
        let number = self.0.len() as u32 + 1;
        let head = if number == 1 { 100 } else { 0 };
        let mut page = vec![0; PAGE];
        self.0.push(Vec::new());
        let mut end = PAGE;
        page[head] = 0x0d;
        page[head + 3..head + 5].copy_from_slice(&(rows.len() as u16).to_be_bytes());
        for (i, (rowid, content)) in rows.iter().enumerate() {
            let most = PAGE - 35;
            let least = (PAGE - 12) * 32 / 255 - 23;
            let fitting = least + content.len().saturating_sub(least) % (PAGE - 4);
            let local = if content.len() <= most {
                content.len()
            } else if fitting <= most {
                fitting
            } else {
                least
            };
            let mut cell = [varint(content.len() as u64), varint(*rowid), content[..local].to_vec()].concat();
            if local < content.len() {
                cell.extend((self.0.len() as u32 + 1).to_be_bytes());
                let parts: Vec<&[u8]> = content[local..].chunks(PAGE - 4).collect();
                for (j, part) in parts.iter().enumerate() {
                    let next = if j + 1 < parts.len() { self.0.len() as u32 + 2 } else { 0 };
                    let mut page = [&next.to_be_bytes()[..], part].concat();
                    page.resize(PAGE, 0);
                    self.0.push(page);
                }
            }
            end -= cell.len();
            page[end..end + cell.len()].copy_from_slice(&cell);
            page[head + 8 + 2 * i..head + 10 + 2 * i].copy_from_slice(&(end as u16).to_be_bytes());
        }
        self.0[number as usize - 1] = page;
        number
    }

    /// An interior page above others.
    fn interior(&mut self, children: &[u32]) -> u32 {
        let mut page = vec![0; PAGE];
        page[0] = 0x05;
        let (last, left) = children.split_last().expect("children");
        page[3..5].copy_from_slice(&(left.len() as u16).to_be_bytes());
        page[8..12].copy_from_slice(&last.to_be_bytes());
        for (i, child) in left.iter().enumerate() {
            let at = PAGE - 5 * (i + 1);
            page[at..at + 4].copy_from_slice(&child.to_be_bytes());
            page[12 + 2 * i..14 + 2 * i].copy_from_slice(&(at as u16).to_be_bytes());
        }
        self.0.push(page);
        self.0.len() as u32
    }

    fn bytes(mut self, topics: u32, messages: u32) -> Vec<u8> {
        let pages = std::mem::take(&mut self.0);
        let mut first = Writer(Vec::new());
        let sqls = [
            (
                "topics",
                topics,
                "CREATE TABLE topics(id INTEGER PRIMARY KEY, \"name\" TEXT, type TEXT, serialization_format TEXT)",
            ),
            (
                "messages",
                messages,
                "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL, x DECIMAL(1, 2), timestamp INTEGER, data BLOB)",
            ),
        ];
        let rows: Vec<_> = sqls
            .iter()
            .map(|(name, root, sql)| {
                row(&[V::Text("table"), V::Text(name), V::Text(name), V::Int(i64::from(*root)), V::Text(sql)])
            })
            .enumerate()
            .map(|(i, row)| (i as u64 + 1, row))
            .collect();
        first.leaf(&rows);
        assert_eq!(first.0.len(), 1);
        let mut bytes = [first.0.remove(0), pages[1..].concat()].concat();
        bytes[..16].copy_from_slice(b"SQLite format 3\0");
        bytes[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
        bytes[28..32].copy_from_slice(&((pages.len()) as u32).to_be_bytes());
        bytes[59] = 1;
        bytes
    }
}

fn message(topic: i64, stamp: i64, data: &[u8]) -> Vec<u8> {
    row(&[V::Null, V::Int(topic), V::Null, V::Int(stamp), V::Blob(data)])
}

fn topic(name: &str, type_name: &str, format: &str) -> Vec<u8> {
    row(&[V::Null, V::Text(name), V::Text(type_name), V::Text(format)])
}

/// A bag with pages of ten numbers each below an interior page, and the place of the first of these pages.
fn counting(pages: u32) -> (Vec<u8>, usize) {
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[(1, topic("/x", "std_msgs/msg/Float64", "cdr"))]);
    let first = writer.0.len();
    let leaves: Vec<u32> = (0..pages)
        .map(|page| {
            let rows = (10 * page..10 * page + 10)
                .map(|n| (u64::from(n) + 1, message(1, i64::from(n), &cdr(&[&f64::from(n).to_le_bytes()]))));
            writer.leaf(&rows.collect::<Vec<_>>())
        })
        .collect();
    let root = writer.interior(&leaves);
    (writer.bytes(topics, root), first * PAGE)
}

fn read(bytes: &[u8]) -> Recorder {
    Recorder::of_bytes(bytes).expect("read")
}

#[test]
fn sample_has_the_stated_messages() {
    let Some(expected) = expected() else { return };
    let all = Recorder::of(&sample::file(SAMPLE).expect("a sample")).expect("read");
    assert_sample(&all, &expected, true);
    assert_eq!(all.topics.len(), 5);
    assert_eq!(all.summary.losses, []);
    assert_eq!(all.summary.notes, [""; 0]);
}

#[test]
fn sample_cut_anywhere_gives_a_part_of_it() {
    let Some(path) = sample::file(SAMPLE) else { return };
    let bytes = std::fs::read(&path).expect("a sample");
    let whole = Recorder::of(&path).expect("read");
    let known: Vec<HashSet<_>> =
        whole.topics.iter().map(|rows| rows.rows.iter().cloned().collect()).collect();
    let mut most = 0;
    for length in (0..bytes.len()).step_by(10_007).chain((0..50_000).step_by(1000)) {
        match Recorder::of_bytes(&bytes[..length]) {
            Ok(part) => {
                assert!(part.summary.lost_parts > 0);
                for rows in &part.topics {
                    let all =
                        whole.topics.iter().position(|all| all.topic.name == rows.topic.name).expect("known");
                    let distinct: HashSet<_> = rows.rows.iter().cloned().collect();
                    assert_eq!(distinct.len(), rows.rows.len(), "no row comes twice");
                    // A row before the first growth of a sequence has fewer values.
                    assert!(distinct.is_subset(&known[all]), "{length} {}", rows.topic.name);
                }
                most = most.max(part.all());
            }
            Err(error) => {
                assert!(matches!(error, IoError::Damaged { .. } | IoError::Empty { .. }), "{error}");
            }
        }
    }
    assert!(most > 7600, "{most}");
}

#[test]
fn common_types_need_no_definition() {
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[
        (1, topic("/joints", "sensor_msgs/msg/JointState", "cdr")),
        (2, topic("/mine", "my_msgs/msg/Mine", "cdr")),
        (3, topic("/json", "std_msgs/msg/Float64", "json")),
    ]);
    let text = |text: &[u8]| [&[2, 0, 0, 0][..], text, &[0, 0]].concat();
    let joints = cdr(&[
        &5u32.to_le_bytes(),
        &6u32.to_le_bytes(),
        &text(b"b\0"),
        &2u32.to_le_bytes(),
        &text(b"l\0"),
        &text(b"r\0"),
        &2u32.to_le_bytes(),
        &1.5f64.to_le_bytes(),
        &2.5f64.to_le_bytes(),
        &0u32.to_le_bytes(),
        &0u32.to_le_bytes(),
    ]);
    let messages = writer.leaf(&[
        (1, message(1, 7, &joints)),
        (2, message(2, 8, &cdr(&[&[0; 8]]))),
        (3, message(3, 9, b"{}")),
    ]);
    let all = read(&writer.bytes(topics, messages));
    assert_eq!(all.summary.losses, []);
    let rows = all.get("/joints");
    assert_eq!((rows.value(0, "position[0]"), rows.value(0, "position[1]")), (1.5, 2.5));
    assert_eq!((rows.rows[0].0, rows.rows[0].1), (5_000_000_006, Some(7)));
    let texts: Vec<_> = rows.topic.texts.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    assert_eq!(texts, [("header.frame_id", "b"), ("name[0]", "l"), ("name[1]", "r")]);
    assert_eq!(all.topics.len(), 1);
    assert!(
        all.summary.notes[0].starts_with("/mine (my_msgs/msg/Mine) cannot be decoded"),
        "{:?}",
        all.summary
    );
    assert!(all.summary.notes[1].contains("'json'"), "{:?}", all.summary);
}

#[test]
fn long_messages_continue_on_other_pages() {
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[(1, topic("/x", "std_msgs/msg/UInt8MultiArray", "cdr"))]);
    let data =
        |n: u32| cdr(&[&0u32.to_le_bytes(), &7u32.to_le_bytes(), &n.to_le_bytes(), &vec![9; n as usize]]);
    let sizes = [10, 400, 450, 460, 470, 480, 500, 900, 5000];
    let leaves: Vec<u32> =
        sizes.iter().map(|&n| writer.leaf(&[(u64::from(n), message(1, 1, &data(n)))])).collect();
    let root = writer.interior(&leaves);
    let bytes = writer.bytes(topics, root);
    let all = read(&bytes);
    assert_eq!(all.topics[0].rows.len(), sizes.len(), "{:?}", all.summary);
    assert!((0..sizes.len()).all(|row| all.topics[0].value(row, "layout.data_offset") == 7.0));
    assert_eq!(all.topics[0].value(0, "data[9]"), 9.0);
    assert_eq!(all.summary.losses, []);
    // Without its end the longest one is lost.
    let all = read(&bytes[..bytes.len() - 3 * PAGE]);
    assert!(all.topics[0].rows.len() < sizes.len());
    assert!(all.summary.lost_parts > 0);
}

#[test]
fn damaged_pages_are_stated_and_lost_pages_found() {
    let (bytes, first) = counting(5);
    let all = read(&bytes);
    assert_eq!(numbers(&all), (0..50).collect::<Vec<u64>>());
    assert_eq!((all.summary.losses.len(), all.summary.notes.len()), (0, 0));
    assert_eq!((all.topics[0].rows[3].0, all.topics[0].rows[3].1), (3, None));
    let mut damaged = bytes.clone();
    damaged[first + PAGE] = 0x33;
    let all = read(&damaged);
    assert_eq!(numbers(&all), [(0..10).collect::<Vec<u64>>(), (20..50).collect()].concat());
    assert_eq!(
        (all.summary.losses[0].offset, all.summary.losses[0].bytes),
        ((first + PAGE) as u64, PAGE as u64)
    );
    // A damaged interior page loses the order, not the rows.
    let mut damaged = bytes.clone();
    damaged[first + 5 * PAGE] = 0x33;
    let all = read(&damaged);
    assert_eq!(numbers(&all), (0..50).collect::<Vec<u64>>());
    assert!(all.summary.notes[0].contains("50 messages were found"), "{:?}", all.summary);
    // Pages that point to each other are read once.
    let mut circle = bytes;
    let root = (first + 5 * PAGE) / PAGE + 1;
    circle[first + 5 * PAGE + 8..first + 5 * PAGE + 12].copy_from_slice(&(root as u32).to_be_bytes());
    assert_eq!(numbers(&read(&circle)), (0..50).collect::<Vec<u64>>());
}

/// A page with rows that refer to the same overflow pages, repeated: work that was the product of their numbers.
#[test]
fn overflow_pages_belong_to_one_row() {
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[(1, topic("/x", "std_msgs/msg/UInt8MultiArray", "cdr"))]);
    let n = 4 << 20;
    let data = cdr(&[&0u32.to_le_bytes(), &7u32.to_le_bytes(), &(n as u32).to_le_bytes(), &vec![9; n]]);
    let first = writer.leaf(&[(1, message(1, 1, &data))]);
    let page = writer.0[first as usize - 1].clone();
    let cell = page[usize::from(u16::from_be_bytes([page[8], page[9]]))..].to_vec();
    let count = (PAGE - 8) / (cell.len() + 2);
    let mut full = vec![0; PAGE];
    full[0] = 0x0d;
    full[4] = count as u8;
    for i in 0..count {
        let at = PAGE - (i + 1) * cell.len();
        full[at..at + cell.len()].copy_from_slice(&cell);
        full[8 + 2 * i..10 + 2 * i].copy_from_slice(&(at as u16).to_be_bytes());
    }
    let leaves: Vec<u32> = (0..1000)
        .map(|_| {
            writer.0.push(full.clone());
            writer.0.len() as u32
        })
        .collect();
    let roots: Vec<u32> = leaves.chunks(50).map(|leaves| writer.interior(leaves)).collect();
    let root = writer.interior(&roots);
    let bytes = writer.bytes(topics, root);
    let all = read(&bytes);
    assert_eq!(all.topics[0].rows.len(), 1);
    assert_eq!(all.summary.lost_parts, 1000 * count as u64 - 1);
    assert_eq!(all.summary.losses[0].reason, "a message is not whole");
    // A page that refers to itself has the content of no row.
    let mut circle = bytes;
    let second = first as usize * PAGE;
    circle[second..second + 4].copy_from_slice(&(first + 1).to_be_bytes());
    let all = read(&circle);
    assert!(
        all.topics.is_empty() && all.summary.lost_parts == 1000 * count as u64,
        "{}",
        all.summary.lost_parts
    );
}

/// Rows that lie upon each other in a page: 64 kB of them gave 2 GB.
#[test]
fn rows_that_lie_upon_each_other_are_lost() {
    let (mut bytes, first) = counting(1);
    for i in 1..200 {
        bytes.copy_within(first + 8..first + 10, first + 8 + 2 * i);
    }
    bytes[first + 4] = 200;
    let all = read(&bytes);
    let whole = message(1, 0, &cdr(&[&[0; 8]])).len();
    assert_eq!(all.topics[0].rows.len(), PAGE / whole);
    assert_eq!(
        (all.summary.lost_parts, all.summary.losses[0].offset),
        (1, first as u64),
        "{:?}",
        all.summary
    );
    assert!(all.summary.losses[0].reason.contains("a row of the table is damaged"));
}

#[test]
fn rows_without_their_columns_are_stated() {
    let value = cdr(&[&[0; 8]]);
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[
        (1, topic("/x", "std_msgs/msg/Float64", "cdr")),
        (2, row(&[V::Null, V::Text("/y"), V::Null, V::Text("cdr")])),
        (3, row(&[V::Null, V::Text("/z")])),
    ]);
    let messages = writer.leaf(&[
        (1, message(1, 1, &value)),
        (2, row(&[V::Null, V::Int(1), V::Null, V::Int(2)])),
        (3, row(&[V::Null, V::Int(1), V::Null, V::Text("2"), V::Blob(&value)])),
        (4, row(&[V::Null])),
        (5, row(&[])),
        (6, message(2, 1, &value)),
    ]);
    let all = read(&writer.bytes(topics, messages));
    assert_eq!((all.topics.len(), all.get("/x").rows.len()), (1, 1));
    let reasons: Vec<&str> = all.summary.losses.iter().map(|loss| loss.reason.as_str()).collect();
    let [text, body, topic, unknown] = [
        "a row of the table lacks a text",
        "a message lacks its stamp or its data",
        "a message lacks its topic",
        "a message of an unknown topic",
    ];
    // Losses of one place and one reason are one.
    assert_eq!(reasons, [text, body, topic, unknown]);
}

#[test]
fn wrong_references_to_pages_are_stated() {
    let (bytes, first) = counting(5);
    let interior = first + 5 * PAGE;
    let pointer = interior + usize::from(u16::from_be_bytes([bytes[interior + 12], bytes[interior + 13]]));
    let number = |page: usize| (page as u32).to_be_bytes();
    for (place, value) in [
        (pointer, number(0)),
        (pointer, number(999)),
        (pointer, number(interior / PAGE + 1)),
        (interior + 8, number(u32::MAX as usize)),
        (interior + 12, [0xff; 4]),
    ] {
        let mut wrong = bytes.clone();
        wrong[place..place + 4].copy_from_slice(&value);
        let all = read(&wrong);
        let mut found = numbers(&all);
        found.sort_unstable();
        assert_eq!(found, (0..50).collect::<Vec<u64>>());
        assert_eq!(all.summary.losses[0].offset, interior as u64);
        assert!(all.summary.losses[0].reason.contains("refers to pages"), "{:?}", all.summary);
        assert!(all.summary.notes[0].contains("messages were found"), "{:?}", all.summary);
    }
    let mut writer = Writer(vec![Vec::new()]);
    let topics = writer.leaf(&[(1, topic("/x", "std_msgs/msg/Float64", "cdr"))]);
    for root in [0, 999] {
        let pages = Writer(writer.0.clone());
        let all = read(&pages.bytes(topics, root));
        assert!(all.summary.losses[0].reason.contains("first page of a table"), "{:?}", all.summary);
    }
}

#[test]
fn write_ahead_log_is_applied() {
    let (bytes, first) = counting(2);
    let folder = tempfile::tempdir().expect("a folder");
    let [bag, log] = ["a.db3", "a.db3-wal"].map(|name| folder.path().join(name));
    std::fs::write(&bag, &bytes).expect("written");
    let read = || Recorder::of(bag.to_str().expect("a path")).expect("read");
    let add = |bytes: &[u8], (mut a, mut b): (u32, u32)| {
        for pair in bytes.chunks(8) {
            a = a.wrapping_add(u32::from_le_bytes(pair[..4].try_into().expect("four"))).wrapping_add(b);
            b = b.wrapping_add(u32::from_le_bytes(pair[4..].try_into().expect("four"))).wrapping_add(a);
        }
        (a, b)
    };
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
    let mut content = words(&[0x377f_0682, 3_007_000, PAGE as u32, 0, 11, 12]);
    let mut sum = add(&content, (0, 0));
    content.extend(words(&[sum.0, sum.1]));
    // The second page of numbers begins with 77 instead of 10; the first page is in a transaction that is not finished.
    for (page, commit) in [(1, bytes.len() / PAGE), (0, 0)] {
        let at = first + page * PAGE;
        let mut new = bytes[at..at + PAGE].to_vec();
        let place = PAGE - 8;
        new[place..].copy_from_slice(&77f64.to_le_bytes());
        let head = words(&[(at / PAGE + 1) as u32, commit as u32]);
        sum = add(&new, add(&head, sum));
        content.extend([head, words(&[11, 12, sum.0, sum.1]), new].concat());
    }
    std::fs::write(&log, &content).expect("written");
    let all = read();
    let mut expected: Vec<u64> = (0..20).collect();
    expected[10] = 77;
    assert_eq!(numbers(&all), expected, "{:?}", all.summary);
    assert_eq!(all.summary.notes, [""; 0]);
    // A wrong checksum ends the log.
    content[100] ^= 1;
    std::fs::write(&log, &content).expect("written");
    assert_eq!(numbers(&read()), (0..20).collect::<Vec<u64>>());
    content[10] ^= 1;
    std::fs::write(&log, &content).expect("written");
    let all = read();
    assert_eq!(numbers(&all), (0..20).collect::<Vec<u64>>());
    assert!(all.summary.notes[0].contains("-wal is damaged: rows in it are not read"), "{:?}", all.summary);
}

#[test]
fn files_without_bag_are_errors_with_a_place() {
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    let (bytes, _) = counting(1);
    for bytes in
        [&b"SQLite format 3\0"[..], &bytes[..100], &[b"SQLite format 3\0", &[0xff; 5000][..]].concat()]
    {
        let error = Recorder::of_bytes(bytes).expect_err("an error");
        assert!(matches!(error, IoError::Damaged { .. }), "{error}");
    }
}

#[test]
fn flipped_bytes_are_survived() {
    flipped(&counting(5).0, 16, ..);
    let Some(path) = sample::file(SAMPLE) else { return };
    flipped(&std::fs::read(path).expect("a sample"), 16, ..);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_pages_are_survived(tail in prop::collection::vec(any::<u8>(), 1..4000), kind in 0usize..3) {
        let (mut bytes, first) = counting(3);
        bytes.truncate(first);
        bytes.extend(tail);
        bytes[first] = [0x05, 0x0d, 0x33][kind];
        survives(&bytes);
    }
}
