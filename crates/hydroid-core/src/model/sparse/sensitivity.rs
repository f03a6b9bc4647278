//! Derivatives of rollouts with respect to coefficients and initial outputs: the variational equation.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::equations::{Equations, EquationsError};
use super::program::{Program, ProgramError};
use super::signal::Signal;
use super::term::Term;
use crate::predict::rollout_steps;

/// Rollouts of equations with their derivatives with respect to parameters `p`: the outputs at the start, then some of
/// the coefficients.
///
/// With `dy/dt = f(y, c, s, Xi)` and `S = dy/dp`, the variational equation is `dS/dt = df/dy S + df/ds ds/dp + df/dp`.
/// It is integrated by the same Runge-Kutta steps as [`Equations::step`], so that `S` is the exact derivative of the
/// numerical rollout (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, 1993, section I.14). Past
/// outputs among the signals carry `S` of their time; the past before the start does not depend on `p`.
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

    fn sizes(&self) -> [usize; 10] {
        let (n, p) = (self.equations.outputs(), self.parameters());
        let (columns, slots) = (n + self.pasts.len(), self.program.slots());
        [self.equations.state_len(), slots, n, n, n, n * columns, n * p, n * p, columns * p, n * p]
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
        let [state, slots, k, sum, before, slope, now, total, stage, rate] = split(scratch, self.sizes());
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
            now.copy_from_slice(&known[step * n * p..]);
            for substep in 0..e.substeps() {
                sum.fill(0.0);
                total.fill(0.0);
                for (halves, weight) in [(0, 1.0), (1, 2.0), (1, 2.0), (2, 1.0)] {
                    let offset = halves as f64 * 0.5 * h;
                    for i in 0..n {
                        slots[1 + i] = if halves == 0 { state[i] } else { state[i] + offset * k[i] };
                    }
                    for (to, (s, r)) in stage.iter_mut().zip(now.iter().zip(&*rate)) {
                        *to = if halves == 0 { *s } else { s + offset * r };
                    }
                    let time = (2 * substep + halves) as f64 * share;
                    e.memory().load_moving(state, before, c, slots, (halves, time));
                    self.past(known, step, time, &mut stage[n * p..]);
                    self.program.evaluate_moving(slots);
                    k.fill(0.0);
                    for &(i, slot, xi) in &self.rates {
                        k[i] += xi * slots[slot];
                    }
                    slope.fill(0.0);
                    for &(at, slot, factor) in &self.slopes {
                        slope[at] += factor * slots[slot];
                    }
                    self.rate(slope, stage, slots, rate);
                    axpy(sum, weight, k);
                    axpy(total, weight, rate);
                }
                axpy(&mut state[..n], h / 6.0, sum);
                axpy(now, h / 6.0, total);
                e.memory().decay(state, c);
            }
            e.memory().shift(state, before, c);
            next[..n * p].copy_from_slice(now);
            y[(step + 1) * n..(step + 2) * n].copy_from_slice(&state[..n]);
        }
    }

    /// `df/dy S + df/ds ds/dp + df/dp`.
    fn rate(&self, slope: &[f64], stage: &[f64], slots: &[f64], rate: &mut [f64]) {
        let (n, p) = (self.equations.outputs(), self.parameters());
        rate.fill(0.0);
        for (row, slope) in rate.chunks_exact_mut(p).zip(slope.chunks_exact(n + self.pasts.len())) {
            for (&factor, s) in slope.iter().zip(stage.chunks_exact(p)) {
                if factor != 0.0 {
                    axpy(row, factor, s);
                }
            }
        }
        for (position, &(output, slot)) in self.direct.iter().enumerate() {
            rate[output * p + n + position] += slots[slot];
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
