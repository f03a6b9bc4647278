//! Where a model was not seen.

use std::fmt::{Display, Formatter, Result};

use serde::Serialize;

use crate::model::Port;

/// An output or input that leaves its training range by more than a tenth of its width: the model extrapolates from there on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outside {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Time at which it leaves the range \[s\]. In a trial it counts from the order, and is 0 if it was outside before.
    pub from_s: f64,
    /// Lowest and highest value.
    pub reached: [f64; 2],
    /// Training range.
    pub range: [f64; 2],
}

impl Outside {
    /// The channel of a port along times and values; `None` if it stays within its range.
    pub fn of(port: &Port, series: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        let range = port.training_range.unwrap_or(port.range);
        let room = 0.1 * (range.high - range.low);
        let (mut from_s, mut low, mut high) = (f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY);
        for (t, value) in series {
            (low, high) = (low.min(value), high.max(value));
            if value < range.low - room || value > range.high + room {
                from_s = from_s.min(t);
            }
        }
        from_s.is_finite().then(|| Self {
            name: port.channel.name.clone(),
            unit: port.channel.unit.clone(),
            from_s,
            reached: [low, high],
            range: [range.low, range.high],
        })
    }
}

impl Display for Outside {
    /// What is reached and what was seen; angles in degrees.
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let Self { name, unit, from_s, reached, range } = self;
        let (factor, unit) = match unit.as_str() {
            "rad" => (1.0_f64.to_degrees(), " deg"),
            "rad/s" => (1.0_f64.to_degrees(), " deg/s"),
            "" | "1" => (1.0, ""),
            unit => (1.0, &*format!(" {unit}")),
        };
        let number = |value: f64| (1e3 * factor * value).round() / 1e3 + 0.0;
        let [[low, high], [least, most]] = [*reached, *range].map(|range| range.map(number));
        write!(
            out,
            "the model extrapolates from {from_s:.1} s on: {name} goes from {low} to {high}{unit}, and from {least} to {most}{unit} in its logs"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::DesignRange;
    use crate::log::Channel;

    #[test]
    fn a_channel_is_outside_a_tenth_beyond_the_range_in_which_it_was_seen() {
        let port = Port {
            channel: Channel::new("delta", "rad"),
            range: DesignRange { low: -9.0, high: 9.0 },
            training_range: Some(DesignRange { low: -0.3, high: 0.2 }),
            noise: None,
            rate_limit: None,
        };
        let of = |values: &[f64]| Outside::of(&port, (0..).map(f64::from).zip(values.iter().copied()));
        assert_eq!(of(&[0.0, 0.249, -0.349, f64::NAN]), None);
        let found = of(&[0.0, 0.1, -0.4, 0.3]).unwrap();
        let expected = ("delta", 2.0, [-0.4, 0.3], [-0.3, 0.2]);
        assert_eq!((found.name.as_str(), found.from_s, found.reached, found.range), expected);
        let text = "the model extrapolates from 2.0 s on: delta goes from -22.918 to 17.189 deg, and from -17.189 to 11.459 deg in its logs";
        assert_eq!(found.to_string(), text);
    }
}
