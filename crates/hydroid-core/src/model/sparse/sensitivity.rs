//! Derivatives of rollouts with respect to coefficients and initial outputs: the variational equation.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::equations::{Equations, EquationsError};
use super::program::{Program, ProgramError};
use super::signal::Signal;
use super::term::Term;
use crate::predict::rollout_steps;

/// Stages of a Runge-Kutta step.
const STAGES: usize = 4;

/// Rollouts of equations with their derivatives with respect to parameters `p`: the outputs at the start, then some of
/// the coefficients.
///
/// With `dy/dt = f(y, c, s, Xi)` and `S = dy/dp`, the variational equation is `dS/dt = df/dy S + df/ds ds/dp + df/dp`.
/// It is integrated by the same Runge-Kutta steps as [`Equations::step`], so that `S` is the exact derivative of the
/// numerical rollout (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, 1993, section I.14). Past
/// outputs among the signals carry `S` of their time; the past before the start does not depend on `p`.
///
/// A step is linear in `S`. With `A_i = df/dy` and `F_i = df/ds ds/dp + df/dp` at its four stages,
///
/// ```text
/// S <- S + sum_i L_i (A_i S + F_i)       L_4 = h/6,               L_3 = h/3 + h L_4 A_4,
///                                        L_2 = h/3 + h/2 L_3 A_3, L_1 = h/6 + h/2 L_2 A_2
/// ```
///
/// so that the matrices of the stages are small, and each column of `df/dp` has one number.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    equations: Equations,
    /// The terms of equations and parameters, then their derivatives.
    program: Program,
    /// `(output, slot, coefficient)`, and the place of the coefficient in the table.
    rates: Vec<(usize, usize, f64)>,
    rate_places: Vec<usize>,
    /// `(output x columns + column, slot, factor)`: columns are the outputs, then the past outputs.
    slopes: Vec<(usize, usize, f64)>,
    /// Place of the coefficient in each factor, and its multiplier.
    slope_places: Vec<(usize, f64)>,
    /// `(samples ago, output)` of each past output.
    pasts: Vec<(usize, usize)>,
    /// `(output, slot)` of the term of each coefficient among the parameters.
    direct: Vec<(usize, usize)>,
}

impl Sensitivity {
    /// Sensitivities to the coefficients at some places of the table `outputs x terms`.
    ///
    /// # Errors
    /// If a place does not exist, or the derivatives need more sub-products than a program can hold.
    pub fn new(equations: &Equations, places: &[usize]) -> Result<Self, EquationsError> {
        let (n, count) = (equations.outputs(), equations.terms().len());
        let expected = n * count;
        if let Some(&given) = places.iter().find(|&&place| place >= expected) {
            return Err(EquationsError::Shape { expected, given });
        }
        let mut table = TermTable::default();
        let (mut rates, mut rate_places) = (Vec::new(), Vec::new());
        for (place, &xi) in equations.coefficients().iter().enumerate().filter(|(_, xi)| **xi != 0.0) {
            rates.push((place / count, table.place(&equations.terms()[place % count]), xi));
            rate_places.push(place);
        }
        let mut direct = Vec::new();
        for &place in places {
            direct.push((place / count, table.place(&equations.terms()[place % count])));
        }
        let first = n + equations.inputs();
        let mut moving: Vec<usize> = (0..n).collect();
        let mut pasts = Vec::new();
        for (index, signal) in equations.signals().iter().enumerate() {
            if let Signal::Past { variable, samples } = *signal
                && usize::from(variable) < n
            {
                moving.push(first + index);
                pasts.push((usize::from(samples), usize::from(variable)));
            }
        }
        let (mut slopes, mut slope_places) = (Vec::new(), Vec::new());
        for (j, term) in equations.terms().iter().enumerate() {
            for (column, &variable) in moving.iter().enumerate() {
                let v =
                    u16::try_from(variable).map_err(|_| EquationsError::Program(ProgramError::TooLarge))?;
                for (scale, derivative) in term.derivative(v) {
                    for output in 0..n {
                        let xi = equations.coefficient(output, j);
                        if xi != 0.0 {
                            slopes.push((
                                output * moving.len() + column,
                                table.place(&derivative),
                                scale * xi,
                            ));
                            slope_places.push((output * count + j, scale));
                        }
                    }
                }
            }
        }
        let program = Program::new(&table.terms, equations.variables()).map_err(EquationsError::Program)?;
        for place in rates.iter_mut().chain(&mut slopes).map(|(_, place, _)| place) {
            *place = program.slot(*place);
        }
        for (_, place) in &mut direct {
            *place = program.slot(*place);
        }
        Ok(Self {
            equations: equations.clone(),
            program,
            rates,
            rate_places,
            slopes,
            slope_places,
            pasts,
            direct,
        })
    }

