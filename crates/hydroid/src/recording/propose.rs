//! Proposal of the sensors and commands of a recording from the names of its fields.

use std::fmt::Write as _;

use super::survey::{FieldSurvey, Survey, TopicSurvey, is_output};
use crate::boat::{Boat, FUNCTIONS, Output, Range};
use crate::log::{ChannelSpec, Selection, Sensors};

/// Names of fields, in lower case, without the part before the last dot where the name has none.
const LATITUDE: &[&str] = &["latitude", "lat", "latitude_deg", "lat_deg"];
const LONGITUDE: &[&str] = &["longitude", "lon", "lng", "long", "longitude_deg", "lon_deg"];
const QUALITY: &[&str] = &["quality", "fix_type", "status.status", "status", "fix"];
const SPEED: &[&str] = &["sog", "spd", "speed_over_ground", "vel_m_s", "gspeed", "ground_speed", "speed"];
const COURSE: &[&str] = &["cog", "gcrs", "course_over_ground", "cog_rad", "ground_course", "course", "track"];
const NORTH: &[&str] = &["vel_n_m_s", "velocity_north", "vel_n", "vn"];
const EAST: &[&str] = &["vel_e_m_s", "velocity_east", "vel_e", "ve"];
const HEADING: &[&str] =
    &["heading", "hdg", "true_heading", "heading_deg", "yaw", "psi", "q[0]", "orientation.w"];
const YAW_RATE: &[&str] = &[
    "gyro_z",
    "gyrz",
    "wz",
    "yaw_rate",
    "angular_velocity.z",
    "gyro_rad[2]",
    "gz",
    "rate",
    "rate_of_turn",
    "r",
];
const FORWARD: &[&str] =
    &["acc_x", "accx", "linear_acceleration.x", "accelerometer_m_s2[0]", "ax", "accel_x", "acceleration_x"];
const STARBOARD: &[&str] =
    &["acc_y", "accy", "linear_acceleration.y", "accelerometer_m_s2[1]", "ay", "accel_y", "acceleration_y"];
/// Words of topics and fields of commands.
const COMMANDS: &[&str] = &[
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
    "throttle",
    "rudder",
    "rpm",
    "rsa",
    "thrust",
    "thruster",
    "motor",
    "delta",
    "engine",
    "prop",
    "propeller",
    "bowthruster",
    "vsp",
    "azimuth",
    "waterjet",
    "nozzle",
    "thr",
    "steering",
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
];

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
/// Names of channels that a table from sensors, or one with velocities, already contains.
const TAKEN: &[&str] = &["t", "x", "y", "psi", "u", "v", "r", "wind_x", "wind_y"];

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

/// Words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for c in name.chars() {
        if c.is_ascii_alphabetic() {
            words.last_mut().into_iter().for_each(|word| word.push(c.to_ascii_lowercase()));
        } else if words.last().is_some_and(|word| !word.is_empty()) {
            words.push(String::new());
        }
    }
    words
}

fn has_word(name: &str, of: &[&str]) -> bool {
    words(name).iter().any(|word| of.contains(&word.as_str()))
}

