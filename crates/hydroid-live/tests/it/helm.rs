//! Commands to an autopilot: refusals, ends, and what may never be sent.

use std::collections::BTreeMap;

use hydroid_live::link::HelmEvent as Event;
use hydroid_live::link::Row;
use hydroid_live::link::mavlink::helm::{Axis, Helm, Options, State, Target};
use hydroid_live::link::mavlink::topics::TOPICS;
use mavlink::MavHeader;
use mavlink::dialects::ardupilotmega::{
    ATTITUDE_DATA, EKF_STATUS_REPORT_DATA, EkfStatusFlags, GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA,
    MavAutopilot, MavCmd, MavFrame, MavMessage, MavModeFlag, MavParamError, MavState, MavType,
    PARAM_ERROR_DATA, PARAM_VALUE_DATA, RC_CHANNELS_DATA, STATUSTEXT_DATA,
};
use proptest::prelude::*;

const MS: i64 = 1_000_000;
const START: i64 = 1_700_000_000_000_000_000;
const LEAVE: u16 = 65535;
const VEHICLE: MavHeader = MavHeader { system_id: 1, component_id: 1, sequence: 0 };
const MANUAL: u32 = 0;
const HOLD: u32 = 4;
const GUIDED: u32 = 15;

fn axis(name: &str, target: Target, low: f64, high: f64, rest: f64) -> Axis {
    Axis { name: name.to_owned(), place: target, low, high, rest }
}

fn channels() -> Vec<Axis> {
    vec![
        axis("rudder", Target::Channel(1), 1100.0, 1900.0, 1500.0),
        axis("thrust", Target::Channel(3), 1200.0, 1800.0, 1500.0),
    ]
}

fn set_points() -> Vec<Axis> {
    vec![axis("speed", Target::Surge, -0.5, 1.1, 0.0), axis("turn", Target::YawRate, -0.3, 0.3, 0.0)]
}

fn options() -> Options {
    Options { own_system: 255, is_allowed: true, is_dry_run: false }
}

/// Parameters of an ArduPilot Rover 4.7 with default values: those that a preflight asks for.
pub(crate) const PARAMETERS: [(&str, f32); 15] = [
    ("MAV_GCS_SYSID", 255.0),
    ("MAV_GCS_SYSID_HI", 0.0),
    ("MAV_OPTIONS", 0.0),
    ("RC_OVERRIDE_TIME", 3.0),
    ("RC_OPTIONS", 32.0),
    ("FS_THR_ENABLE", 1.0),
    ("FS_THR_VALUE", 910.0),
    ("RCMAP_THROTTLE", 3.0),
    ("MODE_CH", 8.0),
    ("RC1_TRIM", 1500.0),
    ("RC1_DZ", 30.0),
    ("RC1_OPTION", 0.0),
    ("RC3_TRIM", 1500.0),
    ("RC3_DZ", 30.0),
    ("RC3_OPTION", 0.0),
];

fn parameters() -> BTreeMap<String, f32> {
    PARAMETERS.map(|(name, value)| (name.to_owned(), value)).into()
}

/// A helm and the autopilot at the other end.
#[expect(clippy::struct_excessive_bools, reason = "faults of the autopilot")]
struct Boat {
    helm: Helm,
    now: i64,
    boot_ns: i64,
    beat: HEARTBEAT_DATA,
    flags: EkfStatusFlags,
    parameters: BTreeMap<String, f32>,
    has_origin: bool,
    /// Pulses of the receiver, those in force, and number of channels of the receiver.
    sticks: [u16; 8],
    pulses: [u16; 8],
    receiver: u8,
    takes_overrides: bool,
    is_silent: bool,
    reports_channels: bool,
    /// All but questions.
    sent: Vec<(i64, MavMessage)>,
    questions: Vec<String>,
    rows: Vec<Row>,
    ends: Vec<String>,
}

impl Boat {
    fn new(axes: Vec<Axis>, options: Options) -> Self {
        let mode = if matches!(axes[0].place, Target::Channel(_)) { MANUAL } else { GUIDED };
        Self {
            helm: Helm::new(axes, options).unwrap(),
            now: START,
            boot_ns: START - 100_000 * MS,
            beat: HEARTBEAT_DATA {
                custom_mode: mode,
                mavtype: MavType::MAV_TYPE_SURFACE_BOAT,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            },
            flags: EkfStatusFlags::EKF_POS_HORIZ_ABS,
            parameters: parameters(),
            has_origin: true,
            sticks: [1500; 8],
            pulses: [1500; 8],
            receiver: 8,
            takes_overrides: true,
            is_silent: false,
            reports_channels: true,
            sent: Vec::new(),
            questions: Vec::new(),
            rows: Vec::new(),
            ends: Vec::new(),
        }
    }

    fn hear(&mut self, message: &MavMessage) {
        self.helm.receive(VEHICLE, message, self.now);
    }

    fn beat(&mut self) {
        let beat = MavMessage::HEARTBEAT(self.beat.clone());
        self.hear(&beat);
    }

    fn text(&mut self, text: &str) {
        let mut said = STATUSTEXT_DATA::DEFAULT;
        said.text = text.into();
        self.hear(&MavMessage::STATUSTEXT(said));
    }

    fn boot_ms(&self) -> u32 {
        u32::try_from((self.now - self.boot_ns) / MS).unwrap()
    }

