//! Formats that are recognised and not read: their names, and what to do.

use crate::formats::time::DAY;

const UNPACK: &str = "unpack it, and give the file inside";
const EXPORT: &str = "export its channels as CSV with a header and a column of time";

/// First bytes of a format, its name, and the remedy.
const SIGNATURES: [(&[u8], &str, &str); 9] = [
    (b"\x1f\x8b", "compressed by gzip", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed by Zstandard", UNPACK),
    (b"BZh", "compressed by bzip2", UNPACK),
    (b"\xfd7zXZ\0", "compressed by xz", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file (also MATLAB 7.3)", EXPORT),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file", EXPORT),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (.xls)", "save it as XLSX or CSV"),
];

/// Name and remedy of a format by the first bytes of a file.
pub(crate) fn named(head: &[u8]) -> Option<(&'static str, &'static str)> {
    let signature = SIGNATURES.iter().find(|(magic, ..)| head.starts_with(magic));
    if let Some(&(_, what, remedy)) = signature {
        return Some((what, remedy));
    }
    let text = head.trim_ascii_start();
    let begins = |word: &[u8]| text.len() >= word.len() && text[..word.len()].eq_ignore_ascii_case(word);
    if begins(b"<?xml") || begins(b"<gpx") {
        let is_gpx = memchr::memmem::find(head, b"<gpx").is_some();
        return Some((if is_gpx { "GPX" } else { "XML" }, EXPORT));
    }
    if begins(b"<!doctype html") || begins(b"<html") {
        return Some(("a web page", "download the file itself, not the page that shows it"));
    }
    if is_candump(text.split(|byte| *byte == b'\n').next().unwrap_or_default()) {
        let remedy = "decode it first, for NMEA 2000 to NMEA 0183 or CSV with the programs of canboat";
        return Some(("a dump of a CAN bus (candump)", remedy));
    }
    is_telemetry(head).then_some((
        "a telemetry log of MAVLink (.tlog)",
        "take the log of the autopilot itself (.BIN, .ulg), or export it as CSV with mavlogdump.py",
    ))
}

/// `(1659169701.000000) can0 09F80101#FF0081B877FAFF`
fn is_candump(line: &[u8]) -> bool {
    let mut words = line.split(|byte| *byte == b' ').filter(|word| !word.is_empty());
    let stamp =
        words.next().and_then(|word| word.strip_prefix(b"(")).and_then(|word| word.strip_suffix(b")"));
    let is_stamp = stamp.is_some_and(|stamp| stamp.iter().all(|byte| byte.is_ascii_digit() || *byte == b'.'));
    is_stamp && words.nth(1).is_some_and(|frame| frame.contains(&b'#'))
}

/// Microseconds since 1970 in eight bytes, most significant first, and the first byte of a frame.
fn is_telemetry(head: &[u8]) -> bool {
    let Some((stamp, rest)) = head.split_first_chunk::<8>() else { return false };
    let day = u64::from_be_bytes(*stamp) / 1_000_000 / DAY.unsigned_abs();
    matches!(rest.first(), Some(0xfd | 0xfe)) && (10_957..47_482).contains(&day)
}
