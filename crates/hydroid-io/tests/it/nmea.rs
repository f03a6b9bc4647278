//! NMEA 0183.

use std::fmt::Write as _;
use std::fs;

use hydroid_io::{Clock, Format, IoError, detect};
use proptest::prelude::*;

use crate::recorder::{Recorder, flipped, survives, truncated};
use crate::sample;

const SECOND: i64 = 1_000_000_000;

/// 2026-04-16T00:00:00Z.
const MIDNIGHT_NS: i64 = 1_776_297_600 * SECOND;

/// 07:44:00.
const START_NS: i64 = MIDNIGHT_NS + (7 * 60 + 44) * 60 * SECOND;

#[test]
fn sample_has_what_its_description_says() {
    let Some(path) = sample::file("tanker.nmea") else { return };
    assert_eq!(detect(&path).expect("a file"), Some(Format::Nmea));
    let log = Recorder::of(&path).expect("a log");
    let counts = [
        ("ROT", 2400),
        ("RSA", 2400),
        ("HDT", 5998),
        ("GGA", 1176),
        ("RMC", 1176),
        ("VTG", 1176),
        ("RPM", 600),
    ];
    assert_eq!(log.topics.len(), counts.len(), "{:?}", log.names());
    for (topic, count) in counts {
        assert_eq!(log.count(topic), count, "{topic}");
        assert_eq!(log.topic(topic).clock, Clock::Utc);
        assert!(log.get(topic).rows.iter().all(|row| row.1.is_none()));
    }
    let first = |topic: &str, field: &str| log.column(topic, field)[0];
    assert_eq!(log.stamps("ROT")[..2], [START_NS, START_NS + SECOND / 2]);
    assert_eq!(log.stamps("RSA")[0], START_NS + 3_000_000);
    assert_eq!(log.stamps("GGA")[0], START_NS + 917_000_000);
    let expected = [
        ("ROT", "rate", -0.2, Some("deg/min")),
        ("ROT", "valid", 1.0, None),
        ("RSA", "starboard", 0.0, Some("deg")),
        ("RSA", "starboard_valid", 1.0, None),
        ("RSA", "port", f64::NAN, Some("deg")),
        ("RSA", "port_valid", 0.0, None),
        ("HDT", "heading", 211.2, Some("deg")),
        ("GGA", "utc_s", 27_840.92, Some("s")),
        ("GGA", "latitude", 1.0 + 11.395_626 / 60.0, Some("deg")),
        ("GGA", "longitude", 103.0 + 54.658_35 / 60.0, Some("deg")),
        ("GGA", "quality", 1.0, None),
        ("GGA", "satellites", 9.0, None),
        ("GGA", "hdop", 0.9, None),
        ("GGA", "altitude", 38.0, Some("m")),
        ("GGA", "geoid_separation", 7.2, Some("m")),
        ("GGA", "age", f64::NAN, Some("s")),
        ("RMC", "utc_s", 27_840.92, Some("s")),
        ("RMC", "valid", 1.0, None),
        ("RMC", "latitude", 1.0 + 11.395_626 / 60.0, Some("deg")),
        ("RMC", "sog", 9.03, Some("kn")),
        ("RMC", "cog", 201.1, Some("deg")),
        ("RMC", "variation", f64::NAN, Some("deg")),
        ("VTG", "cog", 201.1, Some("deg")),
        ("VTG", "cog_magnetic", f64::NAN, Some("deg")),
        ("VTG", "sog", 9.03, Some("kn")),
        ("VTG", "sog_kmh", 16.72, Some("km/h")),
        ("RPM", "number", 1.0, None),
        ("RPM", "speed", 80.0, Some("rpm")),
        ("RPM", "pitch", 100.0, Some("%")),
        ("RPM", "valid", 1.0, None),
    ];
    for (topic, field, value, unit) in expected {
        let read = first(topic, field);
        assert!(read == value || read.is_nan() && value.is_nan(), "{topic}.{field}: {read}");
        assert_eq!(log.unit(topic, field), unit, "{topic}.{field}");
    }
    for topic in ["GGA", "RMC"] {
        for (stamp, time) in log.stamps(topic).iter().zip(log.column(topic, "utc_s")) {
            let arrival = (stamp - MIDNIGHT_NS) as f64 / 1e9;
            assert!((arrival - time).abs() <= 0.010_001, "{topic}: {time} s arrives at {arrival} s");
        }
    }
    // Lines 2132, 2985 and 7476, with CR LF.
    let reasons: Vec<&str> = log.summary.losses.iter().map(|loss| &loss.reason[..]).collect();
    assert_eq!(
        reasons,
        ["a sentence with a wrong checksum", "a sentence that is cut", "bytes that are not text"]
    );
    assert_eq!(log.summary.lost_parts, 3);
    let bytes = fs::read(&path).expect("a file");
    let lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
    for (loss, line) in log.summary.losses.iter().zip([2132, 2985, 7476]) {
        let before: usize = lines[..line].iter().map(|line| line.len()).sum();
        assert_eq!((loss.offset, loss.bytes), (before as u64, lines[line].len() as u64), "line {line}");
    }
    assert_eq!(log.summary.notes, ["sentences that are not read, with their numbers: AIVDM 1, PXDR 1"]);
}

