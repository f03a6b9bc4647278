//! Answers: one line of JSON for each line of the stream.

use std::io::Write as _;

use hydroid_core::adapt::Outcome;
use hydroid_core::control::Mode;
use hydroid_core::predict::Current;

use super::session::Session;
use hydroid::adapt::{BAND_80, BAND_95};
use hydroid::boat::Raw;
use hydroid::closed_loop::{Guided, Pilot};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Status {
    Used(Outcome),
    /// Used by a model that does not learn.
    Constant,
    /// Used as the first sample of a new run.
    Reset,
    /// Not after the last sample.
    Late,
    /// Farther ahead than the longest gap, and not confirmed.
    Ahead,
    /// Answered before a restart.
    Repeated,
    /// Between the grid points of the model.
    Between,
    Error,
    /// Not a line: a measurement on which the command depends is too old.
    Lost,
}

impl Status {
    /// Whether a new run began.
    pub(crate) fn is_reset(self) -> bool {
        matches!(self, Self::Reset)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Used(Outcome::Waiting) => "waiting",
            Self::Constant => "used",
            Self::Used(Outcome::Accepted) => "accepted",
            Self::Used(Outcome::Inflated { .. }) => "inflated",
            Self::Used(Outcome::Rejected(_)) => "rejected",
            Self::Used(Outcome::RolledBack) => "rolled_back",
            Self::Reset => "reset",
            Self::Late => "late",
            Self::Ahead => "ahead",
            Self::Repeated => "repeated",
            Self::Between => "between",
            Self::Error => "error",
            Self::Lost => "lost",
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Writer {
    line: Vec<u8>,
    /// Names of the outputs as JSON keys.
    keys: Vec<Vec<u8>>,
    /// Places, names and raw values of the inputs that are commanded.
    commands: Vec<(usize, Vec<u8>, Option<Raw>)>,
}

impl Writer {
    pub(super) fn new<'a>(
        outputs: impl Iterator<Item = &'a str>,
        commands: impl Iterator<Item = (usize, &'a str, Option<Raw>)>,
    ) -> Self {
        let key = |name: &str| {
            let mut key = Vec::new();
            text(&mut key, name);
            key.push(b':');
            key
        };
        let commands = commands.map(|(place, name, raw)| (place, key(name), raw)).collect();
        Self { line: Vec::new(), keys: outputs.map(key).collect(), commands }
    }

    pub(super) fn begin(&mut self, line: u64, t: Option<f64>, status: Status, note: &str) {
        self.line.clear();
        let _ = write!(self.line, "{{\"line\":{line},\"t\":");
        number(&mut self.line, t.unwrap_or(f64::NAN));
        let _ = write!(self.line, ",\"status\":\"{}\"", status.name());
        if !note.is_empty() {
            self.line.extend_from_slice(if status == Status::Error {
                b",\"message\":"
            } else {
                b",\"note\":"
            });
            text(&mut self.line, note);
        }
    }

    /// The command in force with its status, and reference, pose and errors of a sample.
    pub(super) fn steering(&mut self, pilot: &Pilot, used: bool) {
        let line = &mut self.line;
        line.extend_from_slice(b",\"command\":{");
        for (i, (place, key, _)) in self.commands.iter().enumerate() {
            entry(line, key, i == 0);
            number(line, pilot.command()[*place]);
        }
        if self.commands.iter().any(|(.., raw)| raw.is_some()) {
            line.extend_from_slice(b"},\"raw\":{");
            for (i, (place, key, raw)) in self.commands.iter().enumerate() {
                entry(line, key, i == 0);
                let command = pilot.command()[*place];
                number(line, raw.as_ref().map_or(command, |raw| raw.raw(command)));
            }
        }
        let _ = write!(line, "}},\"control\":\"{}\"", pilot.status());
        if pilot.mode() == Mode::Approach && pilot.approach_m() > 0.0 {
            line.extend_from_slice(b",\"approach\":");
            // To a centimetre.
            number(line, (pilot.approach_m() * 1e2).round() / 1e2);
        }
        for (i, (name, age)) in pilot.lost().enumerate() {
            let _ = write!(line, "{}\"{name}\":", if i == 0 { ",\"lost\":{" } else { "," });
            // To a millisecond.
            number(line, (age * 1e3).round() / 1e3);
        }
        if pilot.lost().next().is_some() {
            line.push(b'}');
        }
        let Some(Guided { reference, distance, cross_track, .. }) = pilot.guided().filter(|_| used) else {
            return;
        };
        let [x, y, psi] = pilot.eta();
        let [north, east] = reference.position;
        let numbers = [
            (",\"pose\":{\"x\":", x),
            (",\"y\":", y),
            (",\"psi\":", psi),
            ("},\"reference\":{\"x\":", north),
            (",\"y\":", east),
            (",\"course\":", reference.course),
            (",\"speed\":", reference.speed),
            ("},\"distance\":", *distance),
            (",\"cross_track\":", *cross_track),
        ];
        for (key, value) in numbers {
            line.extend_from_slice(key.as_bytes());
            number(line, value);
        }
    }

    /// The predicted poses with their bands.
    pub(super) fn track(&mut self, session: &Session) {
        let line = &mut self.line;
        let (poses, deviations) = session.track();
        for (i, key) in [",\"track\":{\"x\":", ",\"y\":", ",\"psi\":"].iter().enumerate() {
            line.extend_from_slice(key.as_bytes());
            list(line, poses.iter().map(|pose| pose[i]));
        }
        for (name, width) in [("band_80", BAND_80), ("band_95", BAND_95)] {
            let _ = write!(line, ",\"{name}\":{{\"position\":");
            list(line, deviations.iter().map(|[position, _]| width * position));
            line.extend_from_slice(b",\"psi\":");
            list(line, deviations.iter().map(|[_, heading]| width * heading));
            line.push(b'}');
        }
        line.push(b'}');
    }

    pub(super) fn session(&mut self, session: &Session) {
        let line = &mut self.line;
        let innovations = session.adapter().innovations();
        if !innovations.is_empty() {
            line.extend_from_slice(b",\"innovation\":");
            list(line, innovations.iter().map(|i| i.value));
            let nis: f64 = innovations.iter().map(|i| (i.value / i.deviation).powi(2)).sum();
            if nis.is_finite() {
                line.extend_from_slice(b",\"nis\":");
                number(line, nis);
            }
        }
        if let Some(guard) = session.adapter().guard() {
            let _ = write!(line, ",\"predicted_by\":\"{}\"", guard.active().name());
        }
        line.extend_from_slice(b",\"estimate\":{");
        for (i, (key, value)) in self.keys.iter().zip(session.estimate()).enumerate() {
            entry(line, key, i == 0);
            number(line, *value);
        }
        if let Some(Current { velocity, covariance: [north, _, east] }) = session.adapter().current() {
            line.extend_from_slice(b"},\"through_water\":{");
            for (i, (key, value)) in self.keys.iter().zip(session.through_water()).enumerate() {
                entry(line, key, i == 0);
                number(line, *value);
            }
            let half_widths = [north, east].map(|variance| BAND_80 * variance.sqrt());
            for (i, key) in ["north", "east"].iter().enumerate() {
                line.extend_from_slice(if i == 0 { b"},\"current\":{" } else { b"," });
                let _ = write!(line, "\"{key}\":");
                number(line, velocity[i]);
            }
            line.extend_from_slice(b",\"band_80\":");
            list(line, half_widths.into_iter());
        }
        line.extend_from_slice(b"},\"prediction\":{\"horizons\":[");
        for (i, horizon) in session.horizons().iter().enumerate() {
            let _ = write!(line, "{}{horizon}", if i == 0 { "" } else { "," });
        }
        line.push(b']');
        for (output, key) in self.keys.iter().enumerate() {
            entry(line, key, false);
            list(line, session.prediction(output));
        }
        for (name, width) in [("band_80", BAND_80), ("band_95", BAND_95)] {
            let _ = write!(line, "}},\"{name}\":{{");
            for (output, key) in self.keys.iter().enumerate() {
                entry(line, key, output == 0);
                list(line, session.deviations(output).map(|deviation| width * deviation));
            }
        }
        line.push(b'}');
    }

    pub(super) fn end(&mut self, us: Option<f64>) -> &[u8] {
        if let Some(us) = us {
            let _ = write!(self.line, ",\"us\":{us:.1}");
        }
        self.line.extend_from_slice(b"}\n");
        &self.line
    }
}

fn entry(line: &mut Vec<u8>, key: &[u8], first: bool) {
    if !first {
        line.push(b',');
    }
    line.extend_from_slice(key);
}

/// Writes a number so that it is read back exactly; `null` if not finite.
fn number(line: &mut Vec<u8>, x: f64) {
    let _ = serde_json::to_writer(line, &x);
}

fn text(line: &mut Vec<u8>, text: &str) {
    let _ = serde_json::to_writer(line, text);
}

fn list(line: &mut Vec<u8>, numbers: impl Iterator<Item = f64>) {
    line.push(b'[');
    for (i, x) in numbers.enumerate() {
        if i > 0 {
            line.push(b',');
        }
        number(line, x);
    }
    line.push(b']');
}
