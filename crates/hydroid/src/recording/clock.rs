//! Clocks that go back, as after a reboot, or where two sessions were joined in one file. What follows is a run of its own:
//! sorted by time, its rows would lie among those of another place.

use std::collections::BTreeMap;
use std::ops::Range;

use hydroid_io::{Clock, Summary, Topic};

use super::table::{STEPS, time_text};
use crate::log::Note;

/// Time \[s\] by which a run follows the earlier ones whose times it would repeat: no gap of that length is bridged.
const APART_S: f64 = 3600.0;
/// Most places that are kept of a file.
const MOST: usize = 1000;
/// Rows that are further apart than this \[s\] belong to different days: stamps from before the clock was set.
const DAY_S: f64 = 86_400.0;

/// Steps between rows: number and sum in classes of 5 % width. The usual step is the mean of those up to twice the median:
/// stamps may jitter, and longer steps are gaps.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps {
    classes: BTreeMap<i32, (u64, f64)>,
    pub(super) longest_ns: i64,
}

impl Steps {
    const WIDTH: f64 = 1.05;

    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    fn class(ratio: f64) -> i32 {
        ratio.log(Self::WIDTH).round() as i32
    }

    fn add(&mut self, step_ns: i64) {
        if step_ns > 0 {
            let class = Self::class(step_ns as f64);
            let (count, sum) = self.classes.entry(class).or_default();
            *count += 1;
            *sum += step_ns as f64;
            self.longest_ns = self.longest_ns.max(step_ns);
        }
    }

    pub(super) fn usual_s(&self) -> Option<f64> {
        let all: u64 = self.classes.values().map(|class| class.0).sum();
        let mut below = 0;
        let (median, _) = self.classes.iter().find(|(_, class)| {
            below += class.0;
            2 * below >= all
        })?;
        let longest = median + Self::class(2.0);
        let usual = self.classes.range(..=longest).map(|(_, class)| *class);
        let (count, sum) = usual.fold((0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        Some(sum / count as f64 / 1e9)
    }
}

/// The stamps of a topic.
#[derive(Debug)]
struct Stamps {
    name: String,
    clock: Clock,
    /// Topics of different files of a folder have clocks of their own.
    file: usize,
    rows: usize,
    /// The last two stamps.
    last: [Option<i64>; 2],
    steps: Steps,
    /// A step back that the next row decides: after a late row, time continues where it was.
    open: Option<Back>,
}

/// A place at which a clock goes back.
#[derive(Clone, Debug)]
struct Back {
    topic: usize,
    from_ns: i64,
    to_ns: i64,
    /// Rows of each topic before it.
    rows: Vec<usize>,
}

impl Back {
    /// Rows of a topic before it. A topic that begins later has none.
    fn before(&self, topic: usize) -> usize {
        self.rows.get(topic).copied().unwrap_or(0)
    }
}

/// The clocks of the topics of a recording, from their stamps in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Clocks {
    topics: Vec<Stamps>,
    backs: Vec<Back>,
}

impl Clocks {
    /// A topic of a file, as often as it is stated.
    pub(super) fn topic(&mut self, id: usize, topic: &Topic, file: usize) {
        if id == self.topics.len() {
            self.topics.push(Stamps {
                name: topic.name.clone(),
                clock: topic.clock,
                file,
                rows: 0,
                last: [None; 2],
                steps: Steps::default(),
                open: None,
            });
        }
    }

    /// The next row of a topic.
    pub(super) fn row(&mut self, topic: usize, stamp_ns: i64) {
        let of = &mut self.topics[topic];
        let [last, before] = of.last;
        of.last = [Some(stamp_ns), last];
        of.rows += 1;
        let Some(last) = last else { return };
        of.steps.add(stamp_ns.saturating_sub(last));
        let open = of.open.take().filter(|open| stamp_ns <= open.from_ns);
        // A single stamp that was ahead, and rows in a slightly wrong order, are no other clock.
        let back_s = last.saturating_sub(stamp_ns) as f64 / 1e9;
        let goes_back = back_s > 0.0
            && before.is_none_or(|before| stamp_ns <= before)
            && back_s > STEPS * of.steps.usual_s().unwrap_or(0.0);
        if let Some(open) = open.filter(|_| self.backs.len() < MOST) {
            self.backs.push(open);
        }
        if goes_back {
            let mut rows: Vec<usize> = self.topics.iter().map(|topic| topic.rows).collect();
            rows[topic] -= 1;
            self.topics[topic].open = Some(Back { topic, from_ns: last, to_ns: stamp_ns, rows });
        }
    }

    /// Steps of a topic.
    pub(super) fn steps(&self, topic: usize) -> &Steps {
        &self.topics[topic].steps
    }