#[test]
fn first_lines_are_those_of_the_description() {
    let (Some(path), Some(expected)) = (sample::file("tanker.nmea"), sample::file("expected.json")) else {
        return;
    };
    let expected: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(expected).expect("a file")).expect("JSON");
    let lines: Vec<&str> =
        expected["first_nmea"].as_array().expect("lines").iter().filter_map(|line| line.as_str()).collect();
    assert_eq!(lines.len(), 12);
    let few = Recorder::of_bytes(lines.join("\r\n").as_bytes()).expect("a log");
    let log = Recorder::of(&path).expect("a log");
    for topic in few.names() {
        for field in &few.topic(topic).fields {
            let (some, all) = (few.column(topic, &field.name), log.column(topic, &field.name));
            let same = some.iter().zip(&all).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
            assert!(same && !some.is_empty(), "{topic}.{}", field.name);
        }
    }
    assert_eq!(few.all(), 12);
    assert_eq!(few.stamps("RMC"), [START_NS + 920_000_000], "time and date of the sentence");
}

#[test]
fn rows_that_are_not_wanted_are_not_given() {
    let Some(path) = sample::file("tanker.nmea") else { return };
    let log = Recorder::without(&path, &["HDT"]).expect("a log");
    assert_eq!((log.count("HDT"), log.count("ROT")), (0, 2400));
}

/// A sentence with its checksum.
fn sentence(body: &str) -> String {
    format!("${body}*{:02X}", body.bytes().fold(0, |sum, byte| sum ^ byte))
}

/// A file with a sentence in each line, behind what is in front of `|`.
fn file(lines: &[&str]) -> Recorder {
    let mut text = String::new();
    for line in lines {
        let (front, body) = line.split_once('|').unwrap_or(("", line));
        writeln!(text, "{front}{}\r", sentence(body)).expect("memory");
    }
    Recorder::of_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"))
}

