//! Figure 4: circles under feedback linearization, with true parameters and with identified equations.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use hydroid_core::control::Status;
use hydroid_core::craft::Craft;

use super::super::StudyError;
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::runner::Runner;
use super::median;
use hydroid::closed_loop::{
    self, ClosedLoopError, Conditions, ControlMethod, ControllerOptions, Metrics, Run, Sample, Scenario,
    SpeedOptions, Task, Track,
};
use hydroid::craft;
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid_report::figure::{Dash, Figure, Key, Line, Mark, Panel, Stroke};
use hydroid_report::style;

/// Duration of a circle \[s\].
const DURATION_S: f64 = 120.0;
const SETTLED_S: f64 = 40.0;
/// Integral gain \[1/s^3\]: a fifth of the stability limit, chosen on circles that are not shown.
const INTEGRAL: f64 = 1.0;
const TRUTH: &str = "true parameters";

/// Circles of a vessel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circles {
    /// The circles; the first one is drawn.
    pub circles: Vec<Circle>,
    /// Seeds of the noise.
    pub seeds: Vec<u64>,
}

/// A circle and the models of its controllers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    pub plant: String,
    /// Radius \[m\].
    pub radius_m: f64,
    /// Speed \[m/s\].
    pub speed_m_s: f64,
    /// Distance of the controlled point ahead of the origin \[m\].
    pub lead_m: f64,
    /// Models compared with the true parameters.
    pub models: Vec<String>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct CircleResult {
    /// RMS distance with clean velocities \[m\].
    clean: f64,
    /// RMS distance with noise, median of the seeds \[m\].
    noisy: f64,
    /// RMS distance with noise and integral action \[m\].
    integral: f64,
    /// Share of noisy samples without the status tracking.
    not_tracking: f64,
    /// Every fifth sample of the first noisy run: time, north and east of the point, and its distance.
    points: Vec<[f64; 4]>,
}

impl Circles {
    pub(super) fn uses(&self) -> (Vec<&String>, Vec<&String>) {
        (Vec::new(), self.circles.iter().flat_map(|circle| &circle.models).collect())
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let basis = format!("first seed of training, {} seeds of noise", self.seeds.len());
        let mut outcome = Outcome { basis, ..Outcome::default() };
        let mut table = Sheet::new(
            "circles",
            &[
                "vessel",
                "radius [m]",
                "speed [m/s]",
                "model",
                "clean [m]",
                "noisy [m]",
                "with integral [m]",
                "not tracking [%]",
            ],
        );
        let mut tracks = Sheet::new(
            "circle_track",
            &["model", "t [s]", "north [m]", "east [m]", "distance from the reference [m]"],
        );
        for (i, circle) in self.circles.iter().enumerate() {
            let vessel =
                craft::built_in(&circle.plant).ok_or_else(|| StudyError::missing("plant", &circle.plant))?;
            let truth = Model::of_vessel(&vessel, 0.1).map_err(|error| runner.cannot(error))?;
            let mut models = vec![(String::from(TRUTH), None, truth)];
            for name in &circle.models {
                let learned = runner.models(name)?;
                if let Some(first) = learned.first() {
                    models.push((name.clone(), Some(first.key), first.model.clone()));
                }
            }
            let what = format!("circles of the {} at {} m/s", circle.plant, circle.speed_m_s);
            let all = runner.each(&what, &models, |(name, key, model)| {
                let settings = (circle, &self.seeds, name);
                let on: Vec<_> = key.iter().copied().collect();
                runner.store.get("circle", runner.store.key("circle", &settings, &on), || {
                    Ok(self.simulate_circle(circle, &vessel, model))
                })
            })?;
            let mut drawn = Vec::new();
            for ((name, ..), result) in models.iter().zip(all) {
                let word = if name == TRUTH { name.clone() } else { palette::title(name) };
                let mut row: Vec<Cell> = vec![
                    circle.plant.as_str().into(),
                    circle.radius_m.into(),
                    circle.speed_m_s.into(),
                    word.clone().into(),
                ];
                match result {
                    Ok(result) => {
                        row.extend(
                            [result.clean, result.noisy, result.integral, 100.0 * result.not_tracking]
                                .map(Cell::Number),
                        );
                        let of = format!("{}_{}", if name == TRUTH { "truth" } else { name }, i);
                        outcome.measure(&format!("{of}_clean"), result.clean);
                        outcome.measure(&format!("{of}_noisy"), result.noisy);
                        outcome.measure(&format!("{of}_integral"), result.integral);
                        drawn.push((word, name.clone(), result.points));
                    }
                    Err(why) => {
                        row.extend([const { Cell::Nothing }; 4]);
                        outcome
                            .remarks
                            .push(format!("{} at {} m/s, {word}: {why}", circle.plant, circle.speed_m_s));
                    }
                }
                table.row(row);
            }
            if i == 0 {
                for (word, _, points) in &drawn {
                    for point in points {
                        let mut row = vec![word.clone().into()];
                        row.extend(point.map(Cell::Number));
                        tracks.row(row);
                    }
                }
                outcome.chart("circle", track(circle, &drawn), "Track of the controlled point with noisy velocities. It starts half a metre from the reference circle (dotted).");
                outcome.chart(
                    "circle_error",
                    distance(&drawn),
                    "Distance of the controlled point from its reference over time.",
                );
            }
        }
        outcome.sheets.push(tracks);
        outcome.table(table, format!("RMS distance of the controlled point from its reference from {SETTLED_S} s to {DURATION_S} s. Columns: clean velocities; noisy velocities (median of {} seeds); noisy velocities with integral action ({INTEGRAL} / s^3). The pose is exact. Commands are limited and held for 0.1 s.", self.seeds.len()));
        Ok(outcome)
    }

