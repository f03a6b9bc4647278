//! Simulations, and their documents.

use serde::Serialize;
use serde_json::json;

use super::setup::Setup;
use crate::boat::Value;
use crate::closed_loop::{
    self, ClosedLoopController, ClosedLoopError, Conditions, ControlMethod, Metrics, MonteCarlo, Run, Sample,
    TruePlant, TunedAutopilot, Wind,
};
use crate::model::MOTION;
use crate::plant::Outside;
use crate::progress::Progress;

/// A simulated closed loop.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// The run; the first one of Monte Carlo trials.
    pub run: Run,
    /// Metrics of the run.
    pub metrics: Metrics,
    /// Monte Carlo trials, if there is more than one run.
    pub trials: Option<MonteCarlo>,
    /// Inputs and velocities of the run that leave the range in which the model of the plant was seen.
    pub outside: Vec<Outside>,
    /// Names of the inputs of this model.
    pub commanded: Vec<String>,
}

impl Simulated {
    /// Where the model of the plant extrapolates, in words.
    pub fn extrapolations(&self) -> impl Iterator<Item = String> {
        self.outside.iter().map(|outside| {
            let why = if self.is_believed(outside) { "not validated" } else { "not valid" };
            format!("{why}: {outside}")
        })
    }

    /// Commands may go to the limits of the actuators; velocities, and sums of inputs that did not move apart, may not go where the model
    /// is not believed.
    fn is_believed(&self, outside: &Outside) -> bool {
        outside.is_believed() || self.commanded.contains(&outside.name)
    }

    /// Whether the motion is valid, the vessel stayed on track and no command was beyond a limit, in all trials.
    pub fn is_sound(&self) -> bool {
        if !self.outside.iter().all(|outside| self.is_believed(outside)) {
            return false;
        }
        match &self.trials {
            Some(trials) => trials.held == trials.runs && trials.violations == 0,
            None => self.metrics.held && self.metrics.violations == 0,
        }
    }
}

#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
enum Outcome<'a> {
    Run(&'a Metrics),
    Trials(&'a MonteCarlo),
}

/// The document of `hydroid control --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Document<'a> {
    #[serde(flatten)]
    outcome: Outcome<'a>,
    controller: serde_json::Value,
    tuning: Option<&'a TunedAutopilot>,
    plant: &'a str,
    task: serde_json::Value,
    conditions: &'a Conditions,
    inputs: Vec<Value>,
    notes: Vec<String>,
    outside: &'a [Outside],
}

impl Setup {
    /// Monte Carlo trials; `None` if the options have a single run.
    ///
    /// # Errors
    /// As [`monte_carlo`](closed_loop::monte_carlo()).
    pub fn trials(&self, progress: Progress<'_>) -> Result<Option<MonteCarlo>, ClosedLoopError> {
        let runs = self.options.runs();
        if runs == 1 {
            return Ok(None);
        }
        let dispersion = self.options.dispersion(&self.scenario.plant);
        let Self { controller, scenario, conditions, from_s, .. } = self;
        closed_loop::monte_carlo(controller, scenario, conditions, &dispersion, runs, *from_s, progress)
            .map(Some)
    }

    /// Simulates the run, or the first one of trials.
    ///
    /// # Errors
    /// As [`run`](closed_loop::run()).
    pub fn simulate(
        &self,
        controller: &mut dyn ClosedLoopController,
        trials: Option<MonteCarlo>,
        progress: Progress<'_>,
    ) -> Result<Simulated, ClosedLoopError> {
        let first = trials.as_ref().and_then(|trials| trials.trials.first());
        let conditions = first.map_or(self.conditions, |trial| trial.conditions);
        let run = closed_loop::run(&self.scenario, &conditions, controller, progress)?;
        let metrics = Metrics::of(&run, self.from_s);
        let outside = self.outside(&run, &conditions);
        let inputs = self.plant.description.inputs.iter();
        let commanded = inputs.map(|port| port.channel.name.clone()).collect();
        Ok(Simulated { run, metrics, trials, outside, commanded })
    }

    /// What leaves the range in which the model of the plant was seen. Its velocities are those through the water.
    fn outside(&self, run: &Run, conditions: &Conditions) -> Vec<Outside> {
        // A vessel with given parameters has no training range.
        if self.plant.is_vessel() {
            return Vec::new();
        }
        let d = &self.plant.description;
        let commands = run.samples.iter().enumerate().map(|(k, sample)| (sample.t, run.command(k)));
        let inputs = Outside::of_commands(&self.plant, &commands);
        let motion = MOTION.iter().enumerate().filter_map(|(i, name)| {
            let port = d.outputs.iter().find(|port| port.channel.name == *name)?;
            let velocity = |sample: &Sample| {
                let ([north, east], (sin, cos)) = (conditions.current, sample.eta[2].sin_cos());
                let flow = [north * cos + east * sin, east * cos - north * sin, 0.0];
                sample.nu[i] - if sample.t < conditions.onset_s { 0.0 } else { flow[i] }
            };
            Outside::of(port, run.samples.iter().map(|sample| (sample.t, velocity(sample))))
        });
        inputs.into_iter().chain(motion).collect()
    }