    /// The places at which a clock goes back, in the order of the file. Topics of one clock show the same place.
    fn places(&self) -> Vec<&Back> {
        let open = self.topics.iter().filter_map(|topic| topic.open.as_ref());
        let mut all: Vec<&Back> = self.backs.iter().chain(open).collect();
        all.sort_by_key(|back| back.rows.iter().sum::<usize>());
        let mut places: Vec<&Back> = Vec::new();
        for back in all {
            let same = |place: &&Back| {
                self.topics[place.topic].file == self.topics[back.topic].file
                    && place.before(back.topic) == back.before(back.topic)
            };
            if !places.iter().any(same) {
                places.push(back);
            }
        }
        places
    }

    /// Rows of each topic in the order of time, without repeated stamps and those of another day. The times of a session
    /// that would repeat those of an earlier one are moved behind all of them.
    pub(super) fn order(&self, times: &mut [Vec<f64>]) -> Vec<Vec<usize>> {
        let places = self.places();
        let sessions: Vec<Vec<Range<usize>>> = (0..times.len())
            .map(|topic| {
                let own =
                    places.iter().filter(|place| self.topics[place.topic].file == self.topics[topic].file);
                let ends = own.map(|place| place.before(topic)).chain([times[topic].len()]);
                ends.scan(0, |from, to| Some(std::mem::replace(from, to)..to)).collect()
            })
            .collect();
        let mut orders: Vec<Vec<Vec<usize>>> = Vec::with_capacity(times.len());
        for (t, ranges) in times.iter().zip(&sessions) {
            let own = |range: &Range<usize>| {
                ordered(&t[range.clone()]).into_iter().map(|k| k + range.start).collect()
            };
            orders.push(ranges.iter().map(own).collect());
        }
        let is_utc = self.topics.iter().all(|topic| topic.clock == Clock::Utc);
        // First and last times of each topic in each session.
        let mut ends: Vec<Vec<Option<[f64; 2]>>> = Vec::with_capacity(times.len());
        for (t, orders) in times.iter().zip(&orders) {
            let of = |order: &Vec<usize>| Some([t[*order.first()?], t[*order.last()?]]);
            ends.push(orders.iter().map(of).collect());
        }
        for session in 1..sessions.iter().map(Vec::len).max().unwrap_or(0) {
            let is_free = |of: &Vec<Option<[f64; 2]>>| {
                let Some(Some([from, to])) = of.get(session) else { return true };
                of[..session].iter().flatten().all(|other| is_utc && (*to < other[0] || *from > other[1]))
            };
            if ends.iter().all(is_free) {
                continue;
            }
            let earlier = ends.iter().flat_map(|of| of.iter().take(session).flatten());
            let last = earlier.map(|[_, to]| *to).fold(f64::NEG_INFINITY, f64::max);
            let own = ends.iter().filter_map(|of| *of.get(session)?);
            let shift = last + APART_S - own.map(|[from, _]| from).fold(f64::INFINITY, f64::min);
            for ((t, ranges), ends) in times.iter_mut().zip(&sessions).zip(&mut ends) {
                let range = ranges.get(session).cloned().unwrap_or_default();
                t[range].iter_mut().for_each(|t| *t += shift);
                ends.iter_mut().skip(session).take(1).flatten().flatten().for_each(|t| *t += shift);
            }
        }
        let merged = orders.into_iter().zip(times).map(|(orders, t)| {
            let mut order = orders.concat();
            order.sort_by(|&a, &b| t[a].total_cmp(&t[b]));
            order
        });
        merged.collect()
    }

    /// A warning of a clock that goes back.
    pub(super) fn note(&self, path: &str, summary: &Summary) -> Option<Note> {
        let places = self.places();
        let first = places.first()?;
        let topic = &self.topics[first.topic];
        let offset = summary.utc_offset_ns.filter(|_| topic.clock == Clock::Boot).unwrap_or(0);
        let text = |ns: i64| time_text(ns.saturating_add(offset) as f64 / 1e9);
        let more = match places.len() {
            1 => String::new(),
            n => format!(", and at {} more places", n - 1),
        };
        let warning = format!(
            "{path}: the clock goes back at row {} of `{}`, from {} to {}{more}: what follows is a run of its own, and comes {APART_S} s after the runs whose times it repeats",
            first.before(first.topic) + 1,
            topic.name,
            text(first.from_ns),
            text(first.to_ns)
        );
        Some(
            Note::warning(warning)
                .with_remedy("if these are several recordings, write each to a file of its own"),
        )
    }
}

/// Rows in the order of their stamps, without repeated stamps; those of the day with the most rows.
fn ordered(t: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..t.len()).collect();
    order.sort_by(|&a, &b| t[a].total_cmp(&t[b]));
    order.dedup_by(|a, b| t[*a] == t[*b]);
    let mut longest = 0..0;
    let mut from = 0;
    for k in 1..=order.len() {
        if k == order.len() || t[order[k]] - t[order[k - 1]] > DAY_S {
            if k - from > longest.len() {
                longest = from..k;
            }
            from = k;
        }
    }
    order[longest].to_vec()
}
