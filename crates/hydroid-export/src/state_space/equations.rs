//! Sparse equations of motion.

use hydroid_core::model::sparse::{Equations, Shape, Signal, Term};

use super::{Channels, Label, StateSpace, lag, outputs_first, rk4};
use crate::graph::{Builder, Module, Scalar, Unary, Vector};

/// Equations as functions of a module.
pub(crate) struct Lowered {
    /// `(state, command) -> state`.
    pub(super) step: usize,
    /// `(state, command) -> state` with the outputs held: the memory follows the command.
    pub(super) wait: usize,
    /// Numbers of the memory, without the weights.
    pub(super) state: Vec<Label>,
    rates: Option<usize>,
    /// `(state, command) -> [outputs, command, signals]`: the variables of the terms.
    pub(crate) variables: usize,
}

/// The sum of coefficients times terms in `variables`: a number for each output.
pub(super) fn rates<'a>(
    b: &'a Builder,
    terms: &[Term],
    coefficients: &[Scalar<'a>],
    variables: &[Scalar<'a>],
) -> Vector<'a> {
    let rows: Vec<Scalar<'_>> = coefficients
        .chunks_exact(terms.len().max(1))
        .map(|row| {
            // A term with the coefficient zero is not part of the sum.
            let product = |(of, xi): (&Term, &Scalar<'a>)| match xi {
                Scalar::Constant(0.0) => Scalar::Constant(0.0),
                xi => term(of, variables) * *xi,
            };
            terms.iter().zip(row).map(product).fold(Scalar::Constant(0.0), |sum, product| sum + product)
        })
        .collect();
    b.gather(&rows)
}

/// Coefficients, of which those at the places `learned` are `weights`.
pub(super) fn with_weights<'a>(
    coefficients: &[f64],
    learned: &[usize],
    weights: Vector<'a>,
) -> Vec<Scalar<'a>> {
    let mut all: Vec<Scalar<'_>> = coefficients.iter().map(|xi| Scalar::Constant(*xi)).collect();
    learned.iter().enumerate().for_each(|(index, &place)| all[place] = weights.at(index));
    all
}

/// Labels of coefficients (`outputs x terms`) at some places.
pub(super) fn weight_labels(
    of: &str,
    terms: &[Term],
    names: &[String],
    outputs: &[Label],
    places: &[usize],
) -> Vec<Label> {
    let label = |place: &usize| {
        let (output, term) = (&outputs[place / terms.len()].name, terms[place % terms.len()].name(names));
        Label::new(format!("coefficient of {term} in the rate of {output}{of}"), "SI")
    };
    places.iter().map(label).collect()
}

/// A term in `variables`.
pub(crate) fn term<'a>(term: &Term, variables: &[Scalar<'a>]) -> Scalar<'a> {
    term.factors().iter().fold(Scalar::Constant(1.0), |product, factor| {
        product * shape(factor.shape, variables[usize::from(factor.variable)])
    })
}

