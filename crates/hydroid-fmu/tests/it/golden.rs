//! Rollouts of the models by their own sessions, to which FMUs are compared; FMUs of all models for `tests/export/fmu`.

use std::path::{Path, PathBuf};

use hydroid::model::{Body, Model};
use hydroid::plant::{Motion, input_values, rest};
use hydroid_core::predict::Workspace;
use hydroid_export::Options;
use hydroid_export::fmu::{FmuOptions, Role, Variables, Version, export};
use serde_json::json;

use crate::models;

pub(crate) const SAMPLES: usize = 1000;

/// A run of a model: commands and conditions at the start, and what follows.
pub(crate) struct Golden {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    pub(crate) start_outputs: Vec<f64>,
    pub(crate) start_inputs: Vec<f64>,
    pub(crate) start_pose: [f64; 3],
    pub(crate) current: [f64; 2],
    /// Row by row.
    pub(crate) commands: Vec<f64>,
    /// Outputs after each command.
    pub(crate) expected: Vec<f64>,
    /// Poses after each command; empty for a model without a motion.
    pub(crate) poses: Vec<[f64; 3]>,
}

/// A pose after a sample on an arc, as documented for [`hydroid::plant::arc`], with complex exponentials written out.
fn moved([x, y, psi]: [f64; 3], from: [f64; 3], to: [f64; 3], [north, east]: [f64; 2], dt: f64) -> [f64; 3] {
    let [u, v, r] = [0, 1, 2].map(|i| f64::midpoint(from[i], to[i]));
    let turn = r * dt;
    let chord = if turn.abs() < 1e-9 { dt } else { 2.0 * (turn / 2.0).sin() / r };
    let course = psi + turn / 2.0;
    [
        x + chord * (u * course.cos() - v * course.sin()) + north * dt,
        y + chord * (u * course.sin() + v * course.cos()) + east * dt,
        psi + turn,
    ]
}

impl Golden {
    pub(crate) fn of(model: &Model) -> Self {
        let d = &model.description;
        let (n, m) = (d.outputs.len(), d.inputs.len());
        let mut start_outputs = rest(model);
        start_outputs[0] = 0.5 * (start_outputs[0] + d.outputs[0].range.high);
        let idle: Vec<f64> = input_values(model).unwrap().iter().map(|value| value.neutral).collect();
        let between = |port: &hydroid::model::Port, share: f64| {
            port.range.low + (port.range.high - port.range.low) * (0.5 + 0.4 * share)
        };
        let start_inputs: Vec<f64> =
            d.inputs.iter().zip(&idle).map(|(port, idle)| 0.5 * (idle + between(port, 0.3))).collect();
        // Commands that are held for 7 and more samples.
        let command =
            |k: usize, c: usize| between(&d.inputs[c], (1.7 * (k / (7 + 4 * c)) as f64 + c as f64).sin());
        let commands: Vec<f64> = (0..SAMPLES * m).map(|at| command(at / m, at % m)).collect();
        // Through the water, by a session of the model in still water.
        let mut still = model.frozen();
        still.description.current = None;
        let mut session = still.session();
        let rows = session.warm_up().max(2);
        for row in 0..rows {
            session.observe(&start_outputs);
            if row + 1 < rows {
                session.advance(&start_inputs);
            }
        }
        let mut expected = vec![0.0; SAMPLES * n];
        if matches!(model.body, Body::Direct(_)) {
            // A direct predictor that runs freely predicts each sample anew.
            for (c, y) in commands.chunks_exact(m).zip(expected.chunks_exact_mut(n)) {
                session.advance(c);
                session.output(y);
            }
        } else {
            session.rollout(&commands, &mut Workspace::new(), &mut expected);
        }
        let (start_pose, current) = ([10.0, -20.0, 1.0], [0.2, -0.1]);
        let mut poses = Vec::new();
        if let Ok(motion) = Motion::of(model) {
            let mut pose = start_pose;
            let mut before = motion.nu(&start_outputs);
            for y in expected.chunks_exact(n) {
                pose = moved(pose, before, motion.nu(y), current, d.dt);
                before = motion.nu(y);
                poses.push(pose);
            }
        }
        Self {
            outputs: n,
            inputs: m,
            start_outputs,
            start_inputs,
            start_pose,
            current,
            commands,
            expected,
            poses,
        }
    }

