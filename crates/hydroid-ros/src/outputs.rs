//! What hydroid publishes: estimate, predictions and diagnostics. Poses are east, north and up in the frame of the map, and
//! forward, port and up in that of the vessel (REP-103, REP-105).

use std::f64::consts::FRAC_PI_2;

use hydroid_live::boat::Boat;
use ros2_client::dds::Publisher;
use serde_json::Value as Json;

use crate::graph::{Graph, Log};
use crate::link::RosLink;
use crate::settings::Ros;
use crate::value::{Value, time};

/// Time between estimates and predictions \[ns\].
const STEP_NS: i64 = 100_000_000;

/// Time between diagnostics \[ns\].
const DIAGNOSTICS_NS: i64 = 1_000_000_000;

/// Levels of diagnostics.
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

/// The publishers.
pub(crate) struct Outputs {
    log: Log,
    told: u64,
    map: String,
    base: String,
    estimate: Publisher<Value>,
    path: Publisher<Value>,
    /// Horizons \[s\] with their publishers.
    predictions: Vec<(f64, Publisher<Value>)>,
    diagnostics: Publisher<Value>,
    sent_ns: i64,
    diagnosed_ns: i64,
}

impl Outputs {
    /// Publishers of a session with some horizons \[s\].
    pub(crate) fn new(graph: &mut Graph, ros: &Ros, horizons_s: &[f64]) -> anyhow::Result<Self> {
        let predictions = horizons_s.iter().map(|horizon| {
            let name = format!("~/prediction_{}s", horizon.to_string().replace('.', "_"));
            anyhow::Ok((*horizon, graph.publisher(&name, "geometry_msgs/msg/PoseWithCovarianceStamped")?))
        });
        let predictions = predictions.collect::<anyhow::Result<_>>()?;
        Ok(Self {
            log: graph.log(),
            told: 0,
            map: ros.map_frame.clone().unwrap_or_else(|| "hydroid_map".to_owned()),
            base: ros.base_frame.clone().unwrap_or_else(|| "base_link".to_owned()),
            estimate: graph.publisher("~/estimate", "nav_msgs/msg/Odometry")?,
            path: graph.publisher("~/predicted_path", "nav_msgs/msg/Path")?,
            predictions,
            diagnostics: graph.publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")?,
            sent_ns: 0,
            diagnosed_ns: 0,
        })
    }

    /// Publishes what is due.
    pub(crate) fn publish(&mut self, boat: &Boat<RosLink>, now_ns: i64) {
        for said in boat.said_after(self.told) {
            self.log.write(said);
            self.told = said.id;
        }
        if now_ns.saturating_sub(self.sent_ns) >= STEP_NS {
            self.sent_ns = now_ns;
            self.publish_motion(boat, now_ns);
        }
        if now_ns.saturating_sub(self.diagnosed_ns) >= DIAGNOSTICS_NS {
            self.diagnosed_ns = now_ns;
            let _ = self.diagnostics.publish(diagnostics(&boat.view(now_ns, [0; 2]), now_ns));
        }
    }

    /// A message that is lost here is followed by the next one.
    fn publish_motion(&self, boat: &Boat<RosLink>, now_ns: i64) {
        let Some((row, position)) = boat.motion(now_ns) else { return };
        let [u, v, r] = row.ground;
        let [du, dv, dr] = row.ground_deviation;
        let twist = Value::Parts(vec![
            vector(u, -v),
            Value::Parts(vec![Value::F64(0.0), Value::F64(0.0), Value::F64(-r)]),
        ]);
        let estimate = Value::Parts(vec![
            header(now_ns, &self.map),
            Value::Text(self.base.clone()),
            Value::Parts(vec![pose(row.pose), covariance([position, position, 0.0])]),
            Value::Parts(vec![twist, covariance([du, dv, dr])]),
        ]);
        let _ = self.estimate.publish(estimate);
        let Some(predicted) = boat.predicted() else { return };
        // Before the first commands are known, and without samples, there is no prediction.
        let age_s = now_ns.saturating_sub(predicted.at_ns) as f64 / 1e9;
        let is_old = predicted.seconds.first().is_none_or(|step| age_s > 3.0 * step);
        if is_old || !predicted.poses.iter().flatten().all(|x| x.is_finite()) {
            return;
        }
        let mut poses = vec![Value::Parts(vec![header(now_ns, &self.map), pose(row.pose)])];
        let mut ahead = Vec::new();
        for ((seconds, at), deviations) in
            predicted.seconds.iter().zip(&predicted.poses).zip(&predicted.deviations)
        {
            #[expect(clippy::cast_possible_truncation, reason = "seconds of a horizon")]
            let then_ns = predicted.at_ns.saturating_add((seconds * 1e9) as i64);
            poses.push(Value::Parts(vec![header(then_ns, &self.map), pose(*at)]));
            let [position, psi] = *deviations;
            let with = Value::Parts(vec![pose(*at), covariance([position, position, psi])]);
            ahead.push((*seconds, Value::Parts(vec![header(then_ns, &self.map), with])));
        }
        for (horizon, publisher) in &self.predictions {
            // A horizon is a whole number of samples.
            let nearest = ahead.iter().min_by(|a, b| (a.0 - horizon).abs().total_cmp(&(b.0 - horizon).abs()));
            if let Some((_, message)) = nearest {
                let _ = publisher.publish(message.clone());
            }
        }
        let _ = self.path.publish(Value::Parts(vec![header(now_ns, &self.map), Value::Sequence(poses)]));
    }
}