    fn report(&mut self, pulses: [u16; 8]) {
        let mut report = RC_CHANNELS_DATA::DEFAULT;
        [
            report.chan1_raw,
            report.chan2_raw,
            report.chan3_raw,
            report.chan4_raw,
            report.chan5_raw,
            report.chan6_raw,
            report.chan7_raw,
            report.chan8_raw,
        ] = pulses;
        (report.time_boot_ms, report.chancount) = (self.boot_ms(), self.receiver);
        self.hear(&MavMessage::RC_CHANNELS(report));
    }

    fn tick(&mut self) {
        let mut sent = Vec::new();
        self.helm.tick(self.now, |message| sent.push(message));
        for message in sent {
            match &message {
                MavMessage::PARAM_REQUEST_READ(question) => {
                    assert_eq!(
                        (question.param_index, question.target_system, question.target_component),
                        (-1, 1, 1)
                    );
                    let name = question.param_id.to_str().unwrap().to_owned();
                    if let Some(&value) = self.parameters.get(&name) {
                        self.set(&name, value);
                    }
                    self.questions.push(name);
                }
                MavMessage::COMMAND_LONG(command) => {
                    assert_eq!((command.command, command.param1), (MavCmd::MAV_CMD_REQUEST_MESSAGE, 49.0));
                    if self.has_origin {
                        self.hear(&MavMessage::GPS_GLOBAL_ORIGIN(GPS_GLOBAL_ORIGIN_DATA::DEFAULT));
                    }
                }
                MavMessage::RC_CHANNELS_OVERRIDE(_) if self.takes_overrides => {
                    for (index, pulse) in pulses_of(&message).into_iter().enumerate() {
                        match pulse {
                            LEAVE => {}
                            // Without a receiver, the last pulse stays.
                            0 if self.receiver == 0 => {}
                            0 => self.pulses[index] = self.sticks[index],
                            pulse => self.pulses[index] = pulse,
                        }
                    }
                    self.sent.push((self.now, message));
                }
                _ => self.sent.push((self.now, message)),
            }
        }
        while let Some(event) = self.helm.take_event() {
            match event {
                Event::Sent(row) => self.rows.push(row),
                Event::HandsOff(reason) => self.ends.push(reason),
            }
        }
    }

    /// The autopilot answers a question, or tells a change.
    fn set(&mut self, name: &str, value: f32) {
        let mut answer = PARAM_VALUE_DATA::DEFAULT;
        (answer.param_id, answer.param_value) = (name.into(), value);
        self.hear(&MavMessage::PARAM_VALUE(answer));
    }

    /// Runs with 50 ticks per second.
    fn run(&mut self, ms: i64) {
        for _ in 0..ms / 20 {
            self.now += 20 * MS;
            let step = (self.now - START) / (20 * MS);
            if !self.is_silent {
                if step % 50 == 0 {
                    self.beat();
                    let flags = self.flags;
                    let mut report = EKF_STATUS_REPORT_DATA::DEFAULT;
                    report.flags = flags;
                    self.hear(&MavMessage::EKF_STATUS_REPORT(report));
                }
                if step % 5 == 0 {
                    if self.reports_channels {
                        self.report(self.pulses);
                    }
                    let mut attitude = ATTITUDE_DATA::DEFAULT;
                    attitude.time_boot_ms = self.boot_ms();
                    self.hear(&MavMessage::ATTITUDE(attitude));
                }
            }
            self.tick();
        }
    }

    fn command(&mut self, values: &[f64]) {
        self.helm.command(values, self.now);
        self.tick();
    }

    /// Runs with a new command at 10 Hz.
    fn steer(&mut self, values: &[f64], ms: i64) {
        for _ in 0..ms / 100 {
            self.command(values);
            self.run(100);
        }
    }

    fn refusals(&self) -> Vec<String> {
        self.helm.refusals(self.now)
    }

    /// The only refusal.
    fn refusal(&self) -> String {
        let refusals = self.refusals();
        assert_eq!(refusals.len(), 1, "{refusals:#?}");
        refusals[0].clone()
    }

    /// All but the last command are forgotten when commands have ended: the release.
    fn released(&mut self) -> Vec<[u16; 8]> {
        self.sent.clear();
        self.tick();
        self.run(3000);
        self.sent.iter().map(|(_, message)| pulses_of(message)).collect()
    }

    fn end(&self) -> &str {
        assert_eq!(self.helm.state(), State::Off);
        assert_eq!(self.ends.len(), 1, "{:?}", self.ends);
        &self.ends[0]
    }
}

fn pulses_of(message: &MavMessage) -> [u16; 8] {
    let MavMessage::RC_CHANNELS_OVERRIDE(m) = message else { panic!("{message:?}") };
    assert_eq!((m.target_system, m.target_component), (1, 1));
    [m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw, m.chan5_raw, m.chan6_raw, m.chan7_raw, m.chan8_raw]
}

#[expect(deprecated, reason = "ArduPilot ignores the successor of this frame")]
fn set_point_of(message: &MavMessage) -> (f32, f32) {
    let MavMessage::SET_POSITION_TARGET_LOCAL_NED(m) = message else { panic!("{message:?}") };
    assert_eq!((m.target_system, m.target_component), (1, 1));
    assert_eq!((m.coordinate_frame, m.type_mask.bits()), (MavFrame::MAV_FRAME_BODY_NED, 1511));
    assert_eq!((m.x, m.y, m.z, m.vy, m.vz, m.afx, m.afy, m.afz, m.yaw), Default::default());
    (m.vx, m.yaw_rate)
}

fn pulses(first: u16, third: u16) -> [u16; 8] {
    let mut pulses = [LEAVE; 8];
    (pulses[0], pulses[2]) = (first, third);
    pulses
}

