//! Where a model was not seen.

use std::fmt::{Display, Formatter, Result};

use serde::Serialize;

use crate::model::{Description, MOTION, Model, Port};

/// Room beyond a training range, relative to its width, within which a model is not said to extrapolate.
const ROOM: f64 = 0.1;

/// Room beyond a training range, relative to its width, within which a motion is believed: the range is twice as wide. There,
/// polynomials of degree 1, 2 and 3 can have 2, 7 and 26 times the error that they have in the range (Chebyshev; T. J. Rivlin,
/// The Chebyshev Polynomials, 1974, theorem 1.10).
const BELIEVED: f64 = 0.5;

/// The training range of a port with room beyond it, relative to its width.
fn seen(port: &Port, room: f64) -> [f64; 2] {
    let range = port.training_range.unwrap_or(port.range);
    let room = room * (range.high - range.low);
    [range.low - room, range.high + room]
}

/// The range of a port within which a model is believed: its training range, twice as wide. A constant has a tenth of its value.
pub(crate) fn believed(port: &Port) -> [f64; 2] {
    widened(seen(port, 0.0))
}

fn widened([low, high]: [f64; 2]) -> [f64; 2] {
    let room = (BELIEVED * (high - low)).max(ROOM * low.abs().max(high.abs()));
    [low - room, high + room]
}

/// Whether a motion can be believed.
///
/// A model that was identified is believed as long as no velocity leaves its training range by more than half of its width. Where
/// no input both pushes and turns, a trial adds nothing to the propulsion of its approach, so that the vessel cannot gain kinetic
/// energy: its speed through the water stays below that of the approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Belief {
    /// Training range of each velocity, and the range within which it is believed.
    ranges: [Option<[[f64; 2]; 2]>; 3],
    /// Speed of the approach \[m/s\].
    speed_m_s: f64,
}

impl Belief {
    pub(super) fn of(model: &Model) -> Self {
        let range = |name: &str| {
            // A vessel with given parameters has no training range.
            let mut ports = model.description.outputs.iter().filter(|_| !model.is_vessel());
            let port = ports.find(|port| port.channel.name == name)?;
            Some([seen(port, 0.0), seen(port, BELIEVED)])
        };
        Self { ranges: MOTION.map(range), speed_m_s: f64::INFINITY }
    }

    /// The same for a motion that begins with an approach at a speed \[m/s\].
    pub(super) const fn below_speed(self, speed_m_s: f64) -> Self {
        Self { speed_m_s, ..self }
    }

    /// Why a motion through the water is not believed; `None` if it is.
    pub(super) fn breach(&self, nu: [f64; 3]) -> Option<String> {
        if !nu.iter().all(|x| x.is_finite()) {
            return Some(String::from("the motion diverges"));
        }
        for (i, (x, range)) in nu.into_iter().zip(&self.ranges).enumerate() {
            if let Some([[least, most], [low, high]]) = range
                && !(*low..=*high).contains(&x)
            {
                let (name, (factor, unit)) = (MOTION[i], scale(["m/s", "m/s", "rad/s"][i]));
                let [x, least, most] = [x, *least, *most].map(|value| rounded(factor * value));
                return Some(format!(
                    "{name} is {x}{unit}, and {least} to {most}{unit} in the logs of the model"
                ));
            }
        }
        let speed = nu[0].hypot(nu[1]);
        (speed > (1.0 + ROOM) * self.speed_m_s).then(|| {
            let [speed, before] = [speed, self.speed_m_s].map(rounded);
            format!("the speed through the water is {speed} m/s, {before} m/s at the order, and no order pushes more")
        })
    }
}

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
        Self::of_range((&port.channel.name, &port.channel.unit), seen(port, 0.0), series)
    }

    /// What leaves its range among the inputs of a model, and among the sums of those that did not move apart, along commands with their
    /// times \[s\].
    pub fn of_commands<'a>(
        model: &Model,
        commands: &(impl Iterator<Item = (f64, &'a [f64])> + Clone),
    ) -> Vec<Self> {
        // A vessel with given parameters has no training range.
        if model.is_vessel() {
            return Vec::new();
        }
        let Description { inputs, provenance, .. } = &model.description;
        let alone = inputs.iter().enumerate();
        let alone =
            alone.filter_map(|(c, port)| Self::of(port, commands.clone().map(|(t, row)| (t, row[c]))));
        let together = provenance.moved_together.iter().filter_map(|together| {
            let last = together.factors.iter().rposition(|factor| *factor != 0.0)?;
            let (name, half) = (together.deviation_name(inputs), together.half_width());
            let deviations = commands.clone().map(|(t, row)| (t, together.deviation(row)));
            Self::of_range((&name, &inputs[last].channel.unit), [-half, half], deviations)
        });
        alone.chain(together).collect()
    }

    fn of_range(
        (name, unit): (&str, &str),
        [least, most]: [f64; 2],
        series: impl Iterator<Item = (f64, f64)>,
    ) -> Option<Self> {
        let room = ROOM * (most - least);
        let (lowest, highest) = (least - room, most + room);
        let (mut from_s, mut low, mut high) = (f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY);
        for (t, value) in series {
            (low, high) = (low.min(value), high.max(value));
            if value < lowest || value > highest {
                from_s = from_s.min(t);
            }
        }
        from_s.is_finite().then(|| Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            from_s,
            reached: [low, high],
            range: [least, most],
        })
    }
}

impl Outside {
    /// Why the motion is not to be believed from its time on.
    pub fn reason(&self) -> String {
        let Self { name, from_s, .. } = self;
        let ([low, high], [least, most], unit) = self.shown();
        format!(
            "from {from_s:.1} s on: {name} goes from {low} to {high}{unit}, and only from {least} to {most}{unit} in the logs of the model"
        )
    }

    /// What is reached and what was seen, with the unit; angles in degrees.
    fn shown(&self) -> ([f64; 2], [f64; 2], String) {
        let (factor, unit) = scale(&self.unit);
        let [reached, range] =
            [self.reached, self.range].map(|range| range.map(|value| rounded(factor * value)));
        (reached, range, unit)
    }

    /// Whether a motion can be believed up to the values that are reached.
    pub fn is_believed(&self) -> bool {
        let ([low, high], [least, most]) = (self.reached, widened(self.range));
        low >= least && high <= most
    }
}

impl Display for Outside {
    /// What is reached and what was seen; angles in degrees.
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let Self { name, from_s, .. } = self;
        let ([low, high], [least, most], unit) = self.shown();
        write!(
            out,
            "the model extrapolates from {from_s:.1} s on: {name} goes from {low} to {high}{unit}, and from {least} to {most}{unit} in its logs"
        )
    }
}

/// Factor and unit, with a blank before it, in which a quantity is shown.
fn scale(unit: &str) -> (f64, String) {
    match unit {
        "rad" => (1.0_f64.to_degrees(), String::from(" deg")),
        "rad/s" => (1.0_f64.to_degrees(), String::from(" deg/s")),
        "" | "1" => (1.0, String::new()),
        unit => (1.0, format!(" {unit}")),
    }
}

fn rounded(value: f64) -> f64 {
    (1e3 * value).round() / 1e3 + 0.0
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
