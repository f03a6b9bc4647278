//! Figure 8: prediction error over time, frozen, adapted and guarded, with the actions of the guard.

use serde::{Deserialize, Serialize};

use hydroid_core::adapt::guard::{Action, Guard};
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::vessel::State;

use super::super::StudyError;
use super::super::outcome::{Outcome, Sheet};
use super::super::palette;
use super::super::runner::{Learned, LoadedRecord, Runner};
use super::adaptation::options;
use super::{OUTPUTS, median, range};
use hydroid::adapt;
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel, Stroke};
use hydroid_report::style;

/// Origin stride, and first origin \[samples\].
const STRIDE: usize = 5;
const WARM_UP: usize = 100;
/// Speed of the change of mode of the hydrofoil \[m/s\].
const TRANSITION: f64 = 2.5;
/// Smaller errors are drawn at this value.
const LEAST: f64 = 1e-3;
/// Largest time between an origin and a change of mode that it is near to \[s\].
const NEAR_S: f64 = 4.0;
/// Share of the errors that are its peaks.
const WORST: f64 = 0.05;
/// Half-width of an 80 % band of a normal distribution \[standard deviations\].
const BAND_80: f64 = 1.281_55;

/// Errors over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Along {
    /// The network; its first seed is drawn.
    pub model: String,
    /// The records; the first is drawn.
    pub records: Vec<String>,
    /// Horizon \[samples\].
    pub steps: usize,
}

/// Result along a record: times of the origins, errors of frozen, adapted and guarded network, and times of guard
/// actions.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Adaptation {
    t: Vec<f64>,
    errors: [Vec<[f64; 3]>; 3],
    switched_s: Vec<f64>,
    /// Predicted outputs of the adapted network, and their standard deviations.
    predicted: Vec<[f64; 3]>,
    deviations: Vec<[f64; 3]>,
    measured: Vec<[f64; 3]>,
}