    pub(crate) fn command(&self, k: usize) -> &[f64] {
        &self.commands[k * self.inputs..][..self.inputs]
    }

    /// The outputs and the pose after command `k`.
    pub(crate) fn row(&self, k: usize) -> Vec<f64> {
        let mut row = self.expected[k * self.outputs..][..self.outputs].to_vec();
        row.extend(self.poses.get(k).into_iter().flatten());
        row
    }
}

/// Largest difference, relative to the larger of 1 and the value.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, |most, x| {
        // A NaN is kept.
        if x <= most { most } else { x }
    })
}

/// A library of this build.
pub(crate) fn library() -> PathBuf {
    hydroid_export::fmu::find_library().expect("cargo builds the library beside the tests")
}

/// Writes the FMUs of all kinds of models with their expected rollouts into the folder `HYDROID_FMU_FOLDER`.
#[test]
#[ignore = "writes the FMUs for tests/export/fmu; .ci/run runs it"]
fn write_fmus() {
    let Some(folder) = std::env::var_os("HYDROID_FMU_FOLDER") else {
        eprintln!("skipped: no HYDROID_FMU_FOLDER");
        return;
    };
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder).unwrap();
    let mut hostile = models::model(Body::Equations(models::equations(Vec::new())));
    hostile.description.inputs[0].channel.name = String::from("\"/><Float64 name='x'>&lt;%s%n\u{1}]]>");
    hostile.description.inputs[1].channel.name = String::from("time");
    hostile.description.outputs[1].channel.unit = String::from("<&\"'\u{7}\n%s");
    let mut all = models::all();
    all.push((String::from("hostile"), hostile));
    for (name, model) in all {
        write(&folder, &name, &model);
    }
}

fn write(folder: &Path, name: &str, model: &Model) {
    for (version, end) in [(Version::V2, "2"), (Version::V3, "3")] {
        let options = Options { name: format!("{name}_fmi{end}") };
        let fmu = FmuOptions { version, libraries: vec![library()] };
        for file in export(model, &options, &fmu).unwrap() {
            std::fs::write(folder.join(file.name), file.content).unwrap();
        }
    }
    let golden = Golden::of(model);
    let variables = Variables::of(model);
    let names = |prefix: &dyn Fn(&Role) -> bool| -> Vec<&str> {
        let all = variables.all().iter();
        all.filter(|variable| prefix(&variable.role)).map(|variable| variable.name.as_str()).collect()
    };
    let rows: Vec<Vec<f64>> = (0..SAMPLES).map(|k| golden.row(k)).collect();
    let commands: Vec<&[f64]> = (0..SAMPLES).map(|k| golden.command(k)).collect();
    let parameters: Vec<(&str, f64)> = names(&|role| matches!(role, Role::StartOutput(_)))
        .into_iter()
        .zip(golden.start_outputs.iter().copied())
        .chain(
            names(&|role| matches!(role, Role::StartInput(_)))
                .into_iter()
                .zip(golden.start_inputs.iter().copied()),
        )
        .chain(names(&|role| matches!(role, Role::StartPose(_))).into_iter().zip(golden.start_pose))
        .chain(names(&|role| matches!(role, Role::Current(_))).into_iter().zip(golden.current))
        .collect();
    let parameters: serde_json::Map<String, serde_json::Value> =
        parameters.into_iter().map(|(name, value)| (name.to_owned(), json!(value))).collect();
    let manifest = json!({
        "dt": model.description.dt,
        "inputs": names(&|role| matches!(role, Role::Input(_))),
        "outputs": names(&|role| matches!(role, Role::Output(_) | Role::Pose(_))),
        "parameters": parameters,
        "commands": commands,
        "expected": rows,
        "model_exchange": variables.continuous().is_ok(),
    });
    std::fs::write(folder.join(format!("{name}.json")), manifest.to_string()).unwrap();
}
