//! Sparse regression: scaling, thresholded least squares, and conversion to physical units.

use hydroid_core::model::sparse::{Equations, Program, Shape, Signal, Term};

use super::assemble::{AssemblyOptions, assemble_with};
use super::constraints::fit_constrained;
use super::criterion::stepwise_bidirectional;
use super::error::FitError;
use super::options::{FitOptions, Optimizer, RegressionOptions, Scaling};
use super::qr::QrFactor;
use super::regression_form::RegressionForm;
use super::robust::{Loss, assemble_huber};
use super::stepwise::stepwise;
use super::stlsq::{SparseSolution, stlsq};
use super::subset::best_subset;
use crate::log::Trajectory;

/// An assembled regression, which can be solved for many thresholds.
#[derive(Clone, Debug)]
pub struct LinearRegression {
    terms: Vec<Term>,
    outputs: usize,
    inputs: usize,
    signals: Vec<Signal>,
    dt: f64,
    /// Factor with scaled columns; columns of unidentifiable terms are zero.
    plain: QrFactor,
    groups: Vec<QrFactor>,
    effective: f64,
    unidentifiable: Vec<usize>,
    /// Physical coefficient = scaled coefficient * `output_scale[i]` / `term_scale[j]`.
    term_scale: Vec<f64>,
    output_scale: Vec<f64>,
    skipped: u64,
}

/// Identified equations with residuals and contributions.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The equations, in physical units.
    pub equations: Equations,
    /// RMS residual of each equation \[unit of the output per second\].
    pub residual_rms: Vec<f64>,
    /// Contribution of each coefficient in the sense of [`Scaling`], `outputs x terms`.
    pub scaled: Vec<f64>,
}

impl LinearRegression {
    /// Assembles the regression of the runs.
    ///
    /// # Errors
    /// If there are too few rows for the terms, an output is constant, or the runs have different channels or steps.
    pub fn new(
        runs: &[&Trajectory],
        terms: Vec<Term>,
        regression: RegressionForm,
        scaling: &Scaling,
    ) -> Result<Self, FitError> {
        let options = RegressionOptions { scaling: scaling.clone(), ..RegressionOptions::default() };
        Self::with(runs, terms, regression, &options)
    }

