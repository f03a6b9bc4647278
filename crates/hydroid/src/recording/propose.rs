//! Proposal of the sensors and commands of a recording from its messages, the names of its fields and their values.

use std::fmt::Write as _;

use super::commands::{Command, output};
use super::survey::{FieldSurvey, Survey, TopicSurvey, is_output};
use super::words::{Name, Quantity, SHARED, has_word};
use crate::boat::{Boat, Range};
use crate::log::units::{self, Unit};
use crate::log::{ChannelSpec, FASTEST_RAD_S, Selection, Sensors};

/// Words of topics that contain measurements, estimates of them, or the items of a mission.
const MEASUREMENTS: &[&str] = &[
    "imu",
    "gyro",
    "accel",
    "accelerometer",
    "mag",
    "magnetometer",
    "baro",
    "gps",
    "gnss",
    "gpa",
    "fix",
    "navsatfix",
    "compass",
    "att",
    "attitude",
    "estimator",
    "ekf",
    "innovations",
    "odom",
    "odometry",
    "pose",
    "battery",
    "mission",
    "waypoint",
    "waypoints",
    "mavc",
];
/// Words of topics of the stages of a controller before its outputs, and of reports on it.
const CONTROLLERS: &[&str] =
    &["setpoint", "sp", "controls", "control", "status", "twist", "twiststamped", "vel"];

/// Columns of a recording that look like sensors, motion and commands.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Proposal {
    /// The selection.
    pub selection: Selection,
    /// What is known of its inputs.
    pub boat: Boat,
    /// What each column was taken for, and what was not found.
    pub remarks: Vec<String>,
}

impl TopicSurvey {
    /// Name of a field within the topic.
    pub(super) fn local<'a>(&self, field: &'a FieldSurvey) -> &'a str {
        field.column.strip_prefix(&self.name).and_then(|rest| rest.strip_prefix('.')).unwrap_or(&field.column)
    }

    /// The first field that has one of the names, in the order of the names.
    fn find(&self, names: &[&str]) -> Option<&FieldSurvey> {
        let named = |name: &&str| {
            self.fields
                .iter()
                .find(|field| self.local(field).eq_ignore_ascii_case(name) && field.low.is_some())
        };
        names.iter().find_map(named)
    }

    /// The field whose name states a quantity: the one with the most usual name. In a table, one with other words
    /// that the name of another quantity has as well, as those of a device, if there is none.
    pub(super) fn of(&self, quantity: Quantity) -> Option<&FieldSurvey> {
        let names: Vec<(&FieldSurvey, Name)> = self
            .fields
            .iter()
            .filter(|field| field.low.is_some())
            .map(|field| (field, Name::of(self.local(field))))
            .collect();
        let ranked = names.iter().filter_map(|(field, name)| Some((name.rank(quantity)?, *field)));
        // Of names with the same words the shorter one.
        if let Some((_, field)) = ranked.min_by_key(|(rank, field)| (*rank, field.column.len())) {
            return Some(field);
        }
        let is_shared = |others: &[&str]| {
            let mut rest = SHARED.iter().filter(|of| **of != quantity);
            rest.any(|of| names.iter().any(|(_, name)| name.others(*of).is_some_and(|found| found == others)))
        };
        let mut devices = names.iter().filter(|_| self.type_name.is_empty() && SHARED.contains(&quantity));
        let found = devices.find(|(_, name)| name.others(quantity).is_some_and(|others| is_shared(&others)));
        found.map(|(field, _)| *field)
    }

    /// Whether its name or type contains a word.
    pub(super) fn is(&self, of: &[&str]) -> bool {
        has_word(&self.name, of) || has_word(&self.type_name, of)
    }

    /// Whether its messages are of ROS: axes are forward, port, up, and east, north, up (REP 103).
    fn is_ros(&self) -> bool {
        self.type_name.contains("_msgs/")
    }

    /// Rank of the topic among those of commands, 0 for the best; none for a topic of measurements.
    pub(super) fn rank(&self) -> Option<u32> {
        let name = self.name.split('[').next().unwrap_or_default();
        // Outputs of PX4 to each actuator, then pulse widths of autopilots.
        if ["actuator_motors", "actuator_servos"].contains(&name) {
            return Some(0);
        }
        if is_output(&self.name) || self.name.starts_with("RCO") {
            return Some(1);
        }
        let is_mission = name == "CMD" && self.find(&["CNum"]).is_some();
        let is_of = |words: &[&str]| has_word(&self.name, words) || has_word(self.kind(), words);
        if is_mission || name.starts_with("vehicle_command") || is_of(MEASUREMENTS) {
            return None;
        }
        Some(if is_of(CONTROLLERS) { 3 } else { 2 })
    }

    fn kind(&self) -> &str {
        self.type_name.rsplit('/').next().unwrap_or_default()
    }
}

