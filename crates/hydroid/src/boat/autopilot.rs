//! Inputs from what a recording holds of its outputs: parameters of the autopilot, else the pulse widths themselves.

use std::collections::BTreeMap;

use super::{Boat, Evidence, Input, Property, Role};
use crate::log::Neutral;

/// A function of an output of ArduPilot (`SERVOn_FUNCTION`) that is reversible: its neutral position is within its limits.
pub(crate) struct Function {
    pub(crate) number: f64,
    /// Name of the input.
    pub(crate) name: &'static str,
    meaning: &'static str,
    role: Role,
}

pub(crate) const FUNCTIONS: [Function; 4] = [
    Function { number: 26.0, name: "steering", meaning: "ground steering", role: Role::Steering },
    Function { number: 70.0, name: "throttle", meaning: "throttle", role: Role::Propulsion },
    Function { number: 73.0, name: "throttle_left", meaning: "throttle left", role: Role::Thruster },
    Function { number: 74.0, name: "throttle_right", meaning: "throttle right", role: Role::Thruster },
];

/// Usual pulse widths \[us\].
const USUAL_LIMITS_US: [f64; 2] = [1100.0, 1900.0];
/// Half of them \[us\].
const USUAL_SCALE_US: f64 = 400.0;

/// An output of an autopilot, with its number as the parameters count: from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Pulse width of ArduPilot: `SERVOn_FUNCTION`, `SERVOn_MIN`, `SERVOn_MAX`, `SERVOn_TRIM`.
    ArduPilot(u32),
    /// Pulse width of PX4: `PWM_MAIN_MINn`, `PWM_MAIN_MAXn`, `PWM_MAIN_DISn`.
    Px4(u32),
    /// Normalized command of a motor of PX4, whose bit in `CA_R_REV` says that it is reversible.
    Px4Motor(u32),
}

/// The values of a command in a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Range {
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
    /// Neutral position of pulse widths.
    pub neutral: Option<Neutral>,
}

impl Boat {
    /// Adds what a recording says of an input: by the parameters of the autopilot, if it is an output of one, else by its
    /// values. Returns remarks on what is not known or contradicts itself, with the remedy.
    pub fn find_output(
        &mut self,
        name: &str,
        output: Option<Output>,
        parameters: &BTreeMap<String, f64>,
        seen: &Range,
    ) -> Vec<String> {
        let mut found = Finder { name, parameters, input: Input::default(), remarks: Vec::new() };
        let is_known = match output {
            Some(Output::ArduPilot(n)) => found.ardupilot(n),
            Some(Output::Px4(n)) => found.px4(n, seen),
            Some(Output::Px4Motor(n)) => found.px4_motor(n),
            None => false,
        };
        if !is_known && let Some(neutral) = &seen.neutral {
            found.pulses(neutral, seen);
        }
        if let Some([low, high]) = found.input.limits
            && let margin = 0.01 * (high - low)
            && let Some(value) =
                [seen.low, seen.high].into_iter().find(|x| *x < low - margin || *x > high + margin)
        {
            let what = format!("the recording has {value}, outside the limits {low} to {high}");
            found.remark(what, "correct limits, or leave that part of the recording out");
        }
        if found.input != Input::default() {
            self.inputs.insert(name.to_owned(), found.input);
        }
        found.remarks
    }
}

struct Finder<'a> {
    name: &'a str,
    parameters: &'a BTreeMap<String, f64>,
    input: Input,
    remarks: Vec<String>,
}

