//! Plugins of Gazebo: `gz::sim::systems::Hydrodynamics` and `vrx::SimpleHydrodynamics`.
//!
//! Both act in the frame of the link, forward, port, up. The files are for a link whose origin is that of the vessel file,
//! with the mass, the yaw inertia and the centre of gravity that a comment states.
//!
//! The plugin of Gazebo (gz-sim 7 and later, `src/systems/hydrodynamics/Hydrodynamics.cc`) applies at the origin of the link
//!
//! ```text
//! F_i = sum M_ij dnu_j/dt + sum a_ij nu_j + sum b_ijk nu_j nu_k + sum c_ijk nu_j |nu_k|
//! ```
//!
//! with the derivatives as SNAME defines them: `xDotU` is `X_udot`, `yUR` is `Y_ur`, `nRabsU` is `N_|u|r`. Its own Coriolis
//! forces have wrong signs in some versions. They are switched off, and the products `b` contain them.
//!
//! The plugin of VRX (`vrx_gz/src/SimpleHydrodynamics.cc`) has a diagonal alone, with positive numbers for added mass and
//! damping, and also applies its forces at the origin of the link:
//!
//! ```text
//! F_i = -M_i a_i - (a_i + c_i |nu_i|) nu_i      a = (udot - v r, vdot + u r, rdot)
//! ```

use std::fmt::Write as _;

use hydroid::model::Model;

use super::derivative::{VELOCITY, unit_text};
use super::numbers::short;
use super::{CoefficientOptions, Coefficients, Derivative, Force, Variable, add};
use crate::name::comment;
use crate::{ExportError, File, Options, identifier};

const FORMAT: &str = "sdf";

/// The hydrodynamics of a model as plugins of Gazebo: `NAME_gz.sdf` for its own plugin, `NAME_vrx.sdf` for that of VRX.
/// Comments list what a plugin does not contain.
///
/// # Errors
/// See [`Coefficients::of`].
pub fn sdf(
    model: &Model,
    options: &Options,
    coefficient_options: &CoefficientOptions,
) -> Result<Vec<File>, ExportError> {
    let coefficients = Coefficients::of(model, coefficient_options, FORMAT)?;
    let name = identifier(&options.name);
    let actuators = actuators(model);
    let link = escape(&coefficient_options.link);
    let file = |suffix: &str, text: String| File {
        name: format!("{name}_{suffix}.sdf"),
        content: text.into_bytes(),
    };
    Ok(vec![
        file("gz", gazebo(&coefficients, &actuators, &link)),
        file("vrx", vrx(&coefficients, &actuators, &link)),
    ])
}

/// Text as the content of an element of XML.
fn escape(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            // XML 1.0 has no other control characters.
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// Text without two hyphens in sequence, which end a comment of XML.
fn hyphens(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        if c == '-' && safe.ends_with('-') {
            safe.push(' ');
        }
        safe.push(c);
    }
    safe
}

/// A comment of XML.
fn note(out: &mut String, title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(out, "  <!-- {}", hyphens(title));
    for line in lines {
        let _ = writeln!(out, "       {}", hyphens(line));
    }
    out.push_str("  -->\n");
}

fn element(out: &mut String, name: &str, value: &str, remark: &str) {
    let _ = writeln!(out, "  <{name}>{value}</{name}> <!-- {remark} -->");
}

fn described(derivative: &Derivative) -> String {
    format!("{} = {} {}", derivative.symbol(), short(derivative.value), unit_text(derivative.unit()))
}

