//! Tables of hydrodynamic derivatives in LaTeX, with the packages amsmath and booktabs.

use std::fmt::Write as _;

use hydroid::key::key;
use hydroid::model::{Model, UnitProduct, latex_estimate, latex_text, latex_unit};
use hydroid::plant::described_inputs;

use super::derivative::unit_text;
use super::vessel::deviations;
use super::{Centripetal, CoefficientOptions, Coefficients, Derivative, Force, Inertia, Variable};
use crate::name::comment;
use crate::{ExportError, File, Options, identifier};

const FORMAT: &str = "latex";

/// Tables of the coefficients as `NAME.tex`: mass, derivatives and actuators in SI units with standard deviations, and in the
/// prime system with length and speed. With a speed `U` the derivatives of a straight course are added, which published
/// derivatives from tests with models are:
///
/// ```text
/// Y_v(U) = d Y/dv    Y_r(U) - m U    N_v(U) = d N/dv    N_r(U) - m x_g U        at nu = (U, 0, 0)
/// ```
///
/// They contain the Coriolis and centripetal forces of mass and added mass, and the forces of no actuators. Equations of
/// motion without a given mass become an `align*` and the table of their coefficients.
///
/// # Errors
/// See [`Coefficients::of`]; or if length, speed or density are not positive.
pub fn latex(
    model: &Model,
    options: &Options,
    coefficient_options: &CoefficientOptions,
) -> Result<Vec<File>, ExportError> {
    check(model, coefficient_options)?;
    let text = if let (None, Some(named)) = (coefficient_options.inertia, model.equations()) {
        let without = ["Accelerations: without the mass there are no derivatives."];
        let head = preamble(model, &without);
        format!("{head}{}{}", named.equations_latex(), named.coefficients_latex())
    } else {
        let coefficients = Coefficients::of(model, coefficient_options, FORMAT)?;
        tables(model, &coefficients, coefficient_options)
    };
    Ok(vec![File { name: format!("{}.tex", identifier(&options.name)), content: text.into_bytes() }])
}

fn check(model: &Model, options: &CoefficientOptions) -> Result<(), ExportError> {
    for (what, value, unit) in [
        ("length", options.length, "m"),
        ("speed", options.speed, "m/s"),
        ("density of the water", Some(options.water_density), "kg/m^3"),
    ] {
        let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) else { continue };
        return Err(ExportError::Unsupported {
            model: model.title(),
            format: FORMAT,
            reason: format!("the {what} is {value}"),
            remedy: format!("give a positive number [{unit}]"),
        });
    }
    Ok(())
}

fn preamble(model: &Model, lines: &[&str]) -> String {
    let mut out = format!(
        "% Hydrodynamic coefficients of {}, written by hydroid {}. Packages: amsmath, booktabs.\n",
        comment(&model.description.name),
        env!("CARGO_PKG_VERSION")
    );
    for line in lines {
        let _ = writeln!(out, "% {line}");
    }
    for (input, about) in described_inputs(model) {
        let _ = writeln!(out, "% Input {}: {}", comment(&input), comment(&about));
    }
    out
}

/// Length, speed and density of the prime system.
struct Prime {
    length: Option<f64>,
    speed: Option<f64>,
    density: f64,
}

impl Prime {
    /// What a quantity is divided by: `rho/2 L^p U^q`; none where length or speed are not known.
    fn divisor(&self, [p, q]: [i32; 2]) -> Option<f64> {
        let speed = if q == 0 { 1.0 } else { self.speed?.powi(q) };
        Some(0.5 * self.density * self.length?.powi(p) * speed)
    }
}

#[derive(Default)]
struct Table {
    rows: String,
}

impl Table {
    /// A row; the symbol is LaTeX in mathematics mode.
    fn row(&mut self, symbol: &str, value: f64, deviation: Option<f64>, unit: &str, divisor: Option<f64>) {
        let prime = divisor.map(|by| format!("${}$", latex_estimate(value / by, deviation.map(|d| d / by))));
        let unit = latex_unit(&UnitProduct::of_channel("", unit));
        let _ = writeln!(
            self.rows,
            "  ${symbol}$ & ${}$ & ${unit}$ & {} \\\\",
            latex_estimate(value, deviation),
            prime.as_deref().unwrap_or("--")
        );
    }

    fn derivative(&mut self, symbol: &str, of: &Derivative, prime: &Prime) {
        let divisor = prime.divisor(of.prime_powers());
        self.row(symbol, of.value, of.deviation, &unit_text(of.unit()), divisor);
    }

    fn text(&self, title: &str) -> String {
        format!(
            "\n% {title}\n\\begin{{tabular}}{{lrll}}\n  \\toprule\n  Coefficient & Value & Unit & Prime system \\\\\n  \\midrule\n{}  \
             \\bottomrule\n\\end{{tabular}}\n",
            self.rows
        )
    }
}

