//! Workbooks: one of openpyxl, packages written here, and damaged ones.

use std::fs;
use std::io::{Cursor, Write};

use hydroid_io::{Clock, IoError};
use proptest::prelude::*;
use proptest::sample::Index;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::golden::{golden, same};
use crate::recorder::{Recorder, survives};

const START: i64 = 1_775_547_840_000_000_000;

#[test]
fn a_workbook_of_openpyxl_is_read() {
    let book = Recorder::of(&golden("book.xlsx")).expect("a workbook");
    let names: Vec<&str> = book.names();
    assert_eq!(names, ["gnss", "imu & more", "iso", "rows"]);
    assert_eq!(book.summary.losses, []);
    assert!(book.summary.notes.iter().any(|note| note.contains("'notes'")), "{:?}", book.summary.notes);

    assert_eq!(book.topics[0].topic.clock, Clock::Utc);
    assert_eq!(book.topics[0].topic.texts, [("mode".to_owned(), "auto".to_owned())]);
    assert_eq!(
        (book.topics[0].unit("lat"), book.topics[0].unit("sog"), book.topics[0].unit("fix")),
        (Some("deg"), Some("kn"), None)
    );
    assert_eq!(book.topics[0].rows.len(), 120);
    let [lat, sog, fix, quality] = ["lat", "sog", "fix", "quality"].map(|field| book.topics[0].column(field));
    for i in 0..120 {
        let n = i as f64;
        assert_eq!(book.topics[0].table()[i].0, START + 1_000_000 * (769 + 200 * i64::try_from(i).unwrap()));
        assert!((lat[i] - (63.44 + n * 1e-6)).abs() < 1e-12);
        assert!(same(sog[i], if i % 10 == 9 { f64::NAN } else { 1.25 * n }));
        assert_eq!(fix[i], if i % 2 == 0 { 1.0 } else { 0.0 });
        // The cell G10 holds an error.
        assert!(same(quality[i], if i == 5 { f64::NAN } else { 4.0 }));
    }

    assert_eq!(book.topics[1].topic.clock, Clock::Boot);
    assert_eq!(
        ["t", "wz", "acc_x", "clock", "day"].map(|field| book.topics[1].unit(field)),
        [Some("s"), Some("rad/s"), Some("m/s2"), Some("s"), Some("s")]
    );
    assert_eq!(book.topics[1].rows.len(), 60);
    for (i, (stamp, values)) in book.topics[1].table().iter().enumerate() {
        let n = i as f64;
        assert_eq!(*stamp, 20_000_000 * i64::try_from(i).unwrap());
        assert!((values[1] + 0.00255 * n).abs() < 1e-12);
        assert_eq!(values[2..], [-0.402, 7.0 * 3600.0 + 44.0 * 60.0 + n, 1_775_520_000.0]);
    }

    assert_eq!(
        book.topics[2].table(),
        [(START + 3_000_000, vec![1824.0]), (START + 111_000_000, vec![1884.0])]
    );
    assert_eq!(book.topics[2].unit("servo"), Some("us"));
    assert_eq!(book.topics[3].topic.clock, Clock::None);
    assert_eq!(book.topics[3].table(), [(0, vec![1.0, 2.0]), (1, vec![3.0, 4.0])]);
}

/// A package with these parts.
fn package(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in parts {
        zip.start_file(*name, SimpleFileOptions::default()).expect("a part");
        zip.write_all(content.as_bytes()).expect("its content");
    }
    zip.finish().expect("a package").into_inner()
}

const LINKS: &str =
    r#"<Relationships><Relationship Id="a" Type="x/worksheet" Target="/xl/s.xml"/></Relationships>"#;

