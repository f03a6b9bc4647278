//! ArduPilot DataFlash.

use std::fs;

use hydroid_io::{Clock, Format, IoError, detect};

use crate::recorder::{Recorder, flipped, truncated};
use crate::sample;

/// 2026-04-07T07:44:00Z, the start of the run, 65 s after that of the device.
const START_NS: i64 = 1_775_547_840_000_000_000;

#[test]
fn sample_has_what_its_description_says() {
    let Some(path) = sample::file("otter.BIN") else { return };
    assert_eq!(detect(&path).expect("a file"), Some(Format::DataFlash));
    let log = Recorder::of(&path).expect("a log");
    for (topic, count) in
        [("GPS", 556), ("IMU", 6000), ("ATT", 600), ("XKF1", 600), ("POS", 600), ("RCOU", 34)]
    {
        assert_eq!(log.count(topic), count, "{topic}");
        assert_eq!(log.topic(topic).clock, Clock::Boot);
    }
    assert_eq!(log.topics.len(), 7, "these and MSG: {:?}", log.names());
    assert_eq!(
        log.topic("MSG").texts,
        [("Message".to_owned(), "ArduRover V4.5.7 (otter, simulated)".to_owned())]
    );
    assert_eq!(log.summary.lost_bytes, 6, "{:?}", log.summary);
    assert_eq!(log.summary.losses.len(), 1);
    assert_eq!(log.summary.losses[0].offset, 144_480);
    assert_eq!(log.summary.notes, [""; 0]);
    assert_eq!(log.summary.utc_offset_ns, Some(START_NS - 65_000_000_000));
    let parameters: Vec<(&str, f64)> =
        log.summary.parameters.iter().map(|(name, &value)| (&name[..], value)).collect();
    assert_eq!(
        parameters,
        [
            ("FRAME_CLASS", 2.0),
            ("SERVO1_FUNCTION", 73.0),
            ("SERVO1_MAX", 1900.0),
            ("SERVO1_MIN", 1100.0),
            ("SERVO3_FUNCTION", 74.0),
            ("SERVO3_MAX", 1900.0),
            ("SERVO3_MIN", 1100.0)
        ]
    );
    let units = [
        ("GPS", "Lat", Some("deg")),
        ("GPS", "Spd", Some("m/s")),
        ("GPS", "GCrs", Some("deg")),
        ("GPS", "GMS", Some("s")),
        ("GPS", "HDop", None),
        ("GPS", "I", None),
        ("GPS", "NSats", None),
        ("IMU", "GyrZ", Some("rad/s")),
        ("IMU", "AccX", Some("m/s2")),
        ("IMU", "T", Some("degC")),
        ("ATT", "Yaw", Some("deg")),
        ("RCOU", "C1", Some("us")),
        ("XKF1", "GX", Some("deg/s")),
        ("XKF1", "PN", Some("m")),
    ];
    for (topic, field, unit) in units {
        assert_eq!(log.unit(topic, field), unit, "{topic}.{field}");
    }
}

/// `expected.json` has what pymavlink reads: it leaves the factors of MULT to the reader, who finds them in the
/// unit.
#[test]
fn first_rows_of_the_sample_are_those_of_pymavlink() {
    let (Some(path), Some(expected)) = (sample::file("otter.BIN"), sample::file("expected.json")) else {
        return;
    };
    let expected: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(expected).expect("a file")).expect("JSON");
    let log = Recorder::of(&path).expect("a log");
    let mut compared = 0;
    for (topic, fields) in expected["first_dataflash"].as_object().expect("messages") {
        for (field, value) in fields.as_object().expect("fields") {
            let Some(value) = value.as_f64() else { continue };
            if field == "TimeUS" {
                assert_eq!(log.stamps(topic)[0] as f64, value * 1000.0);
                continue;
            }
            let factor = if field == "GMS" { 1000.0 } else { 1.0 };
            assert_eq!(log.column(topic, field)[0], value / factor, "{topic}.{field}");
            compared += 1;
        }
    }
    assert_eq!(compared, 71);
}