impl Along {
    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let records = runner.records(&self.records)?;
        let models = runner.models(&self.model)?;
        let pairs: Vec<(&Learned, &LoadedRecord)> = models
            .iter()
            .flat_map(|learned| records.iter().map(move |loaded| (learned, &**loaded)))
            .collect();
        let all =
            runner.each(&format!("{} along the records", self.model), &pairs, |&(learned, loaded)| {
                runner.fits(learned, loaded)?;
                let key = runner.store.key("along", &self.steps, &[learned.key, loaded.key]);
                runner.store.get("along", key, || self.adapt(learned, loaded))
            })?;
        let (Some(adaptation), Some(loaded)) = (all.first(), records.first()) else {
            return Ok(Outcome::default());
        };
        let mut outcome = Outcome::default();
        outcome.basis(models.len(), &self.records);
        self.draw(adaptation, loaded, &mut outcome);
        let each: Vec<(&Adaptation, &LoadedRecord)> =
            all.iter().zip(&pairs).map(|(adaptation, (_, loaded))| (adaptation, *loaded)).collect();
        measures(&each, &mut outcome);
        Ok(outcome)
    }

    fn draw(&self, adaptation: &Adaptation, loaded: &LoadedRecord, outcome: &mut Outcome) {
        let names = ["frozen", "adapted", "guarded"];
        let mut sheet = Sheet::new(
            "along",
            &["t [s]", "u [m/s]", "way", "error of u [m/s]", "error of v [m/s]", "error of r [rad/s]"],
        );
        for (way, errors) in names.iter().zip(&adaptation.errors) {
            for (t, error) in adaptation.t.iter().zip(errors) {
                let u = speed(loaded, *t);
                let [a, b, c] = *error;
                sheet.row(vec![(*t).into(), u.into(), (*way).into(), a.into(), b.into(), c.into()]);
            }
        }
        outcome.sheets.push(sheet);
        let steps = self.steps;
        outcome.chart(
            "error_over_time",
            self.figure(adaptation, loaded),
            format!(
                "{}, trained at low speed, along {}: error against the truth of the prediction {steps} steps ({:.1} s) ahead, at the time of its origin, for u, v and r. Curves are means over eight origins (4 s). The frozen network never adapts to flight; the adapted one has been adapted to it after the first take-off. Vertical lines mark the times at which the guard changes the model that predicts.",
                palette::title(&self.model),
                loaded.name,
                steps as f64 * loaded.run.dt,
            ),
        );
        let coverage = adaptation.coverage();
        outcome.chart(
            "bands",
            self.bands(adaptation, loaded.run.dt),
            format!(
                "Prediction of the adapted network {steps} steps ahead with its 80 % band, and measurements at the predicted time, around the first flight. Along the whole record the bands of u, v and r together contain {:.0} % of the measurements.",
                100.0 * coverage
            ),
        );
        outcome.chart(
            "track",
            track(loaded),
            format!("Track of {}: grey in displacement mode, black while flying.", loaded.name),
        );
    }

    fn adapt(&self, learned: &Learned, loaded: &LoadedRecord) -> Result<Adaptation, StudyError> {
        let run = &loaded.run;
        let truth = run.truth.as_ref().unwrap_or(&run.outputs);
        let mut adapted = adapt::adapter(&learned.model, &options(false, learned), &[run])?.0;
        let mut guarded = adapt::adapter(&learned.model, &options(true, learned), &[run])?.0;
        let mut frozen = learned.model.session();
        let mut adaptation = Adaptation {
            t: Vec::new(),
            errors: Default::default(),
            switched_s: Vec::new(),
            predicted: Vec::new(),
            deviations: Vec::new(),
            measured: Vec::new(),
        };
        let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * self.steps]);
        for k in 0..run.len().saturating_sub(self.steps) {
            let sessions: [&mut dyn Predictor; 3] = [frozen.as_mut(), adapted.as_mut(), guarded.as_mut()];
            let origin = k >= WARM_UP && k % STRIDE == 0;
            let commands = run.inputs.rows(k, k + self.steps);
            let at = k + self.steps;
            for (session, errors) in sessions.into_iter().zip(&mut adaptation.errors) {
                session.observe(run.outputs.row(k));
                if origin {
                    session.rollout(commands, &mut work, &mut y);
                    let end = &y[3 * (self.steps - 1)..];
                    errors.push(std::array::from_fn(|c| (end[c] - truth.row(at)[c]).abs()));
                }
            }
            if origin {
                adapted.rollout(commands, &mut work, &mut y);
                adaptation.predicted.push(std::array::from_fn(|c| y[3 * (self.steps - 1) + c]));
                let mut deviations = [0.0; 3];
                adapted.deviations(commands, &[self.steps], &mut work, &mut deviations);
                adaptation.deviations.push(deviations);
                adaptation.measured.push(std::array::from_fn(|c| run.outputs.row(at)[c]));
            }
            frozen.advance(run.inputs.row(k));
            adapted.advance(run.inputs.row(k));
            guarded.advance(run.inputs.row(k));
            if origin {
                adaptation.t.push(run.t0 + k as f64 * run.dt);
            }
            let events = guarded.guard().map(Guard::events);
            let switched =
                events.into_iter().flatten().any(|event| matches!(event.action, Action::Switched { .. }));
            if switched {
                adaptation.switched_s.push(run.t0 + k as f64 * run.dt);
            }
        }
        Ok(adaptation)
    }

    fn bands(&self, adaptation: &Adaptation, dt: f64) -> Figure {
        let off = adaptation.measured.iter().position(|y| y[0] > TRANSITION).unwrap_or(0);
        let from = off.saturating_sub(40);
        let to = (from + 160).min(adaptation.t.len());
        let ahead = self.steps as f64 * dt;
        let mut figure = Figure::new("Predictions with bands", "time [s]")
            .key(Key::Line(palette::line(&self.model)), format!("predicted {ahead:.1} s earlier"))
            .key(Key::Area(style::BAND), "80 % band")
            .key(Key::Line(style::MEASURED_LINE), "measured");
        for (c, (output, unit)) in OUTPUTS.iter().enumerate() {
            let line = |values: &[[f64; 3]]| -> Vec<(f64, f64)> {
                (from..to).map(|i| (adaptation.t[i] + ahead, values[i][c])).collect()
            };
            let band = |i: usize| {
                let half = BAND_80 * adaptation.deviations[i][c];
                (
                    adaptation.t[i] + ahead,
                    adaptation.predicted[i][c] - half,
                    adaptation.predicted[i][c] + half,
                )
            };
            let band =
                Mark::Band { points: (from..to).map(band).collect(), colour: style::BAND, opacity: 0.35 };
            figure = figure.panel(
                Panel::new(format!("{output} [{unit}]"))
                    .height(120.0)
                    .mark(band)
                    .mark(Mark::Line(Line::new(line(&adaptation.measured), style::MEASURED_LINE)))
                    .mark(Mark::Line(Line::new(line(&adaptation.predicted), palette::line(&self.model)))),
            );
        }
        figure
    }

    fn figure(&self, adaptation: &Adaptation, loaded: &LoadedRecord) -> Figure {
        let strokes = [
            palette::way("frozen", &self.model),
            palette::line(&self.model),
            Stroke { width: 1.2, colour: style::INK, ..style::MEASURED_LINE },
        ];
        let speeds = adaptation.t.iter().map(|&t| (t, speed(loaded, t))).collect();
        let events = Stroke { colour: style::ALARM, width: 0.8, ..style::MEASURED_LINE };
        let mut figure = Figure::new("Error of the prediction over time", "time [s]")
            .key(Key::Line(strokes[0]), "frozen")
            .key(Key::Line(strokes[1]), "adapted")
            .key(Key::Line(strokes[2]), "adapted, guarded")
            .panel(
                Panel::new("true u [m/s] (dotted: change of mode)")
                    .mark(Mark::Level { at: TRANSITION, stroke: style::VALIDATION_LINE })
                    .mark(Mark::Line(Line::new(speeds, style::MEASURED_LINE))),
            );
        for (c, (output, unit)) in OUTPUTS.iter().enumerate() {
            let mut panel = Panel::new(format!("error of {output} [{unit}]")).decades().height(120.0);
            panel = panel.mark(Mark::Verticals { at: adaptation.switched_s.clone(), stroke: events });
            for (errors, stroke) in adaptation.errors.iter().zip(strokes) {
                let points = smoothed(&adaptation.t, errors.iter().map(|error| error[c]));
                panel = panel.mark(Mark::Line(Line::new(points, stroke)));
            }
            figure = figure.panel(panel);
        }
        figure
    }
}