/// A column with an expression, as in `hydroid.toml`.
pub(super) fn spec(text: &str) -> Option<ChannelSpec> {
    text.parse().ok()
}

/// A column with the unit that is usual for it, if neither the file nor its name states one.
fn with_unit(field: &FieldSurvey, usual: &str) -> String {
    // The reader knows the unit of the header and the one behind the last underscore.
    if field.unit.is_some() || units::from_name(&field.column, false).is_some() {
        return field.column.clone();
    }
    let quantity = |unit: &str| Unit::parse(unit).ok().and_then(|unit| unit.quantity);
    let named = Name::of(&field.column).unit.filter(|unit| quantity(unit) == quantity(usual));
    format!("{} [{}]", field.column, named.as_deref().unwrap_or(usual))
}

/// A direction, in degrees if its values are.
fn angle(field: &FieldSurvey) -> String {
    with_unit(field, if field.high > Some(7.0) { "deg" } else { "rad" })
}

/// The best of the topics by a score; those without a score are none.
fn best(topics: &[TopicSurvey], score: impl Fn(&TopicSurvey) -> Option<u32>) -> Option<&TopicSurvey> {
    let scored = topics.iter().filter_map(|topic| Some((score(topic)?, topic)));
    // The first of equal ones.
    scored.rev().max_by_key(|(score, _)| *score).map(|(_, topic)| topic)
}

impl Survey {
    /// Proposes a selection.
    pub fn proposal(&self) -> Proposal {
        let mut proposal = Proposal::default();
        let mut sensors = Sensors::default();
        let topics = &self.topics;
        self.position(&mut sensors);
        self.heading(&mut sensors);
        let is_kurs = |spec: &&ChannelSpec| Name::of(&spec.column).is_kurs();
        let mut doubts = Vec::new();
        if sensors.heading.is_none()
            && let Some(kurs) = sensors.course.as_ref().filter(is_kurs).cloned()
        {
            doubts.push(format!(
                "`{}` is taken for the heading, because nothing else looks like one: if it is the course over ground, it is no heading, and the sway is not known",
                kurs.column
            ));
            (sensors.heading, sensors.course, sensors.speed) = (Some(kurs), None, None);
        }
        if sensors.course.is_none()
            && let Some(speed) = self.speed_alone()
        {
            doubts.push(format!("`{speed}` is not proposed: a speed over ground needs a course over ground"));
        }
        self.inertial(&mut sensors, &mut doubts);
        let has_motion = self.motion(&mut proposal.selection);
        let has_position = [&sensors.latitude, &sensors.north, &sensors.speed, &sensors.velocity_north]
            .iter()
            .any(|of| of.is_some());
        let has_sensors = has_position && (sensors.heading.is_some() || sensors.yaw_rate.is_some());
        // A table with velocities needs no sensors; an estimate on board is worse than the sensors.
        if has_sensors && !(has_motion && topics.len() == 1) {
            if has_motion {
                let outputs: Vec<String> =
                    proposal.selection.outputs.iter().map(ToString::to_string).collect();
                proposal.remarks.push(format!(
                    "the recording also contains velocities, which were estimated on board: outputs = [\"{}\"] without [log.sensors] uses them",
                    outputs.join("\", \"")
                ));
            }
            for (name, spec) in sensors.columns() {
                proposal.remarks.push(format!("{name}: {}", spec.column));
            }
            if sensors.quality.is_none() && sensors.latitude.is_some() {
                proposal.remarks.push("no column states the kind of the position fix".to_owned());
            }
            proposal.selection = Selection { sensors: Some(sensors), ..Selection::default() };
        } else if has_motion {
            for output in &proposal.selection.outputs {
                proposal.remarks.push(format!("{}: {}", output.name, output.column));
            }
        } else {
            for (missing, what) in [
                (!has_position, "a position or a velocity of a GNSS"),
                (sensors.heading.is_none() && sensors.yaw_rate.is_none(), "a heading or a yaw rate"),
            ] {
                if missing {
                    proposal.remarks.push(format!("nothing looks like {what}"));
                }
            }
        }
        // What a table with velocities has beside them is no doubt.
        if !has_motion {
            proposal.remarks.splice(0..0, doubts);
        }
        let mut others = Vec::new();
        let commands = self.commands(&proposal.selection, &mut others);
        proposal.selection.time.clone_from(&self.time);
        proposal.selection.inputs = commands.iter().map(|(spec, _)| spec.clone()).collect();
        if proposal.selection.inputs.is_empty() {
            proposal.remarks.push("nothing looks like a command: name the inputs".to_owned());
        }
        for input in &proposal.selection.inputs {
            proposal.remarks.push(format!("command {}: {}", input.name, input.column));
        }
        proposal.remarks.extend(others);
        for (spec, Command { topic, field, .. }) in commands {
            let seen = Range {
                low: field.low.unwrap_or(f64::NAN),
                high: field.high.unwrap_or(f64::NAN),
                neutral: field.neutral.clone(),
            };
            let output = output(topic, topic.local(field));
            proposal.remarks.extend(proposal.boat.find_output(&spec.name, output, &self.parameters, &seen));
        }
        proposal
    }