#[test]
fn rows_that_are_not_wanted_are_not_given() {
    let Some(path) = sample::file("otter.BIN") else { return };
    let log = Recorder::without(&path, &["IMU", "GPS"]).expect("a log");
    assert_eq!(log.count("IMU"), 0);
    assert_eq!(log.count("POS"), 600);
    assert_eq!(log.summary.utc_offset_ns, Some(START_NS - 65_000_000_000), "known without rows of GPS");
}

/// Writes messages.
#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
}

fn padded(text: &str, size: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(size, 0);
    bytes
}

impl Writer {
    /// With UNIT, MULT, FMTU and PARM as ArduPilot defines them.
    fn new() -> Self {
        let mut writer = Self::default();
        writer.format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
        writer.format(176, 76, "UNIT", "QbZ", "TimeUS,Id,Label");
        writer.format(177, 44, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
        writer.format(178, 20, "MULT", "Qbd", "TimeUS,Id,Mult");
        writer.format(179, 31, "PARM", "QNf", "TimeUS,Name,Value");
        for (letter, label) in
            [(b's', "s"), (b'#', "instance"), (b'm', "m"), (b'n', "m/s"), (b'o', "m/s/s"), (b'a', "Ah")]
        {
            writer.message(176, &[&0u64.to_le_bytes(), &[letter], &padded(label, 64)]);
        }
        for (letter, factor) in [
            (b'-', 0.0),
            (b'?', 1.0),
            (b'0', 1.0),
            (b'B', 0.01),
            (b'C', 1e-3),
            (b'F', 1e-6),
            (b'!', 3.6),
            (b'2', 100.0),
        ] {
            writer.message(178, &[&0u64.to_le_bytes(), &[letter], &f64::to_le_bytes(factor)]);
        }
        writer
    }

    fn message(&mut self, kind: u8, parts: &[&[u8]]) -> &mut Self {
        self.bytes.extend([0xa3, 0x95, kind]);
        self.bytes.extend(parts.concat());
        self
    }

    fn format(&mut self, kind: u8, length: u8, name: &str, letters: &str, columns: &str) -> &mut Self {
        self.message(128, &[&[kind, length], &padded(name, 4), &padded(letters, 16), &padded(columns, 64)])
    }

    fn units(&mut self, kind: u8, units: &str, factors: &str) -> &mut Self {
        self.message(177, &[&0u64.to_le_bytes(), &[kind], &padded(units, 16), &padded(factors, 16)])
    }

    /// A message of type 1, `TimeUS,N` (`QB`).
    fn count(&mut self, n: u8) -> &mut Self {
        self.message(1, &[&(u64::from(n) * 1000).to_le_bytes(), &[n]])
    }

    fn counter() -> Self {
        let mut writer = Self::new();
        writer.format(1, 12, "CNT", "QB", "TimeUS,N");
        writer
    }

    fn read(&self) -> Recorder {
        Recorder::of_bytes(&self.bytes).expect("a log")
    }
}

#[test]
fn each_type_of_field_is_read() {
    let mut writer = Writer::new();
    let columns = "TimeUS,a,b,B,h,H,i,I,f,d,n,N,c,C,e,E";
    writer.format(
        1,
        64 + 8 + 1 + 1 + 2 + 2 + 4 + 4 + 4 + 8 + 4 + 16 + 2 + 2 + 4 + 4 + 3,
        "ALL",
        "QabBhHiIfdnNcCeE",
        columns,
    );
    let array: Vec<u8> = (0..32).flat_map(|i: i16| (i - 5).to_le_bytes()).collect();
    writer.message(
        1,
        &[
            &7u64.to_le_bytes(),
            &array,
            &(-1i8).to_le_bytes(),
            &[200],
            &(-300i16).to_le_bytes(),
            &60_000u16.to_le_bytes(),
            &(-70_000i32).to_le_bytes(),
            &4_000_000_000u32.to_le_bytes(),
            &1.5f32.to_le_bytes(),
            &2.25f64.to_le_bytes(),
            &padded("ab", 4),
            &padded("longer", 16),
            &(-1234i16).to_le_bytes(),
            &56_789u16.to_le_bytes(),
            &(-123_456i32).to_le_bytes(),
            &3_000_000_000u32.to_le_bytes(),
        ],
    );
    writer.format(2, 3 + 8 + 4 + 1 + 8 + 2 + 2 + 2 + 64, "MORE", "QLMqgggZ", "TimeUS,L,M,q,g1,g2,g3,Z");
    writer.message(
        2,
        &[
            &8u64.to_le_bytes(),
            &(-634_401_999i32).to_le_bytes(),
            &[15],
            &(-(1i64 << 40)).to_le_bytes(),
            &0xc100u16.to_le_bytes(),
            &0x0001u16.to_le_bytes(),
            &0x7c00u16.to_le_bytes(),
            &padded("text", 64),
        ],
    );
    let log = writer.read();
    let value = |topic: &str, field: &str| log.column(topic, field)[0];
    assert_eq!(log.stamps("ALL"), [7000]);
    assert_eq!((value("ALL", "a[0]"), value("ALL", "a[31]")), (-5.0, 26.0));
    let expected = [
        ("b", -1.0),
        ("B", 200.0),
        ("h", -300.0),
        ("H", 60_000.0),
        ("i", -70_000.0),
        ("I", 4e9),
        ("f", 1.5),
        ("d", 2.25),
        ("c", -12.34),
        ("C", 567.89),
        ("e", -1234.56),
        ("E", 3e7),
    ];
    for (field, expected) in expected {
        assert_eq!(value("ALL", field), expected, "{field}");
    }
    let texts =
        |topic: &str| log.topic(topic).texts.iter().map(|(a, b)| format!("{a}={b}")).collect::<Vec<_>>();
    assert_eq!(texts("ALL"), ["n=ab", "N=longer"]);
    let expected = [
        ("L", -63.440_199_9),
        ("M", 15.0),
        ("q", -((1i64 << 40) as f64)),
        ("g1", -2.5),
        ("g3", f64::INFINITY),
    ];
    for (field, expected) in expected {
        assert_eq!(value("MORE", field), expected, "{field}");
    }
    assert_eq!(value("MORE", "g2"), 2f64.powi(-24));
    assert_eq!(texts("MORE"), ["Z=text"]);
    assert_eq!(log.summary.losses, []);
}

#[test]
fn factors_and_units_are_applied_once() {
    let mut writer = Writer::new();
    writer.format(1, 3 + 8 + 2 * 6 + 4, "UNI", "QhcchhHf", "TimeUS,cm,c,cc,raw,big,unk,acc");
    writer.units(1, "smmmmaxo", "FBB-0!?-");
    let shorts = [123i16, 456, 789, 12, 10, 7].map(i16::to_le_bytes).concat();
    writer.message(1, &[&1_000_000u64.to_le_bytes(), &shorts, &9.5f32.to_le_bytes()]);
    let log = writer.read();
    let expected = [
        ("cm", 1.23, Some("m")),
        ("c", 4.56, Some("m")),
        ("cc", 7.89, Some("m")),
        ("raw", 12.0, Some("m")),
        ("big", 36.0, Some("Ah")),
        ("unk", 7.0, None),
        ("acc", 9.5, Some("m/s2")),
    ];
    for (field, value, unit) in expected {
        assert_eq!((log.column("UNI", field)[0], log.unit("UNI", field)), (value, unit), "{field}");
    }
}

#[test]
fn instances_are_topics() {
    let mut writer = Writer::new();
    writer.format(1, 13, "BAT", "QBB", "TimeUS,I,V").units(1, "s#-", "F--");
    writer.format(2, 16, "NVF", "QnB", "TimeUS,Name,V").units(2, "s#-", "F--");
    for (instance, value) in [(1u8, 10u8), (0, 11), (1, 12), (200, 13)] {
        writer.message(1, &[&1u64.to_le_bytes(), &[instance, value]]);
    }
    for (name, value) in [("ab", 1u8), ("cd", 2), ("ab", 3)] {
        writer.message(2, &[&1u64.to_le_bytes(), &padded(name, 4), &[value]]);
    }
    let log = writer.read();
    assert_eq!(log.names(), ["BAT[1]", "BAT", "BAT[200]", "NVF[ab]", "NVF[cd]"]);
    assert_eq!(log.column("BAT[1]", "V"), [10.0, 12.0]);
    assert_eq!(log.column("BAT", "V"), [11.0]);
    assert_eq!(log.column("NVF[ab]", "V"), [1.0, 3.0]);
    assert_eq!(log.topic("BAT[1]").type_name, "BAT");
}

#[test]
fn zeros_at_the_end_are_no_loss() {
    let mut writer = Writer::counter();
    writer.count(1).count(2);
    for zeros in [1, 2, 3, 300, 5000] {
        let bytes = [&writer.bytes[..], &vec![0; zeros]].concat();
        let log = Recorder::of_bytes(&bytes).expect("a log");
        assert_eq!((log.count("CNT"), log.summary.lost_parts), (2, 0), "{zeros} zeros: {:?}", log.summary);
    }
    let bytes = [&writer.bytes[..], &[0; 300], &writer.bytes[..]].concat();
    let log = Recorder::of_bytes(&bytes).expect("a log");
    assert_eq!((log.count("CNT"), log.summary.lost_bytes), (4, 300), "zeros in the middle are");
}

#[test]
fn a_message_that_is_cut_is_left_out() {
    let mut writer = Writer::counter();
    writer.count(1).count(2);
    let cut = writer.bytes.len() - 4;
    writer.bytes.truncate(cut);
    writer.count(3).count(4);
    let log = writer.read();
    assert_eq!(log.column("CNT", "N"), [1.0, 3.0, 4.0]);
    assert_eq!(log.summary.lost_bytes, 8, "{:?}", log.summary);
}

#[test]
fn a_header_in_data_does_not_mislead() {
    let mut writer = Writer::counter();
    writer.format(2, 3 + 8 + 16, "TXT", "QN", "TimeUS,Text");
    writer.count(1);
    // Rubbish with a header that no other follows, then a message with a header in its text.
    writer.bytes.extend(b"rubbish\xa3\x95\x01rubbish, longer than a message");
    let text = [b"\xa3\x95\x01", &[1u8; 13][..]].concat();
    writer.message(2, &[&5u64.to_le_bytes(), &text]).count(2);
    let log = writer.read();
    assert_eq!(log.column("CNT", "N"), [1.0, 2.0]);
    assert_eq!(log.count("TXT"), 1);
    assert_eq!(log.summary.lost_bytes, 40);
}

#[test]
fn stamps_beyond_2_to_the_63_are_lost_and_do_not_wrap() {
    let mut writer = Writer::counter();
    writer.count(1);
    for time in [i64::MAX.cast_unsigned() / 1000 + 1, 1 << 63, u64::MAX] {
        writer.message(1, &[&time.to_le_bytes(), &[2]]);
    }
    writer.count(3);
    let log = writer.read();
    assert_eq!((log.column("CNT", "N"), log.stamps("CNT")), (vec![1.0, 3.0], vec![1_000_000, 3_000_000]));
    assert_eq!(log.summary.lost_bytes, 3 * 12, "{:?}", log.summary);
    assert!(log.summary.losses[0].reason.contains("2^63 ns"));
}

#[test]
fn messages_without_format_are_stated() {
    let mut writer = Writer::counter();
    for n in 1..5 {
        writer.count(n).message(77, &[b"unknown"]);
    }
    let log = writer.read();
    assert_eq!(log.column("CNT", "N"), [1.0, 2.0, 3.0, 4.0]);
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (4, 40));
    assert!(log.summary.losses[0].reason.contains("type 77"), "{:?}", log.summary);
}

