//! The writer of Parquet, whose files the reader reads. Those of pyarrow read them in `python/tests/test_recordings.py`.

use std::io::{self, Write};

use hydroid_io::{Field, write_parquet};
use proptest::prelude::*;
use proptest::sample::select;

use crate::recorder::Recorder;

type Columns = Vec<(Field, Vec<f64>)>;

fn written(columns: &Columns) -> Vec<u8> {
    let columns: Vec<(Field, &[f64])> =
        columns.iter().map(|(field, values)| (field.clone(), values.as_slice())).collect();
    let mut bytes = Vec::new();
    write_parquet(&columns, &mut bytes).expect("memory does not fail");
    bytes
}

fn column(name: &str, unit: Option<&str>, values: Vec<f64>) -> (Field, Vec<f64>) {
    (Field { name: name.to_owned(), unit: unit.map(str::to_owned) }, values)
}

/// Asserts that the file has these columns bit for bit, and that NaN is NaN.
fn assert_read_back(columns: &Columns, rows: usize) -> Recorder {
    let read = Recorder::of_bytes(&written(columns)).expect("tables");
    assert_eq!((read.summary.lost_parts, &read.summary.notes), (0, &Vec::new()), "{:?}", read.summary);
    let topic = &read.topics[0];
    let fields: Vec<Field> = columns.iter().map(|(field, _)| field.clone()).collect();
    assert_eq!(topic.topic.fields, fields);
    assert_eq!(topic.rows.len(), rows);
    for (i, (field, values)) in columns.iter().enumerate() {
        for (row, found) in topic.rows.iter().enumerate() {
            let (found, value) = (f64::from_bits(found.2[i]), values.get(row).copied().unwrap_or(f64::NAN));
            let same = found.to_bits() == value.to_bits() || found.is_nan() && value.is_nan();
            assert!(same, "{} in row {row}: {found:?} instead of {value:?}", field.name);
        }
    }
    read
}

/// Names of topics and fields, with indices, and what a reader of text would stumble over.
const NAMES: &str = r#"[/b-g_ü船]{1,5}(\.[b-g_]{1,9}){0,3}(\[[0-9]{1,2}\])?|[b-g],\"[b-g]\n[b-g]"#;

fn cell() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        2 => Just(f64::NAN),
        1 => select(vec![0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::MIN_POSITIVE / 8.0, f64::MAX]),
    ]
}

fn tables() -> impl Strategy<Value = (Columns, usize)> {
    let unit = prop::option::of(select(vec!["m/s", "deg", "°", "m/s2", "s", "a much longer name of a unit"]));
    let names = prop::collection::btree_set(NAMES, 1..40);
    (names, 1..70_usize).prop_flat_map(move |(names, rows)| {
        let columns: Vec<_> = names
            .into_iter()
            .map(|name| {
                // Some columns lack their end.
                let values = prop::collection::vec(cell(), rows / 2..=rows);
                (unit.clone(), values).prop_map(move |(unit, values)| column(&name, unit, values))
            })
            .collect();
        columns.prop_map(|columns| {
            let rows = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
            (columns, rows)
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn what_is_written_is_read_back((columns, rows) in tables()) {
        assert_read_back(&columns, rows);
    }
}

/// A row group has 65,536 rows.
#[test]
fn row_groups_follow_each_other() {
    for rows in [0, 1, 7, 8, 9, 65_535, 65_536, 65_537, 90_000] {
        let values = |f: fn(f64) -> f64| (0_u32..rows).map(|k| f(f64::from(k))).collect();
        let columns = vec![
            column("t", Some("s"), values(|k| 0.02 * k)),
            column("u", Some("m/s"), values(f64::sin)),
            column("gaps", None, values(|k| if k % 3.0 == 0.0 { f64::NAN } else { k })),
            column("empty", None, values(|_| f64::NAN)),
            column("late", None, values(|k| if k < 70_000.0 { f64::NAN } else { k })),
            column("early", None, vec![1.0; 5.min(rows as usize)]),
        ];
        let read = assert_read_back(&columns, rows as usize);
        // The time is that of the rows.
        let stamps = read.topics[0].stamps();
        assert!(stamps.iter().zip(0_i64..).all(|(stamp, k)| *stamp == 20_000_000 * k));
    }
}

#[test]
fn a_damaged_page_is_found_by_its_checksum() {
    let columns =
        vec![column("u", None, vec![0.25; 1000]), column("v", None, (0_u32..1000).map(f64::from).collect())];
    let whole = written(&columns);
    // The pages are in front of the footer, which starts with the version of the format.
    let footer = u32::from_le_bytes(*whole[..whole.len() - 4].last_chunk().expect("a size")) as usize;
    let at = whole.len() - 8 - footer - 10;
    let mut bytes = whole;
    bytes[at] ^= 1;
    let read = Recorder::of_bytes(&bytes).expect("tables");
    assert_eq!(read.summary.lost_parts, 1);
    assert!(read.summary.losses[0].reason.contains("column 'v': the checksum"), "{:?}", read.summary);
    assert!(read.topics[0].column("u").iter().all(|value| *value == 0.25));
    assert!(read.topics[0].column("v").iter().all(|value| value.is_nan()));
}

/// A disk that is full.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn an_error_of_the_writer_is_not_swallowed() {
    let columns = vec![column("u", Some("m/s"), vec![1.0, 2.0])];
    let size = written(&columns).len();
    let write = |room| write_parquet(&[(columns[0].0.clone(), &columns[0].1)], Full(room));
    for room in 0..size {
        assert_eq!(write(room).expect_err("no room").kind(), io::ErrorKind::StorageFull);
    }
    assert!(write(size).is_ok());
}
