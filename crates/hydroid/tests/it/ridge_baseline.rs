//! Baseline of the identified equations: ridge regression of the increment over a coarse step with a fixed list of
//! terms, on the splits of the real ships.
//!
//! `y_{k+s} - y_k = step * Xi theta(y_k, c)`, simulated with the coarse step (0.5 s for the tug, 1 s for the tanker).
//! `theta` is `{1, u, v, r, u|u|, v|v|, r|r|, uv, ur, vr, commands, commands |commands|}`; the command is that at the
//! start of the step or its mean over the step. Columns have unit RMS, and the penalty is `lambda` per row. Every
//! sample of a test run is an origin, as for the equations.

// A program of research/ includes this file.
#![allow(unreachable_pub, missing_docs)]

use std::path::{Path, PathBuf};

use hydroid::evaluate::{Evaluation, Options, evaluate};
use hydroid::identify::output_ranges;
use hydroid::log::{self, PrepareOptions, Selection, Table, Trajectory};
use hydroid::progress::silent;
use hydroid::sindy::{BLOCK_ROWS, QrFactor};
use hydroid_core::model::sparse::Term;
use hydroid_core::predict::{Predictor, Workspace, plain, rollout_steps};

/// Logs of a ship by use, and their preparation.
pub struct Ship {
    pub name: &'static str,
    pub folder: &'static str,
    pub train: &'static [&'static str],
    pub validate: &'static [&'static str],
    pub test: &'static [&'static str],
    pub outputs: &'static str,
    pub inputs: &'static str,
    pub wind: Option<&'static str>,
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// Coarse step of the baseline \[samples\].
    pub stride: usize,
    /// Whether towed ends of logs are kept.
    pub keep_towed: bool,
}

pub const CYBERSHIP: Ship = Ship {
    name: "CyberShip Enterprise I",
    folder: "cybership-enterprise1",
    train: &["random_run1.csv"],
    validate: &["run1.csv"],
    test: &["random_run3.csv"],
    outputs: "u=u_mps,v=v_mps,r=r_radps",
    inputs: "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster",
    wind: None,
    horizon: 100,
    stride: 10,
    keep_towed: false,
};

pub const ESSO: Ship = Ship {
    name: "Esso Osaka, random runs",
    folder: "esso-osaka",
    train: &[
        "random_03-Aug-2020_11_04_37.csv",
        "random_06-Aug-2020_16_24_25_1.csv",
        "random_06-Aug-2020_16_24_25_4.csv",
        "random_31-Jul-2020_12_29_58.csv",
    ],
    validate: &["random_06-Aug-2020_16_24_25_6.csv"],
    test: &["random_31-Jul-2020_14_52_18.csv"],
    outputs: "u=u_velo,v=vm_velo,r=r_angvelo",
    inputs: "n=n_prop,delta=delta_rudder",
    wind: Some("wind_velo_relative_mid,wind_dir_relative_mid"),
    horizon: 300,
    stride: 10,
    keep_towed: false,
};

impl Ship {
    pub fn runs(&self, data: &Path) -> [Vec<Trajectory>; 3] {
        let files: Vec<PathBuf> = [self.train, self.validate, self.test]
            .iter()
            .flat_map(|part| part.iter().map(|file| data.join(self.folder).join(file)))
            .collect();
        let raw: Vec<_> = files.iter().map(|file| log::read(file).unwrap()).collect();
        let selection = Selection {
            wind: self.wind.map(|wind| wind.parse().unwrap()),
            ..Selection::of(self.outputs, self.inputs).unwrap()
        };
        let options = PrepareOptions { keep_towed: self.keep_towed, ..PrepareOptions::default() };
        let prepared = log::prepare(&raw, &selection, &options).unwrap();
        let mut parts = [Vec::new(), Vec::new(), Vec::new()];
        for (run, source) in prepared.runs.into_iter().zip(prepared.sources) {
            let part = usize::from(source >= self.train.len())
                + usize::from(source >= self.train.len() + self.validate.len());
            parts[part].push(run);
        }
        parts
    }
}

/// The command of a coarse step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    Start,
    Mean,
}

/// The run at every `stride`-th sample, once from each of the first `stride` samples, so that all origins are kept.
pub fn coarse(run: &Trajectory, stride: usize, held: Held) -> Vec<Trajectory> {
    (0..stride)
        .map(|phase| {
            let at: Vec<usize> = (phase..run.len().saturating_sub(stride)).step_by(stride).collect();
            let outputs = at.iter().flat_map(|&k| run.outputs.row(k)).copied().collect();
            let inputs = at
                .iter()
                .flat_map(|&k| {
                    let mean =
                        |c: usize| (k..k + stride).map(|j| run.inputs.row(j)[c]).sum::<f64>() / stride as f64;
                    (0..run.inputs.width())
                        .map(|c| if held == Held::Start { run.inputs.row(k)[c] } else { mean(c) })
                        .collect::<Vec<_>>()
                })
                .collect();
            Trajectory {
                name: run.name.clone(),
                t0: run.t0 + phase as f64 * run.dt,
                dt: stride as f64 * run.dt,
                outputs: Table::new(run.outputs.channels().to_vec(), outputs),
                inputs: Table::new(run.inputs.channels().to_vec(), inputs),
                truth: None,
                heading: None,
                position: None,
            }
        })
        .collect()
}

