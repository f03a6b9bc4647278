//! Table 1: all methods, measured.

use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use hydroid_core::adapt::kalman::KalmanNetwork;
use hydroid_core::predict::Workspace;

use super::super::StudyError;
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::runner::{Learned, LoadedRecord, Runner};
use super::adaptation::{adaptation, options};
use super::{OUTPUTS, median, range};
use hydroid::adapt::{self, KalmanOptions};
use hydroid::evaluate::{self, Against, evaluate};
use hydroid::model::Body;
use hydroid_report::figure::{Figure, Mark, Panel, Points, Sign};

/// Comparison of all methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The methods, in the order of the table.
    pub methods: Vec<MethodRow>,
}

/// A method: its models, and a description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodRow {
    pub name: String,
    /// Model of the simple vessel.
    pub simple: Option<String>,
    /// Model of the hydrofoil in both modes.
    pub hydrofoil: Option<String>,
    /// Model of the hydrofoil at a sample time of 10 ms.
    pub fast: Option<String>,
    /// Model that is adapted online.
    pub learns: Option<String>,
    /// Record of the adaptation.
    pub sea: Option<String>,
    /// Required prior knowledge.
    pub knows: String,
    /// Statement of the thesis.
    pub thesis: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Judged {
    /// Mean absolute error 20 steps ahead, from measured origins, against the truth.
    pub(super) at_20: Vec<f64>,
    diverged: usize,
    /// Median time of a rollout of 20 steps \[us\].
    rollout_us: f64,
}

/// Adapter: stored numbers, time per sample \[us\], and error of u 20 steps ahead relative to the frozen one.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Learning {
    memory: usize,
    us: f64,
    left: f64,
}

impl Comparison {
    pub(super) fn uses(&self) -> (Vec<&String>, Vec<&String>) {
        let records = self.methods.iter().filter_map(|m| m.sea.as_ref()).collect();
        let models = self.methods.iter().flat_map(|m| [&m.simple, &m.hydrofoil, &m.fast, &m.learns]);
        (records, models.flatten().collect())
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let mut outcome = Outcome::default();
        let mut panel = Panel::new("error of u after 20 steps, hydrofoil [m/s]").height(340.0).decades();
        let mut rows = Vec::new();
        for method in &self.methods {
            let row = Row::new(method, runner)?;
            row.tell(runner, &mut outcome)?;
            if let (Some(found), Some(name)) = (&row.hydrofoil, &method.hydrofoil) {
                panel = panel.mark(Mark::Points(Points {
                    points: vec![(found.seconds.max(1e-3).log10(), found.judged.at_20[0].log10())],
                    sign: Sign::Disc,
                    colour: palette::colour(name),
                    radius: 5.0,
                    label: Some(method.name.clone()),
                }));
            }
            rows.push(row);
        }
        exponents(&self.methods, runner, &mut outcome)?;
        outcome.chart(
            "accuracy_time",
            Figure::new("Accuracy against training time", "training [s]").x_decades().panel(panel),
            "All methods on the hydrofoil in both modes: mean absolute error of u, 2 s ahead, against training time on this machine; medians over seeds. Lower left is better. The table contains v and r.",
        );
        outcome.table(
            errors(&rows),
            "Table 1, measured. Errors are mean absolute errors 20 steps ahead, from measured origins, against the truth of the test record. 20 steps are 2 s, or 0.2 s at a sample time of 10 ms. Training time, peak memory and the time of a prediction of 20 steps are those of the model of the hydrofoil, if there is one. Peak memory is that of the whole process, including records. Times and memory were measured on this machine.",
        );
        outcome.table(
            learning_and_words(&rows),
            "Online adaptation: the model was trained at low speed and is adapted along a record with flight. Memory is the complete state of the adapter. The error ratio is the adapted error of u divided by the frozen one, 20 steps ahead; v and r are not compared here. The last columns are the required prior knowledge and the statement of the thesis.",
        );
        Ok(outcome)
    }
}

struct Row<'a> {
    method: &'a MethodRow,
    simple: Option<Found>,
    hydrofoil: Option<Found>,
    fast: Option<Found>,
    learning: Option<Learning>,
}

impl<'a> Row<'a> {
    fn new(method: &'a MethodRow, runner: &Runner<'_>) -> Result<Self, StudyError> {
        let of = |name: &Option<String>| -> Result<Option<Found>, StudyError> {
            let Some(name) = name else { return Ok(None) };
            let models = runner.models(name)?;
            let judged: Vec<Judged> =
                models.iter().map(|learned| judged(runner, name, learned)).collect::<Result<_, _>>()?;
            Ok(Some(middle(&models, &judged)))
        };
        let learning = match (&method.learns, &method.sea) {
            (Some(name), Some(sea)) => Some(learning(runner, name, &*runner.record(sea)?)?),
            _ => None,
        };
        let (simple, hydrofoil, fast) = (of(&method.simple)?, of(&method.hydrofoil)?, of(&method.fast)?);
        Ok(Self { method, simple, hydrofoil, fast, learning })
    }

