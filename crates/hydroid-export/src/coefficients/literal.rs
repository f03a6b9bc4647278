//! Data as literals of Python and MATLAB.

use super::numbers::exact;

/// A value of generated code.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    /// `None`, or the empty matrix.
    Nothing,
    /// A number; infinity is a number of both languages.
    Number(f64),
    /// A truth value.
    Flag(bool),
    /// An index, counted from 0 in Python and from 1 in MATLAB. Without one, `None` and 0.
    Index(Option<usize>),
    /// Text without quotes, backslashes and line breaks: see [`comment`](crate::name::comment).
    Text(String),
    /// Numbers, flags, indices.
    Row(Vec<Self>),
    /// Rows of one length.
    Matrix(Vec<Self>),
    Record(Vec<(&'static str, Self)>),
    List(Vec<Self>),
}

impl Literal {
    pub(super) fn numbers(values: &[f64]) -> Self {
        Self::Row(values.iter().map(|value| Self::Number(*value)).collect())
    }

    pub(super) fn matrix<const N: usize>(rows: &[[f64; N]]) -> Self {
        Self::Matrix(rows.iter().map(|row| Self::numbers(row)).collect())
    }

    pub(super) fn python(&self) -> String {
        let each = |values: &[Self]| values.iter().map(Self::python).collect::<Vec<String>>().join(", ");
        match self {
            Self::Nothing => String::from("None"),
            Self::Number(x) => exact(*x, "math.inf"),
            Self::Flag(flag) => String::from(if *flag { "True" } else { "False" }),
            Self::Index(index) => index.map_or_else(|| String::from("None"), |index| index.to_string()),
            Self::Text(text) => format!("\"{text}\""),
            Self::Row(values) | Self::Matrix(values) => format!("[{}]", each(values)),
            Self::Record(fields) => {
                let fields = fields.iter().map(|(name, value)| format!("{name}={}", value.python()));
                format!("dict({})", fields.collect::<Vec<String>>().join(", "))
            }
            Self::List(records) if records.is_empty() => String::from("[]"),
            Self::List(records) => {
                let lines: Vec<String> =
                    records.iter().map(|record| format!("    {},", record.python())).collect();
                format!("[\n{}\n]", lines.join("\n"))
            }
        }
    }

    pub(super) fn matlab(&self) -> String {
        let each =
            |values: &[Self], by: &str| values.iter().map(Self::matlab).collect::<Vec<String>>().join(by);
        match self {
            Self::Nothing => String::from("[]"),
            Self::Number(x) => exact(*x, "Inf"),
            Self::Flag(flag) => String::from(if *flag { "1" } else { "0" }),
            Self::Index(index) => index.map_or(0, |index| index + 1).to_string(),
            Self::Text(text) => format!("'{text}'"),
            Self::Row(values) => format!("[{}]", each(values, " ")),
            Self::Matrix(rows) => format!("[{}]", each(rows, "; ")),
            Self::Record(fields) => {
                let fields = fields.iter().map(|(name, value)| format!("'{name}', {}", value.matlab()));
                format!("struct({})", fields.collect::<Vec<String>>().join(", "))
            }
            Self::List(records) if records.is_empty() => String::from("{}"),
            Self::List(records) => format!("{{ ...\n    {} ...\n    }}", each(records, ", ...\n    ")),
        }
    }
}
