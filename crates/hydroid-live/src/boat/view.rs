//! The state of a session as JSON, for the page.

use serde_json::{Value, json};

use hydroid_core::predict::Current;

use super::on_board::OnBoard;
use super::steering::{EXPERIMENTS, Steering, inputs};
use super::{Boat, Said, seconds};
use crate::experiment::Fence;
use crate::link::Link;
use hydroid::adapt::BAND_95;
use hydroid::closed_loop::Pilot;

/// Importance of what is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// News.
    Info,
    /// Something that the crew should look at.
    Warning,
    /// Something does not work.
    Error,
}

impl Level {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// A predicted path.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Predicted {
    /// Time of the sample from which it begins, in nanoseconds since 1970.
    pub at_ns: i64,
    /// Horizons \[s\].
    pub seconds: Vec<f64>,
    /// North, east \[m\] and heading \[rad\] at the horizons.
    pub poses: Vec<[f64; 3]>,
    /// Upper bounds of the standard deviations of position \[m\] and heading \[rad\].
    pub deviations: Vec<[f64; 2]>,
}

impl Said {
    pub fn json(&self) -> Value {
        json!({ "id": self.id, "time": utc(self.at_ns), "level": self.level.name(), "text": self.text })
    }
}

/// Seconds since 1970.
fn utc(ns: i64) -> f64 {
    ns as f64 / 1e9
}

impl<L: Link> Boat<L> {
    /// The motion at a time in nanoseconds since 1970: time since then \[s\], north, east \[m\] and heading \[rad\].
    pub fn pose(&self, now_ns: i64) -> Option<[f64; 4]> {
        let [north, east, psi] = self.motion.at(self.motion.time())?.pose;
        Some([utc(now_ns), north, east, psi])
    }

    /// The motion at a time in nanoseconds since 1970, and the standard deviation of the position \[m\]; `None` if position
    /// or heading are not measured at present.
    pub fn motion(&self, now_ns: i64) -> Option<(hydroid::navigate::Row, f64)> {
        if !self.is_located(now_ns) {
            return None;
        }
        let row = self.motion.at(seconds(self.begun_ns, now_ns))?;
        Some((row, self.motion.uncertainty()?.0))
    }

    /// The prediction of the model on board.
    pub fn predicted(&self) -> Option<Predicted> {
        let active = self.active.as_ref()?;
        let (poses, deviations) = active.follower().track();
        let dt = active.model.description.dt;
        let [north, east] = active.path_origin;
        Some(Predicted {
            at_ns: self.at_ns(active.sample().t),
            seconds: active.horizons.iter().map(|horizon| *horizon as f64 * dt).collect(),
            poses: poses.iter().map(|pose| [pose[0] + north, pose[1] + east, pose[2]]).collect(),
            deviations: deviations.to_vec(),
        })
    }

    /// Names of the outputs of the model on board.
    pub fn outputs(&self) -> Vec<String> {
        let ports = self.active.iter().flat_map(|active| &active.model.description.outputs);
        ports.map(|port| port.channel.name.clone()).collect()
    }

    /// Measured outputs of the last sample, and their prediction one sample before.
    pub fn compared(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let active = self.active.as_ref()?;
        let measured = active.sample().outputs.clone();
        let predicted = (0..measured.len()).map(|output| active.expected(output)).collect();
        Some((measured, predicted))
    }

