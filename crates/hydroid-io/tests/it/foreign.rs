//! Formats that are recognised and not read.

use hydroid_io::{IoError, LogFile, detect};

#[test]
fn formats_that_are_not_read_are_named() {
    let telemetry = [&1_659_169_701_000_000_u64.to_be_bytes()[..], &[0xfd, 9, 0, 0]].concat();
    for (head, words) in [
        (&b"\x1f\x8b\x08\0"[..], "gzip"),
        (b"\x28\xb5\x2f\xfd\x04", "Zstandard"),
        (b"<?xml version=\"1.0\"?>\n<gpx version=\"1.1\">", "GPX"),
        (b"\n<kml>", ""),
        (b"<?xml version=\"1.0\"?>\n<kml>", "XML"),
        (b"(1659169701.000000) can0 09F80101#FF0081B877FAFF\n", "candump"),
        (b"(1659169701.000000) u v r\n", ""),
        (b"<!DOCTYPE html>", "web page"),
        (&telemetry, "MAVLink"),
        (b"t,u,v\n0,1,2\n", ""),
    ] {
        match detect(LogFile::in_memory("log", head)) {
            Err(IoError::NotRead { what, .. }) => {
                assert!(!words.is_empty() && what.contains(words), "{what} {words}");
            }
            other => assert!(words.is_empty() && matches!(other, Ok(None)), "{other:?} {words}"),
        }
    }
}
