//! Invalid parameters are rejected with the name of the field.

use hydroid_core::vessel::{Flying, InvalidParams, Mode, Plant, VesselParams};

/// The error of a hydrofoil changed by `edit`.
fn refusal(edit: impl FnOnce(&mut VesselParams)) -> InvalidParams {
    let mut params = VesselParams::hydrofoil();
    edit(&mut params);
    Plant::new(&params).expect_err("should be refused")
}

fn flying(params: &mut VesselParams) -> &mut Flying {
    params.flying.as_mut().expect("the hydrofoil flies")
}

#[test]
fn the_reference_plants_are_valid() {
    for params in [VesselParams::simple(), VesselParams::hydrofoil(), VesselParams::hydrofoil_low_speed()] {
        assert_eq!(params.validate(), Ok(()));
    }
}

#[test]
fn mass_matrices_are_those_of_the_reference() {
    let params = VesselParams::hydrofoil();
    for (added, expected) in [(1.0, [85.5, 162.5, 11.0, 41.4455]), (0.5, [82.75, 121.25, 11.0, 28.874])] {
        for (ours, theirs) in params.mass_matrix(added).iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-12, "{ours} and {theirs}");
        }
    }
}

#[test]
fn numbers_that_are_not_finite() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for error in [
            refusal(|p| p.rigid_body.mass = bad),
            refusal(|p| p.rigid_body.x_g = bad),
            refusal(|p| p.added_mass.y_rdot = bad),
            refusal(|p| p.drag.quadratic[1][2] = bad),
            refusal(|p| p.rudder.gain = bad),
            refusal(|p| p.propeller.lag = bad),
            refusal(|p| flying(p).slope = bad),
            refusal(|p| p.commands.rudder.limits[1] = bad),
            refusal(|p| p.noise.r = bad),
        ] {
            assert!(matches!(error, InvalidParams::NotFinite { .. }), "{error}");
        }
    }
}

#[test]
fn parameters_that_must_be_positive() {
    for bad in [0.0, -1.0] {
        for (error, named) in [
            (refusal(|p| p.rigid_body.mass = bad), "rigid_body.mass"),
            (refusal(|p| p.rigid_body.i_z = bad), "rigid_body.i_z"),
            (refusal(|p| p.rudder.gain = bad), "rudder.gain"),
            (refusal(|p| p.propeller.lag = bad), "propeller.lag"),
            (refusal(|p| flying(p).transition_speed = bad), "flying.transition_speed"),
            (refusal(|p| flying(p).slope = bad), "flying.slope"),
        ] {
            assert_eq!(error, InvalidParams::NotPositive { field: named, value: bad });
        }
    }
}

#[test]
fn parameters_that_must_not_be_negative() {
    for (error, named) in [
        (refusal(|p| p.drag.linear[2][2] = -1.0), "drag.linear[2][2]"),
        (refusal(|p| p.drag.quadratic[0][0] = -1.0), "drag.quadratic[0][0]"),
        (refusal(|p| flying(p).drag_factor = -1.0), "flying.drag_factor"),
        (refusal(|p| flying(p).added_mass_factor = -1.0), "flying.added_mass_factor"),
        (refusal(|p| p.noise.u = -1.0), "noise.u"),
    ] {
        assert_eq!(error, InvalidParams::Negative { field: named, value: -1.0 });
    }
}

#[test]
fn added_mass_of_the_wrong_sign_is_not_taken_for_a_lighter_vessel() {
    let error = refusal(|p| p.added_mass.y_vdot = 82.5);
    assert_eq!(error, InvalidParams::PositiveAddedMass { field: "added_mass.y_vdot", value: 82.5 });
}

#[test]
fn a_singular_mass_matrix_of_either_mode() {
    let error = refusal(|p| p.added_mass.y_rdot = -100.0);
    assert!(matches!(error, InvalidParams::MassMatrix { mode: Mode::Normal, .. }), "{error}");
    // With this off-diagonal term the normal mode is valid, the flying mode with three times the added mass is not.
    let error = refusal(|p| {
        p.added_mass.y_rdot = -60.0;
        p.added_mass.n_rdot = -25.0;
        flying(p).added_mass_factor = 3.0;
    });
    assert!(matches!(error, InvalidParams::MassMatrix { mode: Mode::Flying, .. }), "{error}");
}

#[test]
fn yaw_inertia_below_what_the_offset_alone_brings() {
    let error = refusal(|p| p.rigid_body.x_g = 0.5);
    assert!(matches!(error, InvalidParams::YawInertia { .. }), "{error}");
}

#[test]
fn limits_reversed_or_empty() {
    let error = refusal(|p| p.commands.propeller.limits = [100.0, -100.0]);
    assert!(matches!(error, InvalidParams::Limits { field: "commands.propeller.limits", .. }), "{error}");
    let error = refusal(|p| p.commands.rudder.limits = [0.1, 0.1]);
    assert!(matches!(error, InvalidParams::Limits { field: "commands.rudder.limits", .. }), "{error}");
}

#[test]
fn a_rudder_angle_in_degrees() {
    let error = refusal(|p| p.commands.rudder.limits = [-30.0, 30.0]);
    assert_eq!(error, InvalidParams::RudderAngle { limit: -30.0 });
    assert!(error.to_string().contains("radians"));
}

#[test]
fn a_command_without_a_name() {
    assert_eq!(
        refusal(|p| p.commands.rudder.name = " ".into()),
        InvalidParams::EmptyName { field: "commands.rudder.name" }
    );
}
