//! Plugins of Gazebo: `gz::sim::systems::Hydrodynamics` and `vrx::SimpleHydrodynamics`.
//!
//! Both act in the frame of the link, forward, port, up, at its origin, which is that of the vessel file.
//!
//! The added mass is part of the inertia of the link (`fluid_added_mass`, SDF 1.10, physics engine DART). DART solves for the
//! accelerations with it and adds its Coriolis and centripetal forces. The plugins multiply an added mass by the acceleration
//! of the last step: that recursion diverges where the added mass is greater than the mass, as of most hulls in sway. Their
//! added mass is 0 for this reason.
//!
//! The plugin of Gazebo (gz-sim 7 and later, `src/systems/hydrodynamics/Hydrodynamics.cc`) applies
//!
//! ```text
//! F_i = sum a_ij nu_j + sum b_ijk nu_j nu_k + sum c_ijk nu_j |nu_k|
//! ```
//!
//! with the derivatives as SNAME defines them: `yUR` is `Y_ur`, `nRabsU` is `N_|u|r`. That of VRX
//! (`vrx_gz/src/SimpleHydrodynamics.cc`) has a diagonal alone, with positive numbers:
//!
//! ```text
//! F_i = -(a_i + c_i |nu_i|) nu_i
//! ```

use std::fmt::Write as _;

use hydroid::model::Model;
use hydroid_core::craft::{RudderLaw, ThrustLaw};
use hydroid_core::model::sparse::Shape;

use super::derivative::VELOCITY;
use super::numbers::short;
use super::{CoefficientOptions, Coefficients, Derivative, Force, Variable, add};
use crate::name::comment;
use crate::{ExportError, File, Options, identifier};

const FORMAT: &str = "sdf";

/// The hydrodynamics of a model for Gazebo: `NAME_inertial.sdf` for the link, and `NAME_gz.sdf` with Gazebo's own plugin or
/// `NAME_vrx.sdf` with that of VRX for the model. Comments list what a plugin does not contain.
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
        file("inertial", inertial(&coefficients)),
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

/// Name of an element of Gazebo's plugin; `None` for a variable that it lacks.
fn gazebo_element(derivative: &Derivative) -> Option<String> {
    let row = derivative.force.letter().to_ascii_lowercase();
    let letter = |index: u16| VELOCITY.get(usize::from(index)).map(|name| name.to_ascii_uppercase());
    let Variable::Product(term) = &derivative.variable else { return None };
    let (mut factors, mut absolute) = (String::new(), String::new());
    for factor in term.factors() {
        let letter = letter(factor.variable)?;
        match factor.shape {
            Shape::Power(n) => factors.push_str(&letter.repeat(usize::from(n))),
            Shape::Abs => absolute.push_str(&letter),
            _ => return None,
        }
    }
    match (factors.len(), absolute.len()) {
        (1 | 2, 0) => Some(format!("{row}{factors}")),
        (1, 1) => Some(format!("{row}{factors}abs{absolute}")),
        _ => None,
    }
}

