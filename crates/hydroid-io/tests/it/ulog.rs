//! PX4 ULog.

use std::fs;

use hydroid_io::{Clock, Format, IoError, detect};

use crate::recorder::{Recorder, flipped, truncated};
use crate::sample;

/// 2026-04-07T07:44:00Z, the start of the run, 42 s after that of the device.
const START_NS: i64 = 1_775_547_840_000_000_000;

#[test]
fn sample_has_what_its_description_says() {
    let Some(path) = sample::file("otter.ulg") else { return };
    assert_eq!(detect(&path).expect("a file"), Some(Format::ULog));
    let log = Recorder::of(&path).expect("a log");
    let counts = [
        ("sensor_combined", 6000),
        ("sensor_gps", 556),
        ("vehicle_attitude", 600),
        ("vehicle_local_position", 600),
        ("actuator_outputs", 34),
    ];
    assert_eq!(log.topics.len(), counts.len());
    for (topic, count) in counts {
        assert_eq!(log.count(topic), count, "{topic}");
        assert_eq!(log.topic(topic).clock, Clock::Boot);
        assert!(log.topic(topic).fields.iter().all(|field| !field.name.contains("padding")));
    }
    let first = |topic: &str, field: &str| log.column(topic, field)[0];
    let single = |value: f32| f64::from(value);
    assert_eq!(log.stamps("sensor_combined")[0], 42_000_000_000);
    assert_eq!(log.stamps("sensor_gps")[0], 42_769_000_000);
    assert_eq!(first("sensor_combined", "gyro_rad[2]"), single(0.00255));
    assert_eq!(first("sensor_combined", "accelerometer_m_s2[0]"), single(-0.402));
    assert_eq!(first("sensor_combined", "accelerometer_m_s2[1]"), single(0.117), "starboard");
    assert_eq!(first("sensor_gps", "latitude_deg"), 63.440_199_947);
    assert_eq!(first("sensor_gps", "longitude_deg"), 10.417_992_249);
    assert!((first("sensor_gps", "vel_m_s") - 1.304 * 1852.0 / 3600.0).abs() < 1e-6);
    assert!((first("sensor_gps", "cog_rad") - 37.52f64.to_radians()).abs() < 1e-6);
    assert!(log.column("sensor_gps", "cog_rad").iter().all(|course| (0.0..7.0).contains(course)));
    assert!((first("vehicle_local_position", "x") + 0.01186).abs() < 1e-8);
    assert!((first("vehicle_local_position", "heading") - 1.1989).abs() < 1e-4);
    assert_eq!(first("actuator_outputs", "output[0]"), 1824.0);
    assert_eq!(log.column("actuator_outputs", "output[0]")[1], 1884.0);
    assert_eq!(log.column("actuator_outputs", "output[1]")[1], 1764.0);
    let units = [
        ("sensor_combined", "gyro_rad[0]", Some("rad/s")),
        ("sensor_combined", "accelerometer_m_s2[2]", Some("m/s2")),
        ("sensor_combined", "accelerometer_clipping", None),
        ("sensor_gps", "latitude_deg", Some("deg")),
        ("sensor_gps", "altitude_msl_m", Some("m")),
        ("sensor_gps", "vel_m_s", Some("m/s")),
        ("sensor_gps", "cog_rad", Some("rad")),
        ("sensor_gps", "time_utc_usec", Some("us")),
        ("sensor_gps", "hdop", None),
        ("actuator_outputs", "output[0]", None),
    ];
    for (topic, field, unit) in units {
        assert_eq!(log.unit(topic, field), unit, "{topic}.{field}");
    }
    assert_eq!(log.summary.utc_offset_ns, Some(START_NS - 42_000_000_000));
    let parameters: Vec<(&str, f64)> =
        log.summary.parameters.iter().map(|(name, &value)| (&name[..], value)).collect();
    assert_eq!(
        parameters,
        [
            ("PWM_MAIN_MAX1", 1900.0),
            ("PWM_MAIN_MAX2", 1900.0),
            ("PWM_MAIN_MIN1", 1100.0),
            ("PWM_MAIN_MIN2", 1100.0)
        ]
    );
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (1, 0), "{:?}", log.summary);
    assert!(log.summary.losses[0].reason.contains("dropout of 40 ms"), "{:?}", log.summary);
    assert_eq!(log.summary.notes, [""; 0]);
}

#[test]
fn rows_that_are_not_wanted_are_not_given() {
    let Some(path) = sample::file("otter.ulg") else { return };
    let log = Recorder::without(&path, &["sensor_combined", "sensor_gps"]).expect("a log");
    assert_eq!((log.count("sensor_gps"), log.count("vehicle_attitude")), (0, 600));
    assert_eq!(
        log.summary.utc_offset_ns,
        Some(START_NS - 42_000_000_000),
        "known without rows of sensor_gps"
    );
}

struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn new() -> Self {
        Self { bytes: b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec() }
    }

    /// With the topic `count` of the number 3: `timestamp` and `n`.
    fn counter() -> Self {
        let mut writer = Self::new();
        writer.format("count:uint64_t timestamp;uint32_t n;").subscribe(0, 3, "count");
        writer
    }

    fn message(&mut self, kind: u8, parts: &[&[u8]]) -> &mut Self {
        let data = parts.concat();
        self.bytes.extend(u16::try_from(data.len()).expect("a length").to_le_bytes());
        self.bytes.push(kind);
        self.bytes.extend(data);
        self
    }

    fn format(&mut self, format: &str) -> &mut Self {
        self.message(b'F', &[format.as_bytes()])
    }

    fn subscribe(&mut self, instance: u8, id: u16, name: &str) -> &mut Self {
        self.message(b'A', &[&[instance], &id.to_le_bytes(), name.as_bytes()])
    }

    fn data(&mut self, id: u16, time: u64, parts: &[&[u8]]) -> &mut Self {
        self.message(b'D', &[&id.to_le_bytes(), &time.to_le_bytes(), &parts.concat()])
    }

    fn count(&mut self, n: u32) -> &mut Self {
        self.data(3, u64::from(n) * 10, &[&n.to_le_bytes()])
    }

    fn flags(&mut self, incompatible: u8, appended: u64) -> &mut Self {
        self.message(
            b'B',
            &[&[0; 8], &[incompatible, 0, 0, 0, 0, 0, 0, 0], &appended.to_le_bytes(), &[0; 16]],
        )
    }

    fn read(&self) -> Recorder {
        Recorder::of_bytes(&self.bytes).expect("a log")
    }
}

#[test]
fn nested_formats_and_all_types_are_read() {
    let mut writer = Writer::new();
    writer.format(
        "all:uint64_t timestamp;int8_t a;uint8_t b;bool c;char d;int16_t e;\
         uint16_t f;int32_t g;uint32_t h;int64_t i;uint64_t j;float k;double l;\
         char[6] name;outer[2] o;uint8_t[3] _padding0;",
    );
    writer.format("inner:uint16_t x;uint8_t[2] _padding0;float[2] speed_m_s;");
    writer.format("outer:inner in;uint8_t last;uint8_t[1] _padding0;");
    writer.subscribe(0, 9, "all");
    let inner =
        |x: u16| [&x.to_le_bytes()[..], &[9; 2], &1.5f32.to_le_bytes(), &f32::from(x).to_le_bytes()].concat();
    let values: [&[u8]; 17] = [
        &(-1i8).to_le_bytes(),
        &[200],
        &[1],
        b"A",
        &(-300i16).to_le_bytes(),
        &60_000u16.to_le_bytes(),
        &(-70_000i32).to_le_bytes(),
        &4_000_000_000u32.to_le_bytes(),
        &(-(1i64 << 40)).to_le_bytes(),
        &(1u64 << 41).to_le_bytes(),
        &1.25f32.to_le_bytes(),
        &2.5f64.to_le_bytes(),
        b"boat\0\0",
        &inner(7),
        &[5, 0],
        &inner(8),
        &[6, 0],
    ];
    // Padding at the end is written, written in part, or not.
    writer.data(9, 1, &values);
    writer.data(9, 2, &[&values.concat(), &[0; 3]]);
    let short = values.concat();
    writer.data(9, 3, &[&short[..short.len() - 1]]);
    let log = writer.read();
    let expected = [
        ("a", -1.0),
        ("b", 200.0),
        ("c", 1.0),
        ("d", 65.0),
        ("e", -300.0),
        ("f", 60_000.0),
        ("g", -70_000.0),
        ("h", 4e9),
        ("i", -((1i64 << 40) as f64)),
        ("j", (1u64 << 41) as f64),
        ("k", 1.25),
        ("l", 2.5),
        ("o[0].in.x", 7.0),
        ("o[0].in.speed_m_s[0]", 1.5),
        ("o[0].in.speed_m_s[1]", 7.0),
        ("o[0].last", 5.0),
        ("o[1].in.x", 8.0),
        ("o[1].in.speed_m_s[1]", 8.0),
        ("o[1].last", 6.0),
    ];
    for (field, value) in expected {
        assert_eq!(log.column("all", field), [value; 3], "{field}");
    }
    assert_eq!(log.topic("all").fields.len(), expected.len() + 1);
    assert_eq!(log.topic("all").texts, [("name".to_owned(), "boat".to_owned())]);
    assert_eq!(log.unit("all", "o[1].in.speed_m_s[0]"), Some("m/s"));
    assert_eq!(log.stamps("all"), [1000, 2000, 3000]);
    assert_eq!(log.summary.losses, []);
}

