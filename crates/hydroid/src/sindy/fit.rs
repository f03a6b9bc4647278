//! From runs to equations: scaling, thresholded regression, and back to physical units.

use hydroid_core::model::sparse::{Equations, EquationsError, Program, ProgramError, Signal, Term};
use serde::{Deserialize, Serialize};

use super::assemble::{Assembled, assemble};
use super::kernel::Regression;
use super::stepwise::stepwise;
use super::stlsq::{SparseSolution, Stlsq, stlsq};
use super::triangle::Triangle;
use crate::log::Trajectory;

/// What a coefficient is measured by when it is compared with the threshold.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Scaling {
    /// A term counts by what it contributes: the RMS of `xi theta` over the training data in standard
    /// deviations of the output per second. The same threshold then means the same for every channel,
    /// whatever the units (a propeller in newtons has coefficients of 0.005 that matter).
    #[default]
    Contribution,
    /// Every variable is divided by a scale of its own, and the coefficients of the scaled equations are
    /// compared as they are. One scale for each output, then for each input.
    Variables(Vec<f64>),
}

/// How terms are selected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Optimizer {
    /// Backward elimination: a term leaves when that raises the residual sum of squares by less than this
    /// fraction, or by less than 1e-5 of the whole right-hand side: in noise-free data the discretisation of
    /// the derivative leaves that much, and terms would be kept to explain it. Coefficients are the ridge
    /// solution on the terms that remain.
    Stepwise(f64),
    /// Sequentially thresholded least squares: coefficients below this, in the units of [`Scaling`], are
    /// removed. Ridge acts on the selection only, coefficients are plain least squares.
    Stlsq(f64),
}

/// How to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// How terms are selected.
    pub optimizer: Optimizer,
    /// Ridge penalty for each row of the regression, on scaled columns.
    pub ridge: f64,
    /// Integration steps in one sample of the resulting equations.
    pub substeps: usize,
}

/// Why no equations could be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Fewer rows than unknowns.
    #[error(
        "{rows} usable regression rows for {terms} terms: too few{}",
        if *skipped > *rows {
            format!(
                " ({skipped} more touch a missing value). Put sensors of different rates on one clock with --dt, the step of the slowest; or shorten the window"
            )
        } else {
            String::from(". Give longer logs, a shorter window, or a smaller library (degree)")
        }
    )]
    TooFewRows {
        /// Rows that touch no missing sample.
        rows: u64,
        /// Rows that do.
        skipped: u64,
        /// Terms of the library.
        terms: usize,
    },
    /// Runs that do not belong together.
    #[error("runs '{first}' and '{second}' differ in sample time or channels: prepare them together")]
    DifferentRuns {
        /// The first run.
        first: String,
        /// The run that differs from it.
        second: String,
    },
    /// Numbers that cannot be computed with.
    #[error(
        "products of the channels leave the range of floating-point numbers: bring the channels to sensible units, or choose a smaller degree"
    )]
    Overflow,
    /// An output that does not vary has no equation.
    #[error("output '{0}' does not vary in the training runs: there is nothing to identify. Leave it out")]
    Constant(String),
    /// The library is too large.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The fit gave no usable equations.
    #[error("the fit gave unusable equations: {0}")]
    Equations(#[from] EquationsError),
}

/// A regression that has been streamed once and can be solved for many thresholds.
#[derive(Clone, Debug)]
pub struct Prepared {
    terms: Vec<Term>,
    outputs: usize,
    inputs: usize,
    signals: Vec<Signal>,
    dt: f64,
    /// Factor with scaled columns; those of unidentifiable terms are zero.
    plain: Triangle,
    unidentifiable: Vec<usize>,
    /// Physical coefficient = scaled coefficient x `output_scale[i]` / `term_scale[j]`.
    term_scale: Vec<f64>,
    output_scale: Vec<f64>,
    skipped: u64,
}