#[test]
fn formats_that_contradict_are_refused() {
    let mut writer = Writer::counter();
    writer.count(1);
    writer.format(1, 12, "CNT", "QB", "TimeUS,N").count(2);
    writer.format(1, 11, "CNT", "Q", "TimeUS").message(1, &[&3u64.to_le_bytes()]);
    writer.format(3, 12, "CNT", "QB", "TimeUS,N").message(3, &[&[4; 9]]);
    writer
        .format(2, 200, "BAD", "QB", "TimeUS,N")
        .format(4, 12, "BAD", "QX", "TimeUS,N")
        .format(5, 0, "", "", "");
    writer.format(128, 12, "FMT", "QB", "TimeUS,N").format(6, 3, "NUL", "", "");
    writer.message(6, &[]).message(6, &[]);
    let log = writer.read();
    assert_eq!(log.column("CNT", "N"), [1.0, 2.0]);
    assert_eq!((log.count("NUL"), log.topic("NUL").clock), (2, Clock::None));
    assert_eq!(log.stamps("NUL"), [0, 1]);
    assert_eq!(log.summary.losses, [], "their messages have the stated length");
    assert_eq!(log.summary.notes.len(), 5, "{:?}", log.summary.notes);
}

#[test]
fn late_units_are_stated() {
    let mut writer = Writer::counter();
    writer.count(1).units(1, "s#", "F-").count(2);
    let log = writer.read();
    assert_eq!((log.names(), log.count("CNT")), (vec!["CNT"], 2));
    assert!(log.summary.notes[0].contains("units of CNT"), "{:?}", log.summary.notes);
}

