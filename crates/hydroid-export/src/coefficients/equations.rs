//! Coefficients of equations of motion.

use hydroid::key::key;
use hydroid::model::{Model, NamedEquations};
use hydroid_core::model::sparse::{Factor, Term};

use super::derivative::VELOCITY;
use super::numbers::short;
use super::{Centripetal, CoefficientOptions, Coefficients, Derivative, Force, Variable, add};
use crate::ExportError;

/// The coefficients of equations of `u`, `v`, `r`.
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
/// Terms with inputs, gates and other functions are forces by the same rule.
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
    let matrix = mass_rows(inertia.mass_matrix());
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
    let mut coefficients = Coefficients {
        name: model.description.name.clone(),
        water_density: options.water_density,
        size: None,
        inertia,
        inertia_deviations: [None; 3],
        derivatives: inertia.added_mass().into_iter().filter(|derivative| derivative.value != 0.0).collect(),
        centripetal: Centripetal::InDerivatives,
        cross_flow: (0.0, None),
        inputs: Vec::new(),
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

/// Adds the forces of all terms; whether a derivative by velocities was among them.
fn fill(
    coefficients: &mut Coefficients,
    named: &NamedEquations<'_>,
    order: [usize; 3],
    matrix: &[[f64; 3]; 3],
) -> bool {
    let equations = named.equations();
    let mut found = false;
    for (j, term) in equations.terms().iter().enumerate() {
        let rates = order.map(|output| equations.coefficient(output, j));
        let variable = Variable::Product(reordered(term, |index| place(index, order)));
        for (i, force) in Force::ALL.into_iter().enumerate() {
            let value: f64 = (0..3).map(|k| matrix[i][k] * rates[k]).sum();
            if value == 0.0 {
                continue;
            }
            let of_one = |other: &Term| f64::from(u8::from(other == term));
            let deviation = deviation(named, order, &matrix[i], of_one);
            found |= variable.is_polynomial() && !variable.has_input();
            add(
                &mut coefficients.derivatives,
                Derivative { force, variable: variable.clone(), value, deviation },
            );
        }
    }
    found
}

/// Rows of a mass matrix.
pub(super) fn mass_rows([m11, m22, m23, m33]: [f64; 4]) -> [[f64; 3]; 3] {
    [[m11, 0.0, 0.0], [0.0, m22, m23], [0.0, m23, m33]]
}

/// Standard deviation of a sum of forces of terms with weights, from the members of the bootstrap; `row` is that of the mass matrix.
pub(super) fn deviation(
    named: &NamedEquations<'_>,
    order: [usize; 3],
    row: &[f64; 3],
    weight: impl Fn(&Term) -> f64,
) -> Option<f64> {
    let equations = named.equations();
    let count = equations.terms().len();
    let mut weights = vec![0.0; 3 * count];
    for (j, term) in equations.terms().iter().enumerate() {
        let weight = weight(term);
        for (output, mass) in order.into_iter().zip(row) {
            if equations.coefficient(output, j) != 0.0 {
                weights[output * count + j] = mass * weight;
            }
        }
    }
    named.standard_error_of_sum(&weights)
}

/// Index of a variable of equations with `u`, `v`, `r` first.
pub(super) fn place(index: u16, order: [usize; 3]) -> u16 {
    let velocity = (0..).zip(order).find(|(_, output)| *output == usize::from(index));
    velocity.map_or(index, |(place, _)| place)
}

/// A term with other indices of its variables.
pub(super) fn reordered(term: &Term, place: impl Fn(u16) -> u16) -> Term {
    let of = |factor: &Factor| Factor { variable: place(factor.variable), shape: factor.shape };
    Term::new(term.factors().iter().map(of).collect())
}