fn shape(shape: Shape, x: Scalar<'_>) -> Scalar<'_> {
    let one = Scalar::Constant(1.0);
    match shape {
        Shape::Power(n) => (0..n).fold(one, |power, _| power * x),
        Shape::Abs => x.unary(Unary::Abs),
        Shape::Sign => x.unary(Unary::Sign),
        Shape::Sin => x.unary(Unary::Sin),
        Shape::Cos => x.unary(Unary::Cos),
        Shape::Reciprocal => one / x,
        Shape::Log => x.unary(Unary::Ln),
        Shape::Above(gate) => ((x - gate.centre.0) * gate.slope.0).unary(Unary::Logistic),
        Shape::Below(gate) => one - ((x - gate.centre.0) * gate.slope.0).unary(Unary::Logistic),
    }
}

/// Places of the memory of signals in a state: lags, then the past values of each variable, the latest first.
struct Memory {
    /// Index of the signal, input, time constant \[s\].
    lags: Vec<(usize, usize, f64)>,
    /// Variable, place, number of samples.
    delays: Vec<(usize, usize, usize)>,
}

impl Memory {
    fn of(equations: &Equations) -> Self {
        let (n, m) = (equations.outputs(), equations.inputs());
        let (mut lags, mut delays) = (Vec::new(), Vec::new());
        for (index, signal) in equations.signals().iter().enumerate() {
            if let Signal::Lag { input, time_constant_s } = *signal {
                lags.push((index, usize::from(input) - n, time_constant_s.0));
            }
        }
        let mut end = n + lags.len();
        for variable in 0..n + m {
            let longest = equations.signals().iter().filter_map(|signal| match *signal {
                Signal::Past { variable: of, samples } if usize::from(of) == variable => Some(samples),
                _ => None,
            });
            if let Some(longest) = longest.max() {
                delays.push((variable, end, usize::from(longest)));
                end += usize::from(longest);
            }
        }
        Self { lags, delays }
    }

    fn labels(&self, channels: &[Label], outputs: usize, dt: f64) -> Vec<Label> {
        let mut labels = channels[..outputs].to_vec();
        for &(_, input, time) in &self.lags {
            let Label { name, unit } = &channels[outputs + input];
            labels.push(Label::new(format!("{name} behind a lag of {time} s"), unit));
        }
        for &(variable, _, samples) in &self.delays {
            let Label { name, unit } = &channels[variable];
            let ago = |k: usize| Label::new(format!("{name} {} s ago", k as f64 * dt), unit);
            labels.extend((1..=samples).map(ago));
        }
        labels
    }
}

/// The functions of equations. The coefficients at the places `learned` are weights at the end of the state.
pub(super) fn lower(
    module: &mut Module,
    equations: &Equations,
    channels: &[Label],
    learned: &[usize],
) -> Lowered {
    let (n, m, signals) = (equations.outputs(), equations.inputs(), equations.signals().len());
    let memory = Memory::of(equations);
    let kept = equations.state_len();
    let states = kept + learned.len();

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let s = b.argument("signals", signals);
    let weights = b.argument("weights", learned.len());
    let variables: Vec<Scalar<'_>> = [y, c, s].iter().flat_map(|part| part.elements()).collect();
    let coefficients = with_weights(equations.coefficients(), learned, weights);
    let rows = rates(&b, equations.terms(), &coefficients, &variables);
    let motion = module.add(b.finish("motion", "Rates of the outputs", rows));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let signals_now = signals_at(equations, &memory, (x, x.slice(0, n), c), &|_| 1.0, 0.0);
    let all = b.concat(&[x.slice(0, n), c, b.gather(&signals_now)]);
    let variables = module.add(b.finish("variables", "Variables of the terms", all));

    let rates = memory.delays.is_empty().then(|| {
        let b = Builder::new();
        let (x, c) = (b.argument("state", states), b.argument("command", m));
        let weights = x.slice(kept, learned.len());
        let dy = b.call(motion, n, &[x.slice(0, n), c, x.slice(n, signals), weights]);
        let lags = memory.lags.iter().enumerate();
        let lags = lags.map(|(place, (_, input, time))| (c.at(*input) - x.at(n + place)) / *time);
        let lags = b.gather(&lags.collect::<Vec<_>>());
        let dx = b.concat(&[dy, lags, b.constant(&vec![0.0; learned.len()])]);
        module.add(b.finish("rates", "Rates of the state", dx))
    });

    let h = equations.dt() / equations.substeps() as f64;
    let half = |time: f64| (-0.5 * h / time).exp();
    // Without past outputs, all integration steps of a sample are equal.
    let uniform = memory.delays.iter().all(|(variable, ..)| *variable >= n);
    let step = if uniform {
        let b = Builder::new();
        let (x, c) = (b.argument("state", states), b.argument("command", m));
        let next = integrate(&b, equations, &memory, motion, (x, x.slice(0, n), c), (0, &half));
        let substep =
            module.add(b.finish("integrate", "One step of the Runge-Kutta method of order 4", next));
        let b = Builder::new();
        let (x, c) = (b.argument("state", states), b.argument("command", m));
        let end = b.repeat(substep, equations.substeps(), &[x, c]);
        let next = shifted(&b, &memory, end, x.slice(0, n), c);
        b.finish("step", "State after a sample with the command held", next)
    } else {
        let b = Builder::new();
        let (x, c) = (b.argument("state", states), b.argument("command", m));
        let before = x.slice(0, n);
        let substeps = 0..equations.substeps();
        let end = substeps.fold(x, |x, substep| {
            integrate(&b, equations, &memory, motion, (x, before, c), (substep, &half))
        });
        let next = shifted(&b, &memory, end, before, c);
        b.finish("step", "State after a sample with the command held", next)
    };
    let step = module.add(step);

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let before = x.slice(0, n);
    let whole = |time: f64| (0..2 * equations.substeps()).fold(1.0, |decay, _| decay * half(time));
    let lags = memory.lags.iter().enumerate();
    let lags = lags.map(|(place, (_, input, time))| lag(x.at(n + place), c.at(*input), whole(*time)));
    let end = b.concat(&[
        before,
        b.gather(&lags.collect::<Vec<_>>()),
        x.slice(n + memory.lags.len(), states - n - memory.lags.len()),
    ]);
    let next = shifted(&b, &memory, end, before, c);
    let wait = module.add(b.finish("wait", "State after a sample with the outputs held", next));

    Lowered { step, wait, rates, variables, state: memory.labels(channels, n, equations.dt()) }
}

/// One integration step: outputs by the Runge-Kutta method, lags exactly.
fn integrate<'a>(
    b: &'a Builder,
    equations: &Equations,
    memory: &Memory,
    motion: usize,
    (x, before, c): (Vector<'a>, Vector<'a>, Vector<'a>),
    (substep, half): (usize, &dyn Fn(f64) -> f64),
) -> Vector<'a> {
    let n = equations.outputs();
    let h = equations.dt() / equations.substeps() as f64;
    let y = rk4(b, x.slice(0, n), h, |stage, y| {
        let halves = [0, 1, 1, 2][stage];
        let decay = |time: f64| (0..halves).fold(1.0, |decay, _| decay * half(time));
        let time = (2 * substep + halves) as f64 * 0.5 / equations.substeps() as f64;
        let signals = signals_at(equations, memory, (x, before, c), &decay, time);
        let kept = equations.state_len();
        b.call(motion, n, &[y, c, b.gather(&signals), x.slice(kept, x.len() - kept)])
    });
    let lags = memory.lags.iter().enumerate();
    let lags =
        lags.map(|(place, (_, input, time))| lag(x.at(n + place), c.at(*input), half(*time) * half(*time)));
    let rest = n + memory.lags.len();
    b.concat(&[y, b.gather(&lags.collect::<Vec<_>>()), x.slice(rest, x.len() - rest)])
}

