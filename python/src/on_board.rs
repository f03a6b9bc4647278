//! Controllers on board, sample by sample, and the planner.

use std::collections::VecDeque;

use hydroid::adapt::TrainingRuns;
use hydroid::closed_loop::{Elapsed, Guided, ModelSession, Pilot, Seen, limits_of, longest_gap};
use hydroid::config::control::{Setup, active_weights};
use hydroid::fingerprint::Fingerprint;
use hydroid_core::actuator::{Limits, clamp_to_limits};
use hydroid_core::adapt::Adapter;
use hydroid_core::control::cem::{self, Cost, PlannerOptions};
use hydroid_core::guidance::{Pose, Reference};
use hydroid_core::memory::Memory;
use hydroid_core::predict::Workspace;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{row, shaped, table};
use crate::control::{beginnings, named, options, setup, training};
use crate::error::{chain, internal, unfit, value};
use crate::model::{Model, Session};
use crate::work;

/// First bytes of a saved state.
const MAGIC: &[u8; 8] = b"hydroidc";

/// Longest input delay of a model \[samples\].
const MAX_DELAY: i64 = 100_000;

#[pyclass(module = "hydroid._hydroid")]
pub(crate) struct Controller {
    setup: Setup,
    adapter: Box<dyn Adapter>,
    pilot: Pilot,
    /// Memory of the adapter before its first sample.
    initial: Vec<f64>,
    /// Commands on their way through the input delay of the model, the oldest first.
    under_way: VecDeque<Vec<f64>>,
    delay: usize,
    estimate: Vec<f64>,
    missing: Vec<f64>,
    begun: bool,
    max_gap_s: f64,
}

impl Controller {
    /// A fingerprint of model, controller and task, without which a state means nothing.
    fn fingerprint(&self) -> PyResult<[u8; 8]> {
        let setup = &self.setup;
        let mut fingerprint = Fingerprint::new();
        fingerprint.bytes(&hydroid::model::encode(&setup.model).map_err(value)?);
        fingerprint.text(&toml::to_string(&setup.learning()).map_err(internal)?);
        fingerprint.text(&setup.description().to_string());
        let task = (&setup.task, &setup.pace, setup.scenario.dt_s, setup.scenario.tolerance);
        fingerprint.text(&serde_json::to_string(&task).map_err(internal)?);
        fingerprint.text(&format!("{:?} {}", setup.scenario.limits, setup.conditions.seed));
        Ok(fingerprint.value().to_le_bytes())
    }

    /// Advances the model under the commands that act, across samples without a measurement.
    fn advance(&mut self, samples: usize) {
        for sample in 0..samples {
            self.under_way.push_back(self.pilot.command().to_vec());
            if self.under_way.len() <= self.delay {
                // The command that acts was given before the first sample.
                self.adapter.reset();
                continue;
            }
            if let Some(command) = self.under_way.pop_front() {
                self.adapter.advance(&command);
            }
            if sample + 1 < samples {
                self.adapter.observe(&self.missing);
            }
        }
    }

    fn observe(&mut self, heading: f64, outputs: &[f64]) {
        self.adapter.observe_heading(heading);
        self.adapter.observe(outputs);
        if !(self.adapter.is_sound() && self.adapter.weights().iter().all(|weight| weight.is_finite())) {
            // An adapter whose memory is not finite would stay so for ever: it begins again as the model.
            self.adapter.load(&self.initial);
            self.adapter.reset();
            self.adapter.observe_heading(heading);
            self.adapter.observe(outputs);
        }
        self.adapter.output(&mut self.estimate);
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.adapter.visit_state(memory);
        self.pilot.visit_state(memory);
    }

    fn numbers(&mut self) -> Vec<f64> {
        let mut numbers = Memory::saved(|memory| self.visit_state(memory));
        numbers.push(f64::from(u8::from(self.begun)));
        let missing = self.delay - self.under_way.len();
        numbers.extend(std::iter::repeat_n(f64::NAN, missing * self.pilot.command().len()));
        numbers.extend(self.under_way.iter().flatten());
        numbers
    }

    /// Takes numbers of [`numbers`](Self::numbers), as many as there are now.
    fn restore(&mut self, numbers: &[f64]) {
        let (state, rest) = numbers.split_at(Memory::len_of(|memory| self.visit_state(memory)));
        self.visit_state(&mut Memory::Loading(state));
        let mut rest = rest.iter().copied();
        self.begun = rest.next() == Some(1.0);
        let rest: Vec<f64> = rest.collect();
        let rows = rest.chunks_exact(self.pilot.command().len().max(1));
        let known = rows.filter(|row| row.iter().all(|c| c.is_finite()));
        self.under_way = known.map(<[f64]>::to_vec).collect();
    }
}