#[test]
fn all_sentences_are_read() {
    let nan = f64::NAN;
    let cases: &[(&str, &[(&str, f64)])] = &[
        ("HEHDM,12.5,M", &[("heading", 12.5)]),
        ("HEHDG,12.5,1.5,W,3.25,E", &[("heading", 12.5), ("deviation", -1.5), ("variation", 3.25)]),
        ("HEHDG,12.5,,,,", &[("heading", 12.5), ("deviation", nan), ("variation", nan)]),
        ("HETHS,12.5,A", &[("heading", 12.5), ("valid", 1.0)]),
        ("HETHS,,V", &[("heading", nan), ("valid", 0.0)]),
        ("TIROT,,V", &[("rate", nan), ("valid", 0.0)]),
        (
            "AGRSA,-3.5,A,4.5,A",
            &[("starboard", -3.5), ("starboard_valid", 1.0), ("port", 4.5), ("port_valid", 1.0)],
        ),
        ("ERRPM,E,2,-85.5,-10,V", &[("number", 2.0), ("speed", -85.5), ("pitch", -10.0), ("valid", 0.0)]),
        (
            "GPZDA,010203.5,16,04,2026,00,00",
            &[("utc_s", 3723.5), ("day", 16.0), ("month", 4.0), ("year", 2026.0)],
        ),
        (
            "GPGLL,3330.0,S,07045.0,W,010203,A,A",
            &[("latitude", -33.5), ("longitude", -70.75), ("utc_s", 3723.0), ("valid", 1.0)],
        ),
        ("GPGLL,,,,,010203,V", &[("latitude", nan), ("longitude", nan), ("valid", 0.0)]),
        (
            "VWVHW,10.5,T,11,M,5.5,N,10.2,K",
            &[("heading", 10.5), ("heading_magnetic", 11.0), ("speed", 5.5), ("speed_kmh", 10.2)],
        ),
        (
            "VDVBW,5.5,-0.5,A,6.5,0.25,V,0.75,A,,V",
            &[
                ("water_ahead", 5.5),
                ("water_starboard", -0.5),
                ("water_valid", 1.0),
                ("ground_ahead", 6.5),
                ("ground_starboard", 0.25),
                ("ground_valid", 0.0),
                ("water_starboard_stern", 0.75),
                ("water_stern_valid", 1.0),
                ("ground_starboard_stern", nan),
                ("ground_stern_valid", 0.0),
            ],
        ),
        ("WIMWV,33.5,R,3.6,K,A", &[("angle", 33.5), ("speed", 1.0), ("valid", 1.0)]),
        ("WIMWV,33.5,R,3600,N,A", &[("speed", 1852.0)]),
        ("WIMWV,33.5,R,4.5,M,V", &[("speed", 4.5), ("valid", 0.0)]),
        ("SDDBT,32.8,f,10.0,M,5.5,F", &[("depth", 10.0)]),
        ("SDDPT,10.5,-0.5,100", &[("depth", 10.5), ("offset", -0.5), ("range", 100.0)]),
        (
            "GNGNS,010203.00,0111.5,N,10354.0,E,RR,17,0.7,41.5,7.25,1.0,0000,S",
            &[
                ("utc_s", 3723.0),
                ("latitude", 1.0 + 11.5 / 60.0),
                ("longitude", 103.9),
                ("satellites", 17.0),
                ("hdop", 0.7),
                ("altitude", 41.5),
                ("geoid_separation", 7.25),
                ("age", 1.0),
            ],
        ),
        (
            "GPGST,010203,1.5,2.5,3.5,45,0.5,0.6,0.7",
            &[
                ("rms", 1.5),
                ("semi_major", 2.5),
                ("semi_minor", 3.5),
                ("orientation", 45.0),
                ("latitude_error", 0.5),
                ("longitude_error", 0.6),
                ("altitude_error", 0.7),
            ],
        ),
    ];
    for (line, fields) in cases {
        let log = file(&[line]);
        let topic = &line[2..5];
        assert_eq!(log.names(), [topic]);
        for (field, value) in *fields {
            let read = log.column(topic, field)[0];
            assert!(read == *value || read.is_nan() && value.is_nan(), "{line}: {field} {read}");
        }
        assert_eq!(log.summary.losses, []);
    }
}

