//! Values of a row, and names of columns (SQLite documentation, "Database File Format", section 2.1).

/// A value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value<'a> {
    Null,
    Integer(i64),
    Real,
    Text(&'a [u8]),
    Blob(&'a [u8]),
}

/// The first columns of a row (section 2.1). Values that are not whole are missing.
pub(crate) fn values(content: &[u8], most: usize) -> Vec<Value<'_>> {
    let mut found = Vec::new();
    let mut header = content;
    let Some(length) = varint(&mut header).and_then(|length| usize::try_from(length).ok()) else {
        return found;
    };
    let Some(mut body) = content.get(length..) else { return found };
    let size = content.len() - header.len();
    let mut header = header.get(..length.saturating_sub(size)).unwrap_or_default();
    while found.len() < most {
        let Some(serial) = varint(&mut header) else { break };
        let size = match serial {
            0 | 8 | 9 => 0,
            1..=4 => serial,
            5 => 6,
            6 | 7 => 8,
            _ => serial.saturating_sub(12) / 2,
        };
        let Some((bytes, rest)) = usize::try_from(size).ok().and_then(|size| body.split_at_checked(size))
        else {
            break;
        };
        body = rest;
        found.push(match serial {
            0 | 10 | 11 => Value::Null,
            8 | 9 => Value::Integer(i64::from(serial == 9)),
            7 => Value::Real,
            1..=6 => {
                let sign = if bytes[0] & 0x80 == 0 { 0 } else { -1 };
                Value::Integer(bytes.iter().fold(sign, |sum, &byte| sum << 8 | i64::from(byte)))
            }
            _ if serial % 2 == 0 => Value::Blob(bytes),
            _ => Value::Text(bytes),
        });
    }
    found
}

/// A number of one to nine bytes (section 1.6).
pub(super) fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut sum = 0;
    for i in 0..9 {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        if i == 8 {
            return Some(sum << 8 | u64::from(byte));
        }
        sum = sum << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some(sum);
        }
    }
    None
}

/// Columns of a table ("Limits in SQLite": 2,000 by default).
const MOST_COLUMNS: usize = 2_000;

/// Names of the columns in a statement `CREATE TABLE name(column type, ...)`.
pub(super) fn columns(sql: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut depth = 0;
    let mut quote = None;
    let mut definition = String::new();
    for c in sql.chars() {
        match (c, quote) {
            (_, Some(end)) => quote = if c == end { None } else { quote },
            ('"' | '`' | '\'', None) => quote = Some(c),
            ('[', None) => quote = Some(']'),
            ('(', None) => depth += 1,
            (')', None) => depth -= 1,
            _ => {}
        }
        if depth == 0 && c == ')' || depth == 1 && c == ',' && quote.is_none() {
            let name = definition.trim_start_matches('(').split_whitespace().next().unwrap_or_default();
            names.push(name.trim_matches(['"', '`', '\'', '[', ']']).to_owned());
            definition.clear();
            if names.len() == MOST_COLUMNS {
                break;
            }
        } else if depth > 0 {
            definition.push(c);
        }
    }
    names
}