#[test]
fn instances_are_topics() {
    let mut writer = Writer::counter();
    writer.subscribe(1, 4, "count").subscribe(0, 5, "count");
    writer.count(1).data(4, 5, &[&2u32.to_le_bytes()]).data(5, 6, &[&3u32.to_le_bytes()]);
    let log = writer.read();
    assert_eq!(log.names(), ["count", "count[1]"]);
    assert_eq!((log.column("count", "n"), log.column("count[1]", "n")), (vec![1.0, 3.0], vec![2.0]));
    assert_eq!(log.topic("count[1]").type_name, "count");
}

#[test]
fn gnss_time_gives_the_offset_by_its_median() {
    for name in ["sensor_gps", "vehicle_gps_position"] {
        let mut writer = Writer::new();
        writer.format(&format!("{name}:uint64_t timestamp;uint64_t time_utc_usec;")).subscribe(0, 1, name);
        for (time, utc) in [(1, 0u64), (2, 1_000_002), (3, 1_000_003), (4, 77), (5, 1_000_005), (6, u64::MAX)]
        {
            writer.data(1, time, &[&utc.to_le_bytes()]);
        }
        assert_eq!(writer.read().summary.utc_offset_ns, Some(1_000_000_000), "{name}");
    }
}

#[test]
fn parameters_and_dropouts_are_kept_and_strings_ignored() {
    let mut writer = Writer::counter();
    let parameter = |type_and_name: &str| {
        [&[u8::try_from(type_and_name.len()).expect("short")], type_and_name.as_bytes()].concat()
    };
    writer.message(b'P', &[&parameter("float A_B"), &1.5f32.to_le_bytes()]);
    writer.message(b'P', &[&parameter("int32_t C"), &7i32.to_le_bytes()]);
    writer.message(b'P', &[&parameter("int32_t CUT"), &[7]]);
    writer.message(b'Q', &[&[1], &parameter("int32_t C"), &9i32.to_le_bytes()]);
    writer.message(b'I', &[&parameter("char[3] sys_name"), b"PX4"]);
    writer.message(b'M', &[&[0], &parameter("char[3] more"), b"PX4"]);
    writer.count(1);
    writer.message(b'L', &[b"6", &5u64.to_le_bytes(), b"text"]);
    writer.message(b'C', &[b"6", &[1, 0], &5u64.to_le_bytes(), b"text"]);
    writer.message(b'S', &[&[0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12]]);
    writer.message(b'O', &[&250u16.to_le_bytes()]);
    writer.message(b'R', &[&3u16.to_le_bytes()]);
    writer.message(b'P', &[&parameter("float A_B"), &2.5f32.to_le_bytes()]);
    writer.message(b'T', &[b"a type that is not known"]);
    writer.count(2);
    let log = writer.read();
    assert_eq!(log.count("count"), 2);
    assert_eq!(
        log.summary.parameters.into_iter().collect::<Vec<_>>(),
        [("A_B".to_owned(), 2.5), ("C".to_owned(), 7.0)]
    );
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (1, 0));
    assert!(log.summary.losses[0].reason.contains("250 ms"));
    assert_eq!(log.summary.notes.len(), 1, "{:?}", log.summary.notes);
    assert!(log.summary.notes[0].contains("unknown type T"));
}

#[test]
fn appended_data_follow_a_message_that_is_cut() {
    let mut writer = Writer::new();
    writer.flags(1, 0);
    writer.format("count:uint64_t timestamp;uint32_t n;").subscribe(0, 3, "count").count(1).count(2);
    let place = writer.bytes.len() - 5;
    writer.bytes.truncate(place);
    writer.count(3);
    // The offset in the message of flags.
    let at = 16 + 3 + 16;
    writer.bytes[at..at + 8].copy_from_slice(&(place as u64).to_le_bytes());
    let log = writer.read();
    assert_eq!(log.column("count", "n"), [1.0, 3.0]);
    assert_eq!(log.summary.lost_bytes, 12, "{:?}", log.summary);
}

#[test]
fn unknown_features_are_stated() {
    let mut writer = Writer::new();
    writer.flags(2, 0).format("count:uint64_t timestamp;uint32_t n;").subscribe(0, 3, "count").count(1);
    assert!(writer.read().summary.notes[0].contains("features"));
    writer.bytes[7] = 9;
    assert!(writer.read().summary.notes[0].contains("version 9"));
}