#[test]
fn times_of_arrival_have_many_forms() {
    let at = START_NS + 250_000_000;
    let fronts = [
        ("2026-04-16T07:44:00.250Z ", at, false),
        ("2026-04-16T07:44:00,25Z,", at, false),
        ("2026-04-16 07:44:00.250000000 ", at, true),
        ("2026/04/16 07:44:00.25;", at, true),
        ("[2026-04-16T09:44:00.25+02:00] ", at, false),
        ("2026-04-16T02:14:00.25-0530 ", at, false),
        ("2026-04-16T09:44:00.25+02 ", at, false),
        ("1776325440.25 ", at, false),
        ("1776325440250,", at, false),
        ("1776325440250000 ", at, false),
        ("1776325440250000000 ", at, false),
        ("\\s:r1,c:1776325440250*00\\", at, false),
        ("\\g:1-2-34,c:1776325440*00\\", START_NS, false),
    ];
    for (front, stamp, noted) in fronts {
        let log = file(&[&format!("{front}|HEHDT,1.5,T")]);
        assert_eq!((log.stamps("HDT"), log.topic("HDT").clock), (vec![stamp], Clock::Utc), "{front}");
        assert_eq!(!log.summary.notes.is_empty(), noted, "{front}: {:?}", log.summary.notes);
    }
    for front in [
        "17 ",
        "COM3: ",
        "2026-04-31T07:44:00Z ",
        "2026-04-16T25:44:00Z ",
        "9999999999999 ",
        "9999999999999999999 ",
    ] {
        let log = file(&[&format!("{front}|HEHDT,1.5,T")]);
        assert_eq!((log.stamps("HDT"), log.topic("HDT").clock), (vec![0], Clock::None), "{front}");
    }
}

#[test]
fn a_sentence_without_arrival_has_that_of_the_one_before() {
    let log = file(&["1776325440 |HEHDT,1,T", "HEHDT,2,T", "1776325441 |HEHDT,3,T"]);
    assert_eq!(log.stamps("HDT"), [START_NS, START_NS, START_NS + SECOND]);
    assert!(log.summary.notes[0].contains("without a time of arrival"));
    let log = file(&["HEHDT,2,T", "1776325440 |HEHDT,1,T", "1776325441 |HEHDT,3,T"]);
    assert_eq!(log.stamps("HDT"), [START_NS, START_NS + SECOND]);
    assert_eq!(log.summary.lost_parts, 1);
}

#[test]
fn midnight_is_passed() {
    let last = MIDNIGHT_NS - SECOND;
    let log = file(&[
        "HEHDT,1,T",
        "GPGGA,235959,0111.5,N,10354.0,E,1,09,0.9,38.0,M,7.2,M,,",
        "HEHDT,2,T",
        "GPGLL,0111.5,N,10354.0,E,000000.5,A",
        "HEHDT,3,T",
        "GPRMC,000001,A,0111.5,N,10354.0,E,9,201.1,160426,,,A",
        "GPGLL,0111.5,N,10354.0,E,235959.5,A",
        "GPZDA,000002,16,04,2026,00,00",
    ]);
    assert_eq!(log.stamps("HDT"), [last, last + 3 * SECOND / 4, MIDNIGHT_NS + SECOND / 2]);
    assert_eq!(log.stamps("GGA"), [last]);
    assert_eq!(log.stamps("GLL"), [MIDNIGHT_NS + SECOND / 2, MIDNIGHT_NS - SECOND / 2], "one comes late");
    assert_eq!(
        (log.stamps("RMC"), log.stamps("ZDA")),
        (vec![MIDNIGHT_NS + SECOND], vec![MIDNIGHT_NS + 2 * SECOND])
    );
    assert_eq!(log.topic("HDT").clock, Clock::Utc);
}

#[test]
fn without_date_stamps_are_from_midnight() {
    let log = file(&[
        "GPGLL,0111.5,N,10354.0,E,235959,A",
        "GPRMC,235959.5,V,,,,,,,010180,,,N",
        "HEHDT,1,T",
        "GPGLL,0111.5,N,10354.0,E,000001,A",
    ]);
    let day = 86_400 * SECOND;
    assert_eq!(
        (log.stamps("GLL"), log.stamps("HDT")),
        (vec![day - SECOND, day + SECOND], vec![day - SECOND / 2])
    );
    assert_eq!(log.topic("GLL").clock, Clock::Boot);
    assert!(log.summary.notes[0].contains("midnight"));
}