    /// The document of a simulation.
    pub fn document<'a>(
        &'a self,
        simulated: &'a Simulated,
        tuned: Option<&'a TunedAutopilot>,
    ) -> Document<'a> {
        let Self { scenario, task, pace, scale, response, .. } = self;
        Document {
            outcome: simulated.trials.as_ref().map_or(Outcome::Run(&simulated.metrics), Outcome::Trials),
            controller: self.description(),
            tuning: tuned,
            plant: scenario.plant.name(),
            task: json!({
                "path": task,
                "pace": pace,
                "duration_s": scenario.duration_s,
                "dt_s": scenario.dt_s,
                "tolerance_m": scenario.tolerance,
                "scale": scale,
                "response": response,
            }),
            conditions: &self.conditions,
            inputs: self.values().unwrap_or_default(),
            notes: self.notes(),
            outside: &simulated.outside,
        }
    }

    /// What is said of neutral values and limits that only follow from the logs, and of a model that does not predict its motion.
    pub fn notes(&self) -> Vec<String> {
        let not_identified = self.model.not_identified(&MOTION);
        let of_model = not_identified.map(|reason| {
            format!("the controller relies on a motion that its model does not predict: {reason}")
        });
        self.values().unwrap_or_default().iter().filter_map(Value::note).chain(of_model).collect()
    }

    /// The controller in documents.
    pub fn description(&self) -> serde_json::Value {
        let controller = &self.controller;
        let mut description = json!({
            "kind": controller.method,
            "model": self.model_name,
            "lead_m": controller.lead,
            "reference": controller.timing,
            "adapt": controller.adapt.is_some(),
        });
        match controller.method {
            ControlMethod::FeedbackLinearization => {
                description["bandwidth"] = json!(controller.bandwidth);
                description["integral"] = json!(controller.integral);
                description["adaptive_augmentation"] = json!(controller.learned.is_some());
            }
            ControlMethod::Backstepping => description["rate_per_s"] = json!(controller.rate),
            ControlMethod::CrossEntropy => {
                let (p, cost) = (&controller.planner, &controller.cost);
                description["horizon"] = json!(p.horizon);
                description["hold"] = json!(p.hold);
                description["candidates"] = json!(p.candidates);
                description["iterations"] = json!(p.iterations);
                description["gauss_newton_steps"] = json!(p.gauss_newton_steps);
                description["cost_weights"] = json!([cost.position, cost.heading, cost.speed]);
            }
            ControlMethod::Autopilot => {}
        }
        description
    }

    /// Heading of the report.
    pub fn title(&self) -> String {
        format!("Closed loop of {}: {}", self.scenario.plant.name(), self.controller.method.name())
    }

    /// Settings in the report: name and value.
    pub fn facts(&self, simulated: &Simulated) -> Vec<(String, String)> {
        let Self { options, controller, scenario, .. } = self;
        let words = match controller.method {
            ControlMethod::FeedbackLinearization if controller.learned.is_some() => {
                "feedback linearization of a point ahead of the vessel, with adaptive augmentation"
            }
            ControlMethod::FeedbackLinearization => "feedback linearization of a point ahead of the vessel",
            ControlMethod::Backstepping => "backstepping of a point ahead of the vessel",
            ControlMethod::CrossEntropy => "model predictive control by the cross-entropy method",
            ControlMethod::Autopilot => "line of sight, PID on the heading, PI on the speed",
        };
        let mut facts: Vec<(String, String)> = Vec::new();
        let mut add = |name: &str, value: String| facts.push((name.to_owned(), value));
        add("Controller", words.to_owned());
        if let (Some(model), Some(name)) = (&controller.model, &self.model_name) {
            let adapted = if controller.adapt.is_some() { ", adapted online" } else { "" };
            add("Model", format!("{name} ({}){adapted}", model.kind()));
        }
        let kind = match &scenario.plant {
            TruePlant::Vessel(_) => String::new(),
            TruePlant::Model(model) => format!(" ({}, {})", model.kind(), self.plant_name),
        };
        add("Plant", format!("{}{kind}", scenario.plant.name()));
        let turn = options.turn_speed.map(|turn| format!(", {turn} m/s in turns")).unwrap_or_default();
        let track = &scenario.track;
        let speed = if track.is_station { String::new() } else { format!(", {:.3} m/s{turn}", track.cruise) };
        add("Task", format!("{}{speed}", options.task.name()));
        let Conditions { seed, noise, current, wind, mass, delay_s: delay, .. } = options.conditions();
        let ([north, east], [to_north, to_east]) = (current, wind.force);
        let Wind { gust, gust_s, .. } = wind;
        let onset = options.onset.map(|onset| format!(" (from {} s on)", onset.0)).unwrap_or_default();
        add(
            "Conditions",
            format!(
                "noise × {noise}, current {north}, {east} m/s, wind {to_north}, {to_east} N, gusts {gust} N ({gust_s} s), mass × {mass}{onset}, delay {delay} s, seed {seed}"
            ),
        );
        for note in self.notes() {
            facts.push(("Limits".to_owned(), note));
        }
        facts.extend(simulated.extrapolations().map(|text| ("Extrapolation".to_owned(), text)));
        facts
    }
}
