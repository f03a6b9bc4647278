//! Public sets of runs of real and simulated vessels.

use std::path::{Path, PathBuf};

use hydroid::identify::{Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions};
use hydroid::log::{self, LogError, PrepareOptions, Selection, Split, Trajectory, split_named};
use hydroid::model::Reading;

/// Runs of a vessel.
pub struct Set {
    pub name: &'static str,
    pub folder: &'static str,
    pub runs: &'static [&'static str],
    outputs: &'static str,
    inputs: &'static str,
    wind: bool,
    pub horizon_s: f64,
}

const ESSO: Set = Set {
    name: "esso-random",
    folder: "esso-osaka",
    runs: &[
        "random_03-Aug-2020_11_04_37",
        "random_06-Aug-2020_16_24_25_1",
        "random_06-Aug-2020_16_24_25_4",
        "random_06-Aug-2020_16_24_25_6",
        "random_31-Jul-2020_12_29_58",
        "random_31-Jul-2020_14_52_18",
    ],
    outputs: "u=u_velo,v=vm_velo,r=r_angvelo",
    inputs: "n=n_prop,delta=delta_rudder",
    wind: false,
    horizon_s: 30.0,
};

const FLEET: Set = Set {
    name: "",
    folder: "",
    runs: &["run1", "run2", "run3", "run4", "run5", "run6"],
    outputs: "u,v,r",
    inputs: "",
    wind: false,
    horizon_s: 30.0,
};

pub const SETS: [Set; 9] = [
    Set {
        name: "cybership",
        folder: "cybership-enterprise1",
        runs: &["random_run1", "run1", "random_run3", "dptest1"],
        outputs: "u=u_mps,v=v_mps,r=r_radps",
        inputs: "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster",
        wind: false,
        horizon_s: 5.0,
    },
    Set { name: "esso-random-wind", wind: true, ..ESSO },
    ESSO,
    Set {
        name: "esso-zigzag-wind",
        runs: &[
            "zigzag_31-Jul-2020_13_22_52",
            "zigzag_31-Jul-2020_13_29_19",
            "zigzag_31-Jul-2020_13_50_28",
            "zigzag_31-Jul-2020_14_03_39",
        ],
        wind: true,
        horizon_s: 20.0,
        ..ESSO
    },
    Set { name: "otter", folder: "fleet/otter/rates", inputs: "n_left,n_right", horizon_s: 20.0, ..FLEET },
    Set { name: "tanker", folder: "fleet/tanker/rates", inputs: "rpm,rudder", horizon_s: 60.0, ..FLEET },
    Set { name: "clarke83", folder: "fleet/clarke83/rates", inputs: "thrust,delta", ..FLEET },
    Set { name: "zefakkel", folder: "fleet/zefakkel/rates", inputs: "speed_order,rudder", ..FLEET },
    Set {
        name: "transit",
        folder: "fleet/transit/rates",
        inputs: "throttle,delta_cmd",
        horizon_s: 60.0,
        ..FLEET
    },
];

impl Set {
    /// The runs, by the file that each comes from.
    pub fn read(&self, data: &Path) -> anyhow::Result<(Vec<Vec<Trajectory>>, Reading)> {
        let files: Vec<PathBuf> =
            self.runs.iter().map(|run| data.join(self.folder).join(run).with_extension("csv")).collect();
        let raw = files.iter().map(log::read).collect::<Result<Vec<_>, _>>()?;
        let wind = self.wind.then(|| "wind_velo_relative_mid,wind_dir_relative_mid".parse());
        let selection = Selection { wind: wind.transpose()?, ..Selection::of(self.outputs, self.inputs)? };
        let options = PrepareOptions::default();
        let prepared = log::prepare(&raw, &selection, &options)?;
        let mut runs = vec![Vec::new(); files.len()];
        for (run, source) in prepared.runs.into_iter().zip(prepared.sources) {
            runs[source].push(run);
        }
        Ok((runs, Reading { selection: prepared.selection, options }))
    }

    /// The horizon \[samples\].
    pub fn horizon(&self, dt: f64) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small positive number"
        )]
        let horizon = (self.horizon_s / dt).round() as usize;
        horizon
    }

    /// The identification from all runs but one, which is the test run.
    pub fn job(
        &self,
        runs: &[Vec<Trajectory>],
        reading: &Reading,
        left_out: usize,
        methods: &[Method],
        motion: MotionOption,
        budget_s: Option<f64>,
    ) -> anyhow::Result<Job> {
        let others = runs.iter().enumerate().filter(|(index, _)| *index != left_out);
        let train: Vec<Trajectory> = others.flat_map(|(_, parts)| parts.iter().cloned()).collect();
        let dt = train.first().map_or(1.0, |run| run.dt);
        Ok(Job {
            methods: methods.to_vec(),
            split: split(train, &runs[left_out], methods)?,
            reading: reading.clone(),
            boat: hydroid::boat::Boat::default(),
            horizon: self.horizon(dt),
            origin_stride: 5,
            seed: 0,
            ranges: std::collections::BTreeMap::default(),
            motion,
            rate_limits: RateLimitOption::default(),
            allow_feedback: Vec::new(),
            sindy: SindyOptions::default(),
            networks: NetworkTrainingOptions { budget_s, ..NetworkTrainingOptions::default() },
            vessel: None,
        })
    }
}

/// Methods by their names, separated by commas.
pub fn methods(list: &str) -> anyhow::Result<Vec<Method>> {
    let method = |name: &str| Ok(serde_json::from_value(serde_json::Value::from(name))?);
    list.split(',').map(method).collect()
}

/// All runs but the test runs are cross-validated, or split where a method needs validation runs.
fn split(train: Vec<Trajectory>, test: &[Trajectory], methods: &[Method]) -> Result<Split, LogError> {
    if methods.iter().all(|method| method.is_cross_validated()) {
        return Ok(Split { train, validation: Vec::new(), test: test.to_vec(), notes: Vec::new() });
    }
    split_named(train, Vec::new(), test.to_vec())
}
