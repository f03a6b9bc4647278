//! Parquet: samples and golden files of pyarrow, files written here, and damaged ones.

use std::fs;
use std::io::Read;
use std::sync::LazyLock;

use hydroid_io::{Clock, IoError};
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::Value;

use crate::golden::{golden, same};
use crate::recorder::{Recorder, flipped, survives};
use crate::sample;

const GOLDEN: [&str; 5] =
    ["gzip_v1_plain", "lz4_v2_dictionary", "zstd_v2_delta", "snappy_v1_split", "zstd_v1_int96"];

#[test]
fn samples_have_the_rows_of_the_log() {
    let Some(expected) = sample::file("expected.json") else { return };
    let expected: Value = serde_json::from_slice(&fs::read(expected).expect("a file")).expect("JSON");
    for (topic, units) in [
        ("gnss", vec![("lat", "deg"), ("lon", "deg"), ("sog", "kn"), ("cog", "deg")]),
        ("compass", vec![("heading", "deg")]),
        ("imu", vec![("wz", "rad/s"), ("acc_x", "m/s2"), ("acc_y", "m/s2")]),
        ("servo", vec![("pwm_left", "us"), ("pwm_right", "us")]),
    ] {
        let [zstd, snappy] = ["zstd", "snappy"].map(|codec| {
            let name = format!("otter_{topic}_{codec}");
            let tables = Recorder::of(&sample::file(&format!("parquet/{name}.parquet")).expect("a sample"))
                .expect(&name);
            assert_eq!(tables.topics[0].topic.name, name);
            assert_eq!(
                (tables.topics[0].topic.type_name.as_str(), tables.topics[0].topic.clock),
                ("", Clock::Utc)
            );
            assert_eq!(tables.summary.lost_parts, 0, "{:?}", tables.summary);
            assert_eq!(
                tables.topics[0].rows.len() as u64,
                expected["counts"]["parquet rows"][topic].as_u64().unwrap()
            );
            for (field, unit) in &units {
                assert_eq!(tables.topics[0].unit(field), Some(*unit), "{name} {field}");
            }
            for (row, first) in expected["first_rows"][topic].as_array().expect("rows").iter().enumerate() {
                for (field, value) in first.as_object().expect("a row") {
                    if field == "t" {
                        assert_eq!(tables.topics[0].table()[row].0, value.as_i64().unwrap());
                    } else {
                        assert_eq!(
                            tables.topics[0].column(field)[row],
                            value.as_f64().unwrap(),
                            "{name} {field}"
                        );
                    }
                }
            }
            tables
        });
        assert!(equal(&zstd.topics[0].table(), &snappy.topics[0].table()), "{topic}");
    }
    let gnss =
        Recorder::of(&sample::file("parquet/otter_gnss_zstd.parquet").expect("a sample")).expect("gnss");
    assert_eq!(gnss.topics[0].unit("quality"), None);
    assert!(
        gnss.topics[0].column("cog").iter().all(|cog| cog.is_finite()),
        "no course is empty in these 120 s"
    );
}

fn equal(a: &[(i64, Vec<f64>)], b: &[(i64, Vec<f64>)]) -> bool {
    let values = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(*a, *b));
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.0 == b.0 && values(&a.1, &b.1))
}

/// Names of the columns and rows of `parquet.csv`.
fn golden_rows() -> (Vec<String>, Vec<(i64, Vec<f64>)>) {
    let text = fs::read_to_string(golden("parquet.csv")).expect("the golden values");
    let mut lines = text.lines();
    let names = lines.next().expect("a header").split(',').skip(1);
    let names = names.map(|name| name.strip_suffix(" [m]").unwrap_or(name).to_owned()).collect();
    let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().expect("a number") };
    let rows = lines.map(|line| {
        let (stamp, values) = line.split_once(',').expect("columns");
        (stamp.parse().expect("a stamp"), values.split(',').map(number).collect())
    });
    (names, rows.collect())
}

