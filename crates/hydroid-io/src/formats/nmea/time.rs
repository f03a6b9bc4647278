//! Stamps of sentences: the time of arrival, or the time that sentences state.

use super::arrival::arrival;
use super::line::Line;
use super::sentence::Sentence;
use crate::formats::time::{DAY, SECOND, days};
use crate::sink::{Clock, Summary};

const HALF_A_DAY: i64 = DAY / 2 * SECOND;

/// Where the stamps of a file come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Arrival,
    /// Time and date in the sentences.
    Dated,
    /// Time in the sentences, without date.
    Midnight,
    /// Number of the sentence.
    Number,
}

/// Stamps of the sentences of a file.
#[derive(Debug)]
pub(super) struct Times {
    source: Source,
    /// Days from 1970-01-01, or from the first day if there is no date.
    day: i64,
    /// Time of the day \[ns\] of the last sentence that states one.
    time: i64,
    /// Last time of arrival.
    arrival: Option<i64>,
    number: i64,
    without_arrival: bool,
    without_zone: bool,
}

impl Times {
    /// Decides by the beginning of a file.
    pub(super) fn new(head: &[u8]) -> Self {
        let (mut lines, mut arrivals) = (0, 0);
        let (mut first, mut dated) = (None, None);
        for line in
            head.split(|byte| *byte == b'\n').filter_map(|line| Line::parse(line.trim_ascii_end()).ok())
        {
            lines += 1;
            arrivals += usize::from(arrival(line.prefix).is_some());
            let Some(sentence) = line.formatter().and_then(Sentence::of) else { continue };
            let (fields, count) = line.fields();
            let Some(time) = sentence.time(&fields[..count]) else { continue };
            first.get_or_insert(time);
            dated = sentence.date(&fields[..count]).and_then(|(day, month, year)| days(year, month, day));
            // Arrivals are decided by the first lines; the date may come after many sentences.
            if dated.is_some() || (lines > 1000 && arrivals * 2 > lines) {
                dated = dated.map(|day| if first > Some(time + HALF_A_DAY) { day - 1 } else { day });
                break;
            }
        }
        let source = match (first, dated) {
            _ if arrivals * 2 > lines => Source::Arrival,
            (Some(_), Some(_)) => Source::Dated,
            (Some(_), None) => Source::Midnight,
            (None, _) => Source::Number,
        };
        Self {
            source,
            day: dated.unwrap_or(0),
            time: first.unwrap_or(0),
            arrival: None,
            number: 0,
            without_arrival: false,
            without_zone: false,
        }
    }

    /// Whether the stamps are times in sentences.
    pub(super) fn are_stated(&self) -> bool {
        matches!(self.source, Source::Dated | Source::Midnight)
    }

    pub(super) fn clock(&self) -> Clock {
        match self.source {
            Source::Arrival | Source::Dated => Clock::Utc,
            Source::Midnight => Clock::Boot,
            Source::Number => Clock::None,
        }
    }

    /// Takes note of the time of arrival of a sentence that is not read.
    pub(super) fn see(&mut self, prefix: &[u8]) {
        if self.source != Source::Arrival {
            return;
        }
        match arrival(prefix) {
            Some(found) => {
                self.arrival = Some(found.utc_ns);
                self.without_zone |= !found.zone;
            }
            None => self.without_arrival = true,
        }
    }

    /// Stamp of a sentence.
    pub(super) fn stamp(
        &mut self,
        prefix: &[u8],
        sentence: &Sentence,
        fields: &[&[u8]],
    ) -> Result<i64, &'static str> {
        match self.source {
            Source::Arrival => {
                self.see(prefix);
                self.arrival.ok_or("a sentence before the first time of arrival")
            }
            Source::Dated | Source::Midnight => {
                self.advance(sentence, fields);
                Ok(self.day.saturating_mul(DAY * SECOND).saturating_add(self.time))
            }
            Source::Number => {
                self.number += 1;
                Ok(self.number - 1)
            }
        }
    }

    fn advance(&mut self, sentence: &Sentence, fields: &[&[u8]]) {
        let Some(time) = sentence.time(fields) else { return };
        let date = sentence.date(fields).and_then(|(day, month, year)| days(year, month, day));
        if let (Source::Dated, Some(day)) = (self.source, date) {
            self.day = day;
        } else if time < self.time - HALF_A_DAY {
            self.day += 1;
        } else if time > self.time + HALF_A_DAY {
            // A sentence of the day before that comes late.
            self.day -= 1;
        }
        self.time = time;
    }

    pub(super) fn notes(&self, summary: &mut Summary) {
        if self.without_zone {
            summary.note("the times of arrival have no zone; they are taken as UTC");
        }
        match self.source {
            Source::Arrival if self.without_arrival => {
                summary.note("sentences without a time of arrival have that of the one before");
            }
            Source::Midnight => {
                summary.note("no sentence at the beginning has a date; stamps are from midnight");
            }
            Source::Number => summary.note("no sentence at the beginning has a time; sentences are numbered"),
            Source::Arrival | Source::Dated => {}
        }
    }
}