    /// The state. `damaged` and `dropped` count the frames that the link could not use.
    pub fn view(&self, now_ns: i64, [damaged, dropped]: [u64; 2]) -> Value {
        let clock = self.link.clock();
        let state = self.state.as_ref();
        json!({
            "time": utc(now_ns),
            "link": {
                "address": self.settings.address,
                "autopilot": self.autopilot_name,
                "lost_s": self.lost_since_ns.map(|since| utc(now_ns.saturating_sub(since))),
                "mode": state.map(|state| &state.mode),
                "armed": state.map(|state| state.armed),
                "clock_offset_s": clock.offset_s,
                "round_trip_ms": clock.round_trip_ns.map(|ns| ns as f64 / 1e6),
                "damaged": damaged,
                "dropped": dropped,
            },
            "sensors": self.view_sensors(now_ns),
            "motion": self.view_motion(now_ns),
            "recording": self.recording.as_ref().map(|recording| {
                let health = recording.health();
                json!({
                    "path": recording.path().display().to_string(),
                    "seconds": utc(now_ns.saturating_sub(recording.begun_ns)),
                    "lost": health.lost,
                    "trouble": health.trouble,
                })
            }),
            "model": self.view_model(),
            "offered": self.offered.as_ref().map(|(model, text)| json!({ "name": model.name, "text": text })),
            "identifying": self.identifying.as_ref().map(|_| json!({ "progress": null, "text": "" })),
            "outputs": self.view_outputs(),
            "prediction": self.view_prediction(),
            "errors": self.view_errors(),
            "excitation": self.view_excitation(),
            "experiment": match &self.steering {
                Steering::Experiment { kind, experiment, .. } => json!({
                    "name": kind.to_string(),
                    "progress": experiment.progress(),
                    "remaining_s": experiment.remaining_s(),
                    "text": experiment.text(),
                }),
                _ => Value::Null,
            },
            "experiments": EXPERIMENTS,
            "fence": self.fence().map(|fence| match fence {
                Fence::Circle { north, east, radius } => {
                    let [margin, reached_s] = self.margin().map_or([None; 2], |of| of.map(Some));
                    let reached_s = reached_s.filter(|s| s.is_finite());
                    json!({ "north": north, "east": east, "radius": radius, "margin": margin, "reached_s": reached_s })
                }
            }),
            "path": if let Steering::Path(path) = &self.steering { json!(path) } else { Value::Null },
            "helm": self.view_helm(now_ns),
            "actions": self.possible(),
        })
    }

    fn view_sensors(&self, now_ns: i64) -> Vec<Value> {
        let now = seconds(self.begun_ns, now_ns);
        let max_age_s = self.settings.control.max_age.map(|age| age.0);
        let sensors = self.motion.health().iter().map(|sensor| {
            json!({
                "name": sensor.name,
                "column": sensor.columns,
                "rate_hz": 1.0 / sensor.step,
                "age_s": now - sensor.last,
                "latency_ms": self.delays_ns[sensor.topic] / 1e6,
                "outliers": sensor.outliers,
                "contradicts": sensor.contradicts(max_age_s),
            })
        });
        sensors.collect()
    }

    fn view_motion(&self, now_ns: i64) -> Value {
        let t = seconds(self.begun_ns, now_ns);
        let (Some(row), Some((deviation, current, spread))) = (self.motion.at(t), self.motion.uncertainty())
        else {
            return Value::Null;
        };
        let of_model = self.active.as_ref().and_then(|active| active.follower().adapter().current());
        let current = match of_model {
            Some(Current { velocity, .. }) => Some(*velocity),
            // A current that the headings so far do not tell from the sway is none.
            None => (spread < 0.2).then_some(current),
        };
        json!({
            "north": row.pose[0], "east": row.pose[1], "psi": row.pose[2],
            "u": row.ground[0], "v": row.ground[1], "r": row.ground[2],
            "position_deviation": deviation,
            "current": current,
            "provisional": self.motion.is_provisional(),
        })
    }

    fn view_model(&self) -> Value {
        let Some(active) = &self.active else { return Value::Null };
        let guard = active.follower().adapter().guard();
        json!({
            "name": active.name,
            "learning": active.is_learning,
            "guard": if guard.is_some() { "on" } else { "off" },
            "predicted_by": guard.map(|guard| guard.active().name()),
            "can_roll_back": self.previous.is_some(),
        })
    }

    fn view_outputs(&self) -> Vec<Value> {
        let Some(active) = &self.active else { return Vec::new() };
        let ports = active.model.description.outputs.iter().enumerate();
        let outputs = ports.map(|(i, port)| {
            json!({
                "name": port.channel.name,
                "unit": port.channel.unit,
                "measured": active.sample().outputs[i],
                "predicted": active.expected(i),
                "band_95": active.follower().deviations(i).next().map(|deviation| BAND_95 * deviation),
            })
        });
        outputs.collect()
    }