    fn shown(&self) -> Option<&Found> {
        self.hydrofoil.as_ref().or(self.simple.as_ref())
    }

    fn tell(&self, runner: &Runner<'_>, outcome: &mut Outcome) -> Result<(), StudyError> {
        let Self { method, simple, hydrofoil, fast, learning } = self;
        let seeds = |name: &str| runner.models(name).map(|models| models.len());
        if let (Some(found), Some(name)) = (hydrofoil, &method.hydrofoil) {
            outcome.basis(seeds(name)?, &[] as &[&str]);
            outcome.measure(&format!("{name}_training_s"), found.seconds);
        }
        for (name, found) in [(&method.simple, simple), (&method.hydrofoil, hydrofoil), (&method.fast, fast)]
        {
            let (Some(name), Some(Found { judged, .. })) = (name, found) else { continue };
            let tests: Vec<&String> =
                runner.plan().models.get(name).map(|plan| &plan.test).into_iter().collect();
            outcome.basis(seeds(name)?, &tests);
            for (c, (output, _)) in OUTPUTS.iter().enumerate() {
                outcome.measure(&format!("{name}_{output}_20"), judged.at_20[c]);
            }
            if judged.diverged > 0 {
                outcome.remarks.push(format!(
                    "{name}: {} rollouts diverged and are excluded from all means.",
                    judged.diverged
                ));
            }
        }
        if let (Some(name), Some(learning)) = (&method.learns, learning) {
            outcome.basis(seeds(name)?, &method.sea.iter().collect::<Vec<_>>());
            outcome.measure(&format!("{name}_learning_us"), learning.us);
            outcome.measure(&format!("{name}_learning_left"), learning.left);
        }
        Ok(())
    }
}

/// Exponents of the number of weights in the size of the full covariance of the Kalman filter, from each pair of
/// recurrent networks with different numbers of weights. The size depends on the form of the network alone.
fn exponents(methods: &[MethodRow], runner: &Runner<'_>, outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut sizes: Vec<(String, f64, f64)> = Vec::new();
    for method in methods {
        let Some(name) = &method.learns else { continue };
        let Some(learned) = runner.models(name)?.first().map(covariance_len).transpose()?.flatten() else {
            continue;
        };
        let (weights, numbers) = learned;
        sizes.push((format!("{} {weights}", method.name), weights as f64, numbers as f64));
    }
    let pairs = sizes.iter().enumerate().flat_map(|(i, a)| sizes[..i].iter().map(move |b| (a, b)));
    let exponents: Vec<f64> = pairs
        .filter(|(a, b)| a.1 != b.1)
        .map(|((_, weights_a, numbers_a), (_, weights_b, numbers_b))| {
            (numbers_a / numbers_b).ln() / (weights_a / weights_b).ln()
        })
        .collect();
    if exponents.is_empty() {
        return Ok(());
    }
    let (least, largest) = range(&exponents);
    outcome.basis =
        format!("{} pairs of networks; the size does not depend on seeds and records", exponents.len());
    outcome.measure("covariance_exponent_least", least);
    outcome.measure("covariance_exponent_largest", largest);
    let weights = sizes.iter().map(|(words, ..)| words.as_str()).collect::<Vec<_>>().join(", ");
    outcome.words.insert("covariance_weights".to_owned(), weights);
    Ok(())
}

/// Number of weights of a recurrent network, and of the numbers of the full covariance of its filter.
fn covariance_len(learned: &Learned) -> Result<Option<(usize, usize)>, StudyError> {
    let Body::Recurrent(network) = &learned.model.body else { return Ok(None) };
    // The size does not depend on the noise.
    let noise = Some(vec![1.0; learned.model.description.outputs.len()]);
    let options = KalmanOptions { noise, ..KalmanOptions::default() };
    let options = adapt::network_filter_options(&learned.model, network, &options)?;
    let adapter = KalmanNetwork::with_rehearsal(Arc::clone(network), options, None)
        .map_err(|error| StudyError::Result(error.to_string()))?;
    Ok(Some((network.weights.len(), adapter.filter().covariance_len())))
}

fn number(x: Option<f64>) -> Cell {
    x.map_or(Cell::Nothing, Cell::Number)
}

