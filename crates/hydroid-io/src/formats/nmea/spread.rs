//! Sentences that come several times between two times in sentences: they are spread evenly over the time between.

use crate::sink::Sink;

/// Rows that are held back at most, in a file that states no time any more.
const MOST_HELD: usize = 10_000;
/// A step of more than this multiple of the one before is a pause.
const PAUSE: i64 = 2;

/// Rows since the last time in a sentence.
#[derive(Debug, Default)]
pub(super) struct Spread {
    /// The last time \[ns\].
    time: Option<i64>,
    /// Topic and values of each row.
    rows: Vec<(usize, Vec<f64>)>,
    topics: Vec<Rate>,
}

/// The rows of a topic between two times.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    rows: i64,
    given: i64,
    /// Step \[ns\] between the times before.
    step: Option<i64>,
    /// Rows behind others of the same time.
    spread: u64,
}

impl Spread {
    /// A row of a topic that comes at a time. The rows before it are given to the sink if the time is another one.
    pub(super) fn row(&mut self, topic: usize, time: i64, values: &[f64], sink: &mut dyn Sink) {
        if self.time != Some(time) || self.rows.len() >= MOST_HELD {
            self.flush(Some(time), sink);
        }
        self.rows.push((topic, values.to_vec()));
        if topic >= self.topics.len() {
            self.topics.resize(topic + 1, Rate::default());
        }
        self.topics[topic].rows += 1;
    }

    /// Gives the rows to the sink, before the next time.
    pub(super) fn flush(&mut self, next: Option<i64>, sink: &mut dyn Sink) {
        let before = self.time;
        self.time = next.or(before);
        let Some(from) = before else { return };
        let all = next.map(|next| next.saturating_sub(from)).filter(|all| *all > 0);
        for rate in self.topics.iter_mut().filter(|rate| rate.rows > 0) {
            let even = all.map(|all| all / rate.rows);
            let step = match (even, rate.step) {
                (Some(even), Some(before)) => Some(even.min(before.saturating_mul(PAUSE))),
                (even, before) => even.or(before),
            };
            rate.spread += u64::try_from(rate.rows - 1).unwrap_or(0);
            (rate.step, rate.rows, rate.given) = (step, 0, 0);
        }
        for (topic, values) in self.rows.drain(..) {
            let rate = &mut self.topics[topic];
            let since = rate.given.saturating_mul(rate.step.unwrap_or(0));
            rate.given += 1;
            sink.row(topic, from.saturating_add(since), None, &values);
        }
    }

    /// Rows of a topic that came behind others of the same time.
    pub(super) fn spread(&self, topic: usize) -> u64 {
        self.topics.get(topic).map_or(0, |rate| rate.spread)
    }
}
