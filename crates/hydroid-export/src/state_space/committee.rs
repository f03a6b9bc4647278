//! Committees of difference equations.

use hydroid_core::model::committee::{Committee, Member, Shape};

use super::{Channels, Label, StateSpace, equations};
use crate::graph::{Binary, Builder, Module, Scalar, Test, Vector};

/// The parts of a state. The past serves measurements: from them, every member begins its rollout anew.
///
/// ```text
/// [outputs, span + 1 rows, the present one last | commands, span rows | low | high | member 1 | member 2 .. | weights]
/// member: [outputs at the last clock instant | mean command since | past clock steps, the latest first | samples since]
/// ```
///
/// The weights are the coefficients of the members that learn, in the order of the members.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    n: usize,
    m: usize,
    span: usize,
}

impl Places {
    /// A row of a member that learns begins a clock step before the present.
    fn of(committee: &Committee) -> Self {
        let span = |member: &Member| {
            let shape = member.equations.shape();
            shape.span() + if member.prior.is_some() { shape.clock } else { 0 }
        };
        let span = committee.members().iter().map(span).max().unwrap_or(0);
        Self { n: committee.outputs(), m: committee.inputs(), span }
    }

    fn present(self) -> usize {
        self.span * self.n
    }

    fn commands(self) -> usize {
        (self.span + 1) * self.n
    }

    fn limits(self) -> usize {
        self.commands() + self.span * self.m
    }

    fn members(self) -> usize {
        self.limits() + 2 * self.n
    }

    /// Length of the state of a member.
    fn member(self, shape: &Shape) -> usize {
        (self.n + self.m) * (shape.lags + 1) + 1
    }
}

/// The variables of a member at the instant `ago` samples before the present, without the present mean command if the
/// clock step has not ended.
fn variables<'a>(b: &'a Builder, shape: &Shape, at: Places, past: Vector<'a>, ago: usize) -> Vec<Vector<'a>> {
    let Places { n, m, .. } = at;
    let &Shape { lags, clock, .. } = shape;
    let output = |ago: usize| past.slice(at.present() - ago * n, n);
    let command = |ago: usize| past.slice(at.limits() - ago * m, m);
    let mut parts = Vec::new();
    for lag in 0..=lags {
        let back = ago + lag * clock;
        parts.push(output(back));
        if back < clock {
            parts.push(b.constant(&vec![0.0; m]));
            continue;
        }
        // Means are formed as along a run, value by value.
        let mut mean = command(back);
        for j in 1..clock {
            let share = b.constant(&[1.0 / (j + 1) as f64]);
            mean = mean + (command(back - j) - mean) * share;
        }
        parts.push(mean);
    }
    parts
}

/// Rollouts of the members from the present of a past: limits, then the states of the members.
fn begin<'a>(b: &'a Builder, committee: &Committee, at: Places, past: Vector<'a>) -> Vector<'a> {
    let n = at.n;
    let y = past.slice(at.present(), n);
    let mut parts = Vec::new();
    if committee.ranges().is_empty() {
        parts.push(b.constant(&vec![-f64::MAX; n]));
        parts.push(b.constant(&vec![f64::MAX; n]));
    } else {
        let ranges = committee.ranges();
        let low: Vec<f64> = ranges.iter().map(|range| range.0).collect();
        let high: Vec<f64> = ranges.iter().map(|range| range.1).collect();
        let width: Vec<f64> = ranges.iter().map(|range| range.1 - range.0).collect();
        let width = b.constant(&width);
        parts.push(y.binary(Binary::Min, b.constant(&low)) - width);
        parts.push(y.binary(Binary::Max, b.constant(&high)) + width);
    }
    for member in committee.members() {
        parts.extend(variables(b, member.equations.shape(), at, past, 0));
        parts.push(b.constant(&[0.0]));
    }
    b.concat(&parts)
}

