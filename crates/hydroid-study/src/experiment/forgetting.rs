//! Forgetting of a network during adaptation, and several epochs over one record.

use serde::{Deserialize, Serialize};

use hydroid_core::adapt::Adapter;
use hydroid_core::predict::Workspace;

use super::super::StudyError;
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::runner::{Learned, LoadedRecord, Runner};
use super::{OUTPUTS, median, range};
use hydroid::adapt::{self, KalmanOptions, Options};
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel};

/// Horizon \[samples\].
const STEPS: usize = 20;
/// Error of a filter that has diverged beyond it, or to numbers that are not finite.
const DIVERGED: f64 = 1e6;

/// Epochs along a record, then evaluation under the training conditions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Forgetting {
    pub models: Vec<String>,
    /// The records of the adaptation, each from the weights of the training.
    pub seas: Vec<String>,
    /// A record under the training conditions.
    pub known: String,
    /// A training record, the beginning of which the guarded sessions rehearse.
    pub shore: String,
    /// Duration of the rehearsal \[s\].
    pub shore_s: f64,
    pub epochs: usize,
}

/// Result of a network, unguarded and guarded: error during adaptation in each epoch, and errors under training
/// conditions before and after, with the final weights frozen and with continued adaptation. `last` are the errors of
/// the final weights, frozen, along the record of the adaptation, without guard.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Story {
    epochs: [Vec<[f64; 3]>; 2],
    before: [f64; 3],
    held: [[f64; 3]; 2],
    on: [[f64; 3]; 2],
    last: [f64; 3],
}

impl Forgetting {
    pub(super) fn uses(&self) -> (Vec<&String>, Vec<&String>) {
        (self.seas.iter().chain([&self.known, &self.shore]).collect(), self.models.iter().collect())
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let seas = runner.records(&self.seas)?;
        let [known, shore] = [runner.record(&self.known)?, runner.record(&self.shore)?];
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            "forgetting",
            &[
                "network",
                "",
                "adaptation, epoch 1: u",
                "epoch 2",
                "last epoch",
                "training conditions, before: u",
                "after, weights frozen",
                "after, adapting",
            ],
        );
        let mut panel = Panel::new("error of u during adaptation, 20 steps [m/s]").height(200.0).decades();
        let mut figure = Figure::new("Epochs over one record", "epoch").x_range(1.0, self.epochs as f64);
        let mut ratios = Ratios::default();
        for name in &self.models {
            let models = runner.models(name)?;
            outcome.basis(models.len(), &self.seas);
            let pairs: Vec<(&Learned, &LoadedRecord)> =
                models.iter().flat_map(|model| seas.iter().map(move |sea| (model, &**sea))).collect();
            let what = format!("{name} over {} epochs", self.epochs);
            let stories = runner.each(&what, &pairs, |&(learned, sea)| {
                let settings = (self.shore_s, self.epochs);
                let on = [learned.key, sea.key, known.key, shore.key];
                let key = runner.store.key("forgetting", &settings, &on);
                runner.store.get("forgetting", key, || self.story(runner, learned, sea, &known, &shore))
            })?;
            ratios.add(&stories);
            let middle = |of: &dyn Fn(&Story) -> f64| median(stories.iter().map(of).collect());
            for (way, word) in ["without guard", "guarded, after rehearsal"].into_iter().enumerate() {
                let curve: Vec<f64> = (0..self.epochs).map(|e| middle(&|s| s.epochs[way][e][0])).collect();
                let before = middle(&|s| s.before[0]);
                let (after, on) = (middle(&|s| s.held[way][0]), middle(&|s| s.on[way][0]));
                table.row(vec![
                    palette::title(name).into(),
                    word.into(),
                    curve[0].into(),
                    curve[1.min(self.epochs - 1)].into(),
                    curve[self.epochs - 1].into(),
                    before.into(),
                    after.into(),
                    Cell::Number(on),
                ]);
                if way == 1 {
                    outcome.measure(&format!("{name}_guarded_on_over_before"), on / before);
                }
                let mut stroke = palette::line(name);
                if way == 1 {
                    stroke.dash = hydroid_report::figure::Dash::Dashed;
                }
                let points = curve.iter().enumerate().map(|(e, x)| (e as f64 + 1.0, x.log10())).collect();
                panel = panel.mark(Mark::Line(Line::new(points, stroke)));
                figure = figure.key(Key::Line(stroke), format!("{}, {word}", palette::title(name)));
            }
        }
        ratios.measures(&mut outcome);
        outcome.chart(
            "forgetting",
            figure.panel(panel),
            format!(
                "Mean absolute error of u, 20 steps ahead, in each of {} epochs over {}; medians over seeds and records. The thesis reports that the filter diverges over several epochs.",
                self.epochs, self.seas.join(", ")
            ),
        );
        outcome.table(
            table,
            format!(
                "Training conditions: along {}, a record at low speed. “Weights frozen”: the weights that predict after the last epoch are frozen, and only the state is filtered. “Adapting”: the session continues to adapt. Guarded: the session first rehearses {} s of a training record, and the guard selects the model that predicts. All errors of this table are those of u; the claims below judge v and r as well.",
                self.known, self.shore_s
            ),
        );
        Ok(outcome)
    }

    fn story(
        &self,
        runner: &Runner<'_>,
        learned: &Learned,
        sea: &LoadedRecord,
        known: &LoadedRecord,
        shore: &LoadedRecord,
    ) -> Result<Story, StudyError> {
        let model = &learned.model;
        [sea, known, shore].into_iter().try_for_each(|record| runner.fits(learned, record))?;
        let mut story = Story {
            epochs: Default::default(),
            before: [0.0; 3],
            held: [[0.0; 3]; 2],
            on: [[0.0; 3]; 2],
            last: [0.0; 3],
        };
        for (way, guarded) in [false, true].into_iter().enumerate() {
            let options = if guarded { Options::default().guarded(model) } else { Options::default() };
            let mut session = adapt::adapter(model, &options, &[&sea.run])?.0;
            if !guarded {
                story.before = held(learned, session.weights(), known)?;
            }
            if guarded {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // a number of samples; a cast saturates
                let samples = ((self.shore_s / shore.run.dt) as usize).min(shore.run.len());
                adapt::replay_training_runs(session.as_mut(), &[&shore.run.slice(0, samples)]);
            }
            for epoch in 0..self.epochs {
                runner.tell("epochs of adaptation", epoch as f64 / self.epochs as f64)?;
                story.epochs[way].push(errors(session.as_mut(), sea));
            }
            let weights = session.guard().map_or_else(|| session.weights(), |guard| guard.active_weights());
            story.held[way] = held(learned, weights, known)?;
            if !guarded {
                story.last = held(learned, weights, sea)?;
            }
            story.on[way] = errors(session.as_mut(), known);
        }
        Ok(story)
    }
}

