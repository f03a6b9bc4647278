//! What a new reader receives first: track, series and messages, in bounded memory.

use std::collections::VecDeque;

use axum::body::Bytes;
use serde::Serialize;

use super::{MAX_SAID, MAX_SERIES, MAX_TRACK};

/// Track, series and the last messages.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    track: VecDeque<[f64; 4]>,
    names: Vec<String>,
    /// Time, measured and predicted values, row by row.
    series: VecDeque<f64>,
    said: VecDeque<Bytes>,
    /// Messages ever.
    count: u64,
}

impl History {
    pub(super) fn track(&mut self, point: [f64; 4]) {
        if self.track.len() >= MAX_TRACK {
            self.track.pop_front();
        }
        self.track.push_back(point);
    }

    pub(super) fn name_series(&mut self, names: &[String]) {
        if self.names != names {
            self.series.clear();
            self.names = names.to_vec();
        }
    }

    pub(super) fn series(&mut self, t: f64, measured: &[f64], predicted: &[f64]) {
        let width = self.width();
        if self.series.len() >= MAX_SERIES * width {
            self.series.drain(..width);
        }
        let value = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
        self.series.push_back(t);
        for values in [measured, predicted] {
            self.series.extend((0..self.names.len()).map(|i| value(values, i)));
        }
    }

    pub(super) fn said(&mut self, message: Bytes) {
        if self.said.len() >= MAX_SAID {
            self.said.pop_front();
        }
        self.said.push_back(message);
        self.count += 1;
    }

    /// Number of messages ever.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Messages after the first `count` ones, as far as they are kept.
    pub(super) fn said_since(&self, count: u64) -> impl Iterator<Item = &Bytes> {
        let new = usize::try_from(self.count.saturating_sub(count)).unwrap_or(usize::MAX);
        self.said.iter().skip(self.said.len().saturating_sub(new))
    }

    /// Values in a row of the series.
    fn width(&self) -> usize {
        1 + 2 * self.names.len()
    }

    /// JSON of the whole; unknown numbers are null.
    pub(super) fn json(&mut self) -> Vec<u8> {
        #[derive(Serialize)]
        struct Series<'a> {
            names: &'a [String],
            rows: Vec<&'a [f64]>,
        }
        let width = self.width();
        let rows = self.series.make_contiguous().chunks(width).collect();
        let track = serde_json::to_vec(&self.track).unwrap_or_default();
        let series = serde_json::to_vec(&Series { names: &self.names, rows }).unwrap_or_default();
        let mut json = [b"{\"track\":", track.as_slice(), b",\"series\":", &series, b",\"said\":["].concat();
        for (i, message) in self.said.iter().enumerate() {
            if i > 0 {
                json.push(b',');
            }
            json.extend_from_slice(message);
        }
        json.extend_from_slice(b"]}");
        json
    }
}