#[test]
fn codecs_encodings_and_types_are_those_of_pyarrow() {
    let (names, rows) = golden_rows();
    for name in GOLDEN {
        let tables = Recorder::of(&golden(&format!("{name}.parquet"))).expect(name);
        let topic = &tables.topics[0].topic;
        assert_eq!(topic.fields.iter().map(|field| field.name.clone()).collect::<Vec<_>>(), names, "{name}");
        assert_eq!(topic.texts, [("text".to_owned(), "mode0".to_owned())]);
        assert_eq!(tables.summary.losses, [], "{name}");
        assert!(equal(&tables.topics[0].table(), &rows), "{name}");
        for (field, unit) in [("f64", "m/s"), ("later", "m"), ("day", "d"), ("stamp_ms", "s"), ("lag", "us")]
        {
            assert_eq!(tables.topics[0].unit(field), Some(unit), "{name} {field}");
        }
        for left_out in ["'price'", "'list'", "'pose'", "'text'"] {
            assert!(tables.summary.notes.iter().any(|note| note.contains(left_out)), "{left_out}");
        }
    }
}

#[test]
fn a_damaged_page_costs_its_values_only() {
    let mut bytes = fs::read(golden("gzip_v1_plain.parquet")).expect("a file");
    let (names, rows) = golden_rows();
    // The columns follow each other in the first row group: the damage is in a page of numbers behind the time.
    let at = bytes.len() / 8;
    bytes[at] ^= 1;
    let tables = Recorder::of_bytes(&bytes).expect("tables");
    assert_eq!(tables.summary.lost_parts, 1, "{:?}", tables.summary);
    let loss = &tables.summary.losses[0];
    assert!(loss.reason.contains("checksum"), "{loss:?}");
    assert!((loss.offset..loss.offset + loss.bytes).contains(&(at as u64)), "{loss:?}");
    assert_eq!(tables.topics[0].rows.len(), rows.len());
    let mut lost = vec![0; names.len()];
    for (row, whole) in tables.topics[0].table().iter().zip(&rows) {
        assert_eq!(row.0, whole.0);
        for (field, (value, whole)) in row.1.iter().zip(&whole.1).enumerate() {
            if !same(*value, *whole) {
                assert!(value.is_nan());
                lost[field] += 1;
            }
        }
    }
    let damaged: Vec<usize> = lost.into_iter().filter(|count| *count > 0).collect();
    assert!(matches!(damaged[..], [1..=70]), "{damaged:?}");
}

#[test]
fn a_column_outside_of_the_file_is_lost() {
    let honest = TestColumn::doubles("u", &[1.0, 2.0, 3.0]);
    for shift in [1 << 20, i64::MAX.cast_unsigned() / 2] {
        let outside = TestColumn { name: "v", shift, ..honest.clone() };
        let tables = survives(&Writer::file(&[honest.clone(), outside], 3)).expect("tables");
        assert_eq!(tables.topics[0].column("u"), [1.0, 2.0, 3.0]);
        assert!(tables.topics[0].column("v").iter().all(|value| value.is_nan()));
        assert!(
            tables.summary.losses[0].reason.contains("behind the end of the file"),
            "{:?}",
            tables.summary
        );
        assert_eq!(tables.summary.lost_parts, 1);
    }
}

