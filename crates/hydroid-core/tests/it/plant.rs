//! A vessel with one propeller, whose order is its force, and one rudder that follows at once.

use hydroid_core::craft::{Craft, Dynamics, Posed};
use hydroid_core::vessel::{Command, State};

pub(crate) struct Plant {
    pub(crate) dynamics: Dynamics,
    pub(crate) craft: Craft,
}

impl Plant {
    pub(crate) fn new(craft: &Craft) -> Self {
        craft.validate().unwrap();
        Self { dynamics: Dynamics::new(craft), craft: craft.clone() }
    }

    pub(crate) fn acceleration(&self, nu: [f64; 3], force: f64, rudder: f64) -> [f64; 3] {
        self.dynamics.acceleration(nu, &[force, rudder])
    }

    pub(crate) fn advance(&self, state: &State, command: &Command, h: f64) -> State {
        let State { x, y, psi, u, v, r, p_f } = *state;
        let mut posed = Posed { eta: [x, y, psi], nu: [u, v, r], positions: vec![p_f, command.rd] };
        self.dynamics.advance_pose(&mut posed, &[command.pp, command.rd], h, 1, [0.0; 2], [0.0; 2]);
        let ([x, y, psi], [u, v, r]) = (posed.eta, posed.nu);
        State { x, y, psi, u, v, r, p_f: posed.positions[0] }
    }
}