/// Ratios of errors without guard, by output, with a value for each network: a median over seeds and records.
#[derive(Default)]
struct Ratios {
    /// Last epoch divided by the first.
    epochs: [Vec<f64>; 3],
    /// Final weights, frozen, divided by adapting, along the record of the adaptation in the last epoch.
    greed: [Vec<f64>; 3],
    /// Under training conditions, after the adaptation divided by before.
    forgetting: [Vec<f64>; 3],
}

impl Ratios {
    fn add(&mut self, stories: &[Story]) {
        let middle = |of: &dyn Fn(&Story) -> f64| median(stories.iter().map(of).collect());
        for c in 0..3 {
            let last = |story: &Story| story.epochs[0].last().map_or(f64::NAN, |errors| errors[c]);
            let first = |story: &Story| story.epochs[0].first().map_or(f64::NAN, |errors| errors[c]);
            self.epochs[c].push(middle(&|story| last(story) / first(story)));
            self.greed[c].push(middle(&|story| story.last[c] / last(story)));
            self.forgetting[c].push(middle(&|story| story.held[0][c] / story.before[c]));
        }
    }

    /// The largest ratio of the epochs, because a filter has diverged if one output of one network has; the smallest
    /// ratios of greed and forgetting, because the claims are about every network.
    fn measures(&self, outcome: &mut Outcome) {
        let mut diverged = 0.0f64;
        for (c, (output, _)) in OUTPUTS.iter().enumerate() {
            let (_, epochs) = range(&self.epochs[c]);
            diverged = diverged.max(epochs);
            outcome.measure(&format!("epochs_{output}_last_over_first"), epochs);
            outcome.measure(&format!("greed_{output}"), range(&self.greed[c]).0);
            outcome.measure(&format!("forgetting_{output}"), range(&self.forgetting[c]).0);
        }
        outcome.measure("epochs_last_over_first", diverged);
    }
}

/// Errors along a record with frozen weights and a state filter.
fn held(learned: &Learned, weights: &[f64], loaded: &LoadedRecord) -> Result<[f64; 3], StudyError> {
    let options = Options::default();
    let (_, used) = adapt::adapter(&learned.model, &options, &[&loaded.run])?;
    let model = adapt::learned(&learned.model, &options, weights, &[], &used)?;
    let sure = KalmanOptions {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        state_noise_per_s: 1e-3,
        noise_factor: 1.0,
        leak_s: f64::INFINITY,
        ..KalmanOptions::default()
    };
    let mut session =
        adapt::adapter(&model, &Options { kalman: sure, ..Options::default() }, &[&loaded.run])?.0;
    session.freeze(true);
    Ok(errors(session.as_mut(), loaded))
}

/// Mean absolute errors 20 steps ahead, at most [`DIVERGED`]; an adapter adapts along the record.
fn errors(session: &mut dyn Adapter, loaded: &LoadedRecord) -> [f64; 3] {
    let run = &loaded.run;
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let (mut work, mut y) = (Workspace::new(), [0.0; 3 * STEPS]);
    let (mut sums, mut count) = ([0.0; 3], 0.0);
    session.reset();
    for k in 0..run.len().saturating_sub(STEPS) {
        session.observe(run.outputs.row(k));
        // After the hidden state has converged.
        if k >= 100 && k % 5 == 0 {
            session.rollout(run.inputs.rows(k, k + STEPS), &mut work, &mut y);
            for (c, sum) in sums.iter_mut().enumerate() {
                *sum += (y[3 * (STEPS - 1) + c] - truth.row(k + STEPS)[c]).abs();
            }
            count += 1.0;
        }
        session.advance(run.inputs.row(k));
    }
    // The minimum of NaN and a number is the number.
    sums.map(|sum| (sum / count).min(DIVERGED))
}
