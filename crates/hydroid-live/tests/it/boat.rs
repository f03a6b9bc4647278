//! A small boat and its log.

use std::path::Path;
use std::sync::Arc;

use hydroid::adapt::{self, KalmanOptions, Method};
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, ChannelSpec};
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_live::black_box::{ModelFile, RecordingOptions};

/// The extended Kalman filter for the boat.
pub(crate) fn filter() -> adapt::Options {
    let noise = Some(vec![0.02, 0.01]);
    adapt::Options {
        method: Method::Kalman,
        kalman: KalmanOptions { noise, huber: 4.0, ..KalmanOptions::of_equations() },
        ..adapt::Options::default()
    }
}

/// Surge and yaw rate, propeller and rudder: `du/dt = -0.3 u|u| + 0.5 n`, `dr/dt = -r + 0.8 delta`.
pub(crate) fn model() -> Model {
    let terms =
        vec![Term::signed_square(0, 0), Term::monomial(&[1]), Term::monomial(&[2]), Term::monomial(&[3])];
    let coefficients = vec![-0.3, 0.0, 0.5, 0.0, 0.0, -1.0, 0.0, 0.8];
    let equations = Equations::new(terms, coefficients, 2, 2, 0.1, 2).unwrap();
    let port = |name: &str, unit: &str| Port {
        channel: Channel::new(name, unit),
        range: DesignRange { low: -2.0, high: 2.0 },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    let mut reading = Reading::default();
    reading.selection.time = Some("t".to_owned());
    reading.selection.outputs = ["u", "r"].map(ChannelSpec::named).into();
    reading.selection.inputs = ["n", "delta"].map(ChannelSpec::named).into();
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: "sindy".to_owned(),
            dt: 0.1,
            outputs: vec![port("u", "m/s"), port("r", "rad/s")],
            inputs: vec![port("n", ""), port("delta", "rad")],
            reading,
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: "0.1.0".to_owned(),
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

pub(crate) fn settings(path: &Path) -> RecordingOptions {
    RecordingOptions {
        path: path.to_owned(),
        minutes: 2.0,
        model: ModelFile { file: "boat.safetensors".to_owned(), fingerprint: "boat".to_owned() },
    }
}

/// Command and measurement at a sample of a moving boat with noisy sensors.
pub(crate) fn sample(k: usize) -> ([f64; 2], [f64; 2]) {
    let x = k as f64;
    let noise = (x * x * 0.37).sin() * 0.01;
    let u = 1.0 + 0.3 * (0.2 * x).sin() + noise;
    let r = 0.2 * (0.13 * x).cos() - noise;
    ([1.0 + (0.05 * x).sin(), 0.3 * (0.11 * x).sin()], [u, r])
}

/// A header and `count` lines with gaps, missing values, invalid cells and spikes.
pub(crate) fn lines(count: usize) -> Vec<String> {
    let mut lines = vec!["t,u,r,n,delta".to_owned()];
    for k in 0..count {
        let ([n, delta], [u, r]) = sample(k);
        let t = 0.1 * k as f64;
        lines.push(match k % 211 {
            50 => format!("{t},,{r},{n},"),
            51 => format!("{t},,,{n},{delta}"),
            80..83 => continue,
            100 => "nonsense".to_owned(),
            130 => format!("{t},15,{r},{n},{delta}"),
            150 => format!("{},{u},{r},{n},{delta}", t - 3.0),
            160..180 if k > 500 => continue,
            _ => format!("{t},{u},{r},{n},{delta}"),
        });
    }
    lines
}