/// Nine of ten headings between two times had the stamp of another one, and were left out.
#[test]
fn sentences_that_are_faster_than_the_time_are_spread() {
    let fast = |first: &str| {
        let seconds = (0..3).flat_map(|k| {
            let time = first.replace("SS", &format!("0{k}"));
            std::iter::once(time).chain((0..10).map(move |i| format!("HEHDT,{}.{i},T", 10 * k)))
        });
        let sentences: Vec<String> = seconds.collect();
        let sentences: Vec<&str> = sentences.iter().map(String::as_str).collect();
        let log = file(&sentences);
        let steps = log.stamps("HDT").windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
        assert_eq!(steps, [SECOND / 10; 29], "{first}");
        log.summary.notes.join("; ")
    };
    for first in ["GPRMC,1200SS.0,V,,,,,,,010180,,,N", "GPGLL,0111.5,N,10354.0,E,1200SS,A"] {
        let notes = fast(first);
        assert!(notes.contains("27 of 30 sentences HDT") && notes.contains("time of arrival"), "{notes}");
    }
    let notes = file(&[
        "GPGLL,0111.5,N,10354.0,E,120000,A",
        "HEHDT,1,T",
        "GPGLL,0111.5,N,10354.0,E,120001,A",
        "HEHDT,1,T",
    ]);
    assert!(!notes.summary.notes.join("; ").contains("spread"));
    // Over a pause, and behind the last time, the step is that of before.
    let pause = file(&[
        "GPGLL,0111.5,N,10354.0,E,120000,A",
        "HEHDT,1,T",
        "HEHDT,2,T",
        "GPGLL,0111.5,N,10354.0,E,120001,A",
        "HEHDT,3,T",
        "HEHDT,4,T",
        "GPGLL,0111.5,N,10354.0,E,130000,A",
        "HEHDT,5,T",
        "HEHDT,6,T",
    ]);
    let steps = pause.stamps("HDT").windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
    assert_eq!(steps, [SECOND / 2, SECOND / 2, SECOND, 3598 * SECOND, SECOND]);
}

#[test]
fn topics_are_told_apart_by_talker_and_source() {
    let log = file(&[
        "HEHDT,1,T",
        "GPHDT,2,T",
        "HEHDT,3,T",
        "ERRPM,S,1,80,,A",
        "ERRPM,S,2,81,,A",
        "IIRPM,S,1,82,,A",
        "IIRPM,E,2,83,,A",
        "WIMWV,10,R,5,M,A",
        "WIMWV,20,T,4,M,A",
    ]);
    assert_eq!(log.names(), ["HDT", "HDT[GP]", "RPM", "RPM[S2]", "RPM[II]", "RPM[II E2]", "MWV", "MWV[T]"]);
    assert_eq!((log.column("HDT", "heading"), log.column("HDT[GP]", "heading")), (vec![1.0, 3.0], vec![2.0]));
}

/// `libais_types.nmea`, in which each line is whole, was refused.
#[test]
fn fields_behind_the_checksum_belong_to_the_receiver() {
    let text =
        "!AIVDM,1,1,,A,15N1u<PP1FJuvSRHOE6QIwwh0HQ6,0*30,d-080,S2118,t050056.00,r003669946,1325394001\n";
    let log = Recorder::of_bytes(text.as_bytes()).expect("a log");
    assert_eq!(log.summary.lost_parts, 0);
    assert_eq!(log.summary.notes[0], "sentences that are not read, with their numbers: AIVDM 1");
    let cut = Recorder::of_bytes(text.replace("*30,", "*3,").as_bytes());
    assert!(cut.is_err(), "{:?}", cut.map(|log| log.summary));
}