/// Identified equations and how they came about.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The equations, in physical units.
    pub equations: Equations,
    /// RMS of each equation's residual \[unit of the output per second\].
    pub residual_rms: Vec<f64>,
    /// Contribution of each coefficient in the sense of [`Scaling`], `outputs x terms`.
    pub scaled: Vec<f64>,
}

impl Prepared {
    /// Streams the runs through the library into a triangle.
    ///
    /// # Errors
    /// If there are too few rows for the terms, an output does not vary, or the runs do not belong together.
    pub fn new(
        runs: &[&Trajectory],
        terms: Vec<Term>,
        regression: Regression,
        scaling: &Scaling,
    ) -> Result<Self, FitError> {
        Self::with_signals(runs, terms, &[], regression, scaling)
    }

    /// The same with signals, whose variables come after outputs and inputs.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_signals(
        runs: &[&Trajectory],
        terms: Vec<Term>,
        signals: &[Signal],
        regression: Regression,
        scaling: &Scaling,
    ) -> Result<Self, FitError> {
        let Some(first) = runs.first() else {
            return Err(FitError::TooFewRows { rows: 0, skipped: 0, terms: terms.len() });
        };
        let (outputs, inputs) = (first.outputs.width(), first.inputs.width());
        let alike = |run: &&&Trajectory| {
            (run.outputs.width(), run.inputs.width()) == (outputs, inputs)
                && (run.dt / first.dt - 1.0).abs() <= 1e-6
        };
        if let Some(other) = runs.iter().find(|run| !alike(run)) {
            return Err(FitError::DifferentRuns { first: first.name.clone(), second: other.name.clone() });
        }
        let program = Program::new(&terms, outputs + inputs + signals.len())?;
        let Assembled { triangle, skipped } = assemble(&program, runs, signals, regression);
        if triangle.rows() <= terms.len() as u64 {
            let (rows, terms) = (triangle.rows(), terms.len());
            return Err(FitError::TooFewRows { rows, skipped, terms });
        }
        if !triangle.is_finite() {
            return Err(FitError::Overflow);
        }
        let rms = |column| triangle.column_norm(column) / (triangle.rows() as f64).sqrt();
        let (term_scale, output_scale): (Vec<f64>, Vec<f64>) = match scaling {
            Scaling::Contribution => {
                let deviations = deviations(runs);
                if let Some(constant) = deviations.iter().position(|d| *d == 0.0) {
                    return Err(FitError::Constant(first.outputs.channels()[constant].name.clone()));
                }
                // A term that is zero throughout keeps its place with any scale.
                let scale = |j| Some(rms(j)).filter(|s| *s > 0.0).unwrap_or(1.0);
                ((0..terms.len()).map(scale).collect(), deviations)
            }
            Scaling::Variables(scales) => {
                (terms.iter().map(|term| term_scale(term, scales)).collect(), scales[..outputs].to_vec())
            }
        };
        let inverse: Vec<f64> = term_scale.iter().chain(&output_scale).map(|s| 1.0 / s).collect();
        let scaled = triangle.scaled(&inverse);
        let unidentifiable = unidentifiable(&scaled, terms.len());
        // What the data cannot tell from earlier terms takes no part: a ridge would share a coefficient
        // out among twins, and a vessel that leaves the training range would tell them apart.
        let mask: Vec<f64> =
            (0..scaled.width()).map(|j| if unidentifiable.contains(&j) { 0.0 } else { 1.0 }).collect();
        let plain = scaled.scaled(&mask);
        Ok(Self {
            terms,
            outputs,
            inputs,
            signals: signals.to_vec(),
            dt: first.dt,
            plain,
            unidentifiable,
            term_scale,
            output_scale,
            skipped,
        })
    }

    /// The library.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Rows of the regression.
    pub fn rows(&self) -> u64 {
        self.plain.rows()
    }

    /// Rows left out because a sample in them was missing.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Terms that are zero throughout or depend on earlier terms to rounding: nobody can identify them
    /// from these runs, and no equation has them.
    pub fn unidentifiable(&self) -> &[usize] {
        &self.unidentifiable
    }

    /// Condition number of some terms with columns of unit norm.
    pub fn condition(&self, terms: &[usize]) -> f64 {
        self.plain.condition(terms)
    }

    /// Solves for sparse equations.
    ///
    /// # Errors
    /// If the coefficients are not finite numbers.
    pub fn fit(&self, options: &FitOptions) -> Result<Fit, FitError> {
        let ridged = self.ridged(options.ridge);
        let count = self.terms.len();
        let solutions = (0..self.outputs)
            .map(|i| match options.optimizer {
                Optimizer::Stepwise(tolerance) => stepwise(&ridged, count, count + i, tolerance),
                Optimizer::Stlsq(threshold) => {
                    let settings = Stlsq { threshold, ..Stlsq::default() };
                    stlsq(&self.plain, &ridged, count, count + i, settings)
                }
            })
            .collect();
        self.finish(solutions, options.substeps)
    }

    fn ridged(&self, ridge: f64) -> Triangle {
        if ridge == 0.0 {
            return self.plain.clone();
        }
        let weight = (ridge * self.rows() as f64).sqrt();
        let count = self.terms.len();
        let weights: Vec<f64> =
            (0..self.plain.width()).map(|j| if j < count { weight } else { 0.0 }).collect();
        self.plain.with_ridge(&weights)
    }

    /// Back to physical units.
    fn finish(&self, solutions: Vec<SparseSolution>, substeps: usize) -> Result<Fit, FitError> {
        let count = self.terms.len();
        let mut coefficients = Vec::with_capacity(self.outputs * count);
        let mut scaled = Vec::with_capacity(self.outputs * count);
        let mut residual_rms = Vec::with_capacity(self.outputs);
        let columns: Vec<usize> = (0..count).collect();
        for (i, (solution, scale)) in solutions.into_iter().zip(&self.output_scale).enumerate() {
            // Of the data, not of the penalty that a ridge adds to them.
            let residual = self.plain.residual(&columns, &solution.coefficients, count + i);
            coefficients
                .extend(solution.coefficients.iter().zip(&self.term_scale).map(|(c, s)| c * scale / s));
            scaled.extend(solution.coefficients);
            residual_rms.push(residual * scale / (self.rows() as f64).sqrt());
        }
        let terms = self.terms.clone();
        let equations = Equations::with_signals(
            terms,
            coefficients,
            self.outputs,
            self.inputs,
            self.signals.clone(),
            self.dt,
            substeps,
        )?;
        Ok(Fit { equations, residual_rms, scaled })
    }
}