/// The signals at a stage: `before` are the outputs at the start of the sample, `time` the share of it that has passed.
fn signals_at<'a>(
    equations: &Equations,
    memory: &Memory,
    (x, before, c): (Vector<'a>, Vector<'a>, Vector<'a>),
    decay: &dyn Fn(f64) -> f64,
    time: f64,
) -> Vec<Scalar<'a>> {
    let n = equations.outputs();
    let signal = |(index, signal): (usize, &Signal)| match *signal {
        Signal::Lag { time_constant_s, input } => {
            let place = memory.lags.iter().position(|(of, ..)| *of == index).unwrap_or(0);
            lag(x.at(n + place), c.at(usize::from(input) - n), decay(time_constant_s.0))
        }
        Signal::Past { variable, samples } => {
            let (variable, samples) = (usize::from(variable), usize::from(samples));
            let line = memory.delays.iter().find(|(of, ..)| *of == variable);
            let first = line.map_or(n, |(_, place, _)| *place);
            let from = x.at(first + samples - 1);
            if variable >= n || time == 0.0 {
                return from;
            }
            let to = if samples == 1 { before.at(variable) } else { x.at(first + samples - 2) };
            from + (to - from) * time
        }
    };
    equations.signals().iter().enumerate().map(signal).collect()
}