#[test]
fn a_file_that_is_cut_has_no_footer() {
    let Some(path) = sample::file("parquet/otter_gnss_snappy.parquet") else { return };
    let bytes = fs::read(path).expect("a sample");
    for size in (1000..bytes.len()).step_by(1000).chain([4, 5, 11, 12, bytes.len() - 1]) {
        let error = Recorder::of_bytes(&bytes[..size]).expect_err("no footer");
        assert!(matches!(error, IoError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains("write it again"), "{error}");
    }
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    let error = Recorder::of_bytes(b"PAR1").expect_err("a header alone");
    assert!(error.to_string().contains("footer"), "{error}");
    let error = Recorder::of_bytes(b"PAR1\0\0\0\0\0\0\xff\xff\xff\xffPAR1").expect_err("a wrong length");
    assert!(error.to_string().contains("4294967295 bytes"), "{error}");
}

/// A writer of what the tests need of the format: columns that are required, a page each.
#[derive(Default)]
struct Writer {
    data: Vec<u8>,
}

#[derive(Clone)]
struct TestColumn {
    name: &'static str,
    physical: u64,
    /// `ConvertedType`.
    converted: Option<u64>,
    /// Bytes by which its stated place differs from its place.
    shift: u64,
    codec: u64,
    encoding: u64,
    unpacked: u64,
    values: u64,
    page: Vec<u8>,
    /// Content of a dictionary, with the number of its values.
    dictionary: Option<(u64, Vec<u8>)>,
}

impl TestColumn {
    /// Doubles as they are.
    fn doubles(name: &'static str, values: &[f64]) -> Self {
        let page: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let (unpacked, values) = (page.len() as u64, values.len() as u64);
        Self {
            name,
            physical: 5,
            converted: None,
            shift: 0,
            codec: 0,
            encoding: 0,
            unpacked,
            values,
            page,
            dictionary: None,
        }
    }
}

impl Writer {
    fn varint(&mut self, mut value: u64) {
        while value > 127 {
            self.data.push(value.to_le_bytes()[0] | 128);
            value >>= 7;
        }
        self.data.push(value.to_le_bytes()[0]);
    }

    /// A member with an integer, `step` after the member before.
    fn integer(&mut self, step: u8, value: u64) {
        self.data.push(step << 4 | 6);
        self.varint(value << 1);
    }

    fn text(&mut self, step: u8, text: &str) {
        self.data.push(step << 4 | 8);
        self.varint(text.len() as u64);
        self.data.extend(text.bytes());
    }

    /// A member that is a structure, or a list of `count` structures.
    fn open(&mut self, step: u8) {
        self.data.push(step << 4 | 0xc);
    }

    fn list(&mut self, step: u8, count: u8) {
        self.data.extend([step << 4 | 9, count << 4 | 0xc]);
    }

    fn close(&mut self) {
        self.data.push(0);
    }

    fn page(&mut self, kind: u64, column: &TestColumn, page: &[u8], values: u64, unpacked: u64) {
        self.integer(1, kind);
        self.integer(1, unpacked);
        self.integer(1, page.len() as u64);
        self.open(if kind == 0 { 2 } else { 4 });
        self.integer(1, values);
        self.integer(1, if kind == 0 { column.encoding } else { 0 });
        self.close();
        self.close();
        self.data.extend(page);
    }

    fn file(columns: &[TestColumn], rows: u64) -> Vec<u8> {
        let mut writer = Self { data: b"PAR1".to_vec() };
        let mut chunks = Vec::new();
        for column in columns {
            let start = writer.data.len() as u64;
            if let Some((values, words)) = &column.dictionary {
                writer.page(2, column, words, *values, words.len() as u64);
            }
            let pages = writer.data.len() as u64;
            writer.page(0, column, &column.page, column.values, column.unpacked);
            chunks.push((start, pages, writer.data.len() as u64 - start));
        }
        let footer = writer.data.len();
        let count = u8::try_from(columns.len()).unwrap();
        writer.integer(1, 1);
        writer.list(1, count + 1);
        writer.text(4, "schema");
        writer.integer(1, u64::from(count));
        writer.close();
        for column in columns {
            writer.integer(1, column.physical);
            writer.integer(2, 0);
            writer.text(1, column.name);
            if let Some(converted) = column.converted {
                writer.integer(2, converted);
            }
            writer.close();
        }
        writer.integer(1, rows);
        writer.list(1, 1);
        writer.list(1, count);
        for (column, (start, pages, length)) in columns.iter().zip(chunks) {
            writer.open(3);
            writer.integer(1, column.physical);
            writer.integer(3, column.codec);
            writer.integer(1, rows);
            writer.integer(2, length);
            writer.integer(2, pages + column.shift);
            writer.integer(2, start + column.shift);
            writer.close();
            writer.close();
        }
        writer.integer(2, rows);
        writer.close();
        writer.close();
        let size = u32::try_from(writer.data.len() - footer).unwrap();
        writer.data.extend(size.to_le_bytes());
        writer.data.extend(b"PAR1");
        writer.data
    }
}

fn written(columns: &[TestColumn], rows: u64) -> Recorder {
    Recorder::of_bytes(&Writer::file(columns, rows)).expect("tables")
}

#[test]
fn numbers_named_as_the_time_are_the_time() {
    let values = TestColumn::doubles("u [m/s]", &[1.0, 2.0]);
    for (name, times, stamps, clock) in [
        ("t", [0.5, 1.5], [500_000_000, 1_500_000_000], Clock::Boot),
        ("time_ms", [20.0, 40.0], [20_000_000, 40_000_000], Clock::Boot),
        ("Time [us]", [20.0, 40.5], [20_000, 40_500], Clock::Boot),
        (
            "timestamp",
            [1_775_547_840.25, 1_775_547_841.0],
            [1_775_547_840_250_000_000, 1_775_547_841_000_000_000],
            Clock::Utc,
        ),
        (
            "t",
            [1_775_547_840_250.0, 1_775_547_841_000.0],
            [1_775_547_840_250_000_000, 1_775_547_841_000_000_000],
            Clock::Utc,
        ),
        ("torque", [0.5, 1.5], [0, 1], Clock::None),
    ] {
        let tables = written(&[values.clone(), TestColumn::doubles(name, &times)], 2);
        assert_eq!(tables.topics[0].topic.clock, clock, "{name}");
        assert_eq!(tables.topics[0].table().iter().map(|row| row.0).collect::<Vec<_>>(), stamps, "{name}");
        assert_eq!(tables.topics[0].column("u"), [1.0, 2.0]);
        assert_eq!(tables.topics[0].unit("u"), Some("m/s"));
        // The time stays a field.
        assert_eq!(tables.topics[0].topic.fields.len(), 2);
        assert_eq!(tables.summary.losses, []);
    }
    let tables = written(&[values, TestColumn::doubles("t", &[1.0, f64::NAN])], 2);
    assert_eq!(tables.topics[0].rows.len(), 1);
    assert!(tables.summary.notes.iter().any(|note| note.contains("1 rows have no time")));
}

/// Nanoseconds of the day behind a Julian day; that of 1970-01-01 is 2,440,588.
#[test]
fn stamps_of_96_bits_may_be_before_1970_but_not_beyond_2262() {
    let day = 86_400_000_000_000_i64;
    let stamps = [(2_440_588_u32, 5), (2_440_587, day - 1), (2_440_588 + 106_751, 7), (u32::MAX, 0), (0, 0)];
    let page: Vec<u8> =
        stamps.iter().flat_map(|(day, ns)| [&ns.to_le_bytes()[..], &day.to_le_bytes()].concat()).collect();
    let time = TestColumn { physical: 3, unpacked: 60, page, ..TestColumn::doubles("time", &[0.0; 5]) };
    let tables = written(&[time, TestColumn::doubles("u", &[1.0, 2.0, 3.0, 4.0, 5.0])], 5);
    assert_eq!(
        tables.topics[0].table().iter().map(|row| row.0).collect::<Vec<_>>(),
        [5, -1, 106_751 * day + 7]
    );
    assert!(
        tables.summary.notes.iter().any(|note| note.contains("2 rows have no time")),
        "{:?}",
        tables.summary
    );
}

/// Unsigned integers of 64 bits, which a double would round to 256 ns.
#[test]
fn stamps_beyond_2_to_the_63_are_left_out_and_do_not_wrap() {
    let stamps: [u64; 4] = [1_775_547_840_250_000_001, 1 << 63, u64::MAX, i64::MAX.cast_unsigned()];
    let page: Vec<u8> = stamps.iter().flat_map(|stamp| stamp.to_le_bytes()).collect();
    let time =
        TestColumn { physical: 2, converted: Some(14), page, ..TestColumn::doubles("time_ns", &[0.0; 4]) };
    let tables = written(&[time, TestColumn::doubles("u", &[1.0, 2.0, 3.0, 4.0])], 4);
    assert_eq!(
        tables.topics[0].table().iter().map(|row| row.0).collect::<Vec<_>>(),
        [1_775_547_840_250_000_001, i64::MAX]
    );
    assert_eq!(tables.topics[0].column("u"), [1.0, 4.0]);
    assert!(
        tables.summary.notes.iter().any(|note| note.contains("2 rows have no time")),
        "{:?}",
        tables.summary
    );
}

#[test]
fn a_size_is_not_taken_for_granted() {
    let honest = TestColumn::doubles("u", &[1.0, 2.0, 3.0]);
    // A page that claims 2 GB with each codec.
    for codec in [0, 1, 2, 3, 4, 5, 6, 7, 9] {
        for unpacked in [250 << 20, (1 << 31) - 1, 1 << 40] {
            let bomb = TestColumn { codec, unpacked, ..honest.clone() };
            let tables = written(&[honest.clone(), bomb], 3);
            assert_eq!(tables.topics[0].rows.len(), 3);
            assert!(tables.topics[0].table().iter().all(|(_, values)| values[1].is_nan()), "{codec}");
            assert!(tables.summary.lost_parts >= 1);
        }
    }
    // More values than there are.
    for values in [4, (1 << 31) - 1, (1 << 62) - 1] {
        let tables = written(&[TestColumn { values, ..honest.clone() }], 3);
        assert_eq!(tables.topics[0].column("u"), [1.0, 2.0, 3.0]);
        if let Some(tables) = survives(&Writer::file(&[TestColumn { values, ..honest.clone() }], values)) {
            assert!(tables.topics[0].table().iter().all(|(_, values)| values[0].is_nan()));
            assert_eq!(tables.summary.lost_parts, 1);
        }
    }
    // A dictionary that is missing, and one that lacks the value.
    let index = TestColumn { encoding: 8, page: vec![8, 6, 5], unpacked: 3, ..honest.clone() };
    let lacks = TestColumn { dictionary: Some((3, [0; 24].to_vec())), ..index.clone() };
    for column in [index.clone(), lacks] {
        let tables = written(&[honest.clone(), TestColumn { name: "v", ..column }], 3);
        assert!(tables.topics[0].column("v").iter().all(|value| value.is_nan()));
        assert_eq!(tables.topics[0].column("u"), [1.0, 2.0, 3.0]);
        assert_eq!(tables.summary.lost_parts, 1);
    }
    let six: Vec<u8> =
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].iter().flat_map(|value: &f64| value.to_le_bytes()).collect();
    let has = TestColumn { dictionary: Some((6, six)), ..index };
    assert_eq!(written(&[has], 3).topics[0].column("u"), [5.0; 3]);
}

