//! Neutral value and limits of an input in the units of the model: stated, found, by convention, or from the logs.

use std::fmt::Write as _;

use serde::Serialize;

use super::{Boat, BoatError, Evidence, Input, Property, Raw, Role};
use crate::key::key;
use crate::log::Channel;
use crate::log::pulses::{PULSE_US, USUAL_US};
use crate::log::units::{Quantity, Unit};
use crate::toml_file;

/// Hard over of a steering angle: the 35 degrees at which the IMO prescribes turning circles (MSC.137(76), section 5.2).
pub const HARD_OVER_DEG: f64 = 35.0;

/// Largest part of a logged command beyond a stated limit, relative to the width of the limits.
const ROOM: f64 = 0.01;

/// Neutral value and limits of an input, in the unit of the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Value {
    /// Name of the input.
    pub name: String,
    /// Unit of the model's input; empty if it is not known.
    pub unit: String,
    /// Value without effect: `(raw - neutral) / scale` is 0.
    pub neutral: f64,
    /// Lowest and highest value that the actuator takes. An input that is not commanded has one value.
    pub limits: [f64; 2],
    /// How the neutral value was found; none if it is stated.
    pub neutral_found: Option<Evidence>,
    /// How the limits were found; none if they are stated.
    pub limits_found: Option<Evidence>,
    /// Whether the input is commanded.
    pub is_commanded: bool,
    /// How its values are stated, if not in the unit of the model.
    #[serde(skip)]
    pub stated_as: Option<Raw>,
}

impl Value {
    /// Properties that only follow from the logs in which the model was seen, and may not decide what is sent to a vessel.
    pub fn weak(&self) -> impl Iterator<Item = Property> + '_ {
        let both = [(Property::Neutral, &self.neutral_found), (Property::Limits, &self.limits_found)];
        let weak = both.into_iter().filter(|(_, found)| matches!(found, Some(Evidence::Log(_))));
        weak.filter(|_| self.is_commanded).map(|(property, _)| property)
    }

    /// Neutral value, limits and unit for people: angles in degrees.
    pub fn shown(&self) -> (f64, [f64; 2], String) {
        let (factor, unit) = match self.unit.as_str() {
            "rad" => (1.0_f64.to_degrees(), String::from(" deg")),
            "" | "1" => (1.0, String::new()),
            unit => (1.0, format!(" {unit}")),
        };
        let number = |value: f64| (1e4 * factor * value).round() / 1e4 + 0.0;
        (number(self.neutral), self.limits.map(number), unit)
    }

    /// Neutral value and limits with their evidence, in the unit of the model and as they are sent.
    pub fn describe(&self, raw: Option<&Raw>) -> String {
        let unit =
            if matches!(self.unit.as_str(), "" | "1") { String::new() } else { format!(" {}", self.unit) };
        self.text((self.neutral, self.limits, unit), raw)
    }

    /// As [`describe`](Self::describe), with angles in degrees.
    pub fn describe_in_degrees(&self, raw: Option<&Raw>) -> String {
        self.text(self.shown(), raw)
    }

    fn text(&self, (neutral, [low, high], unit): (f64, [f64; 2], String), raw: Option<&Raw>) -> String {
        let known =
            |found: &Option<Evidence>| found.as_ref().map_or("stated".to_owned(), ToString::to_string);
        let (neutral_found, limits_found) = (known(&self.neutral_found), known(&self.limits_found));
        let mut text = if self.is_commanded {
            format!(
                "neutral {neutral}{unit} ({neutral_found}), limits {low} to {high}{unit} ({limits_found})"
            )
        } else {
            format!("not commanded, {neutral}{unit} ({neutral_found})")
        };
        let Some(raw) = raw else { return text };
        let unit =
            if matches!(raw.unit.as_str(), "" | "1") { String::new() } else { format!(" {}", raw.unit) };
        let _ = write!(text, "; as it is sent, neutral {}{unit}", raw.raw(self.neutral));
        if self.is_commanded {
            let [low, high] = sorted(self.limits.map(|limit| raw.raw(limit)));
            let _ = write!(text, ", limits {low} to {high}{unit}");
        }
        let _ = write!(text, ", and in the model {} (raw - {})", raw.factor, raw.offset);
        text
    }

    /// What is said of the properties that only follow from the logs; none if there are none.
    pub fn note(&self) -> Option<String> {
        // In the unit in which they are stated.
        let (name, (neutral, [low, high], unit)) = match &self.stated_as {
            Some(raw) => {
                let unit = Some(&raw.unit).filter(|unit| !matches!(unit.as_str(), "" | "1"));
                let number = |value: f64| (1e4 * raw.raw(value)).round() / 1e4 + 0.0;
                let unit = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
                (&self.name, (number(self.neutral), sorted(self.limits.map(number)), unit))
            }
            None => (&self.name, self.shown()),
        };
        let why = |found: &Option<Evidence>| found.as_ref().map(ToString::to_string).unwrap_or_default();
        let said = self.weak().map(|property| match property {
            Property::Neutral => format!("neutral of {name}: {neutral}{unit}, {}", why(&self.neutral_found)),
            _ => format!("limits of {name}: {low} to {high}{unit}, {}", why(&self.limits_found)),
        });
        let said = said.collect::<Vec<_>>().join("; ");
        // A part of documents, which are the same from every front end.
        (!said.is_empty()).then(|| format!("{said}; state them with {}", line(name, self.weak())))
    }
}