/// A workbook with one sheet; `extra` are more parts, or others.
fn workbook(rows: &str, properties: &str, extra: &[(&str, &str)]) -> Vec<u8> {
    let book = format!(r#"<workbook>{properties}<sheets><sheet name="log" r:id="a"/></sheets></workbook>"#);
    let sheet = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
    let parts = [("xl/workbook.xml", &*book), ("xl/_rels/workbook.xml.rels", LINKS), ("xl/s.xml", &sheet)];
    package(&[&parts, extra].concat())
}

fn texts(names: &[&str]) -> String {
    let cell = |name: &&str| format!(r#"<c t="inlineStr"><is><t>{name}</t></is></c>"#);
    format!("<row>{}</row>", names.iter().map(cell).collect::<String>())
}

fn one(bytes: &[u8]) -> Recorder {
    let tables = Recorder::of_bytes(bytes).expect("a workbook");
    assert_eq!(tables.topics.len(), 1, "{:?}", tables.summary);
    tables
}

#[test]
fn a_remark_does_not_replace_the_header() {
    let numbers = |k: u32| format!("<row>{}</row>", format!("<c><v>{k}</v></c>").repeat(3));
    let rows = |before: &str, after: &str| {
        workbook(
            &[before, &texts(&["t [s]", "u [m/s]", "n [rpm]"]), after, &numbers(1), &numbers(2)].concat(),
            "",
            &[],
        )
    };
    let remark = "<row><c t=\"inlineStr\"><is><t>target:</t></is></c><c><v>3.6</v></c></row>";
    for (before, after) in [
        ("", ""),
        ("", &*texts(&["target:"])),
        ("", &*texts(&["gusts", "from W"])),
        (&*texts(&["trial 7", "calm"]), ""),
    ] {
        let book = one(&rows(before, after));
        assert_eq!(book.topics[0].unit("n"), Some("rpm"), "{before} {after}");
        assert_eq!(book.topics[0].table().len(), 2, "{before} {after}");
    }
    assert_eq!(one(&rows(remark, "")).topics[0].unit("u"), Some("m/s"));
}

#[test]
fn cells_without_a_place_count_on_and_entities_are_letters() {
    let rows = texts(&["a &lt;b&#62; [m/s]", "c"])
        + "<row><c><v>1</v></c><c><f>A1+1</f><v>2</v></c></row><row/>"
        + r#"<row r="9"><c r="B9"><v>4e-1</v></c></row><row><c t="b"><v>1</v></c><c t="e"><v>#REF!</v></c></row>"#;
    let tables = one(&workbook(&rows, "", &[]));
    assert_eq!(tables.topics[0].unit("a <b>"), Some("m/s"));
    assert_eq!(tables.topics[0].column("a <b>")[0], 1.0);
    assert!(tables.topics[0].column("a <b>")[1].is_nan());
    assert_eq!(tables.topics[0].column("a <b>")[2], 1.0);
    let c = tables.topics[0].column("c");
    assert_eq!(c[..2], [2.0, 0.4]);
    assert!(c[2].is_nan());
}

#[test]
fn formats_tell_dates_from_numbers() {
    let styles = |code: &str| {
        format!(
            r#"<styleSheet><numFmts><numFmt numFmtId="200" formatCode="{code}"/></numFmts>
            <cellStyleXfs><xf numFmtId="14"/></cellStyleXfs>
            <cellXfs><xf numFmtId="0"/><xf numFmtId="200"/><xf numFmtId="22"/><xf numFmtId="47"/></cellXfs></styleSheet>"#
        )
    };
    let rows = |style: u32| {
        texts(&["when", "x"])
            + &format!(r#"<row><c s="{style}"><v>46119.5</v></c><c s="0"><v>1</v></c></row>"#)
            + &format!(r#"<row><c s="{style}"><v>46120.25</v></c><c><v>2</v></c></row>"#)
    };
    let day = 86_400_000_000_000;
    let dates = vec![(46_119 - 25_569) * day + day / 2, (46_120 - 25_569) * day + day / 4];
    for (code, style, expected) in [
        ("yyyy\\-mm\\-dd", 1, Some(&dates)),
        ("[$-409]mmm;@", 1, Some(&dates)),
        ("0", 2, Some(&dates)),
        ("0.00&quot; days&quot;", 1, None),
        ("0_d\\d*y", 1, None),
        ("[Red]General", 1, None),
        ("0;d", 1, None),
        ("0", 0, None),
    ] {
        let tables = one(&workbook(&rows(style), "", &[("xl/styles.xml", &styles(code))]));
        let stamps: Vec<i64> = tables.topics[0].table().iter().map(|row| row.0).collect();
        assert_eq!(stamps, expected.map_or(vec![0, 1], Clone::clone), "{code}");
    }
    // A duration is a number of seconds.
    for (code, style) in [("[h]:mm:ss", 1), ("0", 3)] {
        let tables = one(&workbook(&rows(style), "", &[("xl/styles.xml", &styles(code))]));
        assert_eq!(tables.topics[0].column("when"), [46_119.5 * 86_400.0, 46_120.25 * 86_400.0]);
        assert_eq!(tables.topics[0].unit("when"), Some("s"));
    }
    let tables =
        one(&workbook(&rows(2), r#"<workbookPr date1904="1"/>"#, &[("xl/styles.xml", &styles("0"))]));
    assert_eq!(tables.topics[0].table()[0].0, dates[0] + 1462 * day);
}

#[test]
fn texts_are_dates_only_if_the_day_exists() {
    for (day, date) in [
        ("2026-02-28", true),
        ("2024-02-29", true),
        ("2026-02-29", false),
        ("2026-02-30", false),
        ("2026-02-31", false),
        ("2026-04-31", false),
        ("2026-13-01", false),
    ] {
        for (time, valid) in
            [("", true), ("T07:44:00Z", true), (" 24:00", true), ("T24:01", false), ("T07:44x", false)]
        {
            let rows = texts(&["time", "u"])
                + &format!(r#"<row><c t="str"><v>{day}{time}</v></c><c><v>1</v></c></row>"#)
                + r#"<row><c t="str"><v>2026-05-01</v></c><c><v>2</v></c></row>"#;
            let clock = one(&workbook(&rows, "", &[])).topics[0].topic.clock;
            assert_eq!(clock == Clock::Utc, date && valid, "{day}{time}");
        }
    }
}

#[test]
fn shared_strings_may_be_rich() {
    let strings = "<sst uniqueCount=\"18446744073709551615\"><si><t>t</t></si><si/>\
                   <si><r><t>u</t></r><r><t> [m/s]</t></r><rPh><t>no</t></rPh></si></sst>";
    let rows = r#"<row><c t="s"><v>0</v></c><c t="s"><v>2</v></c><c t="s"><v>99</v></c></row>
                  <row><c><v>1.5</v></c><c><v>3</v></c></row>"#;
    let tables = one(&workbook(rows, "", &[("xl/sharedStrings.xml", strings)]));
    assert_eq!(tables.topics[0].table(), [(1_500_000_000, vec![1.5, 3.0])]);
    assert_eq!(tables.topics[0].unit("u"), Some("m/s"));
}

#[test]
fn places_beyond_the_sheet_are_left_out() {
    let far = r#"<row r="4294967295"><c r="A1"><v>1</v></c><c r="XFE1"><v>2</v></c><c r="ZZZZZZZZ9"><v>3</v></c></row>"#;
    let tables = one(&workbook(&(texts(&["u"]) + far), "", &[]));
    assert_eq!(tables.topics[0].table(), [(0, vec![1.0])]);
    let last = r#"<row><c r="A1"><v>1</v></c><c r="XFD1"><v>2</v></c></row>"#.repeat(100);
    assert_eq!(one(&workbook(&(texts(&["u"]) + &last), "", &[])).topics[0].rows.len(), 100);
}

fn refused(bytes: &[u8], reason: &str) {
    let error = Recorder::of_bytes(bytes).expect_err(reason);
    assert!(matches!(error, IoError::Damaged { .. }), "{error}");
    assert!(error.to_string().contains(reason), "{error}");
}

#[test]
fn bombs_are_refused() {
    let row = texts(&["u"]);
    // Rows without end, in a part of some kilobytes.
    let rows = row.clone() + "<row><c><v>1</v></c></row>" + &"<row></row>".repeat(4 << 20);
    refused(&workbook(&rows, "", &[]), "more than the 1048576 rows");
    // A text without end, a tag without end.
    refused(&workbook(&(row.clone() + &"x".repeat(2 << 20)), "", &[]), "unpacks to far more");
    refused(&workbook(&format!("{row}<c r=\"{}\"/>", "x".repeat(2 << 20)), "", &[]), "unpacks to far more");
    // Sheets with the same part, none of which is long for itself.
    let name = |i: usize| format!(r#"<sheet name="{i}" r:id="a"/>"#);
    let book = format!("<workbook><sheets>{}</sheets></workbook>", (0..64).map(name).collect::<String>());
    let rows = row.clone() + "<row><c><v>1</v></c></row>" + &"<row></row>".repeat(1 << 15);
    let sheet = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
    let parts = [("xl/workbook.xml", &*book), ("xl/_rels/workbook.xml.rels", LINKS), ("xl/s.xml", &sheet)];
    refused(&package(&parts), "unpacks to far more");
    let strings = format!("<sst>{}</sst>", "<si><t>mode</t></si>".repeat(2 << 20));
    refused(&workbook(&row, "", &[("xl/sharedStrings.xml", &strings)]), "unpacks to far more");
}

/// 30 million rows were read for 26 s until they were refused.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn more_rows_than_a_workbook_has_are_refused() {
    let first = texts(&["u"]) + "<row><c><v>1</v></c></row>";
    for more in ["<row/>", "<row></row>", "<row spans=\"1:1\"></row>"] {
        let rows = first.clone() + &more.repeat(1_048_576);
        refused(&workbook(&rows, "", &[]), "more than the 1048576 rows of a workbook");
    }
}

#[test]
fn other_files_say_what_they_are() {
    refused(&package(&[("mimetype", "application/vnd.oasis.opendocument.spreadsheet")]), "holds no workbook");
    refused(&package(&[("xl/workbook.xml", "<html/>")]), "holds no workbook");
    refused(b"PK\x03\x04", "not whole");
    assert!(matches!(Recorder::of_bytes(b""), Err(IoError::Empty { .. })));
    let mut many = workbook(&texts(&["u"]), "", &[]);
    let at = many.len() - 10;
    many[at..at + 4].copy_from_slice(&[255; 4]);
    refused(&many, "more parts");
    let bytes = fs::read(golden("book.xlsx")).expect("a file");
    for size in (1000..bytes.len()).step_by(1000) {
        refused(&bytes[..size], "not whole");
    }
}

#[test]
fn a_damaged_sheet_is_a_loss() {
    let rows = texts(&["u"]) + &"<row><c><v>1</v></c></row>".repeat(60);
    let tables = one(&workbook(&(rows.clone() + "<row><c></row>"), "", &[]));
    assert_eq!(tables.topics[0].rows.len(), 60);
    assert_eq!(tables.summary.lost_parts, 1);
    assert!(tables.summary.losses[0].reason.contains("behind row 61"), "{:?}", tables.summary);
    // The content is another than that of the checksum, which is 16 bytes behind the mark of its directory entry.
    let mut bytes = workbook(&rows, "", &[]);
    let name = bytes.windows(8).rposition(|window| window == b"xl/s.xml").expect("the entry of the sheet");
    bytes[name - 46 + 16] ^= 1;
    let tables = one(&bytes);
    assert_eq!(tables.topics[0].rows.len(), 60);
    assert_eq!(tables.summary.lost_parts, 1, "{:?}", tables.summary);
    // The length of the name of the part, 26 bytes behind its mark, says that the part is outside of the file.
    let mut bytes = workbook(&rows, "", &[]);
    let name = bytes.windows(8).position(|window| window == b"xl/s.xml").expect("the sheet");
    bytes[name - 30 + 26..name - 30 + 28].fill(0xff);
    assert_eq!(survives(&bytes).expect("a workbook").summary.lost_parts, 1);
}

/// A part may be cut before it is packed, so that its checksum is right.
#[test]
fn parts_that_are_cut_are_stated() {
    let rows = texts(&["t", "u"]) + &"<row><c><v>1</v></c><c><v>2</v></c></row>".repeat(60);
    let whole = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
    for end in ["</row></sheetData></worksheet>", "</sheetData></worksheet>", "</worksheet>"] {
        let cut = &whole[..whole.len() - end.len()];
        let book = r#"<workbook><sheets><sheet name="log" r:id="a"/></sheets></workbook>"#;
        let bytes =
            package(&[("xl/workbook.xml", book), ("xl/_rels/workbook.xml.rels", LINKS), ("xl/s.xml", cut)]);
        let tables = one(&bytes);
        assert!(tables.topics[0].rows.len() >= 59, "{end}");
        assert_eq!(tables.summary.lost_parts, 1, "{end}");
        assert!(
            tables.summary.losses[0].reason.contains("'log' is damaged behind row"),
            "{:?}",
            tables.summary
        );
    }
    // A sheet without rows is whole.
    let empty = Recorder::of_bytes(&workbook("", "", &[])).expect("a workbook");
    assert_eq!((empty.topics.len(), empty.summary.lost_parts), (0, 0));
    refused(&workbook(&rows, "", &[("xl/sharedStrings.xml", "<sst><si><t>a</t></si>")]), "is damaged");
    refused(&workbook(&rows, "", &[("xl/styles.xml", "<styleSheet><cellXfs>")]), "is damaged");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn damaged_sheets_do_not_panic(flips in prop::collection::vec((any::<Index>(), 32..127_u8), 1..8)) {
        let sheet = texts(&["t", "u"]) + &r#"<row r="3"><c r="A3" s="1"><v>1.5</v></c><c t="b"><v>1</v></c></row>"#.repeat(60);
        let mut sheet = sheet.into_bytes();
        for (place, letter) in flips {
            let at = place.index(sheet.len());
            sheet[at] = letter;
        }
        survives(&workbook(&String::from_utf8(sheet).expect("letters"), "", &[]));
    }
}