/// A boat that has answered all questions.
fn ready(axes: Vec<Axis>) -> Boat {
    let mut boat = Boat::new(axes, options());
    boat.run(6000);
    boat
}

/// A boat under command.
fn commanded(axes: Vec<Axis>) -> Boat {
    let mut boat = ready(axes);
    boat.helm.begin(boat.now).unwrap();
    boat.tick();
    boat
}

/// The release after the commands of [`commanded`].
fn whole_release() -> Vec<[u16; 8]> {
    let (neutral, release) = (pulses(1500, 1500), pulses(0, 0));
    vec![neutral, neutral, neutral, release, release]
}

#[test]
fn columns_are_inverted() {
    assert_eq!(Target::of("RC_CHANNELS", "chan3_raw"), Ok(Target::Channel(3)));
    assert_eq!(Target::of("RC_CHANNELS_OVERRIDE", "chan8_raw"), Ok(Target::Channel(8)));
    assert_eq!(Target::of("SET_POSITION_TARGET_LOCAL_NED", "vx"), Ok(Target::Surge));
    assert_eq!(Target::of("SET_POSITION_TARGET_LOCAL_NED", "yaw_rate"), Ok(Target::YawRate));
    for (topic, field, why) in [
        ("SERVO_OUTPUT_RAW", "servo1_raw", "beside other inputs"),
        ("RC_CHANNELS", "chan9_raw", "channels 1 to 8 only"),
        ("RC_CHANNELS", "chan0_raw", "not a pulse"),
        ("RC_CHANNELS", "rssi", "not a pulse"),
        ("SET_POSITION_TARGET_LOCAL_NED", "vy", "takes no such command"),
        ("ATTITUDE", "yaw", "takes no such command"),
    ] {
        let error = Target::of(topic, field).unwrap_err();
        assert!(error.contains(why) && error.contains("select RC_CHANNELS.chan1_raw"), "{error}");
        assert!(!error.contains("  "), "{error}");
    }
}

#[test]
fn axes_that_do_not_fit_are_refused() {
    let refused = |axes: Vec<Axis>| Helm::new(axes, options()).unwrap_err();
    assert!(refused(vec![]).contains("at least one"));
    assert!(refused([channels(), set_points()].concat()).contains("'speed' mixes"));
    assert!(refused([channels(), channels()].concat()).contains("'rudder' commands Channel(1), as another"));
    let one = |target, low, high, rest| refused(vec![axis("u", target, low, high, rest)]);
    assert!(one(Target::Channel(9), 1100.0, 1900.0, 1500.0).contains("channels 1 to 8"));
    assert!(one(Target::Channel(0), 1100.0, 1900.0, 1500.0).contains("channels 1 to 8"));
    for (low, high, rest) in [
        (0.0, 1900.0, 1500.0),
        (1100.0, 65535.0, 1500.0),
        (1900.0, 1100.0, 1500.0),
        (1100.0, 1900.0, 1000.0),
        (f64::NAN, 1900.0, 1500.0),
        (1100.0, f64::INFINITY, 1500.0),
        (1100.0, 1900.0, f64::NAN),
        (1500.2, 1500.8, 1500.5),
    ] {
        assert!(
            one(Target::Channel(1), low, high, rest).contains("limits must ascend"),
            "{low} {high} {rest}"
        );
    }
    assert!(one(Target::Surge, -1.0, 1.0, 0.1).contains("is 0"));
    assert!(one(Target::Surge, 0.2, 1.0, 0.2).contains("is 0"));
    assert!(one(Target::YawRate, -1e300, 1e300, 0.0).contains("limits must ascend"));
}

#[test]
fn a_ready_boat_is_not_refused() {
    for axes in [channels(), set_points()] {
        let boat = ready(axes);
        assert_eq!(boat.refusals(), Vec::<String>::new());
        assert!(boat.sent.is_empty());
        assert_eq!(boat.helm.state(), State::Off);
        // Each parameter is asked for once.
        let mut names = boat.questions.clone();
        names.sort_unstable();
        names.dedup();
        assert!(boat.questions.len() <= names.len() + 1, "{:?}", boat.questions);
    }
}