/// Medians over seeds and records: errors while flying, in the second half of the record, adapted divided by frozen;
/// share of the peaks of the adapted error near a change of mode; share of the time that is near one.
fn measures(each: &[(&Adaptation, &LoadedRecord)], outcome: &mut Outcome) {
    outcome.measure("band_80_holds", median(each.iter().map(|(one, _)| one.coverage()).collect()));
    let near: Vec<Vec<bool>> =
        each.iter().map(|(one, loaded)| near_changes(&one.t, &changes(loaded))).collect();
    let of_time = median(near.iter().map(|near| share(near.iter().copied())).collect());
    outcome.measure("time_near", of_time);
    let mut least = f64::INFINITY;
    for (c, (output, _)) in OUTPUTS.iter().enumerate() {
        let left = each.iter().map(|(one, loaded)| {
            let [frozen, adapted] = [0, 1].map(|way| one.late_while_flying(loaded, way, c));
            adapted / frozen
        });
        outcome.measure(&format!("flying_{output}_left"), median(left.collect()));
        let at_changes = each.iter().zip(&near).map(|((one, _), near)| {
            let errors: Vec<f64> = one.errors[1].iter().map(|error| error[c]).collect();
            share(peaks(&errors).into_iter().map(|i| near[i]))
        });
        let at_changes = median(at_changes.collect());
        outcome.measure(&format!("peaks_{output}_near"), at_changes);
        least = least.min(at_changes / of_time);
    }
    outcome.measure("peaks_over_time", least);
}

/// Times at which the true speed crosses that of the change of mode \[s\].
fn changes(loaded: &LoadedRecord) -> Vec<f64> {
    let flies: Vec<bool> = loaded.simulated.states().iter().map(|state| state.u > TRANSITION).collect();
    let crossed = flies.windows(2).enumerate().filter(|(_, pair)| pair[0] != pair[1]);
    crossed.map(|(k, _)| loaded.run.t0 + (k as f64 + 0.5) * loaded.run.dt).collect()
}