fn gazebo(coefficients: &Coefficients, actuators: &[String], link: &str) -> String {
    let mut all = hull(coefficients);
    all.sort_by(|a, b| (a.force, &a.variable).cmp(&(b.force, &b.variable)));
    let mut out = String::from(
        "<plugin filename=\"gz-sim-hydrodynamics-system\" name=\"gz::sim::systems::Hydrodynamics\">\n",
    );
    header(&mut out, coefficients);
    let _ = writeln!(out, "  <link_name>{link}</link_name>");
    element(&mut out, "water_density", &short(coefficients.water_density), "kg/m^3");
    for switch in ["disable_added_mass", "disable_coriolis"] {
        element(
            &mut out,
            switch,
            "true",
            "the physics engine has them, from the inertial element of the link",
        );
    }
    let mut missing = Vec::new();
    for derivative in &all {
        match gazebo_element(derivative) {
            Some(name) => {
                let value = short(derivative.forward_port_up());
                element(&mut out, &name, &value, &derivative.described(&coefficients.inputs));
            }
            None => missing.push(derivative.described(&coefficients.inputs)),
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
    let all = hull(coefficients);
    let mut out =
        String::from("<plugin filename=\"libSimpleHydrodynamics.so\" name=\"vrx::SimpleHydrodynamics\">\n");
    header(&mut out, coefficients);
    let _ = writeln!(out, "  <link_name>{link}</link_name>");
    let mut used = vec![false; all.len()];
    for (by, force) in (0..).zip(Force::ALL) {
        let row = force.letter().to_ascii_lowercase();
        let column = VELOCITY[force as usize].to_ascii_uppercase();
        element(&mut out, &format!("{row}Dot{column}"), "0.0", "in the inertial element of the link");
        for (name, variable) in [
            (format!("{row}{column}"), Variable::product(&[by])),
            (format!("{row}{column}{column}"), Variable::signed(by, by)),
        ] {
            let index = all.iter().position(|d| d.force == force && d.variable == variable);
            let found = index.map_or(Derivative::new(force, variable, 0.0), |index| all[index].clone());
            if let Some(index) = index {
                used[index] = true;
            }
            element(&mut out, &name, &short(-found.value), &found.described(&coefficients.inputs));
        }
    }
    // The plugin limits each component of its force to 10 kN without this element.
    element(&mut out, "max_effort", "1e300", "no limit; the plugin has one of 10 kN without this element");
    let mut missing: Vec<String> = all
        .iter()
        .zip(&used)
        .filter(|(_, used)| !**used)
        .map(|(derivative, _)| derivative.described(&coefficients.inputs))
        .collect();
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

/// The derivatives by velocities, with those of the cross-flow drag in pure motions.
fn hull(coefficients: &Coefficients) -> Vec<Derivative> {
    let mut all = coefficients.beside_added_mass();
    coefficients.cross_flow_derivatives().into_iter().for_each(|derivative| add(&mut all, derivative));
    all
}

/// Mass, centre of gravity, yaw inertia about it, and the added mass about the origin of the link.
fn inertial(coefficients: &Coefficients) -> String {
    let inertia = coefficients.inertia;
    let about_centre = inertia.i_z - inertia.mass * inertia.x_g * inertia.x_g;
    let mut out = String::from("<inertial>\n");
    note(
        &mut out,
        &title(coefficients),
        &[
            String::from("For the link whose origin is that of the vessel file; frame forward, port, up."),
            String::from(
                "The added mass needs SDF 1.10 and the physics engine DART. Where a model has no fluid_added_mass (URDF),",
            ),
            format!(
                "the plugin of VRX can have it as xDotU {}, yDotV {}, nDotR {}, if these are smaller than mass and izz:",
                short(-inertia.x_udot),
                short(-inertia.y_vdot),
                short(-inertia.n_rdot)
            ),
            String::from("it uses the acceleration of the last step, and diverges otherwise."),
        ],
    );
    element(&mut out, "mass", &short(inertia.mass), "kg");
    element(&mut out, "pose", &format!("{} 0 0 0 0 0", short(inertia.x_g)), "m, the centre of gravity");
    out.push_str("  <inertia>\n    <!-- Add ixx and iyy of the boat: surge, sway and yaw do not depend on them. -->\n  ");
    element(&mut out, "izz", &short(about_centre), "kg m^2, about the centre of gravity");
    out.push_str("  </inertia>\n  <fluid_added_mass>\n");
    for (name, value, remark) in [
        ("xx", inertia.x_udot, "-X_udot, kg"),
        ("yy", inertia.y_vdot, "-Y_vdot, kg"),
        ("yr", inertia.y_rdot, "-Y_rdot, kg m"),
        ("rr", inertia.n_rdot, "-N_rdot, kg m^2"),
    ] {
        out.push_str("  ");
        element(&mut out, name, &short(-value), remark);
    }
    out.push_str("  </fluid_added_mass>\n</inertial>\n");
    out
}

fn cross_flow_note(coefficients: &Coefficients) -> Option<String> {
    (!coefficients.cross_flow_derivatives().is_empty()).then(|| {
        format!(
            "the cross-flow drag (C_d = {}) in sway and yaw at once; in pure sway and pure yaw it is contained",
            short(coefficients.cross_flow.0)
        )
    })
}

fn title(coefficients: &Coefficients) -> String {
    let name = comment(&coefficients.name);
    format!("Hydrodynamics of {name}, written by hydroid {}.", env!("CARGO_PKG_VERSION"))
}

fn header(out: &mut String, coefficients: &Coefficients) {
    note(
        out,
        &title(coefficients),
        &[
            String::from(
                "The link needs the mass, the inertia and the added mass of the file _inertial.sdf beside this one.",
            ),
            String::from("The frame of the link is forward, port, up, at the origin of the vessel file."),
            String::from(
                "Symbols in the comments beside the numbers are in the frame forward, starboard, down.",
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
            ThrustLaw::Quadratic => "n^2",
            ThrustLaw::Linear => "n",
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
        let name = comment(&rudder.name);
        let normal = match &rudder.law {
            RudderLaw::Normal(normal) => normal,
            RudderLaw::Linear(gain) => return format!("rudder {name}: moment {} u RD", short(-gain)),
            RudderLaw::Sine(gain) => return format!("rudder {name}: moment {} N s u sin(RD)", short(-gain)),
        };
        let [x, y] = normal.position;
        format!(
            "rudder {name} at {} {} 0 m: area {} m^2, slope of the normal force {} 1/rad",
            short(x),
            short(-y),
            short(normal.area),
            short(normal.lift_slope)
        )
    });
    thrusters.chain(rudders).collect()
}