#[test]
fn both_generations_of_names_are_asked_for() {
    let mut boat = Boat::new(channels(), options());
    for name in ["MAV_GCS_SYSID", "MAV_GCS_SYSID_HI", "MAV_OPTIONS"] {
        boat.parameters.remove(name);
    }
    boat.parameters.insert("SYSID_MYGCS".to_owned(), 255.0);
    boat.run(8000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    // 4.8 says which ones it has no more.
    let mut boat = Boat::new(channels(), options());
    for name in ["RCMAP_THROTTLE", "MODE_CH"] {
        boat.parameters.remove(name);
        let mut error = PARAM_ERROR_DATA::DEFAULT;
        (error.param_id, error.error) = (name.into(), MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST);
        boat.beat();
        boat.hear(&MavMessage::PARAM_ERROR(error));
    }
    boat.parameters.insert("RC1_OPTION".to_owned(), 201.0);
    boat.parameters.insert("RC3_OPTION".to_owned(), 203.0);
    boat.run(3000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    assert!(!boat.questions.iter().any(|name| name == "MODE_CH"));
}

#[test]
fn a_parameter_without_answer_is_asked_for_again() {
    let mut boat = Boat::new(channels(), options());
    boat.parameters.remove("RC3_TRIM");
    boat.run(20_000);
    assert!(boat.refusal().contains("has not answered for its parameters RC3_TRIM"));
    assert!(boat.refusal().contains("system 255 only"));
    assert!(boat.questions.iter().filter(|name| *name == "RC3_TRIM").count() > 10);
    boat.set("RC3_TRIM", 1500.0);
    assert_eq!(boat.refusals(), Vec::<String>::new());
}

#[test]
fn permission_and_dry_run_are_refusals() {
    let mut boat = Boat::new(channels(), Options { is_allowed: false, ..options() });
    boat.run(6000);
    assert!(boat.refusal().contains("not allowed"));
    let mut boat = Boat::new(channels(), Options { is_dry_run: true, ..options() });
    boat.run(6000);
    assert!(boat.refusal().contains("dry run"));
    assert_eq!(boat.helm.begin(boat.now), Err(boat.refusals()));
    boat.steer(&[1600.0, 1600.0], 1000);
    assert!(boat.sent.is_empty());
}

#[test]
fn an_unsuitable_autopilot_is_refused() {
    let boat = Boat::new(channels(), options());
    assert!(boat.refusal().contains("no autopilot has been heard"));
    let changed = |change: fn(&mut Boat)| {
        let mut boat = ready(channels());
        change(&mut boat);
        boat.run(3000);
        boat.refusal()
    };
    assert!(
        changed(|boat| boat.beat.mavtype = MavType::MAV_TYPE_QUADROTOR)
            .contains("neither a boat nor a rover")
    );
    assert!(changed(|boat| boat.beat.custom_mode = HOLD).contains("the mode is HOLD: switch to MANUAL"));
    assert!(changed(|boat| boat.beat.system_status = MavState::MAV_STATE_CRITICAL).contains("CRITICAL"));
    assert!(changed(|boat| boat.beat.base_mode = MavModeFlag::empty()).contains("not armed: arm it"));
    assert!(changed(|boat| boat.flags = EkfStatusFlags::EKF_ATTITUDE).contains("no position"));
    assert!(
        changed(|boat| boat.flags |= EkfStatusFlags::EKF_CONST_POS_MODE).contains("no position"),
        "the last known position is none"
    );
    assert!(changed(|boat| boat.reports_channels = false).contains("RC_CHANNELS does not arrive"));
    assert!(changed(|boat| boat.is_silent = true).contains("the link to the autopilot is lost (silent for"));
    let mut boat = Boat::new(channels(), options());
    boat.beat.autopilot = MavAutopilot::MAV_AUTOPILOT_PX4;
    boat.run(2000);
    assert!(boat.refusal().contains("this is PX4"));
    let mut boat = ready(channels());
    boat.beat.base_mode = MavModeFlag::empty();
    boat.text("PreArm: GPS 1: Bad fix");
    boat.run(2000);
    assert!(boat.refusal().contains("not armed (PreArm: GPS 1: Bad fix): arm it"));
}

#[test]
fn a_missing_origin_is_refused_for_set_points() {
    let mut boat = Boat::new(set_points(), options());
    boat.has_origin = false;
    boat.run(6000);
    assert!(boat.refusal().contains("has no origin"));
    boat.has_origin = true;
    boat.run(3000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    boat.beat.custom_mode = MANUAL;
    boat.run(1000);
    assert!(boat.refusal().contains("the mode is MANUAL: switch to GUIDED"));
    assert_eq!(boat.helm.required_mode(), "GUIDED");
}

#[test]
fn unsuitable_parameters_are_refused() {
    let mut boat = ready(channels());
    for (name, value, why) in [
        (
            "MAV_GCS_SYSID",
            250.0,
            "MAV_GCS_SYSID is 250, and hydroid speaks as 255: start it with own_system=250",
        ),
        ("RC_OVERRIDE_TIME", 0.0, "switched off"),
        ("RC_OVERRIDE_TIME", -1.0, "would never end"),
        ("RC_OVERRIDE_TIME", 0.1, "between 0.5 s and 10 s"),
        ("RC_OVERRIDE_TIME", 60.0, "between 0.5 s and 10 s"),
        ("RC_OPTIONS", 34.0, "bit 1 ignores overrides"),
        (
            "RC3_TRIM",
            1560.0,
            "RC3_TRIM is 1560 us (dead zone 30 us) and the neutral command of 'thrust' is 1500 us",
        ),
        ("RC1_OPTION", 46.0, "switches a function"),
        ("MODE_CH", 3.0, "the channel of 'thrust' selects the mode"),
        ("FS_THR_VALUE", 1200.0, "are a throttle failsafe"),
    ] {
        boat.set(name, value);
        let refusal = boat.refusal();
        assert!(refusal.contains(why) && !refusal.contains("  "), "{refusal}");
        assert_eq!(boat.helm.begin(boat.now), Err(vec![refusal]));
        boat.set(name, parameters()[name]);
        assert_eq!(boat.refusals(), Vec::<String>::new());
    }
    // A range of system ids, and a neutral command within the dead zone.
    boat.set("MAV_GCS_SYSID", 250.0);
    boat.set("MAV_GCS_SYSID_HI", 255.0);
    boat.set("RC3_TRIM", 1520.0);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    boat.set("RC3_TRIM", 1500.0);
    // Without a receiver, the throttle failsafe must be on.
    boat.receiver = 0;
    boat.set("FS_THR_ENABLE", 0.0);
    boat.run(1000);
    assert!(boat.refusal().contains("there is no receiver"));
    // A receiver that is ignored is none.
    boat.receiver = 8;
    boat.run(1000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    boat.set("RC_OPTIONS", 33.0);
    assert!(boat.refusal().contains("there is no receiver"));
    // A rudder without throttle.
    let mut boat = ready(channels()[..1].to_vec());
    assert_eq!(boat.refusals(), Vec::<String>::new());
    boat.pulses[2] = 0;
    boat.run(1000);
    assert!(boat.refusal().contains("channel 3 (RCMAP_THROTTLE) has no pulse"));
}

#[test]
fn set_points_need_the_system_id_only_where_it_is_enforced() {
    let mut boat = Boat::new(set_points(), Options { own_system: 42, ..options() });
    boat.run(6000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    boat.set("MAV_OPTIONS", 1.0);
    assert!(boat.refusal().contains("MAV_OPTIONS restricts commands to MAV_GCS_SYSID, which is 255"));
    let mut boat = Boat::new(set_points(), Options { own_system: 1, ..options() });
    boat.parameters.insert("MAV_OPTIONS".to_owned(), 1.0);
    boat.run(6000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    let mut boat = Boat::new(channels(), Options { own_system: 1, ..options() });
    boat.run(6000);
    assert!(
        boat.refusal()
            .contains("MAV_GCS_SYSID is 255, and hydroid speaks as 1: start it with own_system=255")
    );
}

#[test]
fn commands_are_limited_repeated_and_recorded() {
    let mut boat = commanded(channels());
    assert_eq!(boat.sent.iter().map(|(_, m)| pulses_of(m)).collect::<Vec<_>>(), [pulses(1500, 1500)]);
    for (values, expected) in [
        (&[1600.4, 1300.0][..], pulses(1600, 1300)),
        (&[3000.0, -3000.0], pulses(1900, 1200)),
        (&[f64::NAN, f64::INFINITY], pulses(1500, 1500)),
        (&[1700.0], pulses(1700, 1500)),
        (&[1650.0, 1650.0, 9.0], pulses(1650, 1650)),
    ] {
        boat.sent.clear();
        boat.now += MS;
        // At once, and again at 10 Hz.
        boat.command(values);
        boat.run(900);
        assert!(boat.sent.len() >= 10, "{}", boat.sent.len());
        assert!(boat.sent.iter().all(|(_, message)| pulses_of(message) == expected));
    }
    let row = boat.rows.last().unwrap();
    let topic = TOPICS[row.topic];
    let value = |name| row.values[topic.fields.iter().position(|field| field.name == name).unwrap()];
    assert_eq!(
        (topic.name, value("chan1_raw"), value("chan3_raw")),
        ("RC_CHANNELS_OVERRIDE", 1650.0, 1650.0)
    );
    assert!(value("chan2_raw").is_nan());
    assert_eq!(boat.helm.state(), State::Commanding);
    assert!(boat.ends.is_empty());
}

#[test]
fn set_points_are_limited_and_recorded() {
    let mut boat = commanded(set_points());
    for (values, expected) in [
        ([0.5, 0.1], (0.5, 0.1)),
        ([-9.0, 9.0], (-0.5, 0.3_f32.next_down())),
        ([9.0, -9.0], (1.1_f32.next_down(), (-0.3_f32).next_up())),
        ([f64::NAN, f64::NEG_INFINITY], (0.0, 0.0)),
    ] {
        boat.command(&values);
        assert_eq!(set_point_of(&boat.sent.last().unwrap().1), expected);
        assert!(
            (-0.5..=1.1).contains(&f64::from(expected.0)) && (-0.3..=0.3).contains(&f64::from(expected.1))
        );
    }
    boat.command(&[0.25, -0.125]);
    let row = boat.rows.last().unwrap();
    assert_eq!(
        (TOPICS[row.topic].name, &row.values[..]),
        ("SET_POSITION_TARGET_LOCAL_NED", &[0.25, -0.125][..])
    );
    boat.sent.clear();
    boat.helm.release(boat.now, "by the operator");
    boat.tick();
    boat.run(5000);
    assert_eq!(boat.sent.iter().map(|(_, m)| set_point_of(m)).collect::<Vec<_>>(), [(0.0, 0.0)]);
    assert_eq!(boat.end(), "by the operator");
}

#[test]
fn a_single_set_point_leaves_the_other_at_zero() {
    let mut boat = commanded(set_points()[..1].to_vec());
    boat.command(&[0.5]);
    assert_eq!(set_point_of(&boat.sent.last().unwrap().1), (0.5, 0.0));
}

#[test]
fn a_release_is_neutral_first() {
    for receiver in [0, 8] {
        let mut boat = commanded(channels());
        boat.receiver = receiver;
        boat.steer(&[1700.0, 1800.0], 1000);
        boat.helm.release(boat.now, "by the operator");
        assert_eq!(boat.released(), whole_release());
        // The neutral pulses are read before the release: 50 Hz.
        let times: Vec<_> = boat.sent.iter().map(|(time, _)| (time - boat.sent[0].0) / MS).collect();
        assert_eq!(times, [0, 100, 200, 300, 400]);
        assert_eq!(boat.pulses, [1500; 8]);
        assert_eq!(boat.end(), "by the operator");
        // Commands without a beginning are not sent; there is a new beginning.
        boat.steer(&[1700.0, 1800.0], 1000);
        assert_eq!(boat.sent.len(), 5);
        boat.helm.release(boat.now, "again");
        boat.helm.begin(boat.now).unwrap();
        boat.steer(&[1700.0, 1800.0], 1000);
        assert!(boat.sent.len() >= 15);
        assert_eq!(boat.helm.state(), State::Commanding);
        assert_eq!(boat.ends.len(), 1);
    }
}

#[test]
fn a_release_is_finished_before_a_new_beginning() {
    let mut boat = commanded(channels());
    boat.helm.release(boat.now, "by the operator");
    boat.tick();
    assert!(boat.helm.begin(boat.now).unwrap_err()[0].contains("being released"));
}

#[test]
fn without_new_commands_the_neutral_one_is_sent_and_then_hands_are_off() {
    let mut boat = commanded(channels());
    boat.command(&[1700.0, 1700.0]);
    boat.run(1000);
    assert_eq!(pulses_of(&boat.sent.last().unwrap().1), pulses(1700, 1700));
    boat.run(100);
    assert_eq!(pulses_of(&boat.sent.last().unwrap().1), pulses(1500, 1500));
    assert_eq!(boat.helm.state(), State::Commanding);
    boat.run(940);
    assert!(boat.end().contains("no new command for 2.0 s"), "{}", boat.end());
    let mut boat = commanded(set_points());
    boat.run(5000);
    assert!(boat.end().contains("no new command for 2.0 s"));
}

#[test]
fn hands_are_off_at_once_when_a_condition_fails() {
    for (change, why) in [
        ((|boat| boat.beat.custom_mode = HOLD) as fn(&mut Boat), "the mode is HOLD"),
        (|boat| boat.beat.base_mode = MavModeFlag::empty(), "not armed"),
        (|boat| boat.beat.system_status = MavState::MAV_STATE_CRITICAL, "CRITICAL"),
        (|boat| boat.beat.system_status = MavState::MAV_STATE_EMERGENCY, "EMERGENCY"),
    ] {
        let mut boat = commanded(channels());
        boat.steer(&[1700.0, 1700.0], 1000);
        change(&mut boat);
        boat.beat();
        assert_eq!(boat.helm.state(), State::Off);
        // A pilot with a receiver who changes the mode has the channels at once.
        let is_piloted = boat.beat.custom_mode == HOLD;
        let release = whole_release().split_off(if is_piloted { 3 } else { 0 });
        let sent = release.len();
        assert_eq!(boat.released(), release);
        assert!(boat.end().contains(why));
        // Nothing begins again by itself, and it cannot begin.
        boat.steer(&[1700.0, 1700.0], 3000);
        assert_eq!(boat.sent.len(), sent);
        assert!(boat.helm.begin(boat.now).is_err());
    }
}

#[test]
fn a_set_point_is_never_sent_in_another_mode() {
    let mut boat = commanded(set_points());
    boat.command(&[0.5, 0.1]);
    boat.sent.clear();
    boat.beat.custom_mode = 10;
    boat.beat();
    boat.run(3000);
    assert!(boat.sent.is_empty());
    assert_eq!(boat.end(), "the mode is AUTO");
}

#[test]
fn hands_are_off_when_the_link_is_lost() {
    let mut boat = commanded(channels());
    boat.is_silent = true;
    boat.steer(&[1700.0, 1700.0], 1200);
    assert!(boat.end().contains("the link to the autopilot is lost"));
    // Other messages arrive, but no heartbeats.
    let mut boat = commanded(channels());
    boat.is_silent = true;
    for _ in 0..30 {
        boat.report(boat.pulses);
        boat.steer(&[1700.0, 1700.0], 100);
    }
    assert!(boat.end().contains("the link to the autopilot is lost"));
    // The autopilot does not report the channels any more.
    let mut boat = commanded(channels());
    boat.reports_channels = false;
    boat.steer(&[1700.0, 1700.0], 2500);
    assert!(boat.end().contains("RC_CHANNELS does not arrive"));
}

#[test]
fn hands_are_off_when_others_override() {
    let mut boat = commanded(channels());
    boat.steer(&[1600.0, 1700.0], 1000);
    // The pilot ends the overrides by a switch: the sticks hold.
    boat.takes_overrides = false;
    boat.pulses = [1550; 8];
    boat.steer(&[1600.0, 1700.0], 500);
    assert_eq!(boat.helm.state(), State::Commanding);
    boat.steer(&[1600.0, 1700.0], 200);
    assert!(
        boat.end().contains("channel 1 has a pulse of 1550 us, and hydroid has sent 1600 us"),
        "{}",
        boat.end()
    );
    // They are not overridden by a neutral command.
    let mut sent = boat.sent.iter().map(|(_, message)| pulses_of(message));
    assert_eq!(sent.rfind(|sent| *sent != pulses(1600, 1700)), Some(pulses(0, 0)));
    boat.run(1000);
    assert!(!boat.sent.iter().skip(1).any(|(_, message)| pulses_of(message) == pulses(1500, 1500)));
    // The throttle alone: the rudder becomes neutral before its release.
    let mut boat = commanded(channels());
    boat.steer(&[1600.0, 1700.0], 1000);
    boat.takes_overrides = false;
    boat.pulses[2] = 1400;
    while boat.helm.state() == State::Commanding {
        boat.helm.command(&[1600.0, 1700.0], boat.now);
        boat.run(20);
    }
    let release: Vec<_> = boat.released();
    assert_eq!(release, [pulses(1500, LEAVE), pulses(1500, LEAVE), pulses(0, 0), pulses(0, 0)]);
}

#[test]
fn hands_are_off_when_another_program_overrides_in_turn() {
    let mut boat = commanded(channels());
    for step in 0..100 {
        boat.pulses = if step % 2 == 0 { [1400; 8] } else { [1600; 8] };
        boat.takes_overrides = false;
        boat.steer(&[1600.0, 1600.0], 100);
        if boat.helm.state() == State::Off {
            break;
        }
    }
    assert!(boat.end().contains("has a pulse of 1400 us"));
}

#[test]
fn moving_commands_and_a_delay_of_the_link_are_no_takeover() {
    let mut boat = commanded(channels());
    boat.takes_overrides = false;
    let mut past = std::collections::VecDeque::from(vec![[1500; 8]; 15]);
    for step in 0..500_u32 {
        let value = 1500.0 + 100.0 * f64::from(step % 7);
        boat.helm.command(&[value, value], boat.now);
        boat.run(20);
        // Reported 300 ms later.
        let sent = pulses_of(&boat.sent.last().unwrap().1);
        past.push_back(sent.map(|pulse| if pulse == LEAVE { 1500 } else { pulse }));
        boat.pulses = past.pop_front().unwrap();
    }
    assert_eq!(boat.helm.state(), State::Commanding, "{:?}", boat.ends);
}

#[test]
fn hands_are_off_when_the_autopilot_says_so() {
    for (text, release) in [
        ("Radio Failsafe", whole_release()),
        ("GCS Failsafe", whole_release()),
        ("RC overrides cleared by pilot input", vec![pulses(0, 0); 2]),
    ] {
        let mut boat = commanded(channels());
        boat.steer(&[1600.0, 1700.0], 500);
        boat.text(text);
        assert_eq!(boat.released(), release);
        assert_eq!(boat.end(), format!("the autopilot says: {text}"));
    }
    let mut boat = commanded(channels());
    for text in ["Radio Failsafe Cleared", "PreArm: Radio failsafe", "Throttle armed"] {
        boat.text(text);
    }
    assert_eq!(boat.helm.state(), State::Commanding);
}

#[test]
fn a_restart_ends_commands_and_all_is_asked_for_again() {
    let mut boat = commanded(channels());
    boat.steer(&[1600.0, 1700.0], 500);
    boat.boot_ns = boat.now - 1000 * MS;
    boat.questions.clear();
    boat.run(100);
    assert!(boat.end().contains("has started again"));
    boat.beat();
    assert!(boat.refusals().iter().any(|refusal| refusal.contains("has not answered for its parameters")));
    boat.run(6000);
    assert_eq!(boat.refusals(), Vec::<String>::new());
    assert!(boat.questions.len() > 10);
}

#[test]
fn a_clock_that_goes_back_ends_commands() {
    let mut boat = commanded(channels());
    boat.steer(&[1600.0, 1700.0], 500);
    boat.now -= 3_600_000 * MS;
    boat.sent.clear();
    for _ in 0..100 {
        boat.now += 20 * MS;
        boat.command(&[1600.0, 1700.0]);
    }
    assert!(boat.end().contains("clock"));
    assert_eq!(boat.sent.iter().map(|(_, m)| pulses_of(m)).collect::<Vec<_>>(), whole_release());
    assert!(boat.refusal().contains("lost"));
}

#[test]
fn messages_of_others_do_not_count() {
    let mut boat = commanded(channels());
    let mut beat = boat.beat.clone();
    beat.custom_mode = HOLD;
    boat.helm.receive(MavHeader { system_id: 2, ..VEHICLE }, &MavMessage::HEARTBEAT(beat), boat.now);
    assert_eq!(boat.helm.state(), State::Commanding);
}

#[test]
fn needed_topics_are_named() {
    let names = |axes| {
        let helm = Helm::new(axes, options()).unwrap();
        helm.rates().into_iter().map(|(topic, _)| TOPICS[topic].name).collect::<Vec<_>>()
    };
    assert_eq!(names(channels()), ["RC_CHANNELS", "EKF_STATUS_REPORT"]);
    assert_eq!(names(set_points()), ["EKF_STATUS_REPORT"]);
}

/// What happens to a helm.
#[derive(Clone, Debug)]
enum Action {
    Run(i64),
    Wait(i64),
    Tick,
    Command([f64; 2]),
    Beat { mode: u32, armed: bool, status: MavState },
    Report([u16; 8]),
    Text(&'static str),
    Parameter(usize, f32),
    Flags(u16),
    Begin,
    Release,
    Restart,
    Silent(bool),
    Channels(bool),
    Overrides(bool),
}

fn action() -> impl Strategy<Value = Action> {
    let value = || {
        prop_oneof![
            4 => 1000.0..2000.0,
            3 => -2.0..2.0,
            1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1e300, 65534.6]),
        ]
    };
    let pulse = prop_oneof![Just(1500_u16), 0_u16..=LEAVE];
    let status = prop::sample::select(vec![
        MavState::MAV_STATE_ACTIVE,
        MavState::MAV_STATE_STANDBY,
        MavState::MAV_STATE_CRITICAL,
        MavState::MAV_STATE_EMERGENCY,
    ]);
    let mode = prop::sample::select(vec![MANUAL, GUIDED, HOLD, 10]);
    let texts =
        vec!["Radio Failsafe", "Radio Failsafe Cleared", "RC overrides cleared by pilot input", "PreArm: x"];
    prop_oneof![
        12 => (20..600_i64).prop_map(Action::Run),
        2 => (-3000..5000_i64).prop_map(Action::Wait),
        4 => Just(Action::Tick),
        16 => [value(), value()].prop_map(Action::Command),
        2 => (mode, prop::bool::weighted(0.8), status).prop_map(|(mode, armed, status)| Action::Beat { mode, armed, status }),
        1 => prop::array::uniform8(pulse).prop_map(Action::Report),
        1 => prop::sample::select(texts).prop_map(Action::Text),
        1 => (0..15_usize, prop_oneof![Just(0.0_f32), -10.0..2000.0_f32]).prop_map(|(i, v)| Action::Parameter(i, v)),
        1 => any::<u16>().prop_map(Action::Flags),
        6 => Just(Action::Begin),
        1 => Just(Action::Release),
        1 => Just(Action::Restart),
        1 => prop::bool::weighted(0.2).prop_map(Action::Silent),
        1 => prop::bool::weighted(0.8).prop_map(Action::Channels),
        1 => prop::bool::weighted(0.7).prop_map(Action::Overrides),
    ]
}

/// What was sent since the last look, checked: what the autopilot last said permits it.
struct Watch {
    axes: Vec<Axis>,
    mode: u32,
    /// Messages of the release that may follow.
    release: usize,
    seen_ends: usize,
    commands: usize,
}

impl Watch {
    /// Looks at one tick.
    fn look(&mut self, boat: &mut Boat) {
        let is_commanding = boat.helm.state() == State::Commanding;
        if boat.ends.len() > self.seen_ends {
            assert_eq!(boat.ends.len(), self.seen_ends + 1);
            self.seen_ends = boat.ends.len();
            self.release = if self.mode == MANUAL { 5 } else { 1 };
        }
        let sent = std::mem::take(&mut boat.sent);
        assert!(sent.len() <= 1, "{sent:?}");
        for (_, message) in &sent {
            if is_commanding {
                self.commands += 1;
                self.release = 0;
                assert_eq!(boat.beat.custom_mode, self.mode);
                assert!(boat.beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED));
                assert_eq!(boat.ends.len(), self.seen_ends);
            } else {
                assert!(self.release > 0, "a message after the release: {message:?}");
                self.release -= 1;
            }
            if self.mode == MANUAL {
                let pulses = pulses_of(message);
                for (index, pulse) in pulses.into_iter().enumerate() {
                    let axis = self
                        .axes
                        .iter()
                        .find(|axis| axis.place == Target::Channel(u8::try_from(index + 1).unwrap()));
                    match axis {
                        None => assert_eq!(pulse, LEAVE),
                        Some(axis) if is_commanding => {
                            assert!((axis.low..=axis.high).contains(&f64::from(pulse)), "{pulse}");
                        }
                        Some(_) if self.release < 2 => assert_eq!(pulse, 0),
                        Some(axis) => assert!(f64::from(pulse) == axis.rest || [0, LEAVE].contains(&pulse)),
                    }
                }
            } else {
                let (surge, yaw_rate) = set_point_of(message);
                assert_eq!(boat.beat.custom_mode, self.mode);
                for (value, axis) in [surge, yaw_rate].into_iter().zip(&self.axes) {
                    assert!((axis.low..=axis.high).contains(&f64::from(value)), "{value}");
                    assert!(is_commanding || value == 0.0);
                }
            }
        }
    }
}

fn check(axes: &[Axis], actions: Vec<Action>) -> usize {
    let mut boat = commanded(axes.to_vec());
    boat.sent.clear();
    let mut watch =
        Watch { axes: axes.to_vec(), mode: boat.beat.custom_mode, release: 0, seen_ends: 0, commands: 0 };
    let names: Vec<_> = parameters().into_keys().collect();
    for action in actions {
        match action {
            Action::Run(ms) => {
                for _ in 0..ms / 20 {
                    boat.run(20);
                    watch.look(&mut boat);
                }
            }
            Action::Wait(ms) => boat.now = (boat.now + ms * MS).max(boat.boot_ns).max(START),
            Action::Tick => boat.tick(),
            Action::Command(values) => boat.command(&values),
            Action::Beat { mode, armed, status } => {
                boat.beat.custom_mode = mode;
                boat.beat.base_mode =
                    if armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
                boat.beat.system_status = status;
                boat.beat();
            }
            Action::Report(pulses) => boat.report(pulses),
            Action::Text(text) => boat.text(text),
            Action::Parameter(index, value) => boat.set(&names[index], value),
            Action::Flags(flags) => boat.flags = EkfStatusFlags::from_bits_truncate(flags),
            Action::Begin => {
                // The operator makes ready what can be made ready, and begins.
                (boat.is_silent, boat.reports_channels, boat.takes_overrides) = (false, true, true);
                boat.flags = EkfStatusFlags::EKF_POS_HORIZ_ABS;
                for (name, value) in parameters() {
                    boat.set(&name, value);
                }
                boat.beat.custom_mode = watch.mode;
                boat.beat.base_mode = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
                boat.beat.system_status = MavState::MAV_STATE_ACTIVE;
                boat.beat();
                let refusals = boat.helm.refusals(boat.now);
                let begun = boat.helm.begin(boat.now);
                assert_eq!(begun.is_ok(), boat.helm.state() == State::Commanding);
                if refusals.is_empty() {
                    assert_eq!(begun, Ok(()));
                }
            }
            Action::Release => boat.helm.release(boat.now, "by the operator"),
            Action::Restart => boat.boot_ns = boat.now,
            Action::Silent(is_silent) => boat.is_silent = is_silent,
            Action::Channels(reports) => boat.reports_channels = reports,
            Action::Overrides(takes) => boat.takes_overrides = takes,
        }
        watch.look(&mut boat);
    }
    watch.commands
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn nothing_forbidden_is_ever_sent(is_manual in any::<bool>(), actions in prop::collection::vec(action(), 0..120)) {
        check(&if is_manual { channels() } else { set_points() }, actions);
    }
}

#[test]
fn random_sequences_do_send_commands() {
    use proptest::strategy::ValueTree as _;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let mut sum = [0, 0];
    for case in 0..40 {
        let actions = prop::collection::vec(action(), 100).new_tree(&mut runner).unwrap().current();
        sum[case % 2] += check(&if case % 2 == 0 { channels() } else { set_points() }, actions);
    }
    assert!(sum.iter().all(|&commands| commands > 500), "{sum:?}");
}
