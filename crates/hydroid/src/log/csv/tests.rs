//! The size of the parts in which a log is read does not change the result.

use std::fmt::Write as _;

use proptest::prelude::*;

use super::chunks::CHUNK;
use super::*;

/// Everything that was read, or the error; NaN is equal to itself.
fn shown(read: &Result<RawLog, LogError>) -> String {
    match read {
        Ok(log) => format!("{log:?}"),
        Err(error) => error.to_string(),
    }
}

fn in_parts(text: &str, size: usize) -> Result<RawLog, LogError> {
    assemble::read(text.as_bytes(), "log.csv", size, |_| None)
}

/// More rows than the first part takes for itself, so that parts of every size occur.
const ROWS: usize = 260;

fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        60 => (-500..500_i32).prop_map(|x| (f64::from(x) * 0.1).to_string()),
        4 => Just(String::new()),
        2 => prop::sample::select(vec![
            "NaN", " 1.5 ", "x", "inf", "\"1\"", "\"2\n3\"", "2020-08-03T11:04:37Z", "\u{e9}", "1,5",
        ])
        .prop_map(String::from),
    ]
}

#[test]
fn an_end_of_line_in_a_quoted_cell_does_not_end_the_first_part() {
    for delimiter in [',', ';', '\t'] {
        let row = format!("1{delimiter}\"2\n3\"{delimiter}4\n");
        let text = format!("t{delimiter}name{delimiter}u\n{}", row.repeat(ROWS));
        let whole = shown(&in_parts(&text, CHUNK));
        for size in 1..row.len() {
            assert_eq!(shown(&in_parts(&text, 1500 + size)), whole, "{delimiter:?} {size}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_parts_of_a_file_do_not_change_what_is_read(
        cells in prop::collection::vec(cell(), 3 * ROWS),
        blank_until in prop_oneof![2 => Just(0_usize), 1 => 0..ROWS],
        end in prop::sample::select(vec!["\n", "\r\n", "\r"]),
        delimiter in prop::sample::select(vec![',', ';']),
        defect in prop::option::of((0..ROWS, prop::sample::select(vec!["1", "1;1,1;1,1", "", "\"", "\u{fffd}"]))),
        closed in any::<bool>(),
        size in 1..400_usize,
    ) {
        let mut text = format!("t{delimiter}u [m/s]{delimiter}n{end}");
        for (k, row) in cells.chunks(3).enumerate() {
            match &defect {
                Some((at, line)) if *at == k => text.push_str(line),
                // A column that is empty at first shows its kind in a later part.
                _ => { let _ = write!(text, "{}{delimiter}{}{delimiter}{}", row[0], if k < blank_until { "" } else { &row[1] }, row[2]); }
            }
            if closed || k + 1 < ROWS {
                text.push_str(end);
            }
        }
        prop_assert_eq!(shown(&in_parts(&text, size)), shown(&in_parts(&text, CHUNK)));
    }

    #[test]
    fn a_log_without_some_values_has_their_statistics(
        cells in prop::collection::vec(cell(), 3 * ROWS),
        size in 1..400_usize,
    ) {
        let mut text = "u,v,u_true\n".to_owned();
        for row in cells.chunks(3) {
            let _ = writeln!(text, "{}", row.join(","));
        }
        let plan = |_: &RawLog| Some(Plan { keep: vec![true, false, false], pairs: vec![(0, 2)] });
        let (whole, part) = (in_parts(&text, CHUNK), assemble::read(text.as_bytes(), "log.csv", size, plan));
        let (Ok(whole), Ok(part)) = (&whole, &part) else {
            prop_assert_eq!(shown(&whole), shown(&part));
            return Ok(());
        };
        prop_assert_eq!(&whole.lines, &part.lines);
        for (a, b) in whole.columns.iter().zip(&part.columns) {
            let summary = b.left_out.clone().unwrap_or_else(|| Summary::of(&b.values));
            prop_assert_eq!(format!("{summary:?}"), format!("{:?}", Summary::of(&a.values)));
            prop_assert_eq!((&a.bad, a.bad_cells, &a.stamps), (&b.bad, b.bad_cells, &b.stamps));
        }
        let [u, v, truth] = [0, 1, 2].map(|i| &whole.columns[i].values);
        prop_assert_eq!(&part.rest.pairs, &vec![(0, 2, PairSummary::of(u, truth))]);
        for k in 1..whole.rows() {
            let same = |values: &[f64]| values[k] == values[k - 1] || values[k].is_nan() && values[k - 1].is_nan();
            prop_assert_eq!(part.rest.repeats[k], same(v) && same(truth), "row {}", k);
        }
    }
}

#[test]
fn long_records_are_errors_that_name_the_line() {
    let rows = "1,2\n".repeat(300);
    let long = chunks::LONGEST_LINE + 10;
    let line = format!("t,u\n{rows}{}", "0".repeat(long));
    let error = in_parts(&line, 64).unwrap_err().to_string();
    assert!(error.starts_with(&format!("log.csv, line 302: {long} bytes without an end of line")), "{error}");
    let quote = format!("t,u\n{rows}\"{}", "1,2\n".repeat(long / 4));
    let error = in_parts(&quote, CHUNK).unwrap_err().to_string();
    assert!(error.contains("line 302") && error.contains("quotation mark"), "{error}");
}

#[test]
fn a_header_after_many_blank_lines_is_found() {
    let text = format!("{}t,u\n1,2\n", "\n".repeat(1_000));
    let log = in_parts(&text, 16).unwrap();
    assert_eq!((log.lines.get(0), log.rows()), (1_002, 1));
}