    /// Assembles the regression of the runs with weights, a robust loss, and groups for an ensemble.
    ///
    /// # Errors
    /// As [`LinearRegression::new`]; also if the weights do not match the runs, or the loss is invalid.
    pub fn with(
        runs: &[&Trajectory],
        terms: Vec<Term>,
        regression: RegressionForm,
        options: &RegressionOptions<'_>,
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
        if terms.is_empty() {
            return Err(FitError::Setting(String::from("the library has no terms: add some")));
        }
        check_names(first, &terms)?;
        let signals = options.signals;
        let program = Program::new(&terms, outputs + inputs + signals.len())?;
        check_defined(runs, &terms, signals)?;
        check_weights(runs, options.weights, Trajectory::len)?;
        let rows = |run: &Trajectory| regression.rows(run.len(), run.dt).iter().map(|rows| rows.count).sum();
        check_weights(runs, options.row_weights, rows)?;
        let assembly = AssemblyOptions {
            signals,
            groups: options.groups,
            weights: options.weights,
            row_weights: options.row_weights,
            robust: None,
        };
        let assembled = match options.loss {
            Loss::Squares => assemble_with(&program, runs, regression, &assembly),
            Loss::Huber(k) if k > 0.0 => assemble_huber(&program, runs, regression, &assembly, k),
            Loss::Huber(k) => {
                return Err(FitError::Setting(format!("a Huber loss needs a positive bound, not {k}")));
            }
        };
        let (qr, skipped) = (assembled.qr, assembled.skipped);
        if qr.rows() <= terms.len() as u64 {
            let (rows, terms) = (qr.rows(), terms.len());
            return Err(FitError::TooFewRows { rows, skipped, terms });
        }
        if !qr.is_finite() {
            return Err(FitError::Overflow);
        }
        let rms = |column| qr.column_norm(column) / (qr.rows() as f64).sqrt();
        let (term_scale, output_scale): (Vec<f64>, Vec<f64>) = match &options.scaling {
            Scaling::Contribution => {
                let deviations = deviations(runs);
                if let Some(constant) = deviations.iter().position(|d| *d == 0.0) {
                    return Err(FitError::Constant(first.outputs.channels()[constant].name.clone()));
                }
                // The scale of a term that is zero on all rows is arbitrary.
                let scale = |j| Some(rms(j)).filter(|s| *s > 0.0).unwrap_or(1.0);
                ((0..terms.len()).map(scale).collect(), deviations)
            }
            Scaling::Variables(scales) => {
                (terms.iter().map(|term| term_scale(term, scales)).collect(), scales[..outputs].to_vec())
            }
        };
        let inverse: Vec<f64> = term_scale.iter().chain(&output_scale).map(|s| 1.0 / s).collect();
        let scaled = qr.scaled(&inverse);
        let unidentifiable = unidentifiable(&scaled, terms.len());
        // Excluded, because a ridge would distribute a coefficient among dependent terms, wrong outside the training
        // range.
        let mask: Vec<f64> =
            (0..scaled.width()).map(|j| if unidentifiable.contains(&j) { 0.0 } else { 1.0 }).collect();
        let plain = scaled.scaled(&mask);
        let groups = assembled.groups.iter().map(|group| group.scaled(&inverse).scaled(&mask)).collect();
        Ok(Self {
            terms,
            outputs,
            inputs,
            signals: signals.to_vec(),
            dt: first.dt,
            effective: regression.effective_rows(plain.rows()),
            plain,
            groups,
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

    /// Rows omitted because of a missing sample.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Unidentifiable terms: zero on all rows or linearly dependent on earlier terms. No equation contains them.
    pub fn unidentifiable(&self) -> &[usize] {
        &self.unidentifiable
    }

    /// Condition number of the given terms with columns of unit norm.
    pub fn condition(&self, terms: &[usize]) -> f64 {
        self.plain.condition(terms)
    }

    /// Effective number of independent rows: [`RegressionForm::effective_rows`].
    pub fn effective_rows(&self) -> f64 {
        self.effective
    }

    /// Upper triangular `T` with the second moments `T'T` of the library, `terms x terms`, in physical units, shrunk by
    /// `shrinkage` towards the diagonal.
    pub fn r_factor(&self, shrinkage: f64) -> Vec<f64> {
        let count = self.terms.len();
        let rows = self.rows() as f64;
        let columns: Vec<usize> = (0..count).collect();
        let library = self.plain.select(&columns);
        let penalty: Vec<f64> = columns
            .iter()
            .map(|&j| (shrinkage / (1.0 - shrinkage)).sqrt() * library.column_norm(j))
            .collect();
        let scale: Vec<f64> = self.term_scale.iter().map(|s| s * ((1.0 - shrinkage) / rows).sqrt()).collect();
        let blended = library.with_ridge(&penalty).scaled(&scale);
        columns
            .iter()
            .flat_map(|&i| (0..count).map(move |j| (i, j)))
            .map(|(i, j)| blended.get(i, j))
            .collect()
    }

    pub(super) fn groups(&self) -> &[QrFactor] {
        &self.groups
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Factor from scaled to physical coefficient `(equation, term)`.
    pub(super) fn unit(&self, equation: usize, term: usize) -> f64 {
        self.output_scale[equation] / self.term_scale[term]
    }

    /// RMS residual of each equation for least squares on all terms, in standard deviations of the output per second.
    pub fn least_squares_rms(&self) -> Vec<f64> {
        let columns: Vec<usize> =
            (0..self.terms.len()).filter(|j| !self.unidentifiable.contains(j)).collect();
        let rows = (self.rows() as f64).sqrt();
        (0..self.outputs).map(|i| self.plain.solve(&columns, self.terms.len() + i).residual / rows).collect()
    }

    /// Solves the sparse regression.
    ///
    /// # Errors
    /// If no coefficients satisfy the constraints, or the coefficients are not finite.
    pub fn fit(&self, options: &FitOptions) -> Result<Fit, FitError> {
        let solutions = self.solve(&self.plain, options)?;
        self.in_physical_units(solutions, options.substeps)
    }

    /// Scaled coefficients of all equations from a QR factor with the columns of this regression.
    pub(super) fn solve(
        &self,
        plain: &QrFactor,
        options: &FitOptions,
    ) -> Result<Vec<SparseSolution>, FitError> {
        let ridged = self.ridged(plain, options.ridge);
        if options.constraints.is_empty() {
            return Ok((0..self.outputs)
                .map(|i| self.select(plain, &ridged, i, options.optimizer))
                .collect());
        }
        Ok(fit_constrained(self, plain, &ridged, options)?)
    }

    pub(super) fn select(
        &self,
        plain: &QrFactor,
        ridged: &QrFactor,
        equation: usize,
        optimizer: Optimizer,
    ) -> SparseSolution {
        let count = self.terms.len();
        let target = count + equation;
        match optimizer {
            Optimizer::Stepwise(tolerance) => stepwise(ridged, count, target, tolerance),
            Optimizer::Criterion(criterion) => {
                stepwise_bidirectional(ridged, count, target, criterion, self.effective)
            }
            Optimizer::Stlsq(threshold) => stlsq(plain, ridged, count, target, threshold),
            Optimizer::Subset => best_subset(plain, count, target, self.effective),
        }
    }

    /// Coefficients of the best subset of terms of one equation, in physical units.
    pub(super) fn best_subset(&self, equation: usize) -> Vec<f64> {
        let count = self.terms.len();
        let found = best_subset(&self.plain, count, count + equation, self.effective);
        found.coefficients.iter().enumerate().map(|(j, c)| c * self.unit(equation, j)).collect()
    }

    /// RMS residual of coefficients in physical units, in that of the output per second.
    pub(super) fn residual_rms(&self, equation: usize, coefficients: &[f64]) -> f64 {
        let columns: Vec<usize> = (0..self.terms.len()).collect();
        let scaled: Vec<f64> =
            coefficients.iter().enumerate().map(|(j, c)| c / self.unit(equation, j)).collect();
        let residual = self.plain.residual(&columns, &scaled, columns.len() + equation);
        residual * self.output_scale[equation] / (self.rows() as f64).sqrt()
    }

    /// The fit with given coefficients in physical units, `outputs x terms`.
    pub(super) fn with_coefficients(&self, coefficients: Vec<f64>, substeps: usize) -> Result<Fit, FitError> {
        let count = self.terms.len();
        let of = |i: usize| &coefficients[i * count..(i + 1) * count];
        let residual_rms = (0..self.outputs).map(|i| self.residual_rms(i, of(i))).collect();
        let scaled = |i: usize| of(i).iter().enumerate().map(move |(j, c)| c / self.unit(i, j));
        let scaled = (0..self.outputs).flat_map(scaled).collect();
        let equations = Equations::with_signals(
            self.terms.clone(),
            coefficients,
            self.outputs,
            self.inputs,
            self.signals.clone(),
            self.dt,
            substeps,
        )?;
        Ok(Fit { equations, residual_rms, scaled })
    }

    fn ridged(&self, plain: &QrFactor, ridge: f64) -> QrFactor {
        if ridge == 0.0 {
            return plain.clone();
        }
        let weight = (ridge * self.rows() as f64).sqrt();
        let count = self.terms.len();
        // The penalty must not make excluded terms active.
        let weights: Vec<f64> = (0..plain.width())
            .map(|j| if j < count && plain.column_norm(j) > 0.0 { weight } else { 0.0 })
            .collect();
        plain.with_ridge(&weights)
    }

    fn in_physical_units(&self, solutions: Vec<SparseSolution>, substeps: usize) -> Result<Fit, FitError> {
        let coefficients = solutions.into_iter().enumerate().flat_map(|(i, solution)| {
            let of = move |(j, c): (usize, f64)| c * self.unit(i, j);
            solution.coefficients.into_iter().enumerate().map(of)
        });
        self.with_coefficients(coefficients.collect(), substeps)
    }
}

/// Refuses channels whose name is a number, or that of another term: their equations could not be read.
fn check_names(run: &Trajectory, terms: &[Term]) -> Result<(), FitError> {
    let channels = run.outputs.channels().iter().chain(run.inputs.channels());
    let names: Vec<&str> = channels.map(|channel| channel.name.as_str()).collect();
    let places: Vec<String> = (0..names.len()).map(|place| format!("channel {place}")).collect();
    let other = |(term, name): (&Term, String)| {
        let channel = names.iter().position(|of| *of == name)?;
        (term.name(&places) != places[channel]).then_some(name)
    };
    let number = names.iter().find(|name| name.trim().parse::<f64>().is_ok()).map(|name| (*name).to_owned());
    let name = number.or_else(|| terms.iter().map(|term| (term, term.name(&names))).find_map(other));
    name.map_or(Ok(()), |name| Err(FitError::Name(name)))
}

/// Refuses undefined terms. A varying signal must not pass a pole between samples, where rows are evaluated.
fn check_defined(runs: &[&Trajectory], terms: &[Term], signals: &[Signal]) -> Result<(), FitError> {
    let undefined = |shape: Shape| matches!(shape, Shape::Reciprocal | Shape::Log);
    for term in terms {
        for factor in term.factors().iter().filter(|factor| undefined(factor.shape)) {
            let bad = |value: f64| match factor.shape {
                Shape::Reciprocal => value == 0.0,
                _ => value <= 0.0,
            };
            for run in runs {
                let variable = usize::from(factor.variable);
                let Some((values, held)) = series(run, variable, signals) else { continue };
                let passes = |pair: &[f64]| !held && pair[0] * pair[1] < 0.0;
                let at = values.iter().position(|value| bad(*value));
                let Some(k) = at.or_else(|| values.windows(2).position(passes)) else { continue };
                let channels = run.outputs.channels().iter().chain(run.inputs.channels());
                let mut names: Vec<String> = channels.map(|channel| channel.name.clone()).collect();
                let own: Vec<String> = signals.iter().map(|signal| signal.name(&names, run.dt)).collect();
                names.extend(own);
                let borrowed: Vec<&str> = names.iter().map(String::as_str).collect();
                return Err(FitError::Undefined {
                    term: term.name(&borrowed),
                    channel: names[variable].clone(),
                    run: run.name.clone(),
                    time_s: run.t0 + k as f64 * run.dt,
                });
            }
        }
    }
    Ok(())
}

/// A variable at the samples of a run, and whether it is held between samples.
fn series(run: &Trajectory, variable: usize, signals: &[Signal]) -> Option<(Vec<f64>, bool)> {
    let (n, m) = (run.outputs.width(), run.inputs.width());
    if variable < n {
        return Some((run.outputs.column(variable).collect(), false));
    }
    if variable < n + m {
        return Some((run.inputs.column(variable - n).collect(), true));
    }
    let signal = signals.get(variable - n - m)?;
    let (source, _) = series(run, usize::from(signal.source()), &[])?;
    Some((signal.series(&source, run.dt), signal.is_held(n)))
}

fn check_weights(
    runs: &[&Trajectory],
    weights: &[Vec<f64>],
    count: impl Fn(&Trajectory) -> usize,
) -> Result<(), FitError> {
    if weights.is_empty() {
        return Ok(());
    }
    let sound = |run: &Trajectory, weights: &[f64]| {
        weights.len() == count(run) && weights.iter().all(|w| w.is_finite() && *w >= 0.0)
    };
    for (index, run) in runs.iter().enumerate() {
        if !weights.get(index).is_some_and(|weights| sound(run, weights)) {
            return Err(FitError::Weights(run.name.clone()));
        }
    }
    Ok(())
}

/// Columns among the first `terms` that are zero or linearly dependent on earlier columns.
fn unidentifiable(qr: &QrFactor, terms: usize) -> Vec<usize> {
    let (present, mut missing): (Vec<usize>, Vec<usize>) = (0..terms).partition(|&j| qr.column_norm(j) > 0.0);
    let dependent = qr.solve(&present, terms).dependent;
    missing.extend(dependent.into_iter().map(|position| present[position]));
    missing.sort_unstable();
    missing
}

fn term_scale(term: &Term, scales: &[f64]) -> f64 {
    term.factors().iter().map(|f| scales[usize::from(f.variable)].powi(f.shape.degree())).product()
}

/// Standard deviation of each output over all runs; zero if it varies only by rounding errors.
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
