//! Parts of logs that are used: stretches of time, and conditions on columns.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

use super::condition::Condition;
use super::csv::{RawColumn, RawLog};
use super::error::LogError;
use super::note::{Note, count};
use super::selection::{ChannelSpec, Selection};
use super::{columns, resolve, stamp};
use crate::key::key;

/// A stamp that differs from the end of a stretch by less \[s\] is at the end.
const ROUNDING_S: f64 = 1e-6;

/// A stretch of a log: `120:480` in seconds on the clock of its table, `:480` from its start, `120:` to its end, or
/// `2024-05-01T10:00:00Z/2024-05-01T10:20:00Z`, an interval of ISO 8601. Both ends belong to it. `day1.csv=120:480` is one
/// of this log only.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Stretch {
    text: String,
    /// Name or path of the log, if it is one of a single log.
    log: Option<String>,
    /// Ends \[s\]; infinite ones are those of the log.
    ends: [f64; 2],
    /// Whether the ends count from 1970.
    is_date: bool,
}

impl FromStr for Stretch {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let text = text.trim();
        let bad = |reason: &str| LogError::BadOption {
            what: "a stretch of time",
            value: format!("`{text}`"),
            reason: reason.to_owned(),
        };
        let (log, times) = text.rsplit_once('=').map_or((None, text), |(log, times)| (Some(log), times));
        let form = "write START:END in seconds, as in 120:480, 120: or :480, or two stamps as in 2024-05-01T10:00:00Z/2024-05-01T10:20:00Z; with the name of a log, day1.csv=120:480";
        let (ends, is_date) = if let Some((from, to)) = times.split_once('/') {
            let end =
                |text: &str| stamp::parse(text.trim()).filter(|stamp| stamp.dated).map(|stamp| stamp.seconds);
            (end(from).zip(end(to)), true)
        } else {
            let end = |text: &str, open: f64| match text.trim() {
                "" => Some(open),
                text => text.parse::<f64>().ok().filter(|end| end.is_finite()),
            };
            let ends = times.split_once(':').filter(|(from, to)| !(from.is_empty() && to.is_empty()));
            let ends = ends.and_then(|(from, to)| end(from, f64::NEG_INFINITY).zip(end(to, f64::INFINITY)));
            (ends, false)
        };
        let (from, to) = ends.ok_or_else(|| bad(form))?;
        if from >= to {
            return Err(bad("its end is not after its start"));
        }
        Ok(Self { text: text.to_owned(), log: log.map(str::to_owned), ends: [from, to], is_date })
    }
}

impl fmt::Display for Stretch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl TryFrom<String> for Stretch {
    type Error = LogError;

    fn try_from(text: String) -> Result<Self, LogError> {
        text.parse()
    }
}

impl From<Stretch> for String {
    fn from(stretch: Stretch) -> Self {
        stretch.text
    }
}

impl Stretch {
    /// Whether it is one of a log: of each, or of the one with its name, with or without the folder.
    fn is_for(&self, path: &str) -> bool {
        self.log.as_ref().is_none_or(|name| path == name || path.rsplit(['/', '\\']).next() == Some(name))
    }
}

/// What is used of the logs. A row is used if it is in one of the stretches `between`, in none of `exclude`, and the
/// condition holds. Rows that are not used count as missing: a run ends where they are missing for longer than the gap
/// limit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Parts {
    /// Stretches that are used; all of the log without one that is for it.
    pub between: Vec<Stretch>,
    /// Stretches that are not used.
    pub exclude: Vec<Stretch>,
    /// Condition on columns.
    pub condition: Option<Condition>,
}

/// The parts of one log.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    between: Vec<[f64; 2]>,
    exclude: Vec<[f64; 2]>,
    /// Times from which on the condition holds, or does not.
    condition: Option<Vec<(f64, bool)>>,
}

impl Kept {
    /// Whether a time on the clock of the log is in one of the parts.
    pub(crate) fn has(&self, t: f64) -> bool {
        let is_in = |ends: &[f64; 2]| (ends[0] - ROUNDING_S..=ends[1] + ROUNDING_S).contains(&t);
        let holds = self.condition.as_ref().is_none_or(|changes| {
            let next = changes.partition_point(|(from, _)| *from <= t + ROUNDING_S);
            next.checked_sub(1).is_some_and(|at| changes[at].1)
        });
        holds
            && (self.between.is_empty() || self.between.iter().any(is_in))
            && !self.exclude.iter().any(is_in)
    }
}

impl Parts {
    /// Whether all of each log is used.
    pub fn is_all(&self) -> bool {
        *self == Self::default()
    }

    /// Columns of the condition.
    pub(crate) fn columns(&self) -> Vec<ChannelSpec> {
        let names: BTreeSet<&str> = self.condition.iter().flat_map(Condition::columns).collect();
        names.into_iter().map(ChannelSpec::named).collect()
    }

    /// The parts of a log, without the stretches of others.
    #[must_use]
    pub fn of_log(&self, path: &str) -> Self {
        let own = |all: &[Stretch]| all.iter().filter(|stretch| stretch.is_for(path)).cloned().collect();
        Self { between: own(&self.between), exclude: own(&self.exclude), condition: self.condition.clone() }
    }