/// The fixed list of terms.
pub fn terms(outputs: u16, inputs: u16) -> Vec<Term> {
    let mut terms = vec![Term::constant()];
    terms.extend((0..outputs + inputs).map(|v| Term::monomial(&[v])));
    terms.extend((0..outputs + inputs).map(|v| Term::signed_square(v, v)));
    for a in 0..outputs {
        terms.extend((a + 1..outputs).map(|b| Term::monomial(&[a, b])));
    }
    terms
}

/// `y+ = y + step * Xi theta(y, c)`.
#[derive(Clone)]
pub struct Ridge {
    terms: Vec<Term>,
    /// `outputs x terms`.
    coefficients: Vec<f64>,
    step: f64,
    inputs: usize,
    state: Vec<f64>,
}

impl Ridge {
    pub fn fit(runs: &[Trajectory], lambda: f64) -> Self {
        let (n, m) = (runs[0].outputs.width(), runs[0].inputs.width());
        let terms = terms(u16::try_from(n).unwrap(), u16::try_from(m).unwrap());
        let width = terms.len() + n;
        let mut triangle = QrFactor::new(width);
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for run in runs {
            for k in 0..run.len() - 1 {
                let (y, next) = (run.outputs.row(k), run.outputs.row(k + 1));
                let x: Vec<f64> = y.iter().chain(run.inputs.row(k)).copied().collect();
                let rate = next.iter().zip(y).map(|(b, a)| (b - a) / run.dt);
                let row: Vec<f64> = terms.iter().map(|t| t.value(&x)).chain(rate).collect();
                if row.iter().all(|v| v.is_finite()) {
                    rows.push(row);
                }
            }
        }
        for rows in rows.chunks(BLOCK_ROWS) {
            let mut block = vec![0.0; width * BLOCK_ROWS];
            for (i, row) in rows.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    block[j * BLOCK_ROWS + i] = *value;
                }
            }
            triangle.append_rows(&mut block, rows.len());
        }
        // The norm of a column is its RMS times the root of the number of rows: lambda per row for a column of unit
        // RMS.
        let weights: Vec<f64> = (0..width)
            .map(|j| if j < terms.len() { lambda.sqrt() * triangle.column_norm(j) } else { 0.0 })
            .collect();
        let ridged = triangle.with_ridge(&weights);
        let all: Vec<usize> = (0..terms.len()).collect();
        let coefficients = (0..n).flat_map(|i| ridged.solve(&all, terms.len() + i).coefficients).collect();
        Self { terms, coefficients, step: runs[0].dt, inputs: m, state: vec![f64::NAN; n] }
    }

    fn step(&self, state: &mut [f64], c: &[f64]) {
        let x: Vec<f64> = state.iter().chain(c).copied().collect();
        let theta: Vec<f64> = self.terms.iter().map(|t| t.value(&x)).collect();
        for (y, row) in state.iter_mut().zip(self.coefficients.chunks_exact(theta.len())) {
            *y += self.step * row.iter().zip(&theta).map(|(a, b)| a * b).sum::<f64>();
        }
    }
}

impl Predictor for Ridge {
    plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        self.state.len()
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn reset(&mut self) {
        self.state.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        for (state, y) in self.state.iter_mut().zip(y).filter(|(_, y)| !y.is_nan()) {
            *state = *y;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        let mut state = self.state.clone();
        self.step(&mut state, c);
        self.state = state;
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.state);
    }

    fn rollout(&self, commands: &[f64], _work: &mut Workspace, y: &mut [f64]) {
        let n = self.state.len();
        let mut state = self.state.clone();
        for k in 0..rollout_steps(commands, self.inputs, y, n) {
            self.step(&mut state, &commands[k * self.inputs..(k + 1) * self.inputs]);
            y[k * n..(k + 1) * n].copy_from_slice(&state);
        }
    }

    fn snapshot_len(&self) -> usize {
        self.state.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.state);
    }

    fn restore(&mut self, from: &[f64]) {
        self.state.copy_from_slice(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

/// One row of the table: settings, validation score, and test errors.
pub struct Row {
    pub held: Held,
    pub lambda: f64,
    pub validation: f64,
    pub test: Evaluation,
}

pub fn baseline(ship: &Ship, data: &Path) -> Vec<Row> {
    let parts = ship.runs(data);
    let mut rows = Vec::new();
    for held in [Held::Start, Held::Mean] {
        let [train, validation, test] = parts.each_ref().map(|runs| {
            runs.iter().flat_map(|run| coarse(run, ship.stride, held)).collect::<Vec<Trajectory>>()
        });
        let ranges = output_ranges(&train.iter().collect::<Vec<_>>());
        let options = Options { horizon: ship.horizon / ship.stride, ..Options::default() };
        for lambda in [1e-6, 1e-4, 1e-2, 0.1, 0.3, 1.0] {
            let model = Ridge::fit(&train, lambda);
            let judge = |runs: &[Trajectory]| {
                let runs: Vec<&Trajectory> = runs.iter().collect();
                evaluate("ridge", &mut model.clone(), &ranges, &runs, &options, &mut silent()).unwrap()
            };
            rows.push(Row { held, lambda, validation: judge(&validation).score(), test: judge(&test) });
        }
    }
    rows
}

/// The row with the best validation score.
pub fn chosen(rows: &[Row]) -> &Row {
    rows.iter().min_by(|a, b| a.validation.total_cmp(&b.validation)).unwrap()
}

/// NRMSE of each output at the last horizon, and their mean.
pub fn last(evaluation: &Evaluation) -> (Vec<f64>, f64) {
    let nrmse = evaluation.nrmse.last().unwrap().clone();
    let mean = nrmse.iter().sum::<f64>() / nrmse.len() as f64;
    (nrmse, mean)
}