#[test]
fn sentences_without_checksum_are_read() {
    let text = "$HEHDT,1.5,T\n$HEHDT,2\n$GPGGA,074400,0111.5,N\n$HEROT,2.5,A\n";
    let log = Recorder::of_bytes(text.as_bytes()).expect("a log");
    assert_eq!((log.column("HDT", "heading"), log.column("ROT", "rate")), (vec![1.5], vec![2.5]));
    assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (1, 9 + 23), "{:?}", log.summary);
    // A talker that sends checksums sends none without.
    let text = format!("{}\n$HEHDT,2.5,T\n$HEROT,2.5,A\n$HEROT,3.5,A", sentence("HEHDT,1.5,T"));
    let log = Recorder::of_bytes(text.as_bytes()).expect("a log");
    assert_eq!((log.column("HDT", "heading"), log.column("ROT", "rate")), (vec![1.5], vec![2.5]));
    assert_eq!(log.summary.lost_bytes, 13 + 12, "the last line may be cut");
}

#[test]
fn lines_that_are_damaged_are_lost() {
    let good = sentence("HEHDT,1.5,T");
    let bad = [
        "$HEHDT,1.6,T*00",
        "$HEHDT,1.6,T*7",
        "$HEHDT,1.6,T*7X",
        "$HEHDT,1.6,T*2B$HEHDT,1.7,T*2A",
        "no sentence",
        "$,1,2",
        "$HE\u{1}DT,1.6,T",
        &"x".repeat(5000),
        &format!("{}{good}", " ".repeat(1 << 21)),
    ];
    for bad in bad {
        let text = format!("{good}\n{good}\n{bad}\n{good}\n\n");
        let log = Recorder::of_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(log.column("HDT", "heading"), [1.5; 3], "{bad:.60}");
        assert_eq!((log.summary.lost_parts, log.summary.lost_bytes), (1, bad.len() as u64 + 1), "{bad:.60}");
    }
}

#[test]
fn other_sentences_are_counted() {
    let log = file(&["HEHDT,1,T", "GPGSV,1,1,00", "GPGSV,1,1,00", "PASHR,1,2", "GPXYZW,1"]);
    let text = "sentences that are not read, with their numbers: GPGSV 2, GPXYZW 1, PASHR 1";
    assert!(log.summary.notes.contains(&text.to_owned()), "{:?}", log.summary.notes);
    assert_eq!(log.summary.losses, []);
}

#[test]
fn tables_are_not_taken_for_sentences() {
    let tables: [&str; 5] = [
        "time,heading\n1,2\n2,3\n",
        "time,price\n1,$5\n2,$6\n",
        "$GPHDT,one line,of three\n1,2\n2,3\n",
        "a,b\n$12,!13\n",
        "\n\n",
    ];
    for table in tables {
        assert!(matches!(Recorder::of_bytes(table.as_bytes()), Err(IoError::Unknown { .. })), "{table}");
    }
    assert!(matches!(Recorder::of_bytes(b"$HEHDT,1,T*00\n"), Err(IoError::Damaged { .. })));
    let log = file(&["HEHDT,1,T"]);
    assert_eq!((log.count("HDT"), log.topic("HDT").clock), (1, Clock::None));
}

#[test]
fn a_cut_sample_gives_its_first_rows() {
    let Some(path) = sample::file("tanker.nmea") else { return };
    truncated(&fs::read(path).expect("a file"), 5000);
    let Some(path) = sample::file("tanker.nmea") else { return };
    truncated(&fs::read(path).expect("a file")[..100_000], 1000);
}

#[test]
fn flipped_bytes_cost_little() {
    let Some(path) = sample::file("tanker.nmea") else { return };
    // A flipped end of a line costs two.
    flipped(&fs::read(path).expect("a file"), 0, Some(14_886)..=Some(14_926));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Fields of any text, with the right checksum.
    #[test]
    fn any_fields_are_survived(
        front in "[0-9T:Z. c\\\\,+-]{0,30}",
        formatter in "HDT|HDG|GGA|RMC|GLL|ZDA|MWV|RPM|VBW|GST",
        fields in prop::collection::vec("[0-9.NSEWAVKMT-]{0,20}", 0..25),
    ) {
        let line = format!("{front}{}\n", sentence(&format!("GP{formatter},{}", fields.join(","))));
        let log = survives(line.repeat(3).as_bytes()).expect("a log");
        prop_assert_eq!(log.all(), 3, "{}", line);
    }
}
