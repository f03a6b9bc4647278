//! Coefficients of vessels.

use hydroid::craft::CraftFile;
use hydroid_core::craft::{Coriolis, Craft, Rudder, RudderLaw};

use super::numbers::short;
use super::{Centripetal, Coefficients, Derivative, Force, Inertia, Variable, add};

/// The coefficients of a vessel with any actuators.
pub(super) fn of_craft(file: &CraftFile) -> Coefficients {
    let craft = &file.craft;
    let hull = &craft.hull;
    let deviation = deviations(file);
    let mut derivatives = Vec::new();
    let mut take = |force, variable, value: f64, path: &str| {
        add(&mut derivatives, Derivative { force, variable, value, deviation: deviation(path) });
    };
    for (force, i, value, key) in [
        (Force::X, 0, hull.x_udot, "x_udot"),
        (Force::Y, 1, hull.y_vdot, "y_vdot"),
        (Force::Y, 2, hull.y_rdot, "y_rdot"),
        (Force::N, 1, hull.y_rdot, "y_rdot"),
        (Force::N, 2, hull.n_rdot, "n_rdot"),
    ] {
        take(force, Variable::Acceleration(i), value, &format!("added_mass.{key}"));
    }
    for (i, force) in Force::ALL.into_iter().enumerate() {
        for (j, by) in (0..3).enumerate() {
            take(force, Variable::product(&[by]), -hull.linear[i][j], &format!("drag.linear[{i}][{j}]"));
            take(
                force,
                Variable::signed(by, by),
                -hull.quadratic[i][j],
                &format!("drag.quadratic[{i}][{j}]"),
            );
        }
        for (j, by) in (1..3).enumerate().filter(|_| i > 0) {
            let path = format!("drag.lift[{}][{j}]", i - 1);
            take(force, Variable::signed(0, by), -hull.lift[i - 1][j], &path);
        }
    }
    Coefficients {
        name: craft.name.clone(),
        water_density: craft.water_density,
        size: hull.size,
        inertia: Inertia {
            mass: hull.mass,
            i_z: hull.i_z,
            x_g: hull.x_g,
            x_udot: hull.x_udot,
            y_vdot: hull.y_vdot,
            y_rdot: hull.y_rdot,
            n_rdot: hull.n_rdot,
        },
        inertia_deviations: ["mass", "i_z", "x_g"].map(|key| deviation(&format!("rigid_body.{key}"))),
        derivatives,
        centripetal: match hull.coriolis {
            Coriolis::Full => Centripetal::Full,
            Coriolis::WithoutMunk => Centripetal::WithoutMunk,
        },
        cross_flow: (hull.cross_flow, deviation("drag.cross_flow")),
        inputs: Vec::new(),
        other_forces: other_forces(craft),
    }
}

/// Forces that are no hydrodynamic derivatives.
fn other_forces(craft: &Craft) -> Vec<String> {
    let moment = |rudder: &Rudder| match rudder.law {
        RudderLaw::Normal(_) => None,
        RudderLaw::Linear(gain) => {
            Some(format!("rudder {}: N = {} u RD with its order RD", rudder.name, short(gain)))
        }
        RudderLaw::Sine(gain) => {
            Some(format!("rudder {}: N = {} u sin(RD) with its angle RD [rad]", rudder.name, short(gain)))
        }
    };
    let flying = craft.flying.map(|flying| {
        format!(
            "flying mode: above {} m/s the added mass is multiplied by {} and the damping by {}, with a slope of {} s/m",
            short(flying.transition_speed),
            short(flying.added_mass_factor),
            short(flying.drag_factor),
            short(flying.slope)
        )
    });
    craft.rudders.iter().filter_map(moment).chain(flying).collect()
}

/// Standard deviation of the estimate of a number by its path in the vessel file.
pub(super) fn deviations(file: &CraftFile) -> impl Fn(&str) -> Option<f64> {
    let parameters = file.craft.parameters();
    let representatives = file.representatives();
    let estimates = file.estimate.clone();
    move |path| {
        let index = parameters.iter().position(|(parameter, _)| parameter.path == path)?;
        estimates.iter().find(|estimate| estimate.index == representatives[index])?.deviation
    }
}
