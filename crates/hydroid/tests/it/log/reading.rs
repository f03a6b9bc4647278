//! Forms of CSV files.

use super::{error_of, log};
use hydroid::log::{LogError, read, read_from};

fn read_error(text: &[u8]) -> String {
    error_of(read_from(text, "log.csv"))
}

#[test]
fn headers_give_names_and_units() {
    let log = log("t [s],u [m/s],rudder angle [deg],gap\n0,1,2,3\n");
    let names: Vec<(&str, Option<&str>)> =
        log.columns.iter().map(|c| (c.name.as_str(), c.unit.as_deref())).collect();
    assert_eq!(names, [("t", Some("s")), ("u", Some("m/s")), ("rudder angle", Some("deg")), ("gap", None)]);
    assert_eq!(log.lines.iter().collect::<Vec<_>>(), [2]);
}

#[test]
fn every_way_of_writing_a_table_is_the_same_table() {
    let plain = log("t,u\n0,1.5\n1,2.5\n");
    for text in [
        "\u{feff}t,u\n0,1.5\n1,2.5\n",
        "t,u\r\n0,1.5\r\n1,2.5\r\n",
        "t;u\n0;1.5\n1;2.5\n",
        "t;u\n0;1,5\n1;2,5\n",
        "t\tu\n0\t1.5\n1\t2.5\n",
        " t , u \n 0 , 1.5 \n 1 , 2.5 \n",
        "\"t\",\"u\"\n\"0\",\"1.5\"\n1,2.5\n",
        "\"t\",\"u\",\n0,1.5,\n1,2.5,\n",
        "t,u,,\n0,1.5\n1,2.5,,\n",
        "# t,u\n0,1.5\n1,2.5",
        "\n\nt,u\n0,1.5\n1,2.5\n\n",
    ] {
        let read = log(text);
        assert_eq!(read.columns, plain.columns, "{text:?}");
    }
}

#[test]
fn rows_may_omit_their_last_cells() {
    let log = log("t,u,rudder\n0,1\n1,2,3\n2,3\n");
    assert_eq!((log.short.first, log.short.count), (2, 2));
    assert_eq!(log.columns[2].values[1], 3.0);
    assert!(log.columns[2].values[0].is_nan() && log.columns[2].values[2].is_nan());
    let log = super::log("t;u;rudder\n0;1\n\n1;2\n3;4;5\n");
    assert_eq!((log.short.first, log.short.count), (2, 2));
    assert!(read_error(b"t;u;rudder\n0;1;2\n1;2\n").contains("line 3: 2 cells"));
    assert!(read_error(b"t,u\n0,1,2\n").contains("3 cells where the header names 2 columns"));
    assert!(read_error(b"t,u,n\n0,1,2\n1,2").contains("in the middle of a line"));
}

/// Titles with commas were taken for the header.
#[test]
fn title_lines_have_fewer_cells_than_the_rows() {
    let titles = "Sea trial of boat \"Möwe\", 3 May 2026\nWind: 2 Bft; crew: A, B\n\n";
    for table in [
        "Time [s],u [m/s],n\n0.0,1.5,3\n0.1,1.6,4\n0.2,1.7,3\n",
        "Time [s];u [m/s];n\n0,0;1,5;3\n0,1;1,6;4\n0,2;1,7;3\n",
        "t [s],u [m/s],n,remark\n0.0,1.5,3,\n0.1,1.6,4,start\n0.2,1.7,3,\n",
    ] {
        let with = log(&format!("{titles}{table}"));
        let without = log(table);
        let values = |log: &hydroid::log::RawLog| {
            format!("{:?}", log.columns.iter().map(|c| (&c.name, &c.values)).collect::<Vec<_>>())
        };
        assert_eq!(values(&with), values(&without));
        assert_eq!(with.lines.get(0), 5, "{table}");
    }
    // A first line with as many cells as the rows is the header.
    assert_eq!(log("t,u,n\ns,m/s,rps\n0.0,1.5,3\n0.1,1.6,4\n").columns[0].name, "t");
}