/// A member after a sample: `[predicted outputs, its state]`.
fn advance<'a>(
    b: &'a Builder,
    motion: (usize, &Member),
    at: Places,
    (state, c, weights): (Vector<'a>, Vector<'a>, Vector<'a>),
    [low, high]: [Vector<'a>; 2],
) -> [Vector<'a>; 2] {
    let Places { n, m, .. } = at;
    let &Shape { lags, clock, dt, .. } = motion.1.equations.shape();
    let block = n + m;
    let (first, mean) = (state.slice(0, n), state.slice(n, m));
    let blocks = state.slice(block, block * lags);
    let one = b.constant(&[1.0]);
    let elapsed = state.slice(block * (lags + 1), 1) + one;
    let mean = if clock == 1 {
        c
    } else {
        elapsed.select(Test::LessOrEqual, one, c, mean + (c - mean) * (one / elapsed))
    };
    let rate = b.call(motion.0, n, &[b.concat(&[first, mean, blocks]), weights]);
    let y = first + elapsed * b.constant(&[dt]) * rate;
    // A prediction that is not a number stays so.
    let y = y.select(Test::Less, low, low, high.select(Test::Less, y, high, y));
    let older = blocks.slice(0, block * lags.saturating_sub(1));
    let passed = if lags > 0 { vec![first, mean, older] } else { Vec::new() };
    let mut begun = vec![y, b.constant(&vec![0.0; m])];
    begun.extend(passed);
    begun.push(b.constant(&[0.0]));
    let begun = b.concat(&begun);
    if clock == 1 {
        return [y, begun];
    }
    let within = b.concat(&[first, mean, blocks, elapsed]);
    let end = b.constant(&[clock as f64]);
    [y, elapsed.select(Test::Less, end, within, begun)]
}

/// The state space of a committee; see [`Places`]. The coefficients of members with a prior are weights in the state.
pub(crate) fn state_space(committee: &Committee, channels: &Channels) -> StateSpace {
    let at = Places::of(committee);
    let Places { n, m, span } = at;
    let members = committee.members();
    let lens: Vec<usize> = members.iter().map(|member| at.member(member.equations.shape())).collect();
    let kept = at.members() + lens.iter().sum::<usize>();
    let states = kept + committee.learned();
    let counts: Vec<usize> = members.iter().map(learned).collect();
    let mut module = Module::default();

    let motions: Vec<usize> = members
        .iter()
        .map(|member| {
            let of = &member.equations;
            let b = Builder::new();
            let variables = b.argument("variables", of.shape().variables());
            let weights = b.argument("weights", learned(member));
            let variables: Vec<Scalar<'_>> = variables.elements();
            let places: Vec<usize> = (0..learned(member)).collect();
            let coefficients = equations::with_weights(of.coefficients(), &places, weights);
            let rates = equations::rates(&b, of.terms(), &coefficients, &variables);
            module.add(b.finish("member", "Rates of the outputs by a member", rates))
        })
        .collect();

    let b = Builder::new();
    let past = b.argument("past", at.limits());
    let begun = begin(&b, committee, at, past);
    let begin = module.add(b.finish("begin", "Limits and members at the present of a past", begun));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let limits = [x.slice(at.limits(), n), x.slice(at.limits() + n, n)];
    let (mut place, mut first) = (at.members(), kept);
    let (mut predicted, mut next) = (Vec::new(), Vec::new());
    for (((member, &motion), &len), &count) in members.iter().zip(&motions).zip(&lens).zip(&counts) {
        let of = (x.slice(place, len), c, x.slice(first, count));
        let [y, state] = advance(&b, (motion, member), at, of, limits);
        predicted.push(y);
        next.push(state);
        place += len;
        first += count;
    }
    let votes: Vec<u32> = members.iter().map(|member| member.votes).collect();
    let y = b.median(&predicted, &votes);
    let mut parts = vec![x.slice(n, span * n), y];
    parts.push(b.concat(&[x.slice(at.commands(), span * m), c]).slice_last(span * m));
    parts.extend(limits);
    parts.extend(next);
    parts.push(x.slice(kept, committee.learned()));
    let next = b.concat(&parts);
    let step = module.add(b.finish("step", "State after a sample with the command held", next));

    let b = Builder::new();
    let (x, y) = (b.argument("state", states), b.argument("outputs", n));
    let measured = y.or(x.slice(at.present(), n));
    let past = b.concat(&[x.slice(0, at.present()), measured, x.slice(at.commands(), span * m)]);
    let begun = b.call(begin, kept - at.limits(), &[past]);
    let next = b.concat(&[past, begun, x.slice(kept, committee.learned())]);
    let observe = module.add(b.finish("observe", "State after a measurement of the outputs", next));

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let mut parts = vec![y; span + 1];
    parts.extend(vec![c; span]);
    let past = b.concat(&parts);
    let weights: Vec<f64> = members
        .iter()
        .flat_map(|member| &member.equations.coefficients()[..learned(member)])
        .copied()
        .collect();
    let state = b.concat(&[past, b.call(begin, kept - at.limits(), &[past]), b.constant(&weights)]);
    let start = module.add(b.finish("start", "State of a steady motion", state));
    let output = super::output(&mut module, at.present(), n, states);

    let state = labels(committee, at, channels);
    StateSpace { module, state, start, step, observe, output, rates: None, block: None }
}

/// Number of coefficients of a member that are learned.
fn learned(member: &Member) -> usize {
    if member.prior.is_some() { member.equations.coefficients().len() } else { 0 }
}

/// The function `(state) -> [scaled terms, outputs now less a clock step ago]` of a member, for the row of a regression:
/// terms at the instant a clock step before the present, divided by `scales`.
pub(crate) fn increment(
    space: &mut StateSpace,
    committee: &Committee,
    member: usize,
    scales: &[f64],
) -> usize {
    let (at, of) = (Places::of(committee), &committee.members()[member].equations);
    let clock = of.shape().clock;
    let b = Builder::new();
    let x = b.argument("state", space.state.len());
    let before = variables(&b, of.shape(), at, x, clock);
    let numbers: Vec<Scalar<'_>> = before.iter().flat_map(|part| part.elements()).collect();
    let terms = of.terms().iter().zip(scales);
    let mut parts: Vec<Vector<'_>> =
        terms.map(|(term, scale)| b.vector_of(equations::term(term, &numbers) / *scale)).collect();
    parts.push(x.slice(at.present(), at.n) - before[0]);
    let all = b.concat(&parts);
    space.module.add(b.finish(
        "increment",
        "Scaled terms a clock step ago, and the change of the outputs since",
        all,
    ))
}

fn labels(committee: &Committee, at: Places, channels: &Channels) -> Vec<Label> {
    let mut labels = Vec::new();
    let mut push = |what: &str, of: &[Label]| {
        labels.extend(of.iter().map(|label| Label::new(format!("{}{what}", label.name), &label.unit)));
    };
    for samples in (0..=at.span).rev() {
        push(&format!(" {samples} samples ago"), &channels.outputs);
    }
    for samples in (1..=at.span).rev() {
        push(&format!(" {samples} samples ago"), &channels.inputs);
    }
    push(", lowest prediction", &channels.outputs);
    push(", highest prediction", &channels.outputs);
    let samples = [Label::new("samples since the last clock instant", "1")];
    for (index, member) in committee.members().iter().enumerate() {
        for lag in 0..=member.equations.shape().lags {
            push(&format!(" of member {index}, {lag} clock steps ago"), &channels.outputs);
            push(&format!(" of member {index}, mean {lag} clock steps ago"), &channels.inputs);
        }
        push(&format!(" of member {index}"), &samples);
    }
    for (index, member) in committee.members().iter().enumerate().filter(|(_, member)| learned(member) > 0) {
        let ago = |lag: usize| if lag == 0 { String::new() } else { format!(" {lag} clock steps ago") };
        let names: Vec<String> = (0..=member.equations.shape().lags)
            .flat_map(|lag| channels.all().into_iter().map(move |label| label.name + &ago(lag)))
            .collect();
        labels.extend(equations::weight_labels(
            &format!(" of member {index}"),
            member.equations.terms(),
            &names,
            &channels.outputs,
            &(0..learned(member)).collect::<Vec<usize>>(),
        ));
    }
    labels
}