    fn inertial(&self, sensors: &mut Sensors, doubts: &mut Vec<String>) {
        let inertial = best(&self.topics, |topic| {
            let field = topic.of(Quantity::YawRate)?;
            // A rate of turn is that of NMEA 0183.
            let named = topic.is(&["imu", "gyro", "sensor", "combined", "rot"]);
            let is_table = topic.type_name.is_empty()
                && (self.topics.len() == 1 || topic.of(Quantity::Heading).is_some());
            (field.varies() && (named || is_table || topic.of(Quantity::Forward).is_some()))
                .then_some(2 * u32::from(topic.of(Quantity::Forward).is_some()) + u32::from(named))
        });
        if let Some(topic) = inertial {
            let sign = if topic.is_ros() { " * -1" } else { "" };
            if let Some(field) = topic.of(Quantity::YawRate) {
                let column = with_unit(field, "rad/s");
                // The unit of a rate that no vessel has in rad/s is not known.
                let is_absurd = column.ends_with("[rad/s]") && field.fastest() > FASTEST_RAD_S;
                if is_absurd {
                    let column = &field.column;
                    doubts.push(format!("`{column}` is not proposed, because its unit is not stated and cannot be rad/s: name it as yaw_rate = \"{column} [deg/s]\" or [deg/min]"));
                } else {
                    // Without a unit in the header, it is in rad/s.
                    let column = column.strip_suffix(" [rad/s]").unwrap_or(&column);
                    sensors.yaw_rate = spec(&format!("{column}{sign}"));
                }
            }
            if let (Some(x), Some(y)) = (topic.of(Quantity::Forward), topic.of(Quantity::Starboard)) {
                sensors.acceleration_forward = spec(&x.column);
                sensors.acceleration_starboard = spec(&format!("{}{sign}", y.column));
            }
        }
    }

