//! Tables of hydrodynamic derivatives in LaTeX, with the packages amsmath and booktabs.

use std::fmt::Write as _;

use hydroid::evaluate::DesignRange;
use hydroid::model::{Model, UnitProduct, latex_estimate, latex_text, latex_unit};
use hydroid::plant::described_inputs;

use super::linear::is_constant;
use super::vessel::deviations;
use super::{Centripetal, CoefficientOptions, Coefficients, Derivative, Input, straight_course};
use crate::name::comment;
use crate::{ExportError, File, Options, identifier};

const FORMAT: &str = "latex";

/// Stands above the table of linear derivatives.
const LINEAR: &str = "
% Linear derivatives: all inputs at their neutral values, lags and delays settled, + and - above and below a kink.
% N is positive to starboard: an input with a positive N turns the bow to starboard.
";

/// Tables of the coefficients as `NAME.tex`: mass, derivatives by velocities and inputs, and actuators in SI units with standard
/// deviations, and in the prime system with length and speed. With a speed `U` the [linear
/// derivatives](straight_course) of a straight course are added, which published derivatives from tests with models are. That of
/// equations is the middle of their training range if none is given.
///
/// They contain the Coriolis and centripetal forces of mass and added mass. Equations of motion without a given mass become an
/// `align*` and the table of their coefficients.
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
        tables(model, &coefficients, coefficient_options)?
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
    fn row(
        &mut self,
        symbol: &str,
        value: f64,
        deviation: Option<f64>,
        unit: &UnitProduct,
        divisor: Option<f64>,
    ) {
        let estimate = |value: f64, deviation: Option<f64>| match deviation {
            None if value == 0.0 => String::from("0"),
            deviation => latex_estimate(value, deviation),
        };
        let prime = divisor.map(|by| format!("${}$", estimate(value / by, deviation.map(|d| d / by))));
        let _ = writeln!(
            self.rows,
            "  ${symbol}$ & ${}$ & ${}$ & {} \\\\",
            estimate(value, deviation),
            latex_unit(unit),
            prime.as_deref().unwrap_or("--")
        );
    }

    fn derivative(&mut self, symbol: &str, of: &Derivative, inputs: &[Input], prime: &Prime) {
        let divisor = prime.divisor(of.prime_powers());
        self.row(symbol, of.value, of.deviation, &of.unit(inputs), divisor);
    }

    fn text(&self, title: &str) -> String {
        format!(
            "\n% {title}\n\\begin{{tabular}}{{lrll}}\n  \\toprule\n  Coefficient & Value & Unit & Prime system \\\\\n  \\midrule\n{}  \
             \\bottomrule\n\\end{{tabular}}\n",
            self.rows
        )
    }
}

fn tables(
    model: &Model,
    coefficients: &Coefficients,
    options: &CoefficientOptions,
) -> Result<String, ExportError> {
    let speed = options.speed.or_else(|| middle_speed(model));
    let prime = Prime {
        length: options
            .length
            .or_else(|| model.description.boat.particulars.length_in_logs())
            .or(coefficients.size.map(|[length, ..]| length)),
        speed,
        density: coefficients.water_density,
    };
    let mut out = head(model, coefficients, &prime);
    if options.speed.is_none() && speed.is_some() {
        out.push_str("% The speed U is the middle of the training range, because none was stated.\n");
    }
    let inertia = coefficients.inertia;
    let mut table = Table::default();
    let unit = |text| UnitProduct::of_channel("", text);
    let [mass, i_z, x_g] = coefficients.inertia_deviations;
    table.row("m", inertia.mass, mass, &unit("kg"), prime.divisor([3, 0]));
    table.row("x_g", inertia.x_g, x_g, &unit("m"), prime.length);
    table.row("I_z", inertia.i_z, i_z, &unit("kg m^2"), prime.divisor([5, 0]));
    if coefficients.cross_flow.0 != 0.0 {
        table.row("C_d", coefficients.cross_flow.0, coefficients.cross_flow.1, &unit("1"), Some(1.0));
    }
    let inputs = &coefficients.inputs;
    let mut all = coefficients.derivatives.clone();
    all.retain(|derivative| derivative.variable.is_polynomial());
    all.sort_by_key(|derivative| {
        (derivative.force, derivative.variable.has_input(), derivative.variable.clone())
    });
    for derivative in &all {
        table.derivative(&derivative.latex(inputs), derivative, inputs, &prime);
    }
    out.push_str(
        &table.text("Mass and hydrodynamic derivatives; standard deviations of estimates behind \\pm"),
    );
    if let Some(speed) = speed {
        let mut table = Table::default();
        let mut notes = String::new();
        for row in straight_course(model, coefficients, speed)? {
            if row.derivative.value.is_nan() {
                let _ = writeln!(
                    notes,
                    "% ${}$ has no value: the force jumps or is not defined there.",
                    row.latex
                );
            } else {
                table.derivative(&row.latex, &row.derivative, inputs, &prime);
            }
        }
        if model.equations().is_some() {
            let names = model.description.inputs.iter().enumerate().filter(|(k, _)| is_constant(model, *k));
            for (_, port) in names {
                let _ = writeln!(
                    notes,
                    "% {} was constant in the logs: its effect is not known.",
                    port.channel.name
                );
            }
            let u = model.description.outputs.iter().find(|port| port.channel.name == "u");
            let range = u.map(|port| port.training_range.unwrap_or(port.range));
            if let Some(DesignRange { low, high }) =
                range.filter(|range| speed < range.low || speed > range.high)
            {
                let _ = writeln!(
                    notes,
                    "% Not validated: U = {speed} m/s is outside of the training range of u, {low:.4} to {high:.4} m/s."
                );
            }
        }
        let actuators = if model.craft().is_some() { ", without actuators" } else { "" };
        let _ = write!(out, "{LINEAR}{notes}");
        out.push_str(&table.text(&format!(
            "Linear derivatives of a straight course at U = {speed} m/s, by velocities{actuators} and by inputs"
        )));
    }
    out.push_str(&actuators(model));
    Ok(out)
}

/// The middle of the training range of `u` in equations, if it is ahead.
fn middle_speed(model: &Model) -> Option<f64> {
    model.equations()?;
    let port = model.description.outputs.iter().find(|port| port.channel.name == "u")?;
    let DesignRange { low, high } = port.training_range.unwrap_or(port.range);
    Some(0.5 * (low + high)).filter(|middle| middle.is_finite() && *middle > 0.0)
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
            writeln!(out, "% Prime system: it needs a length, of the vessel file or a stated one.")
        }
        (Some(length), None) => writeln!(
            out,
            "% Prime system: L = {length} m, rho = {} kg/m^3; linear derivatives need a stated speed.",
            prime.density
        ),
        (Some(length), Some(speed)) => {
            writeln!(out, "% Prime system: L = {length} m, U = {speed} m/s, rho = {} kg/m^3.", prime.density)
        }
    };
    out.push_str(
        "% Derivatives by inputs are per unit of the input, also in the prime system; a radian is 1.\n",
    );
    let others = coefficients.derivatives.iter().filter(|derivative| !derivative.variable.is_polynomial());
    let others = others.map(|derivative| derivative.described(&coefficients.inputs));
    for force in others.chain(coefficients.other_forces.iter().map(|force| comment(force))) {
        let _ = writeln!(out, "% Not in the tables: {force}");
    }
    out
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
