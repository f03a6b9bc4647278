//! The settings of the boat of the campaign, and models of it.

use std::path::Path;
use std::sync::Arc;

use hydroid::closed_loop::ControlMethod;
use hydroid::config::control::{ClosedLoopOptions, TaskKind};
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, ChannelSpec, Selection, Sensors};
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_live::boat::{ExperimentLimits, Settings};
use hydroid_live::link::mavlink;
use rand::{Rng, RngExt as _};

use super::water::ORIGIN_DEG;

/// How the boat is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Commands {
    /// Pulses of channels 3 (throttle) and 1 (steering), in mode MANUAL.
    Channels,
    /// Speed and yaw rate, in mode GUIDED.
    SetPoints,
}

/// Sample time of the models \[s\].
const DT_S: f64 = 0.2;

/// Radius of the geofence \[m\].
pub(super) const FENCE_M: f64 = 80.0;

/// Columns of the sensors and commands.
fn selection(commands: Commands) -> Selection {
    let inputs = match commands {
        Commands::Channels => {
            "throttle=(RC_CHANNELS.chan3_raw - 1500) / 400,steering=(RC_CHANNELS.chan1_raw - 1500) / 400"
        }
        Commands::SetPoints => {
            "throttle=SET_POSITION_TARGET_LOCAL_NED.vx,steering=SET_POSITION_TARGET_LOCAL_NED.yaw_rate"
        }
    };
    let of = |column: &str| Some(ChannelSpec::named(column));
    Selection {
        sensors: Some(Sensors {
            latitude: of("GPS_RAW_INT.lat"),
            longitude: of("GPS_RAW_INT.lon"),
            speed: of("GPS_RAW_INT.vel"),
            course: of("GPS_RAW_INT.cog"),
            heading: of("ATTITUDE.yaw"),
            yaw_rate: of("ATTITUDE.yawspeed"),
            ..Sensors::default()
        }),
        ..Selection::of("u,v,r", inputs).unwrap()
    }
}

/// Settings of the link.
pub(super) fn link(rate_hz: f64) -> mavlink::Settings {
    mavlink::Settings { system: None, own_system: 255, rate_hz, may_command: true, is_dry_run: false }
}

/// Settings with random limits of the commands.
pub(super) fn settings(commands: Commands, folder: &Path, rng: &mut impl Rng) -> Settings {
    let limits = match commands {
        Commands::Channels => {
            [[0.0, rng.random_range(0.6..1.0)], [rng.random_range(-1.0..-0.6), rng.random_range(0.6..1.0)]]
        }
        Commands::SetPoints => [[0.0, rng.random_range(1.0..1.8)], [-0.3, 0.3]],
    };
    let names = ["throttle", "steering"].map(str::to_owned);
    let [push, turn] = names.clone().map(|name| vec![name]);
    Settings {
        address: "campaign".to_owned(),
        selection: selection(commands),
        folder: folder.to_owned(),
        records: rng.random_bool(0.8),
        horizons_s: vec![1.0, 5.0],
        is_dry_run: false,
        boat: hydroid::boat::Boat::default(),
        neutral: std::collections::BTreeMap::new(),
        limits: names.into_iter().zip(limits).collect(),
        push: push.clone(),
        turn: turn.clone(),
        experiment: ExperimentLimits {
            fence_m: FENCE_M,
            centre_deg: Some(ORIGIN_DEG),
            max_speed_m_s: 4.0,
            max_yaw_rate_rad_s: 1.0,
            duration_s: rng.random_range(120.0..400.0),
            seed: rng.random(),
        },
        time_scale: 1.0,
        control: ClosedLoopOptions {
            task: TaskKind::LawnMower,
            controller: ControlMethod::Autopilot,
            speed: Some(1.0),
            leg: Some(50.0),
            spacing: Some(20.0),
            legs: Some(3),
            radius: Some(10.0),
            tolerance: Some(8.0),
            push,
            turn,
            ..ClosedLoopOptions::default()
        },
    }
}

/// A model of the boat whose coefficients are off by the share `off`.
pub(super) fn model(commands: Commands, off: f64, rng: &mut impl Rng) -> Model {
    // Variables: u, v, r, throttle, steering.
    let terms = vec![
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::signed_square(2, 2),
        Term::monomial(&[0, 2]),
        Term::monomial(&[3]),
        Term::monomial(&[4]),
        Term::monomial(&[3, 3]),
        Term::monomial(&[3, 4]),
    ];
    // By output: the catamaran of `vessels/otter.toml`, and one that follows its set-points.
    let mut coefficients = match commands {
        Commands::Channels => [
            [-0.91, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.6, 0.0],
            [0.0, -1.2, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, -10.0, 0.0, 0.0, 1.0, 0.0, 3.5],
        ],
        Commands::SetPoints => [
            [-1.2, 0.0, 0.0, 0.0, 0.0, 1.2, 0.0, 0.0, 0.0],
            [0.0, -1.2, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0],
        ],
    };
    for value in coefficients.as_flattened_mut() {
        *value *= 1.0 + rng.random_range(-off..=off);
    }
    let (inputs, reach) = (["throttle", "steering"], if commands == Commands::Channels { 1.0 } else { 1.8 });
    let equations = Equations::new(terms, coefficients.concat(), 3, 2, DT_S, 2).unwrap();
    let port = |name: &str, unit: &str, low: f64, high: f64| Port {
        channel: Channel::new(name, unit),
        range: DesignRange { low, high },
        training_range: None,
        // The filter that trains a network needs the noise of the outputs.
        noise: Some(if unit == "rad/s" { 0.01 } else { 0.03 }),
        rate_limit: None,
    };
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: "sindy".to_owned(),
            dt: DT_S,
            outputs: vec![
                port("u", "m/s", -0.5, 2.5),
                port("v", "m/s", -0.5, 0.5),
                port("r", "rad/s", -0.7, 0.7),
            ],
            inputs: vec![port(inputs[0], "", 0.0, reach), port(inputs[1], "", -1.0, 1.0)],
            reading: Reading { selection: selection(commands), ..Reading::default() },
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: "0.2.0".to_owned(),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
        },
        body: Body::Equations(Arc::new(equations)),
        members: Members::default(),
        learning: None,
    }
}
