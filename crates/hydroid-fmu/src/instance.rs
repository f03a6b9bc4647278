//! An instance: phases, variables, and what the interface does with them.

use hydroid_export::fmu::{Role, Variable};

use crate::co_simulation::{CoSimulation, Start};
use crate::resource::Resource;
use crate::state::State;

/// Kind of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    CoSimulation,
    ModelExchange,
}

/// Phase in the life of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    Instantiated,
    Initialization,
    /// Between communication steps.
    Step,
    /// Model exchange.
    Event,
    Continuous,
    Terminated,
}

impl Phase {
    const ALL: [Self; 6] = [
        Self::Instantiated,
        Self::Initialization,
        Self::Step,
        Self::Event,
        Self::Continuous,
        Self::Terminated,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "before the initialization",
            Self::Initialization => "in the initialization",
            Self::Step => "between steps",
            Self::Event => "at an event",
            Self::Continuous => "in continuous time",
            Self::Terminated => "after the end",
        }
    }
}

/// An instance of the FMU.
#[derive(Debug)]
pub(crate) struct Instance {
    pub(crate) resource: Resource,
    pub(crate) phase: Phase,
    pub(crate) time_s: f64,
    pub(crate) inputs: Vec<f64>,
    /// Parameters: outputs at the start, commands before it, pose at the start, current.
    start_outputs: Vec<f64>,
    start_inputs: Vec<f64>,
    start_pose: [f64; 3],
    pub(crate) current: [f64; 2],
    /// Outputs, hidden states, pose.
    pub(crate) present: Vec<f64>,
    /// None for model exchange.
    steps: Option<CoSimulation>,
}

pub(crate) type Outcome<T = ()> = Result<T, String>;

impl Instance {
    /// An instance of the model in a folder of resources.
    pub(crate) fn new(kind: Kind, resources: &str, token: &str) -> Outcome<Self> {
        let resource = Resource::load(resources, token)?;
        let steps = match (kind, resource.variables.continuous()) {
            (Kind::ModelExchange, Err(reason)) => {
                return Err(format!("no model exchange, because {reason}; use co-simulation"));
            }
            (Kind::ModelExchange, Ok(_)) => None,
            (Kind::CoSimulation, _) => Some(CoSimulation::new(&resource)),
        };
        let [outputs, inputs] = resource.variables.counts();
        let hidden = resource.variables.continuous().map_or(0, |continuous| continuous.hidden().len());
        let pose = if resource.variables.motion().is_some() { 3 } else { 0 };
        let mut instance = Self {
            resource,
            phase: Phase::Instantiated,
            time_s: 0.0,
            inputs: vec![0.0; inputs],
            start_outputs: vec![0.0; outputs],
            start_inputs: vec![0.0; inputs],
            start_pose: [0.0; 3],
            current: [0.0; 2],
            present: vec![0.0; outputs + hidden + pose],
            steps,
        };
        instance.reset();
        Ok(instance)
    }

    pub(crate) fn kind(&self) -> Kind {
        if self.steps.is_some() { Kind::CoSimulation } else { Kind::ModelExchange }
    }

    /// Returns to the state after the instantiation.
    pub(crate) fn reset(&mut self) {
        (self.phase, self.time_s) = (Phase::Instantiated, 0.0);
        let starts: Vec<(Role, f64)> = self
            .resource
            .variables
            .all()
            .iter()
            .filter_map(|variable| Some((variable.role, variable.start?)))
            .collect();
        for (role, start) in starts {
            if let Some(place) = self.place(role) {
                *place = start;
            }
        }
        if self.steps.is_some() {
            self.steps = Some(CoSimulation::new(&self.resource));
        }
        self.settle();
    }

    /// The number that a variable sets.
    fn place(&mut self, role: Role) -> Option<&mut f64> {
        match role {
            Role::Input(i) => self.inputs.get_mut(i),
            Role::StartOutput(i) => self.start_outputs.get_mut(i),
            Role::StartInput(i) => self.start_inputs.get_mut(i),
            Role::StartPose(i) => self.start_pose.get_mut(i),
            Role::Current(i) => self.current.get_mut(i),
            Role::Time | Role::Output(_) | Role::Pose(_) | Role::Hidden(_) | Role::Derivative(_) => None,
        }
    }