/// Columns among the first `terms` that are zero or depend on earlier ones.
fn unidentifiable(triangle: &Triangle, terms: usize) -> Vec<usize> {
    let (present, mut missing): (Vec<usize>, Vec<usize>) =
        (0..terms).partition(|&j| triangle.column_norm(j) > 0.0);
    let dependent = triangle.solve(&present, terms).dependent;
    missing.extend(dependent.into_iter().map(|position| present[position]));
    missing.sort_unstable();
    missing
}

/// Scale of a term whose variables are divided by their scales.
fn term_scale(term: &Term, scales: &[f64]) -> f64 {
    term.factors().iter().map(|f| scales[usize::from(f.variable)].powi(f.shape.degree())).product()
}

/// Standard deviation of each output over all runs; zero where it does not vary beyond rounding.
fn deviations(runs: &[&Trajectory]) -> Vec<f64> {
    let width = runs.first().map_or(0, |run| run.outputs.width());
    (0..width)
        .map(|c| {
            let values = || runs.iter().flat_map(|run| run.outputs.column(c)).filter(|v| v.is_finite());
            let (sum, count) = values().fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            let mean = sum / count;
            let deviation = (values().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
            if deviation > 1e-12 * mean.abs() { deviation } else { 0.0 }
        })
        .collect()
}