/// The options that state properties of an input.
fn options(name: &str, missing: impl Iterator<Item = Property>) -> String {
    let stated = missing.map(|property| match property {
        Property::Neutral => key("neutral").is(format_args!("{name}=VALUE")).to_string(),
        _ => key("limit").is(format_args!("{name}=LOW:HIGH")).to_string(),
    });
    stated.collect::<Vec<_>>().join(" and ")
}

/// The line of a configuration that states properties of an input.
fn line(name: &str, missing: impl Iterator<Item = Property>) -> String {
    let stated = missing.map(|property| match property {
        Property::Neutral => "neutral = VALUE",
        _ => "limits = [LOW, HIGH]",
    });
    format!("[boat.inputs.{}] {}", toml_file::key(name), stated.collect::<Vec<_>>().join(", "))
}

/// From raw values to those of the model: `(raw - offset) factor`.
#[derive(Clone, Copy)]
pub(super) struct Formula {
    pub(super) offset: f64,
    pub(super) factor: f64,
}

impl Formula {
    fn model(self, raw: f64) -> f64 {
        // Without the sign of a zero.
        (raw - self.offset) * self.factor + 0.0
    }

    fn raw(self, model: f64) -> f64 {
        model / self.factor + self.offset
    }
}

fn sorted([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

impl Boat {
    /// Neutral value and limits of an input. `seen` is the range in which the model was seen; `None` if there is no model.
    ///
    /// The strongest source counts: what is stated or found; conventions (a steering angle has the neutral position 0 and
    /// 35 degrees to each side, or its range in the logs if that is larger; a physical
    /// quantity, and a number whose range contains 0, rests at 0); the log, as weak [`Evidence::Log`].
    ///
    /// # Errors
    /// If the numbers contradict each other, or there is no source.
    pub fn value(&self, channel: &Channel, seen: Option<[f64; 2]>) -> Result<Value, BoatError> {
        let none = Input::default();
        let input = self.inputs.get(&channel.name).unwrap_or(&none);
        let formula = input.formula(channel)?;
        let unit = input.raw_unit(channel);
        let found = |property| input.found.get(&property).cloned();
        let stated = input.limits.map(|limits| sorted(limits.map(|raw| formula.model(raw))));
        let range = seen.or(stated);
        let contains = |x: f64| seen.iter().chain(&stated).any(|[low, high]| *low <= x && x <= *high);
        let by = |text: &str| Some(Evidence::Convention(text.to_owned()));
        let quantity = unit.as_ref().and_then(|unit| unit.quantity);
        let is_pulse = unit.as_ref().is_some_and(|unit| unit.si == "us")
            && range.is_none_or(|range| range.iter().all(|&value| PULSE_US.contains(&formula.raw(value))));
        let is_physical = quantity.is_some_and(|of| !matches!(of, Quantity::Number | Quantity::Time));
        let name = || channel.name.clone();
        let missing = |property| BoatError::Missing {
            input: name(),
            what: if property == Property::Neutral { "neutral" } else { "limits" },
            line: line(&channel.name, [property].into_iter()),
            option: match property {
                Property::Neutral => key("neutral").is(format_args!("{}=VALUE", channel.name)),
                _ => key("limit").is(format_args!("{}=LOW:HIGH", channel.name)),
            }
            .to_string(),
        };
        let middle = |[low, high]: [f64; 2]| {
            (0.5 * (low + high), Some(Evidence::Log("the middle of its range in the log".to_owned())))
        };
        let (neutral, neutral_found) = match (input.neutral, input.role) {
            (Some(raw), _) => (formula.model(raw), found(Property::Neutral)),
            (None, Some(Role::Disturbance)) => (0.0, by("calm")),
            (None, Some(Role::Setting)) => range.map(middle).ok_or_else(|| missing(Property::Neutral))?,
            // A motor that only turns ahead rests at its shortest pulse.
            _ if is_pulse => {
                let usual = Evidence::Log("the usual neutral pulse width".to_owned());
                (formula.model(USUAL_US), Some(usual))
            }
            _ if is_physical || contains(0.0) => (0.0, by("0, without effect")),
            _ => seen.map(middle).ok_or_else(|| missing(Property::Neutral))?,
        };
        let is_commanded = input.role.is_none_or(Role::is_commanded);
        let (limits, limits_found) = match (stated, seen) {
            _ if !is_commanded => ([neutral; 2], None),
            (Some(limits), _) => (limits, found(Property::Limits)),
            (None, seen) if input.role == Some(Role::Steering) && quantity == Some(Quantity::Angle) => {
                let degree = unit.as_ref().and_then(|unit| Unit::parse("deg").ok()?.to(unit).ok());
                let reach = HARD_OVER_DEG * degree.unwrap_or(1.0) * formula.factor.abs();
                let [low, high] = seen.unwrap_or([neutral; 2]);
                ([low.min(neutral - reach), high.max(neutral + reach)], by("35 deg, MSC.137(76) 5.2"))
            }
            (None, Some([low, high])) => {
                // An actuator reaches the neutral position that is stated for it.
                let reached = input.neutral.map_or([low, high], |_| [low.min(neutral), high.max(neutral)]);
                (reached, Some(Evidence::Log("seen in the log".to_owned())))
            }
            (None, None) => return Err(missing(Property::Limits)),
        };
        if is_commanded && stated.is_some_and(|[low, high]| !(low..=high).contains(&neutral)) {
            let [low, high] = input.limits.unwrap_or_default();
            let neutral = formula.raw(neutral);
            return Err(BoatError::NeutralOutside { input: name(), neutral, low, high });
        }
        let unit = channel.unit.clone();
        let stated_as = self.raw_input(channel, None);
        Ok(Value {
            name: name(),
            unit,
            neutral,
            limits,
            neutral_found,
            limits_found,
            is_commanded,
            stated_as,
        })
    }

    /// The value of an input as it is sent and logged, from that of a model.
    ///
    /// # Errors
    /// If the numbers of the input contradict each other.
    pub fn raw(&self, channel: &Channel, value: f64) -> Result<f64, BoatError> {
        let formula = self.inputs.get(&channel.name).map(|input| input.formula(channel)).transpose()?;
        Ok(formula.map_or(value, |formula| formula.raw(value)))
    }

    /// Checks the numbers of the inputs of a log or model: that they do not contradict each other, and that no command of
    /// the log is beyond the limits by more than 1 % of their width. `seen` is the range of an input in the log.
    ///
    /// # Errors
    /// The first contradiction.
    pub fn check_values<'a>(
        &self,
        inputs: impl IntoIterator<Item = (&'a Channel, [f64; 2])>,
    ) -> Result<(), BoatError> {
        for (channel, seen) in inputs {
            self.value(channel, Some(seen))?;
            let Some(input) = self.inputs.get(&channel.name) else { continue };
            let Some([low, high]) = input.limits else { continue };
            let formula = input.formula(channel)?;
            let logged = sorted(seen.map(|value| formula.raw(value)));
            let room = ROOM * (high - low);
            let beyond = if logged[1] > high + room { logged[1] } else { logged[0] };
            if beyond > high + room || beyond < low - room {
                return Err(BoatError::Exceeded {
                    input: channel.name.clone(),
                    low,
                    high,
                    logged: (1e6 * beyond).round() / 1e6,
                });
            }
        }
        Ok(())
    }

    /// States neutral value and limits of an input, in place of those that are known. They are in the unit of the input, or,
    /// for the limits, in another one of its quantity.
    ///
    /// # Errors
    /// If the unit is of another quantity.
    pub fn state_values(
        &mut self,
        channel: &Channel,
        neutral: Option<f64>,
        limits: Option<([f64; 2], Option<&str>)>,
    ) -> Result<(), BoatError> {
        let input = self.inputs.entry(channel.name.clone()).or_default();
        if let Some(neutral) = neutral {
            input.neutral = Some(neutral);
            input.found.remove(&Property::Neutral);
        }
        if let Some((limits, unit)) = limits {
            let factor = match unit {
                None => 1.0,
                Some(unit) => {
                    let own = input.unit.as_deref().unwrap_or(&channel.unit);
                    let factor = Unit::parse(own).and_then(|own| Unit::parse(unit)?.to(&own));
                    factor.map_err(|error| BoatError::Unit {
                        input: channel.name.clone(),
                        unit: unit.to_owned(),
                        error,
                    })?
                }
            };
            input.limits = Some(limits.map(|limit| factor * limit));
            input.found.remove(&Property::Limits);
        }
        Ok(())
    }
}

impl Input {
    /// Unit of the raw values.
    fn raw_unit(&self, channel: &Channel) -> Option<Unit> {
        Unit::parse(self.unit.as_deref().unwrap_or(&channel.unit)).ok()
    }

    /// From raw values to those of the model; an error if the numbers contradict each other.
    pub(super) fn formula(&self, channel: &Channel) -> Result<Formula, BoatError> {
        let input = || channel.name.clone();
        let numbers = self.neutral.iter().chain(self.limits.iter().flatten()).chain(&self.scale);
        if let Some(&number) = numbers.into_iter().find(|number| !number.is_finite()) {
            return Err(BoatError::NotFinite { input: input(), number });
        }
        if let Some([low, high]) = self.limits.filter(|[low, high]| low >= high) {
            return Err(BoatError::NotAscending { input: input(), low, high });
        }
        if let (Some(neutral), Some([low, high])) = (self.neutral, self.limits)
            && self.role.is_none_or(Role::is_commanded)
            && !(low..=high).contains(&neutral)
        {
            return Err(BoatError::NeutralOutside { input: input(), neutral, low, high });
        }
        if let Some(scale) = self.scale {
            if scale == 0.0 {
                return Err(BoatError::NoScale(input()));
            }
            let offset = self.neutral.ok_or_else(|| BoatError::ScaleAlone(input()))?;
            return Ok(Formula { offset, factor: 1.0 / scale });
        }
        // Values of a column without a unit are taken as they are.
        let factor = match &self.unit {
            Some(unit) if !channel.unit.is_empty() => {
                let own = Unit::parse(&channel.unit);
                let factor = own.and_then(|own| Unit::parse(unit)?.to(&own));
                factor.map_err(|error| BoatError::Unit { input: input(), unit: unit.clone(), error })?
            }
            _ => 1.0,
        };
        Ok(Formula { offset: 0.0, factor })
    }
}

/// An error if something that is sent to the vessel only follows from the logs.
///
/// # Errors
/// The first input without a stated or conventional neutral value, or without limits.
pub fn check_firm(values: &[Value]) -> Result<(), BoatError> {
    let Some(value) = values.iter().find(|value| value.weak().next().is_some()) else { return Ok(()) };
    let missing: Vec<Property> = value.weak().collect();
    let name = &value.name;
    let option = options(name, missing.iter().copied());
    let what = if missing.len() > 1 {
        "neutral value and limits"
    } else if missing[0] == Property::Neutral {
        "neutral value"
    } else {
        "limits"
    };
    Err(BoatError::Weak { input: name.clone(), what, line: line(name, missing.into_iter()), option })
}