    fn simulate_circle(
        &self,
        circle: &Circle,
        vessel: &Craft,
        model: &Model,
    ) -> Result<CircleResult, String> {
        let words = |error: ClosedLoopError| error.to_string();
        let task = Task::Circle { radius: circle.radius_m };
        let course =
            Track::new(&task, &SpeedOptions::cruise(circle.speed_m_s)).map_err(|error| error.to_string())?;
        let scene =
            Scenario { duration_s: DURATION_S, start: [0.0, -0.5], ..Scenario::new(vessel.clone(), course) };
        let mut steering =
            ControllerOptions::new(ControlMethod::FeedbackLinearization, &scene.plant, scene.dt_s);
        steering.model = Some(Arc::new(model.clone()));
        steering.lead = circle.lead_m;
        let run = |steering: &ControllerOptions, noise: f64, seed: u64| -> Result<Run, String> {
            let conditions = Conditions { noise, ..Conditions::calm(seed) };
            let mut controller = steering.controller(seed).map_err(words)?;
            let run =
                closed_loop::run(&scene, &conditions, controller.as_mut(), &mut silent()).map_err(words)?;
            let end_s = run.samples.last().map_or(0.0, |sample| sample.t);
            if run.diverged {
                Err(format!("the state of the vessel was not finite after {end_s} s"))
            } else {
                Ok(run)
            }
        };
        let rms = |run: &Run| Metrics::of(run, SETTLED_S).rms_position;
        let clean = rms(&run(&steering, 0.0, 0)?);
        let each = |steering: &ControllerOptions| {
            self.seeds.iter().map(|&seed| run(steering, 1.0, seed)).collect::<Result<Vec<_>, _>>()
        };
        let noisy = each(&steering)?;
        steering.integral = INTEGRAL;
        let integral = median(each(&steering)?.iter().map(rms).collect());
        let not_tracking = |run: &Run| {
            let not = run.samples.iter().filter(|sample| sample.status != Status::Tracking);
            not.count() as f64 / run.samples.len() as f64
        };
        let points = noisy.first().map_or_else(Vec::new, |run| {
            let point = |sample: &Sample| {
                let (sin, cos) = sample.eta[2].sin_cos();
                let north = sample.eta[0] + circle.lead_m * cos;
                [sample.t, north, sample.eta[1] + circle.lead_m * sin, sample.distance]
            };
            run.samples.iter().step_by(5).map(point).collect()
        });
        let middle = |of: &dyn Fn(&Run) -> f64| median(noisy.iter().map(of).collect());
        Ok(CircleResult { clean, noisy: middle(&rms), integral, not_tracking: middle(&not_tracking), points })
    }
}

type Drawn = (String, String, Vec<[f64; 4]>);

fn stroke(name: &str) -> Stroke {
    if name == TRUTH { Stroke { width: 2.4, ..style::PERSISTENCE_LINE } } else { palette::line(name) }
}

fn track(circle: &Circle, drawn: &[Drawn]) -> Figure {
    let edge = 1.15 * circle.radius_m;
    let around = (0..=180)
        .map(|i| f64::from(2 * i).to_radians())
        .map(|angle| (circle.radius_m * angle.sin(), circle.radius_m * angle.cos()));
    let reference = Stroke { colour: style::INK, width: 1.2, dash: Dash::Dotted };
    let mut panel =
        Panel::new("north [m]").range(-edge, edge).mark(Mark::Line(Line::new(around.collect(), reference)));
    let mut figure = Figure::new("Tracks on a circle", "east [m]")
        .x_range(-edge, edge)
        .equal_axes()
        .key(Key::Line(reference), "reference");
    for (word, name, points) in drawn {
        let points = points.iter().map(|[_, north, east, _]| (*east, *north)).collect();
        panel = panel.mark(Mark::Line(Line::new(points, stroke(name))));
        figure = figure.key(Key::Line(stroke(name)), word.clone());
    }
    figure.panel(panel)
}

fn distance(drawn: &[Drawn]) -> Figure {
    let mut panel = Panel::new("distance from the reference [m]").height(220.0).decades();
    let mut figure = Figure::new("Distance from the reference over time", "time [s]");
    for (word, name, points) in drawn {
        let points = points.iter().map(|[t, .., distance]| (*t, distance.max(1e-5).log10())).collect();
        panel = panel.mark(Mark::Line(Line::new(points, stroke(name))));
        figure = figure.key(Key::Line(stroke(name)), word.clone());
    }
    figure.panel(panel)
}
