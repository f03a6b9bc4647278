//! Equations of motion as vehicles of the Python Vehicle Simulator and functions of MSS.

use hydroid::key::key;
use hydroid::model::Model;
use hydroid_core::model::sparse::{Equations, Factor, Shape, Signal, Term};

use super::derivative::VELOCITY;
use super::equations::motion;
use super::literal::Literal;
use super::numbers::{exact, short};
use super::values;
use super::vehicle::{Channel, Vehicle, describe};
use crate::ExportError;
use crate::name::comment;

/// Languages of the expressions.
#[derive(Clone, Copy, PartialEq)]
enum Language {
    Python,
    Matlab,
}

/// The data of the templates.
///
/// # Errors
/// If the outputs are not `u`, `v`, `r`, or the model has delays or limits of rates.
pub(super) fn vehicle(model: &Model, equations: &Equations) -> Result<Vehicle, ExportError> {
    let refuse = |reason: String, remedy: &str| {
        Err(ExportError::Unsupported {
            model: model.title(),
            format: "mss",
            reason,
            remedy: remedy.to_owned(),
        })
    };
    let order = match motion(model) {
        Ok(order) => order,
        Err(reason) => return refuse(reason, "identify equations of the outputs u, v [m/s] and r [rad/s]"),
    };
    let inputs = &model.description.inputs;
    if let Some(port) = inputs.iter().find(|port| port.rate_limit.is_some()) {
        return refuse(
            format!("its input '{}' has a limit of the rate", port.channel.name),
            &format!(
                "identify without limits of rates, or a vessel with {}, whose actuators have them",
                key("methods").is("grey-box")
            ),
        );
    }
    let mut lags = Vec::new();
    let mut positions = Vec::new();
    for signal in equations.signals() {
        let Signal::Lag { input, time_constant_s } = *signal else {
            return refuse(
                String::from("it has delayed values"),
                "identify without delays, or export it to C or CasADi",
            );
        };
        let command = usize::from(input) - equations.outputs();
        positions.push(format!(
            "s({}) of {}, {} s",
            positions.len() + 1,
            comment(&inputs[command].channel.name),
            short(time_constant_s.0)
        ));
        lags.push(Literal::Record(vec![
            ("command", Literal::Index(Some(command))),
            ("time", Literal::Number(time_constant_s.0)),
        ]));
    }
    let values = values(model, "mss")?;
    let channels = inputs.iter().zip(&values).map(|(port, value)| Channel {
        name: &port.channel.name,
        unit: &port.channel.unit,
        // The wind is not limited to the value that it has in trials.
        limits: if value.is_commanded { value.limits } else { [port.range.low, port.range.high] },
        neutral: value.neutral,
    });
    let mut data = vec![
        ("NAME", Literal::Text(comment(&model.description.name))),
        ("LAGS", Literal::List(lags)),
        ("STEP", Literal::Number(equations.dt() / equations.substeps() as f64)),
    ];
    let commands = describe(channels, &mut data);
    let lines = |language, indent: &str, end: &str| {
        let line = |output: usize| format!("{indent}{}{end}", sum(equations, order, output, language));
        order.map(line).join("\n")
    };
    let python = lines(Language::Python, "        ", ",");
    let matlab = lines(Language::Matlab, "    ", "; ...");
    let title = comment(&model.description.name);
    Ok(Vehicle { title, commands, positions, data, accelerations: Some([python, matlab]) })
}

/// The right side of the equation of an output, on one line.
fn sum(equations: &Equations, order: [usize; 3], output: usize, language: Language) -> String {
    let mut text = String::new();
    for (j, term) in equations.terms().iter().enumerate() {
        let coefficient = equations.coefficient(output, j);
        if coefficient == 0.0 {
            continue;
        }
        text.push_str(match (text.is_empty(), coefficient < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        text.push_str(&exact(coefficient.abs(), "inf"));
        text.push_str(&product(term, equations, order, language));
    }
    if text.is_empty() { String::from("0.0") } else { text }
}

/// The factors of a term, each after a sign of its operation.
fn product(term: &Term, equations: &Equations, order: [usize; 3], language: Language) -> String {
    let of = |factor: &Factor| {
        let variable = variable(usize::from(factor.variable), equations, order, language);
        let call = |name: &str| match language {
            Language::Python => format!(" * np.{name}({variable})"),
            Language::Matlab => format!(" * {name}({variable})"),
        };
        match factor.shape {
            Shape::Power(n) => format!(" * {variable}").repeat(usize::from(n)),
            Shape::Abs => format!(" * abs({variable})"),
            Shape::Sign => call("sign"),
            Shape::Sin => call("sin"),
            Shape::Cos => call("cos"),
            Shape::Log => call("log"),
            Shape::Reciprocal => format!(" / {variable}"),
            Shape::Above(gate) | Shape::Below(gate) => {
                let sign = if matches!(factor.shape, Shape::Above(_)) { "+" } else { "-" };
                let tanh = if language == Language::Python { "np.tanh" } else { "tanh" };
                let slope = exact(0.5 * gate.slope.0, "inf");
                let centre = exact(gate.centre.0, "inf");
                format!(" * 0.5 * (1.0 {sign} {tanh}({slope} * ({variable} - ({centre}))))")
            }
        }
    };
    term.factors().iter().map(of).collect()
}

fn variable(index: usize, equations: &Equations, order: [usize; 3], language: Language) -> String {
    let (outputs, inputs) = (equations.outputs(), equations.inputs());
    let element = |name: &str, k: usize| match language {
        Language::Python => format!("{name}[{k}]"),
        Language::Matlab => format!("{name}({})", k + 1),
    };
    if let Some(j) = order.iter().position(|&output| output == index) {
        return String::from(VELOCITY[j]);
    }
    if index < outputs + inputs {
        element("c", index - outputs)
    } else {
        element("s", index - outputs - inputs)
    }
}