#[test]
fn gps_time_knows_the_leap_seconds() {
    // Week and UTC of the same instant, on both sides of leap seconds.
    let cases = [
        (2413, 200_658_769, Some(1_775_547_840_769_000_000)),
        // 2016-12-31T23:59:59 was 17 s behind, 2017-01-01 is 18 s.
        (1930, 16_000, Some(1_483_228_799_000_000_000)),
        (1930, 18_000, Some(1_483_228_800_000_000_000)),
        (2413, 604_800_000, None),
        (0, 5000, None),
    ];
    for (week, millisecond, utc) in cases {
        let mut writer = Writer::new();
        writer.format(1, 3 + 8 + 1 + 4 + 2, "GPS", "QBIH", "TimeUS,Status,GMS,GWk").units(1, "s-s-", "F-C-");
        let week = u16::to_le_bytes(week);
        writer.message(1, &[&9u64.to_le_bytes(), &[1], &4242u32.to_le_bytes(), &week]);
        writer.message(1, &[&5u64.to_le_bytes(), &[3], &u32::to_le_bytes(millisecond), &week]);
        let log = writer.read();
        assert_eq!(log.summary.utc_offset_ns, utc.map(|utc: i64| utc - 5000), "{millisecond} ms");
    }
}

#[test]
fn nothing_is_not_a_log() {
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    assert!(matches!(Recorder::of_bytes(b"\xa3\x95\x80"), Err(IoError::Damaged { offset: 0, .. })));
    assert!(matches!(Recorder::of_bytes(b"\xa3\x95\x80\x80\x59FMT"), Err(IoError::Damaged { .. })));
    assert!(matches!(Recorder::of_bytes(b"time,rudder\n1,2\n"), Err(IoError::Unknown { .. })));
    let alone = Recorder::of_bytes(&Writer::new().bytes).expect("formats alone");
    assert_eq!(alone.topics, []);
}