impl Finder<'_> {
    fn parameter(&self, key: &str) -> Option<f64> {
        self.parameters.get(key).copied()
    }

    fn remark(&mut self, what: impl AsRef<str>, remedy: &str) {
        self.remarks.push(format!(
            "{}: {}: {remedy} in [boat.inputs.{}]",
            self.name,
            what.as_ref(),
            self.name
        ));
    }

    fn neutral(&mut self, value: f64, evidence: Evidence) {
        self.input.neutral = Some(value);
        self.input.found.insert(Property::Neutral, evidence);
    }

    fn limits(&mut self, limits: [f64; 2], evidence: Evidence) {
        self.input.limits = Some(limits);
        self.input.found.insert(Property::Limits, evidence);
    }

    fn scale(&mut self, scale: f64, evidence: Evidence) {
        self.input.scale = Some(scale);
        self.input.found.insert(Property::Scale, evidence);
    }

    /// Limits by two parameters; none if they are not known, or contradict each other.
    fn limits_of(&mut self, low: &str, high: &str) -> Option<[f64; 2]> {
        let limits = [self.parameter(low)?, self.parameter(high)?];
        if limits[0] >= limits[1] {
            let what = format!(
                "{low} = {} is not below {high} = {}; the parameters are not used",
                limits[0], limits[1]
            );
            self.remark(what, "correct them in the autopilot, or check neutral, limits and scale");
            return None;
        }
        self.limits(limits, Evidence::Parameter(format!("{low}, {high}")));
        Some(limits)
    }

    /// True if the pulse widths need not be asked.
    fn ardupilot(&mut self, n: u32) -> bool {
        let key = |what: &str| format!("SERVO{n}_{what}");
        let (low, high, trim) = (key("MIN"), key("MAX"), key("TRIM"));
        let Some(number) = self.parameter(&key("FUNCTION")) else { return false };
        self.input.unit = Some("us".to_owned());
        let limits = self.limits_of(&low, &high);
        let Some(function) = FUNCTIONS.iter().find(|function| function.number == number) else {
            // Only of a reversible output is the neutral position known: a motor of a copter rests at its lower limit.
            let what = format!("{} = {number} is not a function whose role is known", key("FUNCTION"));
            self.remark(what, "state role, neutral and scale");
            return true;
        };
        self.input.role = Some(function.role);
        let evidence = format!("{} = {number} ({})", key("FUNCTION"), function.meaning);
        self.input.found.insert(Property::Role, Evidence::Parameter(evidence));
        if self.parameter(&key("REVERSED")) == Some(1.0) {
            self.remarks.push(format!(
                "{}: {} = 1: a shorter pulse pushes ahead or turns to starboard, as the recording has it",
                self.name,
                key("REVERSED")
            ));
        }
        let Some(limits) = limits else { return false };
        let middle = limits[0].midpoint(limits[1]);
        let why = match self.parameter(&trim) {
            Some(value) if (limits[0]..=limits[1]).contains(&value) => {
                self.neutral(value, Evidence::Parameter(trim));
                None
            }
            Some(value) => {
                let what = format!(
                    "{trim} = {value} is outside {low} = {} to {high} = {}; it is not used",
                    limits[0], limits[1]
                );
                self.remark(what, "correct it in the autopilot, or check neutral");
                Some(format!("{trim} is outside"))
            }
            None => Some(format!("the file has no {trim}")),
        };
        if let Some(why) = why {
            self.neutral(middle, Evidence::Convention(format!("middle of {low} and {high}: {why}")));
        }
        self.scale((limits[1] - limits[0]) / 2.0, Evidence::Parameter(format!("half of {high} - {low}")));
        true
    }

    fn px4(&mut self, n: u32, seen: &Range) -> bool {
        let key = |what: &str| format!("PWM_MAIN_{what}{n}");
        let (low, high, disarmed) = (key("MIN"), key("MAX"), key("DIS"));
        // Older versions have -1 for a common value; a function of 0 is an output that is not used.
        let is_set = |key: &str| self.parameter(key).is_some_and(|value| value > 0.0);
        if !is_set(&low) || !is_set(&high) || self.parameter(&key("FUNC")) == Some(0.0) {
            return false;
        }
        self.input.unit = Some("us".to_owned());
        let Some(limits) = self.limits_of(&low, &high) else { return false };
        match (self.parameter(&disarmed), &seen.neutral) {
            (Some(value), _) if (limits[0]..=limits[1]).contains(&value) => {
                self.neutral(value, Evidence::Parameter(format!("{disarmed}, the disarmed output")));
            }
            (_, Some(neutral)) => self.neutral_of(neutral),
            _ => {
                self.remark(
                    "neither parameters nor values tell the neutral position",
                    "state neutral and scale",
                );
                return true;
            }
        }
        self.scale((limits[1] - limits[0]) / 2.0, Evidence::Parameter(format!("half of {high} - {low}")));
        true
    }

    fn px4_motor(&mut self, n: u32) -> bool {
        self.neutral(0.0, Evidence::Convention("actuator_motors.control is 0 at rest".to_owned()));
        if let Some(reversible) = self.parameter("CA_R_REV") {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bits; saturates")]
            let is_reversible = reversible as u32 >> (n - 1) & 1 == 1;
            let low = if is_reversible { -1.0 } else { 0.0 };
            self.limits([low, 1.0], Evidence::Parameter(format!("CA_R_REV = {reversible}")));
        }
        true
    }

    fn neutral_of(&mut self, neutral: &Neutral) {
        self.neutral(neutral.value, Evidence::Log(neutral.words().to_owned()));
    }

    fn pulses(&mut self, neutral: &Neutral, seen: &Range) {
        self.input.unit = Some("us".to_owned());
        self.neutral_of(neutral);
        let usual = || Evidence::Convention("usual for a pulse width: no parameter states it".to_owned());
        self.scale(USUAL_SCALE_US, usual());
        let [low, high] = USUAL_LIMITS_US;
        if seen.low < low || seen.high > high {
            let what = format!(
                "its values, {} to {}, are beyond the usual limits, {low} to {high}, and no parameter states them",
                seen.low, seen.high
            );
            self.remark(what, "state limits");
        } else {
            self.limits(USUAL_LIMITS_US, usual());
        }
    }
}
