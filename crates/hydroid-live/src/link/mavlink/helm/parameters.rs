//! Parameters of the autopilot that are asked for, one after another.

use super::axis::{Axis, Kind};
use super::{MS, is_due};

/// Time for the answer to a question.
const ANSWER_NS: i64 = 1_000 * MS;

/// A parameter that some releases do not have is asked for so many times.
const ATTEMPTS: u32 = 5;

/// Names of the system id whose commands are taken, from 4.7 on and before.
pub(super) const GCS_IDS: [&str; 2] = ["MAV_GCS_SYSID", "SYSID_MYGCS"];

/// Names of the switch (bit 0) that restricts set-points to it.
pub(super) const ENFORCE: [&str; 2] = ["MAV_OPTIONS", "SYSID_ENFORCE"];

/// A parameter.
#[derive(Clone, Debug)]
struct Parameter {
    name: String,
    /// Of parameters with the same number, which are names of several releases, one answers.
    group: usize,
    /// Whether all releases have one of the group.
    is_required: bool,
    value: Option<f64>,
    is_absent: bool,
    attempts: u32,
}

/// Parameters that the checks need.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    list: Vec<Parameter>,
    /// The last question, and its time until it is answered.
    asked: usize,
    asked_ns: Option<i64>,
}

impl Parameters {
    /// Those of the commands, and others: names that all releases have, and names that some do not have.
    pub(super) fn new(axes: &[Axis], kind: Kind, others: &[Vec<String>; 2]) -> Self {
        let mut list = Vec::new();
        let mut group = 0;
        let mut add = |is_required, names: &[&str]| {
            list.extend(names.iter().map(|&name| Parameter {
                name: name.to_owned(),
                group,
                is_required,
                value: None,
                is_absent: false,
                attempts: 0,
            }));
            group += 1;
        };
        add(true, &GCS_IDS);
        add(false, &["MAV_GCS_SYSID_HI"]);
        if kind == Kind::Overrides {
            for name in ["RC_OVERRIDE_TIME", "RC_OPTIONS", "FS_THR_ENABLE", "FS_THR_VALUE"] {
                add(true, &[name]);
            }
            // 4.8 has RCn_OPTION in their place.
            for name in ["RCMAP_THROTTLE", "MODE_CH"] {
                add(false, &[name]);
            }
            for channel in axes.iter().map(Axis::channel) {
                for field in ["TRIM", "DZ", "OPTION"] {
                    add(true, &[&format!("RC{channel}_{field}")]);
                }
            }
        } else {
            add(true, &ENFORCE);
        }
        for (names, is_required) in others.iter().zip([true, false]) {
            for name in names {
                add(is_required, &[name]);
            }
        }
        Self { asked: list.len() - 1, list, asked_ns: None }
    }

    /// The value of a parameter.
    pub(super) fn value(&self, name: &str) -> Option<f64> {
        self.list.iter().find(|parameter| parameter.name == name)?.value
    }

    /// Name and value of the first parameter that was answered.
    pub(super) fn first_of(&self, names: &[&'static str]) -> Option<(&'static str, f64)> {
        names.iter().find_map(|&name| self.value(name).map(|value| (name, value)))
    }

    /// Names of the parameters whose answers are awaited.
    pub(super) fn open(&self) -> Vec<&str> {
        self.list.iter().filter(|parameter| self.is_open(parameter)).map(|p| p.name.as_str()).collect()
    }

    fn is_open(&self, parameter: &Parameter) -> bool {
        let mut group = self.list.iter().filter(|other| other.group == parameter.group);
        let is_given_up = if parameter.is_required {
            // One of the group must be known.
            parameter.is_absent && !group.clone().all(|other| other.is_absent)
        } else {
            parameter.is_absent || parameter.attempts >= ATTEMPTS
        };
        !is_given_up && group.all(|other| other.value.is_none())
    }

    /// Takes an answer: a value, or `None` if there is no such parameter.
    pub(super) fn answer(&mut self, name: &str, value: Option<f64>) {
        let Some(index) = self.list.iter().position(|parameter| parameter.name == name) else { return };
        let parameter = &mut self.list[index];
        parameter.is_absent = value.is_none();
        if let Some(value) = value.filter(|value| value.is_finite()) {
            parameter.value = Some(value);
            if index == self.asked {
                // The next question does not wait.
                self.asked_ns = None;
            }
        }
    }

    /// The next question, when the last one was answered or has waited for long.
    pub(super) fn question(&mut self, now_ns: i64) -> Option<&str> {
        if !is_due(self.asked_ns, ANSWER_NS, now_ns) {
            return None;
        }
        let count = self.list.len();
        let indices = (1..=count).map(|step| (self.asked + step) % count);
        self.asked = indices.into_iter().find(|&index| self.is_open(&self.list[index]))?;
        self.asked_ns = Some(now_ns);
        let parameter = &mut self.list[self.asked];
        parameter.attempts = parameter.attempts.saturating_add(1);
        Some(&parameter.name)
    }

    /// Does not wait for the last answer.
    pub(super) fn forget_question(&mut self) {
        self.asked_ns = None;
    }

    pub(super) fn forget(&mut self) {
        self.forget_question();
        for parameter in &mut self.list {
            (parameter.value, parameter.is_absent, parameter.attempts) = (None, false, 0);
        }
    }
}