#[test]
fn title_lines_stand_above_the_header() {
    for text in ["---- log 1 ----\nt,u\n0,1\n", "Trial 7\n\ncalm\nt;u\n0;1,5\n", "a run\r\nt\tu\r\n0\t1\r\n"]
    {
        let log = log(text);
        assert_eq!(log.columns[1].name, "u", "{text:?}");
        assert_eq!(log.lines.iter().next(), Some(text.matches('\n').count() as u64), "{text:?}");
    }
    assert_eq!(log("u\n1\n2\n").columns[0].name, "u");
    assert!(read_error(b"u\n1\n2,5\n").contains("2 cells where the header names 1"));
}

#[test]
fn a_text_without_numbers_is_no_table() {
    for text in
        ["a letter\nof two lines\n", "Dear all,\nwe sailed, and\nit was, well, fine\n", "x,y\nleft,right\n"]
    {
        let error = read_error(text.as_bytes());
        assert!(error.contains("log.csv, line"), "{error}");
    }
    assert!(read_error(b"x,y\nleft,right\n").contains("no cell of the file is a number (`left`)"));
}

#[test]
fn lines_are_counted_as_an_editor_counts_them() {
    assert_eq!(log("\nt,u\n0,1\n\n1,2\n").lines.iter().collect::<Vec<_>>(), [3, 5]);
}

#[test]
fn missing_cells_are_nan() {
    let log = log("t,u\n0,\n1,NaN\n2,nan\n3,NA\n4,null\n5,-\n6,  \n7,1\n");
    let u = &log.columns[1];
    assert_eq!(u.values.iter().filter(|x| x.is_nan()).count(), 7);
    assert_eq!(u.bad, None);
}

#[test]
fn text_and_infinity_are_remembered() {
    let log = log("t,u,mode\n0,1,auto\n1,inf,hand\n2,1e999,hand\n");
    let bad = log.columns[1].bad.as_ref().unwrap();
    assert_eq!((bad.line, bad.text.as_str(), bad.infinite), (3, "inf", true));
    assert_eq!(log.columns[1].bad_cells, 2);
    assert_eq!(log.columns[2].bad_cells, 3);
}

#[test]
fn an_index_column_without_a_name_gets_one() {
    let log = log(",t,u\n0,0,1\n1,1,2\n");
    assert_eq!(log.columns[0].name, "column 1");
}

#[test]
fn each_broken_table_has_its_own_message() {
    for (text, parts) in [
        ("t,u\n0,1\n1\n2,3\n", &["line 3", "1 cells", "2 columns"][..]),
        ("t,u\n0,1\n1,2,3\n2,3\n", &["line 3", "3 cells", "quotes"]),
        ("t,u\n0,1\n1", &["line 3", "middle of a line", "delete this last line"]),
        ("t,u,u\n0,1,2\n", &["columns 2 and 3", "`u`", "rename"]),
        ("t,u\n", &["header", "no samples"]),
        ("", &["is empty"]),
        (" \n \n", &["is empty"]),
        ("0,1,2\n1,2,3\n", &["0, 1, 2", "names the columns"]),
    ] {
        let message = read_error(text.as_bytes());
        for part in parts {
            assert!(message.contains(part), "{text:?}: {message}");
        }
    }
}

#[test]
fn other_encodings_are_named() {
    assert!(read_error(b"t,psi [\xb0]\n0,1\n").contains("line 1: not UTF-8"));
    assert!(read_error(b"t,u\n0,1\n\xff,1\n").contains("line 3"));
    assert!(read_error(b"\xff\xfet\0,\0u\0").contains("UTF-16"));
    assert!(read_error(b"\x7fELF\0\0\xff\xfe").contains("does not seem to be CSV"));
}

#[test]
fn missing_files_and_folders_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    assert!(matches!(read(&dir.path().join("no.csv")), Err(LogError::NotFound { .. })));
    assert!(matches!(read(dir.path()), Err(LogError::IsDirectory { .. })));
    let file = dir.path().join("run.csv");
    std::fs::write(&file, "t,u\n0,1\n").unwrap();
    let log = read(&file).unwrap();
    assert_eq!(log.file_name(), "run.csv");
    assert_eq!(log.rows(), 1);
}