fn near_changes(t: &[f64], changes: &[f64]) -> Vec<bool> {
    t.iter().map(|t| changes.iter().any(|change| (t - change).abs() <= NEAR_S)).collect()
}

/// Places of the largest errors.
fn peaks(errors: &[f64]) -> Vec<usize> {
    let mut places: Vec<usize> = (0..errors.len()).collect();
    places.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of errors, rounded up
    places.truncate((WORST * errors.len() as f64).ceil() as usize);
    places
}

fn share(which: impl Iterator<Item = bool>) -> f64 {
    let (all, chosen) =
        which.fold((0.0, 0.0), |(all, chosen), one| (all + 1.0, chosen + f64::from(u8::from(one))));
    chosen / all
}

impl Adaptation {
    /// Median error of an output while flying, in the second half of these errors.
    fn late_while_flying(&self, loaded: &LoadedRecord, way: usize, c: usize) -> f64 {
        let aloft = self.t.iter().zip(&self.errors[way]).filter(|(t, _)| speed(loaded, **t) > TRANSITION);
        let errors: Vec<f64> = aloft.map(|(_, error)| error[c]).collect();
        median(errors[errors.len() / 2..].to_vec())
    }

    /// Share of the measurements inside their 80 % band.
    fn coverage(&self) -> f64 {
        let (mut inside, mut all) = (0.0, 0.0);
        for ((predicted, deviations), measured) in
            self.predicted.iter().zip(&self.deviations).zip(&self.measured)
        {
            for c in 0..3 {
                all += 1.0;
                inside += f64::from(u8::from((measured[c] - predicted[c]).abs() < BAND_80 * deviations[c]));
            }
        }
        inside / all
    }
}

fn track(loaded: &LoadedRecord) -> Figure {
    let states = loaded.simulated.states();
    let part = |flying: bool| {
        let point = |state: &State| {
            let here = (state.u > TRANSITION) == flying;
            (if here { state.y } else { f64::NAN }, if here { state.x } else { f64::NAN })
        };
        states.iter().step_by(5).map(point).collect::<Vec<_>>()
    };
    let (low, high) = range(&states.iter().map(|state| state.y).collect::<Vec<_>>());
    let (south, north) = range(&states.iter().map(|state| state.x).collect::<Vec<_>>());
    let mut panel = Panel::new("north [m]").range(south - 5.0, north + 5.0);
    let mut figure = Figure::new("Track of the lawn-mower by mode", "east [m]")
        .x_range(low - 5.0, high + 5.0)
        .equal_axes();
    for (flying, colour, word) in
        [(false, style::PERSISTENCE, "displacement mode"), (true, style::INK, "flying")]
    {
        let stroke = Stroke { colour, width: 1.8, ..style::MEASURED_LINE };
        panel = panel.mark(Mark::Line(Line::new(part(flying), stroke)));
        figure = figure.key(Key::Line(stroke), word);
    }
    figure.panel(panel)
}

fn speed(loaded: &LoadedRecord, t: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index, rounded; a cast saturates
    let k = (t / loaded.run.dt).round() as usize;
    loaded.simulated.states().get(k).map_or(f64::NAN, |state| state.u)
}

/// Logarithms of the means over eight origins.
fn smoothed(t: &[f64], values: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    let values: Vec<f64> = values.collect();
    t.chunks(8)
        .zip(values.chunks(8))
        .map(|(t, v)| (t[0], (v.iter().sum::<f64>() / v.len() as f64).max(LEAST).log10()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_are_the_worst_twentieth_and_near_is_four_seconds() {
        let t: Vec<f64> = (0..40).map(f64::from).collect();
        let near = near_changes(&t, &[10.5]);
        assert_eq!(share(near.iter().copied()), 8.0 / 40.0);
        let mut errors = vec![0.1; 40];
        (errors[12], errors[30]) = (2.0, 1.0);
        assert_eq!(peaks(&errors), [12, 30]);
        assert_eq!(share(peaks(&errors).into_iter().map(|i| near[i])), 0.5);
    }
}