#[test]
fn a_page_is_not_unpacked_beyond_its_size() {
    let honest = TestColumn::doubles("u", &[1.0, 2.0, 3.0]);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::copy(&mut std::io::repeat(0).take(300 << 20), &mut gzip).expect("zeros");
    let page = gzip.finish().expect("a page");
    for (unpacked, reason) in [(24, "size that it states"), (300 << 20, "larger than 256 MiB")] {
        let bomb = TestColumn { name: "v", codec: 2, unpacked, page: page.clone(), ..honest.clone() };
        let tables = written(&[honest.clone(), bomb], 3);
        assert_eq!(tables.topics[0].column("u"), [1.0, 2.0, 3.0]);
        assert!(tables.topics[0].column("v").iter().all(|value| value.is_nan()));
        assert!(tables.summary.losses[0].reason.contains(reason), "{:?}", tables.summary);
    }
}

#[test]
fn a_run_cannot_give_rows_without_end() {
    // A run of 2^31 truth values in five bytes, with its size in front.
    let page = vec![6, 0, 0, 0, 0xfe, 0xff, 0xff, 0xff, 0x0f, 1];
    let values = (1 << 31) - 1;
    let run =
        TestColumn { physical: 0, encoding: 3, unpacked: 10, values, page, ..TestColumn::doubles("on", &[]) };
    let bytes = Writer::file(std::slice::from_ref(&run), 3);
    assert_eq!(Recorder::of_bytes(&bytes).expect("tables").topics[0].column("on"), [1.0; 3]);
    // The sink stops the reading.
    let stopped = Recorder::of_bytes(&Writer::file(&[run], values));
    assert!(matches!(stopped, Err(IoError::Interrupted)));
}