    /// Replaces the coefficients, as [`Equations::set_coefficients`]. Nothing is allocated.
    ///
    /// # Panics
    /// If there is not one for each place of the table.
    pub fn set_coefficients(&mut self, coefficients: &[f64]) {
        self.equations.set_coefficients(coefficients);
        for ((_, _, xi), &place) in self.rates.iter_mut().zip(&self.rate_places) {
            *xi = coefficients[place];
        }
        for ((_, _, factor), &(place, scale)) in self.slopes.iter_mut().zip(&self.slope_places) {
            *factor = scale * coefficients[place];
        }
    }

    /// Length of the scratch of [`rollout`](Self::rollout).
    pub fn scratch(&self) -> usize {
        self.sizes().iter().sum()
    }

    fn sizes(&self) -> [usize; 12] {
        let (n, p, pasts) = (self.equations.outputs(), self.parameters(), self.pasts.len());
        let (columns, slots, direct) = (n + pasts, self.program.slots(), self.direct.len());
        let state = self.equations.state_len();
        let [slopes, gains, forcing] = [n * columns, n * n, direct].map(|of_stage| STAGES * of_stage);
        [state, slots, n, n, n, slopes, gains, forcing, n * n, n * columns, n * p, pasts * p]
    }

    /// Number of parameters: one for each output, then one for each place.
    pub fn parameters(&self) -> usize {
        self.equations.outputs() + self.direct.len()
    }

    /// Rolls out from a state ([`Equations::step`]) under commands row by row. `y` receives the outputs and `s` their
    /// derivatives `outputs x parameters`, beginning with the start: one row more than there are commands. `scratch` has
    /// [`scratch`](Self::scratch) numbers.
    ///
    /// # Panics
    /// If the lengths do not fit together.
    pub fn rollout(
        &self,
        start: &[f64],
        commands: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
        s: &mut [f64],
    ) {
        let e = &self.equations;
        let (n, m, p) = (e.outputs(), e.inputs(), self.parameters());
        let steps = rollout_steps(commands, m, &y[n..], n);
        assert_eq!(s.len(), (steps + 1) * n * p, "one block of derivatives for each row of outputs");
        let [state, slots, k, sum, before, slopes, gains, forcing, transition, product, now, pasts] =
            split(scratch, self.sizes());
        let (columns, direct) = (n + self.pasts.len(), self.direct.len());
        state.copy_from_slice(start);
        y[..n].copy_from_slice(&start[..n]);
        s[..n * p].fill(0.0);
        for i in 0..n {
            s[i * p + i] = 1.0;
        }
        let h = e.dt() / e.substeps() as f64;
        let share = 0.5 / e.substeps() as f64;
        for step in 0..steps {
            let c = &commands[step * m..(step + 1) * m];
            before.copy_from_slice(&state[..n]);
            slots[1 + n..=n + m].copy_from_slice(c);
            e.memory().load_held(state, slots);
            self.program.evaluate_held(slots);
            let (known, next) = s.split_at_mut((step + 1) * n * p);
            let next = &mut next[..n * p];
            next.copy_from_slice(&known[step * n * p..]);
            for substep in 0..e.substeps() {
                let time = |halves: usize| (2 * substep + halves) as f64 * share;
                sum.fill(0.0);
                slopes.fill(0.0);
                for (stage, (halves, weight)) in
                    [(0, 1.0), (1, 2.0), (1, 2.0), (2, 1.0)].into_iter().enumerate()
                {
                    let offset = halves as f64 * 0.5 * h;
                    for i in 0..n {
                        slots[1 + i] = if halves == 0 { state[i] } else { state[i] + offset * k[i] };
                    }
                    e.memory().load_moving(state, before, c, slots, (halves, time(halves)));
                    self.program.evaluate_moving(slots);
                    k.fill(0.0);
                    for &(i, slot, xi) in &self.rates {
                        k[i] += xi * slots[slot];
                    }
                    for &(at, slot, factor) in &self.slopes {
                        slopes[stage * n * columns + at] += factor * slots[slot];
                    }
                    for (into, &(_, slot)) in forcing[stage * direct..].iter_mut().zip(&self.direct) {
                        *into = slots[slot];
                    }
                    axpy(sum, weight, k);
                }
                axpy(&mut state[..n], h / 6.0, sum);
                set_gains(gains, slopes, n, h);
                now.copy_from_slice(next);
                transition.fill(0.0);
                for (stage, halves) in [0, 1, 1, 2].into_iter().enumerate() {
                    let gain = &gains[stage * n * n..][..n * n];
                    multiply(gain, &slopes[stage * n * columns..][..n * columns], n, product);
                    self.past(known, step, time(halves), pasts);
                    let rows = next.chunks_exact_mut(p).zip(transition.chunks_exact_mut(n));
                    for ((row, transition), product) in rows.zip(product.chunks_exact(columns)) {
                        let (by_output, by_past) = product.split_at(n);
                        axpy(transition, 1.0, by_output);
                        by_past.iter().zip(pasts.chunks_exact(p)).for_each(|(&by, s)| axpy(row, by, s));
                    }
                }
                let (f0, f1, f2, f3) = quarters(forcing);
                for (i, row) in next.chunks_exact_mut(p).enumerate() {
                    for (&by, s) in transition[i * n..].iter().zip(now.chunks_exact(p)) {
                        axpy(row, by, s);
                    }
                    let forced = self.direct.iter().zip(f0).zip(f1).zip(f2).zip(f3);
                    for (into, ((((&(output, _), f0), f1), f2), f3)) in row[n..].iter_mut().zip(forced) {
                        let gain = |stage: usize| gains[(stage * n + i) * n + output];
                        *into += gain(0) * f0 + gain(1) * f1 + gain(2) * f2 + gain(3) * f3;
                    }
                }
                e.memory().decay(state, c);
            }
            e.memory().shift(state, before, c);
            y[(step + 1) * n..(step + 2) * n].copy_from_slice(&state[..n]);
        }
    }