#[pymethods]
impl Controller {
    #[new]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        options: &Bound<'_, PyDict>,
        guard: &Bound<'_, PyAny>,
        training_log: Option<&Bound<'_, PyAny>>,
        training_time: f64,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (options, guarding) = self::options(options, guard, training_log)?;
        options.check_on_board().map_err(|error| chain(&error))?;
        let mut setup = setup(py, options, &guarding, Some(named("model", model)?), None)?;
        setup.check_firm().map_err(|error| chain(&error))?;
        let rehearsed = training(py, &setup.model, training_log)?;
        let made = work::run(py, threads, progress, move |control| {
            setup.tune(&mut |done| control.report(done))?;
            let (mut adapter, _) = setup.adapter()?;
            if setup.controller.adapt.is_some() {
                let replayed = beginnings(&rehearsed, training_time);
                TrainingRuns { replayed, rehearsed: rehearsed.concat() }.remember(adapter.as_mut());
            }
            let pilot = setup.pilot(adapter.as_ref(), None)?;
            Ok((setup, adapter, pilot))
        })?;
        let (setup, mut adapter, pilot) =
            made.map_err(|error: hydroid::config::control::SetupError| chain(&error))?;
        let reading = setup.model.description.reading.options;
        let delay = reading.input_delay.samples(setup.scenario.dt_s);
        if !(0..=MAX_DELAY).contains(&delay) {
            return Err(value(format!(
                "model: its input delay is {delay} samples, and a controller needs 0 to {MAX_DELAY}: identify without a negative delay"
            )));
        }
        let initial = Memory::saved(|memory| adapter.visit_state(memory));
        let outputs = adapter.outputs();
        let max_gap_s = reading.max_gap_s.unwrap_or_else(|| longest_gap(setup.scenario.dt_s));
        Ok(Self {
            setup,
            adapter,
            pilot,
            initial,
            under_way: VecDeque::new(),
            delay: usize::try_from(delay).unwrap_or(0),
            estimate: vec![f64::NAN; outputs],
            missing: vec![f64::NAN; outputs],
            begun: false,
            max_gap_s,
        })
    }

    #[pyo3(signature = (pose, outputs, samples=1, gap_s=None))]
    fn step(
        &mut self,
        py: Python<'_>,
        pose: &Bound<'_, PyAny>,
        outputs: &Bound<'_, PyAny>,
        samples: usize,
        gap_s: Option<f64>,
    ) -> PyResult<ControlStep> {
        let (mut eta, mut y) = ([f64::NAN; 3], vec![f64::NAN; self.missing.len()]);
        row("pose", pose, 3, |given| eta.copy_from_slice(given))?;
        row("outputs", outputs, y.len(), |given| y.copy_from_slice(given))?;
        let longest = (self.max_gap_s / self.setup.scenario.dt_s).ceil();
        if samples == 0 || samples as f64 > longest {
            return Err(unfit("samples", format!("1 to {longest}; after a longer time give gap_s"), samples));
        }
        if let Some(gap_s) = gap_s
            && !(gap_s.is_finite() && gap_s > 0.0)
        {
            return Err(unfit("gap_s", "seconds, more than 0", gap_s));
        }
        py.detach(|| {
            let elapsed = match gap_s {
                _ if !self.begun => Elapsed::Start,
                None => {
                    self.advance(samples);
                    Elapsed::Steps(samples)
                }
                Some(gap_s) => {
                    self.adapter.reset();
                    self.under_way.clear();
                    Elapsed::Gap(gap_s)
                }
            };
            self.begun = true;
            self.observe(eta[2], &y);
            let Self { adapter, pilot, estimate, .. } = self;
            let weights = pilot.adapts().then(|| active_weights(adapter.as_ref()));
            let session = ModelSession { predictor: adapter.as_ref(), weights };
            let seen = Seen { pose: eta, outputs: &y, estimate, session };
            pilot.steer(elapsed, &seen);
        });
        Ok(ControlStep {
            command: self.pilot.command().to_vec(),
            status: self.pilot.status(),
            pose: self.pilot.eta(),
            estimate: self.estimate.clone(),
            guided: self.pilot.guided().copied(),
        })
    }

    fn planned<'py>(&self, py: Python<'py>, samples: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let width = self.pilot.command().len();
        if samples > 1_000_000 {
            return Err(unfit("samples", "at most 1000000", samples));
        }
        table(py, (0..samples).flat_map(|later| self.pilot.planned(later).iter().copied()).collect(), width)
    }

    /// The model with the weights in use.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, active_weights(self.adapter.as_ref()))
    }

    #[getter]
    fn dt(&self) -> f64 {
        self.setup.scenario.dt_s
    }

    #[getter]
    fn output_names(&self) -> Vec<&str> {
        self.setup.model.description.outputs.iter().map(|port| port.channel.name.as_str()).collect()
    }

    #[getter]
    fn input_names(&self) -> Vec<&str> {
        self.setup.model.description.inputs.iter().map(|port| port.channel.name.as_str()).collect()
    }

    /// Low and high limit, limit of the rate and value at rest of each command.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let limits = PyDict::new(py);
        for (name, of) in self.input_names().into_iter().zip(&self.setup.scenario.limits) {
            limits.set_item(name, (of.low, of.high, of.rate, of.rest))?;
        }
        Ok(limits)
    }

    #[getter]
    fn state<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.fingerprint()?);
        bytes.extend(self.numbers().iter().flat_map(|x| x.to_le_bytes()));
        Ok(PyBytes::new(py, &bytes))
    }

    #[setter]
    fn set_state(&mut self, state: &[u8]) -> PyResult<()> {
        let wrong = |found: &str| {
            unfit("state", "the state of a controller of the same model, task and options", found)
        };
        let rest = state.strip_prefix(MAGIC).ok_or_else(|| wrong("other bytes"))?;
        let rest = rest
            .strip_prefix(&self.fingerprint()?)
            .ok_or_else(|| wrong("that of another model, task or options"))?;
        let (numbers, left) = rest.as_chunks::<8>();
        let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let before = self.numbers();
        if numbers.len() != before.len() || !left.is_empty() {
            return Err(wrong("a damaged one"));
        }
        self.restore(&numbers);
        if !self.adapter.is_sound() {
            self.restore(&before);
            return Err(wrong("numbers that no controller has"));
        }
        Ok(())
    }

    fn __repr__(&self) -> String {
        let Setup { controller, options, model, .. } = &self.setup;
        let (law, task) = (controller.method.name(), options.task.name());
        format!("Controller({law}, {task}, model '{}')", model.description.name)
    }
}