fn tables(model: &Model, coefficients: &Coefficients, options: &CoefficientOptions) -> String {
    let prime = Prime {
        length: options.length.or(coefficients.size.map(|[length, ..]| length)),
        speed: options.speed,
        density: coefficients.water_density,
    };
    let mut out = head(model, coefficients, &prime);
    let inertia = coefficients.inertia;
    let mut table = Table::default();
    let [mass, i_z, x_g] = coefficients.inertia_deviations;
    table.row("m", inertia.mass, mass, "kg", prime.divisor([3, 0]));
    table.row("x_g", inertia.x_g, x_g, "m", prime.length);
    table.row("I_z", inertia.i_z, i_z, "kg m^2", prime.divisor([5, 0]));
    if coefficients.cross_flow.0 != 0.0 {
        table.row("C_d", coefficients.cross_flow.0, coefficients.cross_flow.1, "1", Some(1.0));
    }
    let mut all = coefficients.derivatives.clone();
    all.sort_by_key(|derivative| (derivative.force, derivative.variable));
    for derivative in &all {
        table.derivative(&derivative.latex(), derivative, &prime);
    }
    out.push_str(
        &table.text("Mass and hydrodynamic derivatives; standard deviations of estimates behind \\pm"),
    );
    if let Some(speed) = options.speed {
        let mut table = Table::default();
        for (symbol, derivative) in straight_course(coefficients, speed) {
            table.derivative(&symbol, &derivative, &prime);
        }
        out.push_str(
            &table.text(&format!(
                "Linear derivatives of a straight course at U = {speed} m/s, without actuators"
            )),
        );
    }
    out.push_str(&actuators(model));
    out
}

fn head(model: &Model, coefficients: &Coefficients, prime: &Prime) -> String {
    let centripetal = match coefficients.centripetal {
        Centripetal::Full => "Coriolis and centripetal forces of the added mass come beside them.",
        Centripetal::WithoutMunk => {
            "Coriolis and centripetal forces of the added mass come beside them, without the Munk moment."
        }
        Centripetal::InDerivatives => "They contain the Coriolis and centripetal forces of the added mass.",
    };
    let mut out = preamble(
        model,
        &[
            "Frame forward, starboard, down; derivatives as SNAME (1950) defines them: resistance is negative.",
            centripetal,
        ],
    );
    if coefficients.cross_flow.0 != 0.0 {
        out.push_str(
            "% Cross-flow drag: dY = -rho/2 T C_d |v + x r| (v + x r) dx over the length, dN = x dY.\n",
        );
    }
    let _ = match (prime.length, prime.speed) {
        (None, _) => {
            writeln!(out, "% Prime system: it needs a length, from the vessel file or {}.", key("length"))
        }
        (Some(length), None) => writeln!(
            out,
            "% Prime system: L = {length} m, rho = {} kg/m^3; linear derivatives need a {}.",
            prime.density,
            key("speed")
        ),
        (Some(length), Some(speed)) => {
            writeln!(out, "% Prime system: L = {length} m, U = {speed} m/s, rho = {} kg/m^3.", prime.density)
        }
    };
    for force in &coefficients.other_forces {
        let _ = writeln!(out, "% Not in the tables: {}", comment(force));
    }
    out
}

/// Linear derivatives at `nu = (U, 0, 0)` with their symbols. `Y` and `N` by `r` contain the centripetal forces of the mass.
fn straight_course(coefficients: &Coefficients, speed: f64) -> Vec<(String, Derivative)> {
    let all = coefficients.with_centripetal();
    let Inertia { mass, x_g, .. } = coefficients.inertia;
    let mut rows = Vec::new();
    for (force, j, symbol, of_mass) in [
        (Force::X, 0, "X_u(U)", 0.0),
        (Force::Y, 1, "Y_v(U)", 0.0),
        (Force::Y, 2, "Y_r(U) - m U", mass * speed),
        (Force::N, 1, "N_v(U)", 0.0),
        (Force::N, 2, "N_r(U) - m x_g U", mass * x_g * speed),
    ] {
        let of = |derivative: &&Derivative| derivative.force == force;
        let parts: Vec<(f64, Option<f64>)> = all
            .iter()
            .filter(of)
            .map(|d| {
                let slope = d.variable.slope(j, speed);
                (d.value * slope, d.deviation.map(|deviation| deviation * slope.abs()))
            })
            .collect();
        let value = parts.iter().map(|(value, _)| value).sum::<f64>() - of_mass;
        let deviation = parts.iter().filter_map(|(_, deviation)| *deviation).fold(0.0, f64::hypot);
        let variable = Variable::product(&[j]);
        let derivative =
            Derivative { force, variable, value, deviation: (deviation > 0.0).then_some(deviation) };
        rows.push((symbol.to_owned(), derivative));
    }
    rows
}

/// The numbers of thrusters and rudders.
fn actuators(model: &Model) -> String {
    let Some(file) = model.craft_file() else { return String::new() };
    let deviation = deviations(file);
    let mut rows = String::new();
    for (parameter, value) in file.craft.parameters() {
        let is_actuator = ["thruster.", "rudder."].iter().any(|kind| parameter.path.starts_with(kind));
        if !is_actuator || value == 0.0 {
            continue;
        }
        let _ = writeln!(
            rows,
            "  {} & ${}$ & ${}$ \\\\",
            latex_text(&parameter.path),
            latex_estimate(value, deviation(&parameter.path)),
            latex_unit(&UnitProduct::of_channel("", parameter.unit))
        );
    }
    format!(
        "\n% Actuators, with the paths of the vessel file; units are per unit of the order\n\\begin{{tabular}}{{lrl}}\n  \\toprule\n  \
         Number & Value & Unit \\\\\n  \\midrule\n{rows}  \\bottomrule\n\\end{{tabular}}\n"
    )
}