impl TopicSurvey {
    /// Name of a field within the topic.
    fn local<'a>(&self, field: &'a FieldSurvey) -> &'a str {
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

    /// Whether its name or type contains a word.
    fn is(&self, of: &[&str]) -> bool {
        has_word(&self.name, of) || has_word(&self.type_name, of)
    }

    /// Whether its messages are of ROS: axes are forward, port, up, and east, north, up (REP 103).
    fn is_ros(&self) -> bool {
        self.type_name.contains("_msgs/")
    }

    /// Rank of the topic among those of commands, 0 for the best; none for a topic of measurements.
    fn rank(&self) -> Option<u32> {
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
fn spec(text: &str) -> Option<ChannelSpec> {
    text.parse().ok()
}

/// A column with the unit that is usual for it if the file has none.
fn with_unit(field: &FieldSurvey, unit: &str) -> String {
    match &field.unit {
        Some(_) => field.column.clone(),
        None => format!("{} [{unit}]", field.column),
    }
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
        let inertial = best(topics, |topic| {
            let field = topic.find(YAW_RATE)?;
            // A rate of turn is that of NMEA 0183.
            let named = topic.is(&["imu", "gyro", "sensor", "combined", "rot"]);
            (field.varies() && (named || topic.find(FORWARD).is_some()))
                .then_some(2 * u32::from(topic.find(FORWARD).is_some()) + u32::from(named))
        });
        if let Some(topic) = inertial {
            let sign = if topic.is_ros() { " * -1" } else { "" };
            sensors.yaw_rate =
                topic.find(YAW_RATE).and_then(|field| spec(&format!("{}{sign}", field.column)));
            if let (Some(x), Some(y)) = (topic.find(FORWARD), topic.find(STARBOARD)) {
                sensors.acceleration_forward = spec(&x.column);
                sensors.acceleration_starboard = spec(&format!("{}{sign}", y.column));
            }
        }
        let has_motion = self.motion(&mut proposal.selection);
        let has_position =
            sensors.latitude.is_some() || sensors.speed.is_some() || sensors.velocity_north.is_some();
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
        let mut others = Vec::new();
        let commands = self.commands(&proposal.selection, &mut others);
        proposal.selection.time.clone_from(&self.time);
        proposal.selection.inputs = commands.iter().map(|(spec, _, _)| spec.clone()).collect();
        if proposal.selection.inputs.is_empty() {
            proposal.remarks.push("nothing looks like a command: name the inputs".to_owned());
        }
        for input in &proposal.selection.inputs {
            proposal.remarks.push(format!("command {}: {}", input.name, input.column));
        }
        proposal.remarks.extend(others);
        for (spec, topic, field) in commands {
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

    fn position(&self, sensors: &mut Sensors) {
        let gnss = &["gps", "gnss", "fix", "gga", "navsat", "navsatfix"];
        let position = best(&self.topics, |topic| {
            let (latitude, longitude) = (topic.find(LATITUDE)?, topic.find(LONGITUDE)?);
            let is_fix = latitude.varies() && longitude.varies();
            is_fix.then(|| 2 * u32::from(topic.is(gnss)) + u32::from(topic.find(QUALITY).is_some()))
        });
        if let Some(topic) = position {
            let of = |names: &[&str]| {
                topic.find(names).and_then(|field| {
                    // Older logs have integers in 1e-7 degrees.
                    let scale = if field.high.unwrap_or(0.0).abs() > 1e4 { " * 1e-7" } else { "" };
                    spec(&format!("{}{scale}", with_unit(field, "deg")))
                })
            };
            (sensors.latitude, sensors.longitude) = (of(LATITUDE), of(LONGITUDE));
            sensors.quality = topic.find(QUALITY).and_then(|field| spec(&field.column));
        }
        let first = position.into_iter();
        let rest =
            || self.topics.iter().filter(|topic| topic.is(&["gps", "gnss", "rmc", "vtg", "vel", "velocity"]));
        for topic in first.chain(rest()) {
            if let (Some(speed), Some(course)) = (topic.find(SPEED), topic.find(COURSE))
                && speed.varies()
            {
                sensors.speed = spec(&with_unit(speed, "m/s"));
                sensors.course = spec(&if course.high > Some(7.0) {
                    with_unit(course, "deg")
                } else {
                    with_unit(course, "rad")
                });
                return;
            }
            if let (Some(north), Some(east)) = (topic.find(NORTH), topic.find(EAST)) {
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

    fn heading(&self, sensors: &mut Sensors) {
        let compass = &["compass", "hdt", "ths", "heading", "gyrocompass"];
        let heading = best(&self.topics, |topic| {
            let field = topic.find(HEADING)?;
            // The quaternion of an odometry is an estimate.
            let rank = if topic.is(compass) {
                3
            } else if topic.is(&["attitude", "att", "imu"]) {
                2
            } else {
                u32::from(!topic.is(&["position", "gps"]))
            };
            field.varies().then_some(rank)
        });
        let Some((topic, field)) = heading.and_then(|topic| Some((topic, topic.find(HEADING)?))) else {
            return;
        };
        sensors.heading = if let Some(stem) = field.column.strip_suffix("[0]") {
            spec(&format!("{stem}.yaw"))
        } else if let Some(stem) = field.column.strip_suffix(".w") {
            // From east, counter-clockwise, to north, clockwise.
            let turned = format!("({stem}.yaw - {}) * -1", std::f64::consts::FRAC_PI_2);
            spec(&if topic.is_ros() { turned } else { format!("{stem}.yaw") })
        } else if field.unit.is_none() && field.high > Some(7.0) {
            spec(&with_unit(field, "deg"))
        } else {
            spec(&field.column)
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
            let names = ["u", "v", "r"].map(|name| topic.find(&[name]));
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

    /// Fields that look like commands, of the topics of the best rank that contains one. The others are named in a remark.
    fn commands(
        &self,
        selection: &Selection,
        remarks: &mut Vec<String>,
    ) -> Vec<(ChannelSpec, &TopicSurvey, &FieldSurvey)> {
        let sensors =
            selection.sensors.iter().flat_map(|sensors| sensors.columns().map(|(_, spec)| &spec.column));
        let used: Vec<&String> = sensors.chain(selection.outputs.iter().map(|spec| &spec.column)).collect();
        let mut found: Vec<(u32, String, &TopicSurvey, &FieldSurvey)> = Vec::new();
        for topic in &self.topics {
            // The name of a single table is that of the whole recording.
            let is_named = self.topics.len() > 1 || !topic.type_name.is_empty();
            let Some(rank) = (if is_named { topic.rank() } else { Some(0) }) else { continue };
            for field in &topic.fields {
                let local = topic.local(field);
                let is_command = ((is_named && (rank < 2 || topic.is(COMMANDS)))
                    || has_word(local, COMMANDS))
                    && !has_word(local, NO_COMMANDS);
                if is_command && field.varies() && !used.contains(&&field.column) {
                    found.push((rank, self.name(topic, local), topic, field));
                }
            }
        }
        let best = found.iter().map(|found| found.0).min();
        let (found, others): (Vec<_>, Vec<_>) = found.into_iter().partition(|found| Some(found.0) == best);
        let mut others: Vec<&str> = others.iter().map(|(_, _, topic, _)| topic.name.as_str()).collect();
        others.dedup();
        if !others.is_empty() {
            remarks.push(format!("not proposed beside these commands: fields of {}", others.join(", ")));
        }
        let repeated = |name: &str| found.iter().filter(|f| f.1 == name).count() > 1;
        let is_taken = |name: &str| TAKEN.contains(&name) || name.starts_with("deviation_");
        let mut commands = Vec::new();
        for (_, name, topic, field) in &found {
            let is_free = !repeated(name) && !is_taken(name);
            let name = if is_free { name.clone() } else { words_of(&field.column) };
            let name = if is_taken(&name) { format!("command_{name}") } else { name };
            commands.extend(spec(&format!("{name}={}", field.column)).map(|spec| (spec, *topic, *field)));
        }
        commands
    }

    /// Name of the channel of a command.
    fn name(&self, topic: &TopicSurvey, local: &str) -> String {
        if let Some(Output::ArduPilot(n)) = output(topic, local)
            && let Some(number) = self.parameters.get(&format!("SERVO{n}_FUNCTION"))
            && let Some(function) = FUNCTIONS.iter().find(|function| function.number == *number)
        {
            return function.name.to_owned();
        }
        // Names in the message itself, in an array beside that of the values.
        if let Some((_, index)) = local.strip_suffix(']').and_then(|inner| inner.rsplit_once('['))
            && let Some((_, text)) = topic.texts.iter().find(|(name, _)| *name == format!("name[{index}]"))
        {
            return words_of(text);
        }
        match topic.name.get(..3) {
            Some("RSA") if local == "starboard" => return "rudder".to_owned(),
            Some("RPM") if local == "speed" => return "shaft_speed".to_owned(),
            _ => {}
        }
        let last = local.rsplit('.').next().unwrap_or(local);
        words_of(last)
    }
}

/// The output of an autopilot that a field contains.
fn output(topic: &TopicSurvey, local: &str) -> Option<Output> {
    if topic.name.starts_with("RCO") {
        return Some(Output::ArduPilot(local.strip_prefix('C')?.parse().ok()?));
    }
    let index =
        |name: &str| local.strip_prefix(name)?.strip_prefix('[')?.strip_suffix(']')?.parse::<u32>().ok();
    match topic.name.as_str() {
        // The first instance is that of the main outputs.
        "actuator_outputs" => Some(Output::Px4(index("output")?.checked_add(1)?)),
        "actuator_motors" => Some(Output::Px4Motor(index("control").filter(|index| *index < 32)? + 1)),
        _ => None,
    }
}

/// A name of letters, digits and underscores.
fn words_of(text: &str) -> String {
    let name: String = text.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    name.trim_matches('_').to_owned()
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