    fn position(&self, sensors: &mut Sensors) {
        let gnss = &["gps", "gnss", "fix", "gga", "navsat", "navsatfix"];
        let position = best(&self.topics, |topic| {
            let (latitude, longitude) = (topic.of(Quantity::Latitude)?, topic.of(Quantity::Longitude)?);
            let is_fix = latitude.varies() && longitude.varies();
            is_fix.then(|| 2 * u32::from(topic.is(gnss)) + u32::from(topic.of(Quantity::Quality).is_some()))
        });
        if let Some(topic) = position {
            let of = |quantity| {
                topic.of(quantity).and_then(|field| {
                    // Older logs have integers in 1e-7 degrees.
                    let scale = if field.high.unwrap_or(0.0).abs() > 1e5 { " * 1e-7" } else { "" };
                    spec(&format!("{}{scale}", with_unit(field, "deg")))
                })
            };
            (sensors.latitude, sensors.longitude) = (of(Quantity::Latitude), of(Quantity::Longitude));
            sensors.quality = topic.of(Quantity::Quality).and_then(|field| spec(&field.column));
        }
        if let ([table], None) = (&self.topics[..], position)
            && let (Some(north), Some(east)) = (table.of(Quantity::PlaceNorth), table.of(Quantity::PlaceEast))
        {
            // Letters are axes only in metres.
            let is_place = |field: &FieldSurvey| {
                let named = units::from_name(&field.column, false).map(|(_, unit)| unit);
                let unit = field.unit.as_deref().or(named).and_then(|unit| Unit::parse(unit).ok());
                unit.and_then(|unit| unit.quantity) == Some(units::Quantity::Length) && field.varies()
            };
            if table.type_name.is_empty() && is_place(north) && is_place(east) {
                (sensors.north, sensors.east) = (spec(&with_unit(north, "m")), spec(&with_unit(east, "m")));
            }
        }
        let first = position.into_iter();
        let named = |topic: &&TopicSurvey| {
            self.topics.len() == 1 || topic.is(&["gps", "gnss", "rmc", "vtg", "vel", "velocity"])
        };
        for topic in first.chain(self.topics.iter().filter(named)) {
            if let (Some(speed), Some(course)) = (topic.of(Quantity::Speed), topic.of(Quantity::Course))
                && speed.varies()
            {
                // Without a unit, the positions show it.
                let column = with_unit(speed, "m/s");
                sensors.speed = spec(column.strip_suffix(" [m/s]").unwrap_or(&column));
                sensors.course = spec(&angle(course));
                return;
            }
            if let (Some(north), Some(east)) = (topic.of(Quantity::North), topic.of(Quantity::East)) {
                sensors.velocity_north = spec(&north.column);
                sensors.velocity_east = spec(&east.column);
                return;
            }
            if topic.is_ros() && topic.kind().starts_with("Twist") && !topic.is(&["cmd", "command"]) {
                let stem =
                    if topic.find(&["twist.twist.linear.x"]).is_some() { "twist.twist" } else { "twist" };
                if let (Some(x), Some(y)) =
                    (topic.find(&[&format!("{stem}.linear.x")]), topic.find(&[&format!("{stem}.linear.y")]))
                    && x.varies()
                {
                    sensors.velocity_north = spec(&y.column);
                    sensors.velocity_east = spec(&x.column);
                    return;
                }
            }
        }
    }

    /// A speed over ground of a table.
    fn speed_alone(&self) -> Option<&str> {
        let [table] = &self.topics[..] else { return None };
        table.of(Quantity::Speed).filter(|speed| speed.varies()).map(|speed| speed.column.as_str())
    }

    fn heading(&self, sensors: &mut Sensors) {
        let compass = &["compass", "hdt", "ths", "heading", "gyrocompass"];
        let heading = best(&self.topics, |topic| {
            let field = topic.of(Quantity::Heading)?;
            // The quaternion of an odometry is an estimate.
            let rank = if topic.is(compass) {
                3
            } else if topic.is(&["attitude", "att", "imu"]) {
                2
            } else {
                u32::from(!topic.is(&["position", "gps"]))
            };
            let is_true = !Name::of(topic.local(field)).is_magnetic();
            field.varies().then_some(rank + if is_true { 4 } else { 0 })
        });
        let Some((topic, field)) = heading.and_then(|topic| Some((topic, topic.of(Quantity::Heading)?)))
        else {
            return;
        };
        sensors.heading = if let Some(stem) = field.column.strip_suffix("[0]") {
            spec(&format!("{stem}.yaw"))
        } else if let Some(stem) = field.column.strip_suffix(".w") {
            // From east, counter-clockwise, to north, clockwise.
            let turned = format!("({stem}.yaw - {}) * -1", std::f64::consts::FRAC_PI_2);
            spec(&if topic.is_ros() { turned } else { format!("{stem}.yaw") })
        } else {
            spec(&angle(field))
        };
    }