    /// Derivatives of the past outputs at a share `time` of the sample, interpolated like their values.
    fn past(&self, known: &[f64], step: usize, time: f64, into: &mut [f64]) {
        let (n, p) = (self.equations.outputs(), self.parameters());
        for (&(samples, variable), into) in self.pasts.iter().zip(into.chunks_exact_mut(p)) {
            into.fill(0.0);
            for (ago, weight) in [(samples, 1.0 - time), (samples - 1, time)] {
                if let Some(at) = step.checked_sub(ago) {
                    axpy(into, weight, &known[(at * n + variable) * p..][..p]);
                }
            }
        }
    }
}

/// The matrices `L` of [`Sensitivity`] from the derivatives of the stages (`outputs x columns`, outputs first).
fn set_gains(gains: &mut [f64], slopes: &[f64], n: usize, h: f64) {
    let columns = slopes.len() / (STAGES * n);
    for (stage, own, by_later) in
        [(3, h / 6.0, 0.0), (2, h / 3.0, h), (1, h / 3.0, 0.5 * h), (0, h / 6.0, 0.5 * h)]
    {
        let (before, later) = gains.split_at_mut((stage + 1) * n * n);
        let gain = &mut before[stage * n * n..];
        gain.fill(0.0);
        for i in 0..n {
            gain[i * (n + 1)] = own;
        }
        if stage + 1 < STAGES {
            let slope = &slopes[(stage + 1) * n * columns..][..n * columns];
            for (row, later) in gain.chunks_exact_mut(n).zip(later.chunks_exact(n)) {
                for (l, slope) in later.iter().zip(slope.chunks_exact(columns)) {
                    axpy(row, by_later * l, &slope[..n]);
                }
            }
        }
    }
}

/// The parts of the four stages.
fn quarters(x: &[f64]) -> (&[f64], &[f64], &[f64], &[f64]) {
    let (first, last) = x.split_at(x.len() / 2);
    let ((a, b), (c, d)) = (first.split_at(first.len() / 2), last.split_at(last.len() / 2));
    (a, b, c, d)
}

/// `into = a b` for a square matrix `a` of `n` rows.
fn multiply(a: &[f64], b: &[f64], n: usize, into: &mut [f64]) {
    let columns = b.len() / n;
    into.fill(0.0);
    for (row, a) in into.chunks_exact_mut(columns).zip(a.chunks_exact(n)) {
        a.iter().zip(b.chunks_exact(columns)).for_each(|(&a, b)| axpy(row, a, b));
    }
}

#[derive(Default)]
struct TermTable {
    index: BTreeMap<Term, usize>,
    terms: Vec<Term>,
}

impl TermTable {
    fn place(&mut self, term: &Term) -> usize {
        if let Some(&known) = self.index.get(term) {
            return known;
        }
        self.terms.push(term.clone());
        self.index.insert(term.clone(), self.terms.len() - 1);
        self.terms.len() - 1
    }
}

#[inline]
fn axpy(to: &mut [f64], a: f64, x: &[f64]) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += a * x;
    }
}

fn split<const N: usize>(mut buffer: &mut [f64], sizes: [usize; N]) -> [&mut [f64]; N] {
    sizes.map(|size| {
        let (part, rest) = core::mem::take(&mut buffer).split_at_mut(size);
        buffer = rest;
        part
    })
}