    /// Presents the start.
    fn settle(&mut self) {
        let [n, _] = self.resource.variables.counts();
        self.present[..n].copy_from_slice(&self.start_outputs);
        let hidden = self.hidden();
        if let Ok(continuous) = self.resource.variables.continuous() {
            continuous.settle(&self.start_outputs, &self.start_inputs, &mut self.present[n..n + hidden]);
        }
        self.present[n + hidden..].iter_mut().zip(self.start_pose).for_each(|(x, start)| *x = start);
    }

    fn hidden(&self) -> usize {
        self.resource.variables.continuous().map_or(0, |continuous| continuous.hidden().len())
    }

    /// An error unless the instance is in one of the phases.
    pub(crate) fn need(&self, action: &str, phases: &[Phase]) -> Outcome {
        if phases.contains(&self.phase) {
            return Ok(());
        }
        let allowed: Vec<&str> = phases.iter().map(|phase| phase.name()).collect();
        Err(format!("{action} is possible {}, not {}", allowed.join(" or "), self.phase.name()))
    }

    pub(crate) fn enter_initialization(&mut self) -> Outcome {
        self.need("the initialization", &[Phase::Instantiated])?;
        self.settle();
        self.phase = Phase::Initialization;
        Ok(())
    }

    /// Sets the time at the start.
    pub(crate) fn set_start_time(&mut self, time_s: f64) -> Outcome {
        self.need("setting the start time", &[Phase::Instantiated])?;
        self.time_s = finite("the start time", time_s)?;
        Ok(())
    }

    pub(crate) fn exit_initialization(&mut self) -> Outcome {
        self.need("the end of the initialization", &[Phase::Initialization])?;
        self.settle();
        let Some(steps) = &mut self.steps else {
            self.phase = Phase::Event;
            return Ok(());
        };
        let start = Start {
            time_s: self.time_s,
            outputs: &self.start_outputs,
            inputs: &self.start_inputs,
            eta: self.start_pose,
            current: self.current,
        };
        steps.start(&self.resource.model, start)?;
        self.phase = Phase::Step;
        Ok(())
    }