/// Name of an element of Gazebo's plugin; `None` for a variable that it lacks.
fn gazebo_element(derivative: &Derivative) -> Option<String> {
    let row = derivative.force.letter().to_ascii_lowercase();
    let letter = |j: usize| VELOCITY[j].to_ascii_uppercase();
    match derivative.variable {
        Variable::Acceleration(i) => Some(format!("{row}Dot{}", letter(i))),
        Variable::Product { powers, magnitudes } => {
            let factors: Vec<usize> = (0..3).flat_map(|j| vec![j; usize::from(powers[j])]).collect();
            let absolute: Vec<usize> = (0..3).filter(|&j| magnitudes[j]).collect();
            match (factors.as_slice(), absolute.as_slice()) {
                ([j], []) => Some(format!("{row}{}", letter(*j))),
                ([j, k], []) => Some(format!("{row}{}{}", letter(*j), letter(*k))),
                ([j], [k]) => Some(format!("{row}{}abs{}", letter(*j), letter(*k))),
                _ => None,
            }
        }
    }
}

fn gazebo(coefficients: &Coefficients, actuators: &[String], link: &str) -> String {
    let mut all = coefficients.with_centripetal();
    coefficients.cross_flow_derivatives().into_iter().for_each(|derivative| add(&mut all, derivative));
    all.sort_by_key(|derivative| (derivative.force, derivative.variable));
    let mut out = String::from(
        "<plugin filename=\"gz-sim-hydrodynamics-system\" name=\"gz::sim::systems::Hydrodynamics\">\n",
    );
    header(&mut out, coefficients);
    let _ = writeln!(out, "  <link_name>{link}</link_name>");
    element(&mut out, "water_density", &short(coefficients.water_density), "kg/m^3");
    element(
        &mut out,
        "disable_coriolis",
        "true",
        "the Coriolis forces of the added mass are among the products below",
    );
    let mut missing = Vec::new();
    for derivative in &all {
        match gazebo_element(derivative) {
            Some(name) => {
                let value = short(derivative.forward_port_up());
                element(&mut out, &name, &value, &described(derivative));
            }
            None => missing.push(described(derivative)),
        }
    }
    missing.extend(cross_flow_note(coefficients));
    missing.extend(coefficients.other_forces.clone());
    note(&mut out, "Not in this plugin:", &missing);
    note(&mut out, "Actuators, which plugins of their own simulate:", actuators);
    out.push_str("</plugin>\n");
    out
}

fn vrx(coefficients: &Coefficients, actuators: &[String], link: &str) -> String {
    let mut all = coefficients.derivatives.clone();
    coefficients.cross_flow_derivatives().into_iter().for_each(|derivative| add(&mut all, derivative));
    let mut out =
        String::from("<plugin filename=\"libSimpleHydrodynamics.so\" name=\"vrx::SimpleHydrodynamics\">\n");
    header(&mut out, coefficients);
    let _ = writeln!(out, "  <link_name>{link}</link_name>");
    let mut used = vec![false; all.len()];
    let mut value_of = |force: Force, variable: Variable| {
        let index = all.iter().position(|d| d.force == force && d.variable == variable)?;
        used[index] = true;
        Some(all[index])
    };
    for (i, force) in Force::ALL.into_iter().enumerate() {
        let row = force.letter().to_ascii_lowercase();
        let column = VELOCITY[i].to_ascii_uppercase();
        for (name, variable) in [
            (format!("{row}Dot{column}"), Variable::Acceleration(i)),
            (format!("{row}{column}"), Variable::product(&[i])),
            (format!("{row}{column}{column}"), Variable::signed(i, i)),
        ] {
            let found = value_of(force, variable).unwrap_or(Derivative::new(force, variable, 0.0));
            element(&mut out, &name, &short(-found.value), &described(&found));
        }
    }
    // The plugin limits each component of its force to 10 kN without this element.
    element(&mut out, "max_effort", "1e300", "no limit; the plugin has one of 10 kN without this element");
    let mut missing: Vec<String> = all
        .iter()
        .zip(&used)
        .filter(|(_, used)| !**used)
        .map(|(derivative, _)| described(derivative))
        .collect();
    missing.extend(vrx_differences(coefficients));
    missing.extend(cross_flow_note(coefficients));
    missing.extend(coefficients.other_forces.clone());
    note(&mut out, "Not in this plugin:", &missing);
    note(
        &mut out,
        "Heave, roll and pitch",
        &[String::from("keep the defaults of the plugin: the model has surge, sway and yaw alone.")],
    );
    note(&mut out, "Actuators, which plugins of their own simulate:", actuators);
    out.push_str("</plugin>\n");
    out
}

