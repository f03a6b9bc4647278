//! The vessels of the thesis.
//!
//! Rigid body, added mass, propeller limits and part of the drag are those of the Maritime Robotics Otter USV (L = 2.0
//! m, 25 kg payload) in T. I. Fossen's Python Vehicle Simulator, `otter.py`. The thesis gives equations without
//! numbers: the remaining drag and the rudder constants are chosen freely.

use alloc::string::String;
use alloc::vec;

use super::{
    CommandInput, Coriolis, Craft, Flying, Hull, Order, Rudder, RudderLaw, Servo, ThrustLaw, Thruster,
};

/// Thesis section 3.2: 1 cm/s, 1 cm/s, 1 deg/s.
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453_292_519_943_295];

/// Hull 55 kg and payload 25 kg; yaw inertia 14.79 kg m^2 about the centre of gravity, moved to the origin amidships.
/// Added mass: -0.1 and -1.5 hull masses, -1.7 yaw inertias.
fn hull(linear: [[f64; 3]; 3], quadratic: [[f64; 3]; 3]) -> Hull {
    Hull {
        size: None,
        mass: 80.0,
        x_g: 0.1375,
        i_z: 16.3025,
        x_udot: -5.5,
        y_vdot: -82.5,
        y_rdot: 0.0,
        n_rdot: -25.143,
        linear,
        quadratic,
        lift: [[0.0; 2]; 2],
        cross_flow: 0.0,
        coriolis: Coriolis::WithoutMunk,
    }
}

fn command(name: &str, unit: &str, limits: [f64; 2]) -> CommandInput {
    CommandInput { name: name.into(), unit: unit.into(), limits, neutral: 0.0 }
}

fn servo(command: usize, lag: f64) -> Servo {
    let limits = [f64::NEG_INFINITY, f64::INFINITY];
    Servo { order: Order { terms: vec![(command, 0.0, 1.0)], limits }, lag, rate: None }
}

/// A vessel with a propeller, whose order is its force and lags by 1 s, and a rudder that follows at once.
fn of_parts(name: &str, hull: &Hull, commands: [CommandInput; 2], law: RudderLaw) -> Craft {
    let propeller = Thruster {
        name: String::from("propeller"),
        position: [0.0; 2],
        angle: 0.0,
        servo: servo(0, 1.0),
        dead_band: 0.0,
        law: ThrustLaw::Linear,
        forward: 1.0,
        reverse: 1.0,
        speed_loss: 0.0,
        diameter: None,
        steering: None,
        force_noise: None,
    };
    Craft {
        name: name.into(),
        water_density: 1025.0,
        hull: *hull,
        flying: None,
        commands: commands.into(),
        thrusters: vec![propeller],
        rudders: vec![Rudder { name: String::from("rudder"), servo: servo(1, 0.0), law }],
        noise: NOISE,
    }
}

impl Craft {
    /// The simple vessel (thesis eq. 1-6): linear drag, yaw moment `u RD`, measured propeller force.
    pub fn simple() -> Self {
        let linear = [[77.55, 0.0, 0.0], [0.0, 162.5, -16.25], [0.0, -16.25, 82.88]];
        let commands = [command("PP_cmd", "N", [-130.0, 240.0]), command("RD_cmd", "N s", [-25.0, 25.0])];
        let hull = hull(linear, [[0.0; 3]; 3]);
        let mut craft = of_parts("simple", &hull, commands, RudderLaw::Linear(1.0));
        craft.thrusters[0].force_noise = Some(1.0);
        craft
    }

    /// The hydrofoil (thesis eq. 7-12): linear and quadratic drag, yaw moment `70 u sin(RD)`, half of the drag and of
    /// the added mass above 2.5 m/s.
    pub fn hydrofoil() -> Self {
        Self {
            name: "hydrofoil".into(),
            flying: Some(Flying {
                added_mass_factor: 0.5,
                drag_factor: 0.5,
                transition_speed: 2.5,
                slope: 12.0,
            }),
            ..Self::hydrofoil_low_speed()
        }
    }

    /// The hydrofoil without its flying mode: the low-speed model C0 of the thesis (section 4.2).
    pub fn hydrofoil_low_speed() -> Self {
        let degrees_30 = 30.0_f64.to_radians();
        let linear = [[20.0, 0.0, 0.0], [0.0, 81.25, -8.125], [0.0, -8.125, 41.44]];
        let quadratic = [[18.65, 0.0, 0.0], [0.0, 200.0, -20.0], [0.0, -20.0, 414.4]];
        let commands =
            [command("PP_cmd", "N", [-130.0, 350.0]), command("RD_ang", "rad", [-degrees_30, degrees_30])];
        of_parts("hydrofoil_low_speed", &hull(linear, quadratic), commands, RudderLaw::Sine(70.0))
    }
}