    fn view_prediction(&self) -> Value {
        let (Some(active), Some(Predicted { seconds, poses, deviations, .. })) =
            (&self.active, self.predicted())
        else {
            return Value::Null;
        };
        let ports = active.model.description.outputs.iter().enumerate();
        let by_name = |of: &dyn Fn(usize) -> Vec<f64>| -> Value {
            ports
                .clone()
                .map(|(i, port)| (port.channel.name.clone(), json!(of(i))))
                .collect::<serde_json::Map<_, _>>()
                .into()
        };
        let pose = |part: usize| poses.iter().map(|pose| pose[part]).collect::<Vec<f64>>();
        json!({
            "seconds": seconds,
            "north": pose(0),
            "east": pose(1),
            "psi": pose(2),
            "position_95": deviations.iter().map(|[position, _]| BAND_95 * position).collect::<Vec<f64>>(),
            "outputs": by_name(&|i| active.follower().prediction(i).collect()),
            "bands_95": by_name(&|i| active.follower().deviations(i).map(|d| BAND_95 * d).collect()),
        })
    }

    fn view_errors(&self) -> Value {
        let Some(active) = &self.active else { return Value::Null };
        let dt = active.model.description.dt;
        let of = |adapted: bool| -> serde_json::Map<String, Value> {
            let ports = active.model.description.outputs.iter().enumerate();
            ports.map(|(i, port)| (port.channel.name.clone(), json!(active.rmse(adapted, i)))).collect()
        };
        json!({
            "seconds": active.horizons.iter().map(|h| *h as f64 * dt).collect::<Vec<f64>>(),
            "frozen": of(false),
            "adapted": of(true),
        })
    }

    fn view_excitation(&self) -> Value {
        let explored = match &self.explored {
            Ok(explored) => explored,
            Err(error) => return json!({ "inputs": [], "sufficient": false, "text": error }),
        };
        let inputs: Vec<Value> = explored
            .inputs()
            .iter()
            .zip(inputs(&self.link, &self.settings, self.commands.columns()).unwrap_or_default())
            .map(|(channel, input)| {
                let all: f64 = channel.seconds.iter().sum();
                let share = |s: &f64| if all > 0.0 { s / all } else { 0.0 };
                let shares: Vec<f64> = channel.seconds.iter().map(share).collect();
                json!({ "name": input.name, "low": input.low, "high": input.high, "histogram": shares })
            })
            .collect();
        json!({
            "seconds": explored.excited_s(),
            "needed_seconds": explored.needed_s(),
            "inputs": inputs,
            "sufficient": explored.is_sufficient(),
            "text": explored.text(),
        })
    }

    fn view_helm(&self, now_ns: i64) -> Value {
        let refusals = if self.link.is_commanding() { Vec::new() } else { self.link.refusals(now_ns) };
        let state = match &self.steering {
            Steering::Off => "off",
            Steering::Experiment { .. } => "experiment",
            Steering::Preparing(_) => "preparing",
            Steering::Path(_) => "steering",
        };
        let wanted = match &self.steering {
            Steering::Experiment { command, .. } => command.clone(),
            Steering::Path(_) => {
                let pilot = self.active.as_ref().and_then(OnBoard::pilot);
                pilot.map(|pilot| pilot.command().to_vec()).unwrap_or_default()
            }
            _ => self.commands.held().to_vec(),
        };
        // Without limits there is nothing to show: the refusals say what is missing.
        let inputs = inputs(&self.link, &self.settings, self.commands.columns()).unwrap_or_default();
        let commands: Vec<Value> = inputs
            .iter()
            .enumerate()
            .map(|(i, input)| {
                json!({ "name": input.name, "value": wanted.get(i), "low": input.low, "high": input.high })
            })
            .collect();
        let pilot = self.active.as_ref().and_then(OnBoard::pilot);
        json!({
            "state": state,
            "refusals": refusals,
            "commands": commands,
            "status": pilot.map(Pilot::status),
            "distance": pilot.and_then(Pilot::guided).map(|guided| guided.distance),
        })
    }
}