fn errors(rows: &[Row<'_>]) -> Sheet {
    let mut table = Sheet::new(
        "table1",
        &[
            "method",
            "training [s]",
            "peak memory [MB]",
            "20 steps [us]",
            "simple: u [m/s]",
            "v [m/s]",
            "r [rad/s]",
            "hydrofoil: u [m/s]",
            "v [m/s]",
            "r [rad/s]",
            "hydrofoil at 10 ms: u [m/s]",
        ],
    );
    for row in rows {
        let shown = row.shown();
        let mut cells = vec![
            row.method.name.as_str().into(),
            number(shown.map(|found| found.seconds)),
            number(shown.and_then(|found| found.peak_mb)),
            number(shown.map(|found| found.judged.rollout_us)),
        ];
        for found in [&row.simple, &row.hydrofoil] {
            cells.extend((0..3).map(|c| number(found.as_ref().map(|found| found.judged.at_20[c]))));
        }
        cells.push(number(row.fast.as_ref().map(|found| found.judged.at_20[0])));
        table.row(cells);
    }
    table
}

fn learning_and_words(rows: &[Row<'_>]) -> Sheet {
    let mut table = Sheet::new(
        "table1_learning",
        &[
            "method",
            "weights",
            "adaptation: time per sample [us]",
            "memory [kB]",
            "error ratio of u",
            "prior knowledge",
            "statement of the thesis",
        ],
    );
    for row in rows {
        let learning = row.learning.as_ref();
        table.row(vec![
            row.method.name.as_str().into(),
            row.shown().map_or(Cell::Nothing, |found| Cell::Count(found.weights)),
            number(learning.map(|l| l.us)),
            number(learning.map(|l| l.memory as f64 * 8.0 / 1e3)),
            number(learning.map(|l| l.left)),
            row.method.knows.as_str().into(),
            row.method.thesis.as_str().into(),
        ]);
    }
    table
}

/// The models of a method for a vessel: medians over seeds.
struct Found {
    seconds: f64,
    peak_mb: Option<f64>,
    weights: usize,
    judged: Judged,
}

fn middle(models: &[Learned], judged: &[Judged]) -> Found {
    let of = |value: &dyn Fn(&Judged) -> f64| median(judged.iter().map(value).collect());
    let peaks: Vec<f64> = models.iter().filter_map(|learned| learned.about.peak_mb).collect();
    Found {
        seconds: median(models.iter().map(|learned| learned.about.seconds).collect()),
        peak_mb: (!peaks.is_empty()).then(|| median(peaks)),
        weights: models.first().map_or(0, |learned| learned.model.weights()),
        judged: Judged {
            at_20: (0..3).map(|c| of(&|j| j.at_20[c])).collect(),
            diverged: judged.iter().map(|j| j.diverged).sum(),
            rollout_us: of(&|j| j.rollout_us),
        },
    }
}

pub(super) fn judged(runner: &Runner<'_>, name: &str, learned: &Learned) -> Result<Judged, StudyError> {
    let plan = runner.plan().models.get(name).ok_or_else(|| StudyError::missing("model", name))?;
    let test = runner.record(&plan.test)?;
    let key = runner.store.key("judged", &(), &[learned.key, test.key]);
    runner.store.get("judged", key, || {
        let names: Vec<&str> = plan.outputs.iter().map(String::as_str).collect();
        if names != ["u", "v", "r"] {
            return Err(runner.cannot(format_args!("'{name}' has outputs other than u, v, r")));
        }
        let run = test.simulated.to_trajectory(&names)?;
        let options = evaluate::Options {
            horizon: 20,
            origin_stride: 20,
            against: Against::Truth,
            warm_up: 100,
            ..evaluate::Options::default()
        };
        let mut session = learned.model.session();
        let ranges = learned.model.output_ranges();
        let what = format!("evaluating {name}");
        let found =
            evaluate(name, session.as_mut(), &ranges, &[&run], &options, &mut runner.progress(&what))?;
        let (mut work, mut y) = (Workspace::new(), vec![0.0; 20 * names.len()]);
        session.reset();
        let mut times = Vec::new();
        for k in 0..run.len().min(600).saturating_sub(20) {
            session.observe(run.outputs.row(k));
            if k >= 200 {
                let clock = Instant::now();
                session.rollout(run.inputs.rows(k, k + 20), &mut work, &mut y);
                times.push(1e6 * clock.elapsed().as_secs_f64());
            }
            session.advance(run.inputs.row(k));
        }
        let rollout_us = if times.is_empty() { 0.0 } else { median(times) };
        Ok(Judged { at_20: found.mae[19].clone(), diverged: found.diverged, rollout_us })
    })
}

/// An adapted model along a record: medians over seeds.
fn learning(runner: &Runner<'_>, name: &str, sea: &LoadedRecord) -> Result<Learning, StudyError> {
    let mut all = Vec::new();
    for learned in runner.models(name)?.iter() {
        let along = adaptation(runner, learned, sea, false)?;
        let key = runner.store.key("learning", &(), &[learned.key, sea.key]);
        all.push(runner.store.get("learning", key, || {
            // Sequentially, because the result includes a time.
            let mut options = options(false, learned);
            options.evaluate.origin_stride = 500;
            let memory = adapt::adapter(&learned.model, &options, &[&sea.run])?.0.memory_len();
            let timed = adapt::adapt(&learned.model, &[&sea.run], &options, &mut runner.progress("timing"))?;
            let left = along.adapted.mean[19][0] / along.frozen.mean[19][0];
            Ok(Learning { memory, us: timed.report.us_per_sample.median, left })
        })?);
    }
    let of = |value: &dyn Fn(&Learning) -> f64| median(all.iter().map(value).collect());
    let memory = all.first().map_or(0, |learning| learning.memory);
    Ok(Learning { memory, us: of(&|l| l.us), left: of(&|l| l.left) })
}