    /// Rejects the name of a log that is not among those that are read.
    ///
    /// # Errors
    /// If there is such a name.
    pub fn check_names(&self, logs: &[String]) -> Result<(), LogError> {
        for stretch in self.between.iter().chain(&self.exclude) {
            if let Some(name) = &stretch.log
                && !logs.iter().any(|path| stretch.is_for(path))
            {
                return Err(LogError::BadOption {
                    what: "a stretch of time",
                    value: format!("`{stretch}`"),
                    reason: format!("no log that is read has the name `{name}`: {}", logs.join(", ")),
                });
            }
        }
        Ok(())
    }

    /// The parts of a log on a clock on which its table begins to count at `zero` \[s\], with the seconds since 1970 then,
    /// and the times from which on the condition holds, or does not.
    pub(crate) fn of(
        &self,
        path: &str,
        zero: f64,
        date_of_zero: Option<f64>,
        condition: Option<Vec<(f64, bool)>>,
    ) -> Result<Kept, LogError> {
        let ends = |stretches: &[Stretch]| {
            stretches
                .iter()
                .filter(|stretch| stretch.is_for(path))
                .map(|stretch| {
                    let shift = match (stretch.is_date, date_of_zero) {
                        (false, _) => zero,
                        (true, Some(date)) => zero - date,
                        (true, None) => {
                            return Err(LogError::Unusable {
                                path: path.to_owned(),
                                reason: format!("its times have no date, and `{stretch}` has one"),
                                remedy: "name stretches in seconds, as in 120:480".to_owned(),
                            });
                        }
                    };
                    Ok(stretch.ends.map(|end| end + shift))
                })
                .collect::<Result<Vec<_>, _>>()
        };
        Ok(Kept { between: ends(&self.between)?, exclude: ends(&self.exclude)?, condition })
    }

    /// The options that choose, as text.
    pub(crate) fn described(&self) -> String {
        let list = |all: &[Stretch]| all.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
        let texts = [
            (!self.between.is_empty()).then(|| key("between").is(list(&self.between))),
            (!self.exclude.is_empty()).then(|| key("exclude").is(list(&self.exclude))),
            self.condition.as_ref().map(|condition| key("where").is(condition)),
        ];
        texts.into_iter().flatten().map(|key| key.to_string()).collect::<Vec<_>>().join(", ")
    }
}

/// Leaves the rows of a table that are used.
///
/// # Errors
/// If a column of the condition does not exist, a date is compared with times without one, or no row is left.
pub fn keep_parts(
    log: &mut RawLog,
    selection: &Selection,
    dt: Option<f64>,
    notes: &mut Vec<Note>,
) -> Result<(), LogError> {
    let parts = &selection.parts;
    if parts.is_all() {
        return Ok(());
    }
    let time = resolve::time(log, selection, dt, &mut Vec::new())?;
    let (t, date_of_zero) = columns::row_times(log, &time);
    let kept = parts.of(&log.path, 0.0, date_of_zero, None)?;
    let mut rows: Vec<bool> = t.iter().map(|t| kept.has(*t)).collect();
    if let Some(condition) = &parts.condition {
        let names: Vec<String> = parts.columns().into_iter().map(|spec| spec.column).collect();
        let values = names.iter().map(|name| own_values(log, name)).collect::<Result<Vec<_>, _>>()?;
        let mut held = vec![f64::NAN; names.len()];
        for (k, used) in rows.iter_mut().enumerate() {
            for (held, values) in held.iter_mut().zip(&values) {
                *held = if values[k].is_nan() { *held } else { values[k] };
            }
            *used &= condition.holds(&names, &held);
        }
    }
    if matches!(time, resolve::Time::Even(_)) {
        log.columns.retain(|column| column.name != "t");
        log.columns.push(RawColumn::of("t", Some("s"), t.clone()));
    }
    keep_rows(log, &rows, &t, parts, notes)
}

/// Leaves the rows of a table that are used, and says how many. `t` are their times \[s\].
pub(crate) fn keep_rows(
    log: &mut RawLog,
    rows: &[bool],
    t: &[f64],
    parts: &Parts,
    notes: &mut Vec<Note>,
) -> Result<(), LogError> {
    let used = rows.iter().filter(|used| **used).count();
    let path = log.path.clone();
    if used == 0 {
        return Err(no_rows(path, parts, t));
    }
    let all = count(rows.len(), "row");
    notes.push(Note::info(format!("{path}: {used} of {all} are used ({})", parts.described())));
    log.retain(rows);
    Ok(())
}

/// The error of parts without rows.
pub(crate) fn no_rows(path: String, parts: &Parts, t: &[f64]) -> LogError {
    let measured = || t.iter().copied().filter(|t| t.is_finite());
    let (from, to) = (measured().fold(f64::INFINITY, f64::min), measured().fold(f64::NEG_INFINITY, f64::max));
    LogError::Unusable {
        path,
        reason: format!(
            "no row is in the parts that are named ({}); its times are from {from:.1} s to {to:.1} s",
            parts.described()
        ),
        remedy:
            "name other parts: `hydroid inspect` without them shows the times and the ranges of the columns"
                .to_owned(),
    }
}

/// The values of a column, in its unit.
fn own_values<'a>(log: &'a RawLog, name: &str) -> Result<&'a [f64], LogError> {
    let at = resolve::find(log, name).ok_or_else(|| resolve::unknown(log, name))?;
    columns::checked_column(log, at).map(|column| &column.values[..])
}
