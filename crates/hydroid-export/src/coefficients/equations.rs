//! Coefficients of equations of motion.

use hydroid::key::key;
use hydroid::model::{Model, NamedEquations};
use hydroid_core::model::sparse::{Shape, Term};

use super::derivative::VELOCITY;
use super::numbers::short;
use super::{Centripetal, CoefficientOptions, Coefficients, Derivative, Force, Variable, add};
use crate::ExportError;

/// The coefficients of equations of `u`, `v`, `r` whose terms are products of velocities and their magnitudes.
///
/// With the mass matrix `M` of the options, the coefficients `xi` of the accelerations become forces `M xi`, and the
/// Coriolis and centripetal forces of the mass are taken out:
///
/// ```text
/// X = m11 du/dt - m r (v + x_g r)
/// Y = m22 dv/dt + m23 dr/dt + m u r
/// N = m23 dv/dt + m33 dr/dt + m x_g u r
/// ```
///
/// Terms of other forms are forces of actuators or remain a list.
///
/// # Errors
/// If the outputs are others, a unit is not SI, no mass is given or it is not the mass of a vessel.
pub(super) fn of(
    model: &Model,
    options: &CoefficientOptions,
    format: &'static str,
) -> Result<Coefficients, ExportError> {
    let refuse = |reason: String, remedy: &str| {
        Err(ExportError::Unsupported { model: model.title(), format, reason, remedy: remedy.to_owned() })
    };
    let grey_box = key("methods").is("grey-box");
    let Some(named) = model.equations() else { return Err(super::no_coefficients(model, format)) };
    let order = match motion(model) {
        Ok(order) => order,
        Err(reason) => {
            return refuse(
                reason,
                &format!(
                    "identify equations of the outputs u, v [m/s] and r [rad/s], or a vessel with {grey_box}"
                ),
            );
        }
    };
    let Some(inertia) = options.inertia else {
        return refuse(
            String::from("its coefficients are accelerations, and forces need the mass of the vessel"),
            &format!(
                "name a vessel file with the mass by {}, or identify a vessel with {grey_box}",
                key("vessel")
            ),
        );
    };
    let [m11, m22, m23, m33] = inertia.mass_matrix();
    let regular = m11 > 0.0 && m22 > 0.0 && m33 > 0.0 && m22 * m33 > m23 * m23;
    let finite = [m11, m22, m23, m33].iter().all(|entry| entry.is_finite());
    if !(inertia.mass > 0.0 && inertia.i_z > 0.0 && regular && finite) {
        let matrix =
            format!("m11 = {}, m22 = {}, m23 = {}, m33 = {}", short(m11), short(m22), short(m23), short(m33));
        return refuse(
            format!("the given mass is not that of a vessel ({matrix})"),
            "give a positive mass [kg] and yaw inertia [kg m^2], and added masses as derivatives, which are not positive",
        );
    }
    let matrix = [[m11, 0.0, 0.0], [0.0, m22, m23], [0.0, m23, m33]];
    let mut coefficients = Coefficients {
        name: model.description.name.clone(),
        water_density: options.water_density,
        size: None,
        inertia,
        inertia_deviations: [None; 3],
        derivatives: inertia.added_mass().into_iter().filter(|derivative| derivative.value != 0.0).collect(),
        centripetal: Centripetal::InDerivatives,
        cross_flow: (0.0, None),
        other_forces: Vec::new(),
    };
    let found = fill(&mut coefficients, &named, order, &matrix);
    if !found {
        return refuse(
            String::from("none of its terms is a product of velocities"),
            &format!("identify with the library of marine terms, or a vessel with {grey_box}"),
        );
    }
    let (mass, x_g) = (inertia.mass, inertia.x_g);
    for (force, velocities, value) in [
        (Force::X, [1, 2], -mass),
        (Force::X, [2, 2], -mass * x_g),
        (Force::Y, [0, 2], mass),
        (Force::N, [0, 2], mass * x_g),
    ] {
        let rigid = Derivative::new(force, Variable::product(&velocities), value);
        add(&mut coefficients.derivatives, rigid);
    }
    Ok(coefficients)
}

/// Indices of `u`, `v`, `r` in the outputs, which are no others.
pub(super) fn motion(model: &Model) -> Result<[usize; 3], String> {
    let outputs = &model.description.outputs;
    let mut order = [0; 3];
    for ((place, name), unit) in order.iter_mut().zip(VELOCITY).zip(["m/s", "m/s", "rad/s"]) {
        let Some(index) = outputs.iter().position(|port| port.channel.name == name) else {
            return Err(format!("it has no output {name}"));
        };
        let given = &outputs[index].channel.unit;
        if given != unit {
            return Err(format!("its output {name} has the unit '{given}', not {unit}"));
        }
        *place = index;
    }
    if outputs.len() > 3 {
        return Err(format!("it has {} outputs, not u, v and r alone", outputs.len()));
    }
    Ok(order)
}

/// Adds the forces of all terms; whether a derivative was among them.
fn fill(
    coefficients: &mut Coefficients,
    named: &NamedEquations<'_>,
    order: [usize; 3],
    matrix: &[[f64; 3]; 3],
) -> bool {
    let equations = named.equations();
    let names = named.variable_names();
    let uncertainty = named.coefficient_uncertainty();
    let error = |output: usize, term: usize| -> Option<f64> {
        let of = &uncertainty.as_ref()?[output];
        of.standard_errors[of.terms.iter().position(|&known| known == term)?]
    };
    let mut found = false;
    for (j, term) in equations.terms().iter().enumerate() {
        let rates = order.map(|output| equations.coefficient(output, j));
        if rates == [0.0; 3] {
            continue;
        }
        let variable = variable(term, order);
        for (i, force) in Force::ALL.into_iter().enumerate() {
            let value: f64 = (0..3).map(|k| matrix[i][k] * rates[k]).sum();
            if value == 0.0 {
                continue;
            }
            if let Some(variable) = variable {
                // The errors of different equations are taken as independent.
                let errors = (0..3).filter_map(|k| Some(matrix[i][k] * error(order[k], j)?));
                let deviation = errors.fold(0.0, f64::hypot);
                let deviation = (deviation > 0.0).then_some(deviation);
                add(&mut coefficients.derivatives, Derivative { force, variable, value, deviation });
                found = true;
            } else {
                let term = crate::name::comment(&term.name(&names));
                coefficients.other_forces.push(format!("{} = {} {term}", force.letter(), short(value)));
            }
        }
    }
    found
}

/// The variable of a term, if it is a product of velocities and their magnitudes.
fn variable(term: &Term, order: [usize; 3]) -> Option<Variable> {
    let (mut powers, mut magnitudes) = ([0_u8; 3], [false; 3]);
    for factor in term.factors() {
        let i = order.iter().position(|&output| output == usize::from(factor.variable))?;
        match factor.shape {
            Shape::Power(n) => powers[i] = powers[i].checked_add(n)?,
            Shape::Abs => magnitudes[i] = true,
            _ => return None,
        }
    }
    Some(Variable::Product { powers, magnitudes })
}