#[test]
fn a_damaged_beginning_is_recognised() {
    let mut writer = Writer::counter();
    writer.count(1);
    let bytes = [&b"\xff\xff rubbish"[..], &writer.bytes].concat();
    let log = Recorder::of_bytes(&bytes).expect("a log");
    assert_eq!((log.count("CNT"), log.summary.lost_bytes), (1, 10));
}

#[test]
fn instances_do_not_fill_the_memory() {
    let mut writer = Writer::new();
    writer.format(1, 3 + 4 + 64, "MANY", "Ia", "I,a").units(1, "#-", "--");
    for i in 0..20_000u32 {
        writer.message(1, &[&i.to_le_bytes(), &[1; 64]]);
    }
    let log = writer.read();
    assert_eq!(log.topics.len(), 4096);
    assert!(log.summary.notes[0].contains("more topics"), "{:?}", log.summary.notes);
}

#[test]
fn a_cut_sample_gives_its_first_rows() {
    let Some(path) = sample::file("otter.BIN") else { return };
    truncated(&fs::read(path).expect("a file"), 1000);
}

#[test]
fn flipped_bytes_cost_little() {
    let Some(path) = sample::file("otter.BIN") else { return };
    // Without the formats, which are in the first 4 kB.
    flipped(&fs::read(path).expect("a file"), 4000, Some(8331)..=Some(8391));
}