/// A `std_msgs/Header`.
fn header(ns: i64, frame: &str) -> Value {
    Value::Parts(vec![time(ns), Value::Text(frame.to_owned())])
}

/// Three numbers, the last of which is zero.
fn vector(x: f64, y: f64) -> Value {
    Value::Parts(vec![Value::F64(x), Value::F64(y), Value::F64(0.0)])
}

/// A `geometry_msgs/Pose` of north, east and heading.
fn pose([north, east, psi]: [f64; 3]) -> Value {
    let (sine, cosine) = (0.5 * (FRAC_PI_2 - psi)).sin_cos();
    let rotation = [0.0, 0.0, sine, cosine].map(Value::F64);
    Value::Parts(vec![vector(east, north), Value::Parts(rotation.into())])
}

/// A covariance of x, y, z and rotations about them, from standard deviations in the plane and about z.
fn covariance([x, y, z]: [f64; 3]) -> Value {
    let mut all = vec![Value::F64(0.0); 36];
    for (at, deviation) in [(0, x), (7, y), (35, z)] {
        all[at] = Value::F64(deviation * deviation);
    }
    Value::Parts(all)
}

/// A text of a scalar.
fn text(value: &Json) -> Option<String> {
    match value {
        Json::Null => Some("none".to_owned()),
        Json::String(text) => Some(text.clone()),
        Json::Number(_) | Json::Bool(_) => Some(value.to_string()),
        Json::Array(all) if all.iter().all(Json::is_string) => {
            Some(all.iter().filter_map(Json::as_str).collect::<Vec<_>>().join("; "))
        }
        _ => None,
    }
}

/// A `diagnostic_msgs/DiagnosticStatus` with the scalars of an object.
fn status(level: u8, name: &str, message: &str, of: &Json) -> Value {
    let values = of.as_object().into_iter().flatten().filter_map(|(key, value)| {
        Some(Value::Parts(vec![Value::Text(key.clone()), Value::Text(text(value)?)]))
    });
    Value::Parts(vec![
        Value::U8(level),
        Value::Text(format!("hydroid: {name}")),
        Value::Text(message.to_owned()),
        Value::Text("hydroid".to_owned()),
        Value::Sequence(values.collect()),
    ])
}

/// A `diagnostic_msgs/DiagnosticArray` of the state of a session.
fn diagnostics(view: &Json, now_ns: i64) -> Value {
    let mut all = Vec::new();
    let link = &view["link"];
    all.push(match (link["autopilot"].is_null(), link["lost_s"].as_f64()) {
        (true, _) => status(WARN, "topics", "no message has arrived yet", link),
        (_, Some(lost)) => status(ERROR, "topics", &format!("no message for {lost:.0} s"), link),
        _ => status(OK, "topics", "messages arrive", link),
    });
    for sensor in view["sensors"].as_array().into_iter().flatten() {
        let name = format!("sensor {}", sensor["name"].as_str().unwrap_or_default());
        // As the helm: a second beyond two usual steps.
        let old = 1.0 + 2.0 / sensor["rate_hz"].as_f64().unwrap_or(f64::INFINITY);
        all.push(match sensor["age_s"].as_f64() {
            None => status(WARN, &name, "not measured yet", sensor),
            Some(age) if age > old => status(WARN, &name, &format!("not measured for {age:.1} s"), sensor),
            _ => status(OK, &name, "measured", sensor),
        });
    }
    let model = &view["model"];
    all.push(match model["name"].as_str() {
        None => status(OK, "model", "no model on board", model),
        Some(name) => status(OK, "model", name, model),
    });
    let recording = &view["recording"];
    all.push(match recording["trouble"].as_str() {
        None => status(OK, "recording", "nothing is recorded", recording),
        Some("") => status(OK, "recording", "recording", recording),
        Some(trouble) => status(ERROR, "recording", trouble, recording),
    });
    let helm = &view["helm"];
    all.push(status(OK, "helm", helm["state"].as_str().unwrap_or_default(), helm));
    Value::Parts(vec![header(now_ns, ""), Value::Sequence(all)])
}