#[test]
fn a_file_with_an_encrypted_footer_says_so() {
    let error = Recorder::of_bytes(b"PAR1\0\0\0\0\0\0\0\0PARE").expect_err("no key");
    assert!(error.to_string().contains("encrypt"), "{error}");
}

static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    GOLDEN.map(|name| fs::read(golden(&format!("{name}.parquet"))).expect("a file")).to_vec()
});

#[test]
fn flipped_bytes_are_survived() {
    FILES.iter().for_each(|file| flipped(file, 0, ..));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn damaged_footers_do_not_panic(file in 0..GOLDEN.len(), flips in prop::collection::vec((any::<Index>(), any::<u8>()), 1..4)) {
        let mut bytes = FILES[file].clone();
        let size = u32::from_le_bytes(*bytes[..bytes.len() - 4].last_chunk().unwrap()) as usize;
        for (place, byte) in flips {
            let at = bytes.len() - 8 - size + place.index(size);
            bytes[at] = byte;
        }
        survives(&bytes);
    }

    #[test]
    fn random_bytes_do_not_panic(middle in prop::collection::vec(any::<u8>(), 0..600), footer in 0..600_u32) {
        let mut bytes = b"PAR1".to_vec();
        bytes.extend(&middle);
        bytes.extend(footer.min(u32::try_from(middle.len()).unwrap()).to_le_bytes());
        bytes.extend(b"PAR1");
        survives(&bytes);
    }
}
