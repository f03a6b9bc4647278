//! Networks of every kind as models: what they are in words.

use std::sync::Arc;

use hydroid_core::actuator::Map;
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Recurrent, Scaling};

use super::recurrent::cell_text;
use super::{Body, Model};

impl Model {
    /// Whether it is a network.
    pub fn is_network(&self) -> bool {
        self.scaling().is_some()
    }

    /// The direct predictor; none for other models.
    pub fn direct(&self) -> Option<&Arc<Direct>> {
        match &self.body {
            Body::Direct(direct) => Some(direct),
            Body::Equations(_) | Body::Recurrent(_) | Body::Affine(_) | Body::Plant(_) => None,
        }
    }

    /// The control-affine network; none for other models.
    pub fn control_affine(&self) -> Option<&Arc<ControlAffine>> {
        match &self.body {
            Body::Affine(affine) => Some(affine),
            Body::Equations(_) | Body::Recurrent(_) | Body::Direct(_) | Body::Plant(_) => None,
        }
    }

    /// How the channels of a network are scaled; none for models of equations.
    pub fn scaling(&self) -> Option<&Scaling> {
        match &self.body {
            Body::Recurrent(recurrent) => Some(&recurrent.scaling),
            Body::Direct(direct) => Some(&direct.scaling),
            Body::Affine(affine) => Some(&affine.scaling),
            Body::Equations(_) | Body::Plant(_) => None,
        }
    }

    /// A network in words, one line for each thing to know; none for models of equations.
    pub fn network_text(&self) -> Vec<String> {
        match &self.body {
            Body::Recurrent(recurrent) => recurrent_text(recurrent, self.description.dt),
            Body::Direct(direct) => direct_text(direct, self.description.dt),
            Body::Affine(affine) => self.affine_text(affine),
            Body::Equations(_) | Body::Plant(_) => Vec::new(),
        }
    }

    fn affine_text(&self, affine: &ControlAffine) -> Vec<String> {
        let mut lines = vec![
            format!("feed-forward network {}, tanh between its layers", sizes(&affine.network)),
            String::from(
                "gives the rates of the outputs: f(outputs) + sum of g(outputs) phi(actuator), by its structure",
            ),
        ];
        for (port, effector) in self.description.inputs.iter().zip(&affine.effectors) {
            let name = &port.channel.name;
            let phi = match effector.map {
                Map::Identity => "a".to_owned(),
                Map::Sine => "sin(a)".to_owned(),
                Map::SignedSquare => "a |a|".to_owned(),
            };
            let lag = effector.time_constant_s;
            lines.push(format!("{name}: phi(a) = {phi}, a follows {name} with a lag of {lag:.3} s"));
        }
        lines
    }

    /// How the channels of a network are scaled, one line for each; none for models of equations.
    pub fn scaling_text(&self) -> Vec<String> {
        let Some(s) = self.scaling() else { return Vec::new() };
        let d = &self.description;
        let line = |kind: &str, name: &str, mean: f64, scale: f64| {
            let sign = if mean < 0.0 { '+' } else { '-' };
            format!("{kind:<7} {name:<12} ({name} {sign} {:.5}) / {scale:.5}", mean.abs())
        };
        let outputs = d.outputs.iter().zip(s.output_mean.iter().zip(&s.output_scale));
        let inputs = d.inputs.iter().zip(s.input_mean.iter().zip(&s.input_scale));
        let lines = outputs.map(|(port, (&m, &k))| line("output", &port.channel.name, m, k));
        lines.chain(inputs.map(|(port, (&m, &k))| line("input", &port.channel.name, m, k))).collect()
    }
}

fn recurrent_text(recurrent: &Recurrent, dt: f64) -> Vec<String> {
    let network = &recurrent.network;
    let mut lines = vec![format!(
        "{}, {}; state of {} numbers",
        cell_text(&network.cell),
        if network.read_out { "linear read-out" } else { "no read-out: its state is its output" },
        network.state_len()
    )];
    lines.push(String::from(if recurrent.feedback {
        "sees the inputs and the outputs (its own predictions in a rollout)"
    } else {
        "sees the inputs alone"
    }));
    lines.push(String::from(match recurrent.base {
        BaseModel::Nothing => "gives the next outputs themselves",
        BaseModel::Hold => "gives the increments of the outputs",
        BaseModel::Equations(_) => "gives what equations of motion miss over a sample (a grey box)",
    }));
    lines.push(format!(
        "wash-out: {} samples, {:.3} s, before its hidden state is worth something",
        recurrent.wash_out,
        recurrent.wash_out as f64 * dt
    ));
    lines.push(String::from(match &recurrent.state_filter {
        Some(_) => "state filter: measurements correct its hidden state while it walks",
        None => "no state filter",
    }));
    lines
}

/// Lengths from input to output.
fn sizes(network: &Perceptron) -> String {
    let all = [&[network.inputs], network.hidden.as_slice(), &[network.outputs]].concat();
    all.iter().map(usize::to_string).collect::<Vec<_>>().join("-")
}

fn direct_text(direct: &Direct, dt: f64) -> Vec<String> {
    let seconds = |samples: usize| samples as f64 * dt;
    vec![
        format!("feed-forward network {}, tanh between its layers", sizes(&direct.network)),
        format!(
            "sees the last {} samples ({:.3} s) of outputs and inputs, and the inputs to come",
            direct.history,
            seconds(direct.history)
        ),
        format!(
            "gives the next {} samples ({:.3} s) at once{}; longer predictions are chained",
            direct.horizon,
            seconds(direct.horizon),
            match direct.base {
                BaseModel::Nothing => "",
                BaseModel::Hold => ", as differences to the present outputs",
                BaseModel::Equations(_) =>
                    ", as what equations of motion miss from the present sample on (a grey box)",
            }
        ),
    ]
}