#[test]
fn reading_goes_on_after_damage() {
    let mut writer = Writer::counter();
    writer.count(1).count(2);
    writer.bytes.extend([0xff, 0xff, b'D', 3, 0, 1, 2, 3, 0, 0, 0, 0xff]);
    writer.count(3).count(4);
    // A part is missing: the message before it is cut.
    let cut = writer.bytes.len() - 6;
    writer.bytes.truncate(cut);
    writer.count(5).count(6);
    let log = writer.read();
    assert_eq!(log.column("count", "n"), [1.0, 2.0, 3.0, 5.0, 6.0]);
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (2, 12 + 11), "{:?}", log.summary);
}

#[test]
fn stamps_beyond_2_to_the_63_are_lost_and_do_not_wrap() {
    let mut writer = Writer::counter();
    let largest = i64::MAX.cast_unsigned() / 1000;
    for (n, time) in [(0u32, 1), (1, largest), (2, largest + 1), (3, 1 << 63), (4, u64::MAX), (5, 9)] {
        writer.data(3, time, &[&n.to_le_bytes()]);
    }
    let log = writer.read();
    assert_eq!(log.column("count", "n"), [0.0, 1.0, 5.0]);
    assert_eq!(log.stamps("count"), [1000, i64::MAX / 1000 * 1000, 9000]);
    assert_eq!(log.summary.lost_bytes, 3 * (3 + 2 + 8 + 4), "{:?}", log.summary);
    assert!(log.summary.losses[0].reason.contains("2^63 ns"));
}

/// Random bytes have few of the signs of a message.
#[test]
fn noise_is_lost() {
    let mut writer = Writer::counter();
    writer.count(1);
    let before = writer.bytes.len();
    let mut state = 1u64;
    for _ in 0..1_000_000 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        writer.bytes.push((state >> 56) as u8);
    }
    writer.count(2).count(3);
    let log = writer.read();
    assert_eq!(log.column("count", "n"), [1.0, 2.0, 3.0]);
    assert_eq!((log.summary.losses[0].offset, log.summary.lost_bytes), (before as u64, 1_000_000));
}

#[test]
fn data_without_topic_or_format_are_stated() {
    let mut writer = Writer::counter();
    writer.subscribe(0, 4, "no_format");
    for n in 1..6 {
        writer.count(n).data(4, 1, &[]).data(5, 1, &[b"abc"]);
    }
    let log = writer.read();
    assert_eq!(log.count("count"), 5);
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (10, 5 * (13 + 16)), "{:?}", log.summary);
    assert!(log.summary.losses[0].reason.contains("format of no_format is missing"));
    assert!(log.summary.losses[1].reason.contains("number 5"));
}

#[test]
fn hostile_formats_are_refused() {
    let mut writer = Writer::counter();
    // Formats within each other without end, arrays of formats without content, and data longer than a message.
    writer.format("loop:loop a;").subscribe(0, 10, "loop");
    writer.format("nothing:;");
    let mut name = "nothing".to_owned();
    for i in 0..7 {
        writer.format(&format!("level{i}:{name}[60000] a;"));
        name = format!("level{i}");
    }
    writer.subscribe(0, 11, &name);
    writer.format("long:uint64_t[60000] a;").subscribe(0, 12, "long");
    writer.format("huge:uint8_t[99999999999999999999999] a;").subscribe(0, 13, "huge");
    writer.format("odd:uint8_t").format(":uint8_t a;").format("count:float n;");
    writer.format("array:uint64_t timestamp;float[65] a;uint8_t b;").subscribe(0, 14, "array");
    writer.data(14, 1, &[&[0; 260], &[8]]).count(1);
    let log = writer.read();
    assert_eq!(log.count("count"), 1);
    assert_eq!(log.column("array", "b"), [8.0]);
    assert_eq!(log.topic("array").fields.len(), 1, "an array of 65 is left out");
    assert_eq!(log.summary.notes.len(), 8, "{:?}", log.summary.notes);
}

#[test]
fn nothing_is_not_a_log() {
    let header = Writer::new().bytes;
    assert!(matches!(Recorder::of_bytes(&header[..10]), Err(IoError::Damaged { .. })));
    assert!(matches!(Recorder::of_bytes(&header), Err(IoError::Damaged { .. })));
    assert!(matches!(
        Recorder::of_bytes(&[&header[..], &[0xff; 100]].concat()),
        Err(IoError::Damaged { .. })
    ));
}

#[test]
fn a_cut_sample_gives_its_first_rows() {
    let Some(path) = sample::file("otter.ulg") else { return };
    truncated(&fs::read(path).expect("a file"), 1000);
}

#[test]
fn flipped_bytes_cost_little() {
    let Some(path) = sample::file("otter.ulg") else { return };
    // Without the formats, which are in the first 2 kB.
    flipped(&fs::read(path).expect("a file"), 2000, Some(7730)..=Some(7790));
}