/// The state with its past values moved by a sample; `before` are the outputs at its start.
fn shifted<'a>(
    b: &'a Builder,
    memory: &Memory,
    x: Vector<'a>,
    before: Vector<'a>,
    c: Vector<'a>,
) -> Vector<'a> {
    let n = before.len();
    let mut parts = vec![x.slice(0, n + memory.lags.len())];
    for &(variable, place, samples) in &memory.delays {
        let now = if variable < n { before.at(variable) } else { c.at(variable - n) };
        parts.push(b.vector_of(now));
        parts.push(x.slice(place, samples - 1));
    }
    // The weights stay.
    let end = memory.delays.last().map_or(n + memory.lags.len(), |(_, place, samples)| place + samples);
    parts.push(x.slice(end, x.len() - end));
    b.concat(&parts)
}

/// A state of equations whose unknown lags (NaN) have reached the command.
pub(super) fn with_known_lags<'a>(
    b: &'a Builder,
    equations: &Equations,
    x: Vector<'a>,
    c: Vector<'a>,
) -> Vector<'a> {
    let memory = Memory::of(equations);
    let (n, lags) = (equations.outputs(), memory.lags.len());
    let commands: Vec<Scalar<'_>> = memory.lags.iter().map(|(_, input, _)| c.at(*input)).collect();
    let known = x.slice(n, lags).or(b.gather(&commands));
    b.concat(&[x.slice(0, n), known, x.slice(n + lags, x.len() - n - lags)])
}

/// The state of a steady motion: outputs, commands behind their lags, and the same values in the past.
pub(super) fn steady<'a>(b: &'a Builder, equations: &Equations, y: Vector<'a>, c: Vector<'a>) -> Vector<'a> {
    let memory = Memory::of(equations);
    let n = equations.outputs();
    let mut numbers = y.elements();
    numbers.extend(memory.lags.iter().map(|(_, input, _)| c.at(*input)));
    for &(variable, _, samples) in &memory.delays {
        let now = if variable < n { y.at(variable) } else { c.at(variable - n) };
        numbers.extend(std::iter::repeat_n(now, samples));
    }
    b.gather(&numbers)
}

pub(super) fn state_space(equations: &Equations, channels: &Channels) -> StateSpace {
    learning(equations, channels, &[]).0
}

/// The state space with the coefficients at the places `learned` at the end of the state, and its functions.
pub(crate) fn learning(
    equations: &Equations,
    channels: &Channels,
    learned: &[usize],
) -> (StateSpace, Lowered) {
    let mut module = Module::default();
    let (n, m) = (equations.outputs(), equations.inputs());
    let lowered = lower(&mut module, equations, &channels.all(), learned);
    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let weights: Vec<f64> = learned.iter().map(|&place| equations.coefficients()[place]).collect();
    let first = b.concat(&[steady(&b, equations, y, c), b.constant(&weights)]);
    let start = module.add(b.finish("start", "State of a steady motion", first));
    let mut state = lowered.state.clone();
    let mut names: Vec<String> = channels.all().into_iter().map(|label| label.name).collect();
    names.extend(
        equations
            .signals()
            .iter()
            .map(|signal| match *signal {
                Signal::Lag { input, time_constant_s } => {
                    format!("({} behind a lag of {} s)", names[usize::from(input)], time_constant_s.0)
                }
                Signal::Past { variable, samples } => {
                    format!("({} {samples} samples ago)", names[usize::from(variable)])
                }
            })
            .collect::<Vec<String>>(),
    );
    state.extend(weight_labels("", equations.terms(), &names, &channels.outputs, learned));
    let [observe, output] = outputs_first(&mut module, n, state.len());
    let (step, rates) = (lowered.step, lowered.rates);
    (StateSpace { module, state, start, step, observe, output, rates, block: None }, lowered)
}
