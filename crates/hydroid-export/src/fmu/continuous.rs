//! The derivatives of a model in continuous time, for model exchange.

use std::sync::Arc;

use hydroid::model::{Body, Model};
use hydroid::plant::Motion;
use hydroid_core::craft::{Dynamics, Servo};
use hydroid_core::model::sparse::{Equations, Jacobian, Signal};
use hydroid_core::vessel::{Dual, Number, Real};

/// A number with its derivative in one direction.
pub type Directional = Dual<1>;

/// A state that is not an output: the position of an actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    pub name: String,
    /// Unit; empty if unknown.
    pub unit: String,
}

/// `dx/dt = f(x, c)` of a model in continuous time. The state `x` contains the outputs, the hidden states, and the pose
/// `x, y, psi` of a model of the motion:
///
/// ```text
/// [dx/dt, dy/dt] = R(psi) [u, v] + [V_n, V_e],    dpsi/dt = r
/// ```
#[derive(Debug)]
pub struct Continuous {
    field: Field,
    outputs: usize,
    hidden: Vec<Hidden>,
    motion: Option<Motion>,
}

#[derive(Debug)]
enum Field {
    Craft { dynamics: Box<Dynamics<Directional>>, plain: Box<Dynamics>, servos: Vec<Servo>, dt: f64 },
    Equations { equations: Arc<Equations>, jacobian: Box<Jacobian> },
}

/// Why a model has no derivatives.
type NoDerivatives = &'static str;

impl Continuous {
    /// The derivatives of a model.
    ///
    /// # Errors
    /// If the model is one in discrete time, with the reason.
    pub fn of(model: &Model) -> Result<Self, NoDerivatives> {
        if model.description.inputs.iter().any(|port| port.rate_limit.is_some()) {
            return Err("the rate of an input is limited from sample to sample");
        }
        let outputs = model.description.outputs.len();
        let (field, hidden) = match &model.body {
            Body::Craft(craft) => of_craft(model, &craft.file.craft)?,
            Body::Equations(equations) => of_equations(model, equations)?,
            Body::Recurrent(_) | Body::Direct(_) | Body::Affine(_) | Body::Committee(_) => {
                return Err("the model predicts from sample to sample");
            }
        };
        Ok(Self { field, outputs, hidden, motion: Motion::of(model).ok() })
    }

    /// Hidden states, in their order.
    pub fn hidden(&self) -> &[Hidden] {
        &self.hidden
    }

    pub fn states(&self) -> usize {
        self.outputs + self.hidden.len() + if self.motion.is_some() { 3 } else { 0 }
    }

    /// Writes the hidden states at the start of a run with the outputs `y`, after a sample with the command `c` as in
    /// co-simulation: an actuator whose position is not known has held the command.
    pub fn settle(&self, y: &[f64], c: &[f64], hidden: &mut [f64]) {
        match &self.field {
            Field::Craft { plain, servos, dt, .. } => {
                let mut positions = vec![0.0; servos.len()];
                plain.start(y[0], c, &mut positions);
                plain.move_servos(&mut positions, c, *dt);
                let positions = positions.into_iter().zip(servos);
                let moving = positions.filter(|(_, servo)| !servo.follows_at_once());
                hidden.iter_mut().zip(moving).for_each(|(state, (position, _))| *state = position);
            }
            Field::Equations { equations, .. } => {
                for (state, signal) in hidden.iter_mut().zip(equations.signals()) {
                    *state = c[usize::from(signal.source()) - self.outputs];
                }
            }
        }
    }

    /// Writes outputs and hidden states from the snapshot of a session of the model.
    pub fn read_snapshot(&self, snapshot: &[f64], into: &mut [f64]) {
        let own = &mut into[..self.outputs + self.hidden.len()];
        if let Field::Craft { servos, .. } = &self.field {
            own[..self.outputs].copy_from_slice(&snapshot[..self.outputs]);
            let positions = snapshot[self.outputs..].iter().zip(servos);
            let moving = positions.filter(|(_, servo)| !servo.follows_at_once());
            own[self.outputs..].iter_mut().zip(moving).for_each(|(state, (position, _))| *state = *position);
        } else {
            let states = own.len();
            own.copy_from_slice(&snapshot[..states]);
        }
    }

    /// Writes `dx/dt` at the state `x` under the command `c`, with the current `[V_n, V_e]` \[m/s\]. Each number carries the
    /// derivative in one direction of `x` and `c`; the values are those of plain numbers.
    ///
    /// # Panics
    /// If `x` and `rates` are not of the length [`states`](Self::states).
    pub fn rates(&self, x: &[Directional], c: &[Directional], current: [f64; 2], rates: &mut [Directional]) {
        assert!(x.len() == self.states() && rates.len() == self.states(), "a number for each state");
        match &self.field {
            Field::Craft { dynamics, servos, .. } => craft_rates(dynamics, servos, x, c, rates),
            Field::Equations { equations, jacobian } => equation_rates(equations, jacobian, x, c, rates),
        }
        if let Some(motion) = &self.motion {
            let at = self.outputs + self.hidden.len();
            let part = |of: &dyn Fn(&Directional) -> f64| {
                motion.nu(&x[..self.outputs].iter().map(of).collect::<Vec<f64>>())
            };
            let (values, partials) = (part(&|x| x.value), part(&|x| x.partials[0]));
            let [u, v, r] =
                std::array::from_fn(|i| Directional { value: values[i], partials: [partials[i]] });
            let (sin, cos) = x[at + 2].sin_cos();
            rates[at] = u * cos - v * sin + Directional::constant(current[0]);
            rates[at + 1] = u * sin + v * cos + Directional::constant(current[1]);
            rates[at + 2] = r;
        }
    }
}

