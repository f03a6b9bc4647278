//! Parameter vector of the refinement.

use hydroid_core::model::sparse::{Equations, EquationsError, Factor, Gate, Real, Shape, Signal, Term};

use crate::sindy::structure::{GateSpec, Lag};

/// Refined parameters: coefficients, logarithms of time constants, then centre and logarithm of the slope of each gate.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    base: Equations,
    places: Vec<usize>,
    lags: Vec<usize>,
    gates: Vec<(u16, Gate)>,
}

impl Parameters {
    pub(super) fn new(base: &Equations, lags: &[Lag], gates: &[GateSpec]) -> Self {
        let free = |signal: &Signal| match *signal {
            Signal::Lag { input, time_constant_s } => lags.iter().any(|lag| {
                base.outputs() + lag.input == usize::from(input)
                    && Real(lag.time_constant_s) == time_constant_s
            }),
            Signal::Past { .. } => false,
        };
        let places: Vec<usize> =
            (0..base.coefficients().len()).filter(|&place| base.coefficients()[place] != 0.0).collect();
        let count = base.terms().len();
        let mut known = Vec::new();
        for &place in &places {
            for factor in base.terms()[place % count].factors() {
                if let Shape::Above(gate) | Shape::Below(gate) = factor.shape
                    && gates.iter().any(|g| g.output == usize::from(factor.variable) && g.gate == gate)
                    && !known.contains(&(factor.variable, gate))
                {
                    known.push((factor.variable, gate));
                }
            }
        }
        let lags = (0..base.signals().len()).filter(|&i| free(&base.signals()[i])).collect();
        Self { base: base.clone(), places, lags, gates: known }
    }

    pub(super) fn fixed(base: &Equations) -> Self {
        Self { base: base.clone(), places: Vec::new(), lags: Vec::new(), gates: Vec::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.places.len() + self.nonlinear()
    }

    pub(super) fn nonlinear(&self) -> usize {
        self.lags.len() + 2 * self.gates.len()
    }

    pub(super) fn terms(&self) -> usize {
        self.base.terms().len()
    }

    pub(super) fn places(&self) -> &[usize] {
        &self.places
    }

    pub(super) fn start(&self) -> Vec<f64> {
        let coefficients = self.places.iter().map(|&place| self.base.coefficients()[place]);
        let lags = self.lags.iter().map(|&i| match self.base.signals()[i] {
            Signal::Lag { time_constant_s, .. } => time_constant_s.0.ln(),
            Signal::Past { .. } => 0.0,
        });
        let gates = self.gates.iter().flat_map(|(_, gate)| [gate.centre.0, gate.slope.0.ln()]);
        coefficients.chain(lags).chain(gates).collect()
    }

    /// Scales of the finite differences, one for each parameter that is not a coefficient.
    pub(super) fn sizes(&self) -> Vec<f64> {
        let lags = self.lags.iter().map(|_| 1.0);
        lags.chain(self.gates.iter().flat_map(|(_, gate)| [1.0 / gate.slope.0, 1.0])).collect()
    }

    pub(super) fn equations(&self, values: &[f64]) -> Result<Equations, EquationsError> {
        let (coefficients, nonlinear) = values.split_at(self.places.len());
        let (lags, gates) = nonlinear.split_at(self.lags.len());
        let mut table = self.base.coefficients().to_vec();
        for (&place, &value) in self.places.iter().zip(coefficients) {
            table[place] = value;
        }
        let mut signals = self.base.signals().to_vec();
        for (&i, ln) in self.lags.iter().zip(lags) {
            if let Signal::Lag { time_constant_s, .. } = &mut signals[i] {
                *time_constant_s = Real(ln.exp());
            }
        }
        let moved: Vec<Gate> = gates
            .chunks_exact(2)
            .map(|pair| Gate { centre: Real(pair[0]), slope: Real(pair[1].exp()) })
            .collect();
        let terms = self.base.terms().iter().map(|term| self.with_gates(term, &moved)).collect();
        let b = &self.base;
        Equations::with_signals(terms, table, b.outputs(), b.inputs(), signals, b.dt(), b.substeps())
    }

    fn with_gates(&self, term: &Term, moved: &[Gate]) -> Term {
        if self.gates.is_empty() {
            return term.clone();
        }
        let now = |variable: u16, gate: Gate| {
            let at = self.gates.iter().position(|known| *known == (variable, gate));
            at.map_or(gate, |at| moved[at])
        };
        let factors = term.factors().iter().map(|&Factor { variable, shape }| {
            let shape = match shape {
                Shape::Above(gate) => Shape::Above(now(variable, gate)),
                Shape::Below(gate) => Shape::Below(now(variable, gate)),
                other => other,
            };
            Factor { variable, shape }
        });
        Term::new(factors.collect())
    }
}