/// Result of a sample.
#[pyclass(frozen, module = "hydroid")]
pub(crate) struct ControlStep {
    command: Vec<f64>,
    status: &'static str,
    pose: [f64; 3],
    estimate: Vec<f64>,
    guided: Option<Guided>,
}

#[pymethods]
impl ControlStep {
    #[getter]
    fn command<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.command)
    }

    #[getter]
    fn status(&self) -> &'static str {
        self.status
    }

    #[getter]
    fn arrived(&self) -> bool {
        self.status == "arrived"
    }

    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.pose)
    }

    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.estimate)
    }

    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let of = |Guided { reference, .. }: &Guided| {
            let [x, y] = reference.position;
            [x, y, reference.course, reference.speed]
        };
        PyArray1::from_slice(py, &self.guided.as_ref().map_or([f64::NAN; 4], of))
    }

    #[getter]
    fn distance(&self) -> f64 {
        self.guided.map_or(f64::NAN, |guided| guided.distance)
    }

    #[getter]
    fn cross_track(&self) -> f64 {
        self.guided.map_or(f64::NAN, |guided| guided.cross_track)
    }

    fn __repr__(&self) -> String {
        format!("ControlStep({}, command {:?})", self.status, self.command)
    }
}

#[pyclass(module = "hydroid._hydroid")]
pub(crate) struct Planner {
    planner: cem::Planner,
    limits: Vec<Limits>,
    outputs: usize,
    dt_s: f64,
    /// The command before the next plan.
    last: Vec<f64>,
    work: Workspace,
}