fn hidden(name: String, unit: &str) -> Hidden {
    Hidden { name, unit: unit.to_owned() }
}

fn of_craft(
    model: &Model,
    craft: &hydroid_core::craft::Craft,
) -> Result<(Field, Vec<Hidden>), NoDerivatives> {
    let mut servos: Vec<Servo> = Vec::new();
    let mut names = Vec::new();
    for thruster in &craft.thrusters {
        servos.push(thruster.servo.clone());
        let command = match thruster.servo.order.terms.as_slice() {
            [(c, _, _)] => model.description.inputs.get(*c),
            _ => None,
        };
        names.push(hidden(
            format!("{} order", thruster.name),
            command.map_or("", |port| port.channel.unit.as_str()),
        ));
        if let Some(steering) = &thruster.steering {
            servos.push(steering.clone());
            names.push(hidden(format!("{} angle", thruster.name), "rad"));
        }
    }
    for rudder in &craft.rudders {
        servos.push(rudder.servo.clone());
        names.push(hidden(format!("{} angle", rudder.name), "rad"));
    }
    if servos.iter().any(|servo| servo.rate.is_some() && servo.lag == 0.0) {
        return Err(
            "an actuator moves at a limited rate without a lag, so that its rate jumps where it arrives",
        );
    }
    let numbers: Vec<Directional> =
        craft.parameters().iter().map(|(_, number)| Directional::constant(*number)).collect();
    let dynamics = Box::new(Dynamics::new(&craft.with_numbers(&numbers)));
    let moving = names.into_iter().zip(&servos).filter(|(_, servo)| !servo.follows_at_once());
    let names = moving.map(|(name, _)| name).collect();
    let (plain, dt) = (Box::new(Dynamics::new(craft)), model.description.dt);
    Ok((Field::Craft { dynamics, plain, servos, dt }, names))
}

fn of_equations(model: &Model, equations: &Arc<Equations>) -> Result<(Field, Vec<Hidden>), NoDerivatives> {
    let mut names = Vec::new();
    for signal in equations.signals() {
        match signal {
            Signal::Past { .. } => return Err("its equations contain values of past samples"),
            Signal::Lag { input, .. } => {
                let port = usize::from(*input).checked_sub(equations.outputs());
                let port = port.and_then(|at| model.description.inputs.get(at));
                let port = port.ok_or("a lag has no input")?;
                names.push(hidden(format!("{} lag", port.channel.name), &port.channel.unit));
            }
        }
    }
    let jacobian = Jacobian::new(equations).map_err(|_| "its derivatives have too many terms")?;
    Ok((Field::Equations { equations: Arc::clone(equations), jacobian: Box::new(jacobian) }, names))
}

/// The order of a servo; at a limit it does not change with the commands.
fn order(servo: &Servo, c: &[Directional]) -> Directional {
    let commands: Vec<f64> = c.iter().map(|c| c.value).collect();
    let sum: f64 = servo.order.terms.iter().map(|&(at, neutral, gain)| gain * (commands[at] - neutral)).sum();
    let [low, high] = servo.order.limits;
    let inside = sum > low && sum < high;
    let slope = |&(at, _, gain): &(usize, f64, f64)| gain * c[at].partials[0];
    let partial = if inside { servo.order.terms.iter().map(slope).sum() } else { 0.0 };
    Dual { value: servo.order.value(&commands), partials: [partial] }
}

fn craft_rates(
    dynamics: &Dynamics<Directional>,
    servos: &[Servo],
    x: &[Directional],
    c: &[Directional],
    rates: &mut [Directional],
) {
    let mut positions = Vec::with_capacity(servos.len());
    let mut at = 3;
    for servo in servos {
        let order = order(servo, c);
        if servo.follows_at_once() {
            positions.push(order);
            continue;
        }
        let rate = (order - x[at]) * (1.0 / servo.lag);
        let limit = servo.rate.filter(|limit| rate.value.abs() > *limit);
        rates[at] = limit.map_or(rate, |limit| Directional::constant(limit.copysign(rate.value)));
        positions.push(x[at]);
        at += 1;
    }
    rates[..3].copy_from_slice(&dynamics.acceleration([x[0], x[1], x[2]], &positions));
}

fn equation_rates(
    equations: &Equations,
    jacobian: &Jacobian,
    x: &[Directional],
    c: &[Directional],
    rates: &mut [Directional],
) {
    let (n, m) = (equations.outputs(), equations.inputs());
    let variables = x[..n].iter().chain(c).chain(&x[n..n + equations.signals().len()]);
    let variables: Vec<Directional> = variables.copied().collect();
    let mut slots = vec![0.0; equations.slots().max(jacobian.slots()).max(1 + variables.len())];
    let load = |slots: &mut [f64]| {
        slots[1..].iter_mut().zip(&variables).for_each(|(slot, variable)| *slot = variable.value);
    };
    load(&mut slots);
    let mut dy = vec![0.0; n];
    equations.derivative(&mut slots, &mut dy);
    let mut slopes = vec![0.0; n * variables.len()];
    load(&mut slots);
    jacobian.evaluate(&mut slots, &mut slopes);
    for (i, row) in slopes.chunks_exact(variables.len().max(1)).enumerate() {
        let partial = row.iter().zip(&variables).map(|(slope, variable)| slope * variable.partials[0]).sum();
        rates[i] = Dual { value: dy[i], partials: [partial] };
    }
    for (k, signal) in equations.signals().iter().enumerate() {
        if let Signal::Lag { input, time_constant_s } = *signal {
            let command = c.get(usize::from(input) - n).copied().unwrap_or(Directional::constant(0.0));
            rates[n + k] = (command - x[n + k]) * (1.0 / time_constant_s.0);
        }
    }
    debug_assert_eq!(m, c.len(), "a number for each input");
}
