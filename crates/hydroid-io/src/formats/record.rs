//! Messages of fixed layout: places of the numbers and texts, and the topic and rows that they become.

use super::number::{Number, text};
use crate::sink::{Clock, Field, Sink, Topic};

/// Factor of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    One,
    /// Division by a whole number gives the decimal value that was meant; multiplication by 1e-7 does not.
    Divide(f64),
    Multiply(f64),
}

impl Scale {
    pub(crate) fn of(factor: f64) -> Self {
        let divisor = (1.0 / factor).round();
        if !factor.is_finite() || factor == 0.0 || factor == 1.0 {
            Self::One
        } else if divisor.is_finite() && (divisor * factor - 1.0).abs() < 1e-12 {
            Self::Divide(divisor)
        } else {
            Self::Multiply(factor)
        }
    }

    fn apply(self, value: f64) -> f64 {
        match self {
            Self::One => value,
            Self::Divide(divisor) => value / divisor,
            Self::Multiply(factor) => value * factor,
        }
    }
}

/// Layout of the messages of a type.
#[derive(Debug, Default)]
pub(crate) struct Record {
    pub(crate) fields: Vec<Field>,
    /// Place of the number of each field, and its factor.
    pub(crate) columns: Vec<(usize, Number, Scale)>,
    /// Texts with place and length.
    pub(crate) texts: Vec<(String, usize, usize)>,
    /// Place of the time since the start of the device, and its unit in nanoseconds.
    pub(crate) time: Option<(usize, Number, i64)>,
}

impl Record {
    /// Time of a message since the start of the device \[ns\]; `None` if there is none, or if it exceeds `i64`.
    pub(crate) fn time(&self, body: &[u8]) -> Option<i64> {
        let (at, number, unit) = self.time?;
        number.integer(body, at)?.checked_mul(unit)
    }

    /// The topic of the messages, with the texts of the first one.
    pub(crate) fn topic(&self, name: String, type_name: &str, body: &[u8]) -> Topic {
        let value = |at: usize, size: usize| body.get(at..at + size).map(text).unwrap_or_default();
        Topic {
            name,
            type_name: type_name.to_owned(),
            clock: if self.time.is_some() { Clock::Boot } else { Clock::None },
            fields: self.fields.clone(),
            texts: self.texts.iter().map(|(name, at, size)| (name.clone(), value(*at, *size))).collect(),
        }
    }

    /// Gives the row of a message; false if its stamp exceeds `i64`. Messages without time have their number as stamp.
    /// The memory of `values` is used again.
    pub(crate) fn give(
        &self,
        topic: usize,
        body: &[u8],
        number: i64,
        values: &mut Vec<f64>,
        sink: &mut dyn Sink,
    ) -> bool {
        let stamp = if self.time.is_some() { self.time(body) } else { Some(number) };
        if let Some(stamp) = stamp {
            values.clear();
            values.extend(self.columns.iter().map(|(at, number, scale)| scale.apply(number.read(body, *at))));
            sink.row(topic, stamp, None, values);
        }
        stamp.is_some()
    }
}