    pub(crate) fn terminate(&mut self) -> Outcome {
        self.need("the end", &[Phase::Step, Phase::Event, Phase::Continuous])?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    pub(crate) fn variable(&self, reference: u32) -> Outcome<&Variable> {
        let index = usize::try_from(reference).ok();
        let variable = index.and_then(|index| self.resource.variables.all().get(index));
        variable.ok_or_else(|| format!("there is no variable with the value reference {reference}"))
    }

    /// The value of a variable.
    pub(crate) fn get(&self, reference: u32) -> Outcome<f64> {
        let role = self.variable(reference)?.role;
        if let Role::Derivative(index) = role {
            return Ok(self.derivatives_at_present()?[index]);
        }
        let value = match role {
            Role::Time => Some(&self.time_s),
            Role::Input(i) => self.inputs.get(i),
            Role::Output(_) | Role::Hidden(_) | Role::Pose(_) => {
                self.state_index(role).and_then(|index| self.present.get(index))
            }
            Role::StartOutput(i) => self.start_outputs.get(i),
            Role::StartInput(i) => self.start_inputs.get(i),
            Role::StartPose(i) => self.start_pose.get(i),
            Role::Current(i) => self.current.get(i),
            Role::Derivative(_) => None,
        };
        value.copied().ok_or_else(|| format!("the variable {reference} has no value"))
    }

    pub(crate) fn set(&mut self, reference: u32, value: f64) -> Outcome {
        let Variable { role, name, .. } = self.variable(reference)?.clone();
        let value = finite(&name, value)?;
        match role {
            Role::Input(_) => {
                let phases = [
                    Phase::Instantiated,
                    Phase::Initialization,
                    Phase::Step,
                    Phase::Event,
                    Phase::Continuous,
                ];
                self.need("setting an input", &phases)?;
            }
            _ => self.need(
                &format!("setting the parameter {name}"),
                &[Phase::Instantiated, Phase::Initialization],
            )?,
        }
        let place = self.place(role).ok_or_else(|| format!("{name} is calculated and cannot be set"))?;
        *place = value;
        if self.phase == Phase::Initialization {
            self.settle();
        }
        Ok(())
    }

    pub(crate) fn step(&mut self, t: f64, h: f64) -> Outcome {
        self.need("a step", &[Phase::Step])?;
        let Some(steps) = &mut self.steps else { return Err(String::from("model exchange has no steps")) };
        steps.step(t, h, &self.inputs)?;
        self.time_s = t + h;
        let variables = &self.resource.variables;
        let [n, _] = variables.counts();
        let hidden = variables.continuous().map_or(0, |continuous| continuous.hidden().len());
        let (outputs, rest) = self.present.split_at_mut(n);
        let snapshot = steps.present(&self.inputs, outputs, &mut rest[hidden..]);
        let mut states = vec![0.0; n + hidden];
        if let Ok(continuous) = variables.continuous() {
            continuous.read_snapshot(snapshot, &mut states);
            rest[..hidden].copy_from_slice(&states[n..]);
        }
        if self.present.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(format!(
            "the motion is not finite at {} s: the model diverged, or the inputs left its range",
            self.time_s
        ))
    }

    /// Index of a state of model exchange.
    pub(crate) fn state_index(&self, role: Role) -> Option<usize> {
        let [n, _] = self.resource.variables.counts();
        match role {
            Role::Output(i) => Some(i),
            Role::Hidden(i) => Some(n + i),
            Role::Pose(i) => Some(n + self.hidden() + i),
            _ => None,
        }
    }

    pub(crate) fn state(&self) -> State {
        let mut numbers = vec![self.time_s];
        for part in [
            &self.inputs[..],
            &self.start_outputs,
            &self.start_inputs,
            &self.start_pose,
            &self.current,
            &self.present,
        ] {
            numbers.extend(part);
        }
        if let Some(steps) = &self.steps {
            steps.save(&mut numbers);
        }
        State { token: self.resource.token, kind: self.kind() as u8, phase: self.phase as u8, numbers }
    }

    /// Takes a state of an instance of the same model and kind.
    pub(crate) fn set_state(&mut self, state: &State) -> Outcome {
        self.check_state(state)?;
        let foreign = || String::from("the state is that of another FMU or kind of instance");
        let phase = *Phase::ALL.get(usize::from(state.phase)).ok_or_else(foreign)?;
        let own = state.numbers.len() - self.steps.as_ref().map_or(0, CoSimulation::saved_len);
        let (mut rest, steps) = state.numbers.split_at(own);
        if let Some(of) = &mut self.steps {
            of.restore(steps)?;
        }
        for part in [
            std::slice::from_mut(&mut self.time_s),
            &mut self.inputs,
            &mut self.start_outputs,
            &mut self.start_inputs,
            &mut self.start_pose,
            &mut self.current,
            &mut self.present,
        ] {
            let (numbers, others) = rest.split_at(part.len());
            part.copy_from_slice(numbers);
            rest = others;
        }
        self.phase = phase;
        Ok(())
    }

    /// An error if a state is not one of an instance of the same model and kind.
    pub(crate) fn check_state(&self, state: &State) -> Outcome {
        let same = state.token == self.resource.token && state.kind == self.kind() as u8;
        if same && state.numbers.len() == self.state().numbers.len() {
            return Ok(());
        }
        Err(String::from("the state is that of another FMU or kind of instance"))
    }
}

pub(crate) fn finite(name: &str, value: f64) -> Outcome<f64> {
    if value.is_finite() { Ok(value) } else { Err(format!("{name} cannot be set to {value}")) }
}