#[pymethods]
impl Planner {
    /// `limits` has low, high, rate and rest of each input, `weights` those of position, course and speed, then of each
    /// command and of the change of each command.
    #[new]
    fn new(
        model: PyRef<'_, Model>,
        limits: Vec<(f64, f64, f64, f64)>,
        counts: [usize; 5],
        weights: [f64; 3],
        effort: Vec<f64>,
        rate: Vec<f64>,
        distances: [f64; 2],
        seed: u64,
    ) -> PyResult<Self> {
        let description = &model.model.description;
        let first: Vec<&str> =
            description.outputs.iter().take(3).map(|port| port.channel.name.as_str()).collect();
        if first != ["u", "v", "r"] {
            return Err(unfit("model", "the outputs u, v, r first", format!("{first:?}")));
        }
        let limits: Vec<Limits> =
            limits.into_iter().map(|(low, high, rate, rest)| Limits { low, high, rate, rest }).collect();
        let [horizon, hold, candidates, iterations, gauss_newton_steps] = counts;
        check_size(horizon, hold, candidates, gauss_newton_steps, limits.len())?;
        let [position, heading, speed] = weights;
        let [lookahead, tolerance] = distances;
        let cost = Cost { lookahead, position, heading, speed, effort, rate, soft_limits: Vec::new() };
        let options = PlannerOptions {
            horizon,
            hold,
            candidates,
            elites: (candidates / 10).max(2),
            iterations,
            gauss_newton_steps,
            ..PlannerOptions::new(seed)
        };
        let outputs = description.outputs.len();
        let planner = cem::Planner::new(options, cost, &limits, outputs, description.dt, tolerance);
        let planner = planner.map_err(value)?;
        let last = limits.iter().map(|limits| limits.rest).collect();
        Ok(Self { planner, limits, outputs, dt_s: description.dt, last, work: Workspace::new() })
    }

    /// Command, planned commands and predicted outputs of all samples, cost, rollouts and status.
    fn plan<'py>(
        &mut self,
        py: Python<'py>,
        mut session: PyRefMut<'_, Session>,
        pose: &Bound<'_, PyAny>,
        reference: &Bound<'_, PyAny>,
    ) -> PyResult<(
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        f64,
        usize,
        &'static str,
    )> {
        let mut eta = [f64::NAN; 3];
        row("pose", pose, 3, |given| eta.copy_from_slice(given))?;
        let horizon = self.planner.horizon();
        let (given, _) = shaped("reference", reference, [Some(horizon), Some(4)], "horizon, columns")?;
        let references: Vec<Reference> = given
            .as_slice()?
            .as_chunks::<4>()
            .0
            .iter()
            .map(|&[x, y, course, speed]| {
                let pose = Pose { position: [x, y], course, curvature: 0.0 };
                Reference::new(0.0, &pose, speed, 0.0)
            })
            .collect();
        let session = &mut session.session;
        if (session.outputs(), session.inputs()) != (self.outputs, self.limits.len()) {
            return Err(unfit("session", "a session of the model of the planner", "that of another model"));
        }
        let Self { planner, limits, last, work, outputs, dt_s } = self;
        let (inputs, samples) = (limits.len(), horizon * planner.hold());
        let (command, commands, y, plan) = py.detach(|| {
            let mut command = vec![f64::NAN; inputs];
            let plan = planner.command(session.as_ref(), eta, &references, &mut || false, &mut command);
            let mut commands: Vec<f64> =
                (0..samples).flat_map(|later| planner.planned(later).iter().copied()).collect();
            clamp_to_limits(&mut commands, last, limits, *dt_s);
            let mut y = vec![f64::NAN; samples * *outputs];
            session.rollout(&commands, work, &mut y);
            last.copy_from_slice(&command);
            (command, commands, y, plan)
        });
        Ok((
            PyArray1::from_vec(py, command),
            table(py, commands, inputs)?,
            table(py, y, *outputs)?,
            plan.cost,
            plan.tried,
            plan.status.name(),
        ))
    }

    fn reset(&mut self) {
        self.planner.reset();
        for (last, limits) in self.last.iter_mut().zip(&self.limits) {
            *last = limits.rest;
        }
    }
}

/// Low, high, rate and rest of each input of a model.
#[pyfunction]
pub(crate) fn command_limits(model: PyRef<'_, Model>) -> PyResult<Vec<(f64, f64, f64, f64)>> {
    let limits = limits_of(&model.model).map_err(value)?;
    Ok(limits.iter().map(|of| (of.low, of.high, of.rate, of.rest)).collect())
}

/// Bounds the memory and the work of a plan.
fn check_size(
    horizon: usize,
    hold: usize,
    candidates: usize,
    gauss_newton_steps: usize,
    inputs: usize,
) -> PyResult<()> {
    const MAX_SAMPLES: usize = 10_000_000;
    let samples = candidates.saturating_mul(horizon).saturating_mul(hold);
    if samples > MAX_SAMPLES {
        let expected = format!("a product of at most {MAX_SAMPLES}");
        return Err(unfit("candidates, horizon and hold", expected, samples));
    }
    let most = PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS;
    if gauss_newton_steps > 0 && horizon.saturating_mul(inputs) > most {
        let expected = format!("at most {most} commands of a plan, or gauss_newton_steps=0");
        return Err(unfit("horizon", expected, horizon * inputs));
    }
    Ok(())
}