/// The Coriolis and centripetal forces that a vessel has and the plugin of VRX lacks: it multiplies the added mass by the
/// acceleration of the link in space.
fn vrx_differences(coefficients: &Coefficients) -> Vec<String> {
    let mut all = coefficients.with_centripetal();
    let inertia = coefficients.inertia;
    let own = [(Force::X, [1, 2], -inertia.x_udot), (Force::Y, [0, 2], inertia.y_vdot)];
    for (force, velocities, value) in own {
        add(&mut all, Derivative::new(force, Variable::product(&velocities), -value));
    }
    let before = &coefficients.derivatives;
    let is_new = |d: &&Derivative| {
        d.value != 0.0
            && !before
                .iter()
                .any(|known| known.force == d.force && known.variable == d.variable && known.value == d.value)
    };
    let differing = all.iter().filter(is_new);
    differing.map(|d| format!("{} (Coriolis)", described(d))).collect()
}

fn cross_flow_note(coefficients: &Coefficients) -> Option<String> {
    (!coefficients.cross_flow_derivatives().is_empty()).then(|| {
        format!(
            "the cross-flow drag (C_d = {}) in sway and yaw at once; in pure sway and pure yaw it is contained",
            short(coefficients.cross_flow.0)
        )
    })
}

fn header(out: &mut String, coefficients: &Coefficients) {
    let inertia = coefficients.inertia;
    let about_centre = inertia.i_z - inertia.mass * inertia.x_g * inertia.x_g;
    note(
        out,
        &format!(
            "Hydrodynamics of {}, written by hydroid {}.",
            comment(&coefficients.name),
            env!("CARGO_PKG_VERSION")
        ),
        &[
            String::from("The frame of the link is forward, port, up, at the origin of the vessel file."),
            String::from(
                "Symbols in the comments beside the numbers are in the frame forward, starboard, down.",
            ),
            format!(
                "The link needs in its inertial element: mass {} kg, pose {} 0 0 0 0 0 m, izz {} kg m^2 about the centre of gravity.",
                short(inertia.mass),
                short(inertia.x_g),
                short(about_centre)
            ),
        ],
    );
}

/// Thrusters and rudders in the frame of the link. The plugin `gz::sim::systems::Thruster` needs a joint of the model and has one
/// coefficient for both directions, so that it is left to the user.
fn actuators(model: &Model) -> Vec<String> {
    let Some(craft) = model.craft() else { return Vec::new() };
    let thrusters = craft.thrusters.iter().map(|thruster| {
        let [x, y] = thruster.position;
        let law = match thruster.law {
            hydroid_core::craft::ThrustLaw::Quadratic => "n^2",
            hydroid_core::craft::ThrustLaw::Linear => "n",
        };
        format!(
            "thruster {} at {} {} 0 m, yaw {} rad: {} N {law} ahead, {} N {law} astern, loss {} N s/m |n|, lag {} s",
            comment(&thruster.name),
            short(x),
            short(-y),
            short(-thruster.angle),
            short(thruster.forward),
            short(thruster.reverse),
            short(thruster.speed_loss),
            short(thruster.servo.lag)
        )
    });
    let rudders = craft.rudders.iter().map(|rudder| {
        let [x, y] = rudder.position;
        format!(
            "rudder {} at {} {} 0 m: area {} m^2, slope of the normal force {} 1/rad",
            comment(&rudder.name),
            short(x),
            short(-y),
            short(rudder.area),
            short(rudder.lift_slope)
        )
    });
    thrusters.chain(rudders).collect()
}
