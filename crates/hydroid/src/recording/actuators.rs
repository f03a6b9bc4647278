//! Commands among the fields of a recording: one for each actuator.

use super::survey::TopicSurvey;
use super::words::{DEVICES, is_unit, words};

/// What a field states of an actuator, the best input first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    /// The signal to its drive.
    Signal,
    Command,
    /// A lever.
    Lever,
    /// It is not said.
    Unknown,
    Measured,
    SetPoint,
}

impl Stage {
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Signal => "signal to the drive",
            Self::Command => "command",
            Self::Lever => "lever",
            Self::Unknown => "state",
            Self::Measured => "measurement",
            Self::SetPoint => "set-point",
        }
    }
}

/// Words of stages. The first that a name has is its own: a measured command is a measurement.
const STAGES: &[(Stage, &[&str])] = &[
    (
        Stage::SetPoint,
        &[
            "setpoint",
            "set",
            "sp",
            "target",
            "desired",
            "des",
            "ref",
            "reference",
            "soll",
            "requested",
            "req",
        ],
    ),
    (
        Stage::Measured,
        &["feedback", "fb", "actual", "act", "meas", "measured", "measurement", "ist", "rsa", "echo"],
    ),
    (Stage::Signal, &["pwm", "servo"]),
    (Stage::Command, &["cmd", "command", "commanded", "order", "ordered", "befehl"]),
    (Stage::Lever, &["throttle", "thr", "gas", "helm", "steering", "tiller", "wheel", "pinne"]),
];

/// Words that say what an actuator does, and by which a field of a topic of any name is taken for a command.
const STEERING: &[&str] =
    &["rudder", "rsa", "delta", "helm", "steering", "tiller", "ruder", "ruderlage", "azimuth", "nozzle"];
const PROPULSION: &[&str] = &["throttle", "thr", "rpm", "thrust", "drehzahl", "fahrhebel"];
/// Devices: those in a row are the same one.
const MACHINES: &[&[&str]] = &[
    &["motor", "engine", "prop", "propeller", "maschine", "schraube"],
    &["thruster"],
    &["bowthruster"],
    &["vsp"],
    &["waterjet"],
];
/// Commands of actuators that are not named.
const ANY: &[&str] = &[
    "cmd",
    "command",
    "commanded",
    "order",
    "pwm",
    "servo",
    "actuator",
    "actuators",
    "outputs",
    "rcou",
    "setpoint",
];
/// Words of fields that are none.
const NO_COMMANDS: &[&str] = &[
    "valid",
    "time",
    "timestamp",
    "battery",
    "voltage",
    "current",
    "armed",
    "temperature",
    "temp",
    "seq",
    "status",
    "mode",
    "error",
    "noutputs",
    "number",
    "stamp",
    "sec",
    "nanosec",
    "count",
    "rate",
    "deviation",
    "load",
    "power",
    "hours",
    "fuel",
    "oil",
];
/// Words that do not tell actuators apart.
const COMMON: &[&str] = &[
    "main", "angle", "ang", "position", "pos", "winkel", "lage", "speed", "shaft", "rev", "revs", "n", "of",
    "point",
];
/// Words of the sides.
const SIDES: &[(&str, &[&str])] = &[
    ("left", &["port", "l", "bb", "backbord", "links"]),
    ("right", &["starboard", "stbd", "r", "sb", "stb", "steuerbord", "rechts"]),
];

fn is_of(word: &str, of: &[&str]) -> bool {
    of.contains(&word)
}

fn machine(word: &str) -> Option<usize> {
    MACHINES.iter().position(|row| is_of(word, row))
}

/// Whether a word says what a field states of an actuator or of a controller.
pub(super) fn is_role(word: &str) -> bool {
    let of = |stage: &Stage| [Stage::Command, Stage::SetPoint].contains(stage);
    STAGES.iter().any(|(stage, words)| of(stage) && is_of(word, words))
}

/// Words of a shaft speed, if their unit is one of rotation.
const SHAFT: &[&str] = &["n", "shaft", "welle", "wellendrehzahl"];

/// Whether a name is that of a command by its words; those of a shaft speed need its unit.
pub(super) fn is_command(name: &str, is_rotation: bool) -> bool {
    let words = words(name);
    let of = |word: &String| {
        is_of(word, STEERING)
            || is_of(word, PROPULSION)
            || is_of(word, ANY)
            || machine(word).is_some()
            || is_rotation && is_of(word, SHAFT)
    };
    words.iter().any(of) && !words.iter().any(|word| is_of(word, NO_COMMANDS))
}

/// Whether a name has words of something else than commands.
pub(super) fn is_none(name: &str) -> bool {
    words(name).iter().any(|word| is_of(word, NO_COMMANDS))
}

/// Whether a topic is of actuators by its name or type.
pub(super) fn is_topic(topic: &TopicSurvey) -> bool {
    [STEERING, PROPULSION, ANY].into_iter().chain(MACHINES.iter().copied()).any(|words| topic.is(words))
}

/// What the name of a command says of an actuator.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Actuator {
    pub(super) steers: bool,
    /// Number, side and other words; without them the device.
    pub(super) which: Vec<String>,
    pub(super) stage: Stage,
}

impl Actuator {
    pub(super) fn of(name: &str) -> Self {
        let words = words(name);
        let has = |of: &[&str]| words.iter().any(|word| is_of(word, of));
        // The angle of a thruster steers, its speed does not.
        let steers = !has(PROPULSION) && (has(STEERING) || has(&["angle", "ang", "servo", "winkel"]));
        let stage = STAGES.iter().find(|(_, of)| has(of)).map_or(Stage::Unknown, |(stage, _)| *stage);
        let is_common = |word: &String| {
            is_of(word, STEERING)
                || is_of(word, PROPULSION)
                || is_of(word, ANY)
                || is_of(word, COMMON)
                || is_of(word, DEVICES)
                || machine(word).is_some()
                || is_unit(word)
                || STAGES.iter().any(|(_, of)| is_of(word, of))
        };
        let side = |word: &String| {
            let of = SIDES.iter().find(|(_, words)| is_of(word, words));
            of.map_or(word.clone(), |(side, _)| (*side).to_owned())
        };
        let mut which: Vec<String> = words.iter().filter(|word| !is_common(word)).map(side).collect();
        which.sort();
        if which.is_empty()
            && let Some(machine) = words.iter().find_map(|word| machine(word)).filter(|row| *row > 0)
        {
            which.push(MACHINES[machine][0].to_owned());
        }
        Self { steers, which, stage }
    }

    /// Whether two names are of one actuator.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.steers == other.steers && self.which == other.which
    }
}
