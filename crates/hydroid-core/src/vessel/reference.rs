//! The reference plants of the thesis.
//!
//! Rigid body, added mass, propeller limits and part of the drag are those of the Maritime Robotics Otter USV (L = 2.0
//! m, 25 kg payload) in T. I. Fossen's Python Vehicle Simulator, `otter.py`. The thesis gives equations without
//! numbers: the remaining drag and the rudder constants are chosen freely.

use super::params::{
    AddedMass, CommandChannel, Commands, Coriolis, Drag, Flying, Noise, Propeller, RigidBody, Rudder,
    RudderLaw, VesselParams,
};

/// Hull 55 kg and payload 25 kg; yaw inertia 14.79 kg m^2 about the centre of gravity, moved to CO.
const RIGID_BODY: RigidBody = RigidBody { mass: 80.0, x_g: 0.1375, i_z: 16.3025 };

/// -0.1 and -1.5 hull masses, -1.7 yaw inertias.
const ADDED_MASS: AddedMass = AddedMass { x_udot: -5.5, y_vdot: -82.5, n_rdot: -25.143, y_rdot: 0.0 };

/// Thesis section 3.2: 1 cm/s, 1 cm/s, 1 deg/s.
const NOISE: Noise = Noise { u: 0.01, v: 0.01, r: 0.017_453_292_519_943_295, p_f: 0.0 };

impl VesselParams {
    /// The simple vessel (thesis eq. 1-6): linear drag, yaw moment `u RD`, propeller force measured.
    pub fn simple() -> Self {
        Self {
            name: "simple".into(),
            coriolis: Coriolis::WithoutMunk,
            rigid_body: RIGID_BODY,
            added_mass: ADDED_MASS,
            drag: Drag {
                linear: [[77.55, 0.0, 0.0], [0.0, 162.5, -16.25], [0.0, -16.25, 82.88]],
                quadratic: [[0.0; 3]; 3],
            },
            rudder: Rudder { law: RudderLaw::Linear, gain: 1.0 },
            propeller: Propeller { lag: 1.0, force_measured: true },
            flying: None,
            commands: Commands {
                propeller: CommandChannel {
                    name: "PP_cmd".into(),
                    unit: "N".into(),
                    limits: [-130.0, 240.0],
                },
                rudder: CommandChannel { name: "RD_cmd".into(), unit: "N s".into(), limits: [-25.0, 25.0] },
            },
            noise: Noise { p_f: 1.0, ..NOISE },
        }
    }

    /// The hydrofoil (thesis eq. 7-12): linear and quadratic drag, yaw moment `70 u sin(RD)`, half of the drag and of
    /// the added mass above 2.5 m/s, propeller force not measured.
    pub fn hydrofoil() -> Self {
        let degrees_30 = 30.0_f64.to_radians();
        Self {
            name: "hydrofoil".into(),
            coriolis: Coriolis::WithoutMunk,
            rigid_body: RIGID_BODY,
            added_mass: ADDED_MASS,
            drag: Drag {
                linear: [[20.0, 0.0, 0.0], [0.0, 81.25, -8.125], [0.0, -8.125, 41.44]],
                quadratic: [[18.65, 0.0, 0.0], [0.0, 200.0, -20.0], [0.0, -20.0, 414.4]],
            },
            rudder: Rudder { law: RudderLaw::Sine, gain: 70.0 },
            propeller: Propeller { lag: 1.0, force_measured: false },
            flying: Some(Flying {
                added_mass_factor: 0.5,
                drag_factor: 0.5,
                transition_speed: 2.5,
                slope: 12.0,
            }),
            commands: Commands {
                propeller: CommandChannel {
                    name: "PP_cmd".into(),
                    unit: "N".into(),
                    limits: [-130.0, 350.0],
                },
                rudder: CommandChannel {
                    name: "RD_ang".into(),
                    unit: "rad".into(),
                    limits: [-degrees_30, degrees_30],
                },
            },
            noise: NOISE,
        }
    }

    /// The hydrofoil without its flying mode: the low-speed model C0 of the thesis (section 4.2).
    pub fn hydrofoil_low_speed() -> Self {
        Self { name: "hydrofoil_low_speed".into(), flying: None, ..Self::hydrofoil() }
    }
}