    /// Velocities in the recording.
    fn motion(&self, selection: &mut Selection) -> bool {
        for topic in &self.topics {
            if topic.kind() == "Odometry"
                && let (Some(u), Some(v), Some(r)) = (
                    topic.find(&["twist.twist.linear.x"]),
                    topic.find(&["twist.twist.linear.y"]),
                    topic.find(&["twist.twist.angular.z"]),
                )
            {
                let of = |name: &str, field: &FieldSurvey, unit: &str, sign: &str| {
                    spec(&format!("{name}={} [{unit}]{sign}", field.column))
                };
                selection.outputs =
                    [of("u", u, "m/s", ""), of("v", v, "m/s", " * -1"), of("r", r, "rad/s", " * -1")]
                        .into_iter()
                        .flatten()
                        .collect();
                return true;
            }
            let names = [Quantity::Surge, Quantity::Sway, Quantity::Turn].map(|quantity| topic.of(quantity));
            if let [Some(u), _, Some(r)] = names
                && u.varies()
                && r.varies()
            {
                let named = |name: &str, field: &FieldSurvey| spec(&format!("{name}={}", field.column));
                let all = ["u", "v", "r"].into_iter().zip(names);
                selection.outputs = all.filter_map(|(name, field)| named(name, field?)).collect();
                return true;
            }
        }
        false
    }
}

impl Proposal {
    /// The proposal as a file `hydroid.toml`.
    pub fn to_toml(&self, source: &str) -> String {
        let quoted = |spec: &ChannelSpec| {
            format!("\"{}\"", spec.to_string().replace('\\', "\\\\").replace('"', "\\\""))
        };
        let list = |specs: &[ChannelSpec]| {
            let lines: Vec<String> = specs.iter().map(|spec| format!("    {},\n", quoted(spec))).collect();
            format!("[\n{}]", lines.concat())
        };
        let mut text = format!(
            "# Proposal from the names of the fields in {source}.\n# Check columns, units ([deg], [kn], [us]), signs and places.\n[log]\n"
        );
        let selection = &self.selection;
        if let Some(time) = &selection.time {
            let _ = writeln!(text, "time = {}", toml::Value::from(time.as_str()));
        }
        if !selection.outputs.is_empty() {
            let _ = writeln!(text, "outputs = {}", list(&selection.outputs));
        }
        if selection.inputs.is_empty() {
            let _ =
                writeln!(text, "# No command was found. Name them as \"NAME=COLUMN\".\ninputs = [\"none\"]");
        } else {
            let _ = writeln!(text, "# Commands, with the columns of their raw values.");
            let _ = writeln!(text, "inputs = {}", list(&selection.inputs));
        }
        if let Some(sensors) = &selection.sensors {
            text.push_str(
                "\n# Sensors from which pose and velocities are computed. Axes forward, starboard, down: for an inertial unit\n# with axes forward, port, up, yaw_rate and acceleration_starboard have the factor -1.\n[log.sensors]\n",
            );
            for (name, spec) in sensors.columns() {
                let _ = writeln!(text, "{name} = {}", quoted(spec));
            }
            text.push_str(
                "# Places forward, to starboard and below the origin of the body frame [m].\nantenna_m = [0.0, 0.0, 0.0]\nimu_m = [0.0, 0.0, 0.0]\n",
            );
        }
        if !self.boat.is_empty() {
            text.push_str(
                "\n# What the commands are. With a scale, the input of the model is (raw - neutral) / scale.",
            );
            let columns = selection.inputs.iter().map(|spec| (spec.name.as_str(), spec.column.as_str()));
            text.push_str(&self.boat.to_toml(columns));
        }
        text
    }
}
