//! Path-following controller of closed-loop excitations, on the true state and parameters.

use hydroid_core::vessel::kinematics::wrap;
use hydroid_core::vessel::{Command, State};

use super::path::Place;
use super::plan::Stage;
use crate::excitation::{Envelope, PropellerRudder};

/// Path-following controller.
///
/// - Speed: `PP = F(u_d) + k_p (u_d - u) + k_i integral`, `F` the force that holds the speed.
/// - Guidance: line of sight, `chi_d = course - atan(e / lookahead)`, with the cross-track error `e`; heading
///   `psi_d = chi_d - beta` with the sideslip `beta = atan2(v, u)` (Fossen, Handbook of Marine Craft Hydrodynamics and
///   Motion Control, 2nd ed., chapter 12).
/// - Heading: `N = m33 (w^2 (psi_d - psi) + 2 w (r_d - r)) + drag and Coriolis moment`, `r_d` the curvature
///   of the path times the speed; from `N` the rudder command.
pub(super) struct PathController<'a> {
    vessel: &'a PropellerRudder,
    stages: Vec<Stage>,
    stage: usize,
    integral: f64,
    dt_s: f64,
    speed_gain: f64,
    integral_gain: f64,
    bandwidth: f64,
    time_s: f64,
    slowest: f64,
}

impl<'a> PathController<'a> {
    pub(super) fn new(
        vessel: &'a PropellerRudder,
        envelope: &Envelope,
        stages: Vec<Stage>,
        dt_s: f64,
    ) -> Self {
        let [m11, ..] = vessel.craft().hull.mass_matrix();
        // A propeller without a lag still has a sample to follow.
        let lag = vessel.lag_s().max(dt_s);
        // The closed-loop pole is slower than the propeller lag.
        let speed_gain = 0.4 * m11 / lag;
        Self {
            vessel,
            stages,
            stage: 0,
            integral: 0.0,
            dt_s,
            speed_gain,
            integral_gain: speed_gain / (8.0 * lag),
            bandwidth: 2.0 / envelope.time_s,
            time_s: envelope.time_s,
            slowest: 0.1 * envelope.top_speed,
        }
    }

    /// Command of this sample; `None` after the last stage.
    pub(super) fn command(&mut self, state: &State) -> Option<Command> {
        let (stage, place) = loop {
            let stage = *self.stages.get(self.stage)?;
            let place = stage.piece.place(state);
            if place.remaining > 0.0 {
                break (stage, place);
            }
            self.stage += 1;
            self.integral = 0.0;
        };
        let speed = if place.remaining < self.braking_way(state.u, stage.end_speed) {
            stage.end_speed
        } else {
            stage.speed
        };
        Some(Command { pp: self.propeller(state, speed), rd: self.rudder(state, &place) })
    }

    /// Distance in which drag decelerates the vessel, propeller lag included \[m\].
    fn braking_way(&self, from: f64, to: f64) -> f64 {
        if from <= to {
            return 0.0;
        }
        let [m11, ..] = self.vessel.craft().hull.mass_matrix();
        let deceleration = self.vessel.dynamics().holding_force(to) / m11;
        2.0 * self.vessel.lag_s() * from + (from * from - to * to) / (2.0 * deceleration)
    }

    fn propeller(&mut self, state: &State, speed: f64) -> f64 {
        let error = speed - state.u;
        let force = self.vessel.dynamics().holding_force(speed)
            + self.speed_gain * error
            + self.integral_gain * self.integral;
        let wanted = self.vessel.command_of(force);
        let pp = self.vessel.propeller().clamp(wanted);
        // Anti-windup: no integration at a command limit.
        if pp == wanted {
            self.integral += error * self.dt_s;
        }
        pp
    }

    fn rudder(&self, state: &State, place: &Place) -> f64 {
        let speed = state.u.hypot(state.v);
        let lookahead = 1.5 * self.time_s * speed.max(self.slowest);
        let sideslip = if state.u > self.slowest { state.v.atan2(state.u) } else { 0.0 };
        let heading = place.course - (place.cross_track / lookahead).atan() - sideslip;
        let yaw_rate = place.curvature * speed;

        let [_, _, _, m33] = self.vessel.craft().hull.mass_matrix();
        let [.., drag] = self.vessel.dynamics().damping(state.nu());
        let [.., coriolis] = self.vessel.dynamics().coriolis(state.nu());
        let flying = self.vessel.dynamics().flying_weight(state.u);
        let drag_factor =
            self.vessel.craft().flying.map_or(1.0, |mode| 1.0 + flying * (mode.drag_factor - 1.0));
        let w = self.bandwidth;
        let moment = m33 * (w * w * wrap(heading - state.psi) + 2.0 * w * (yaw_rate - state.r))
            + drag_factor * drag
            + coriolis;

        // At low speed the rudder has little effect, and a division by the speed would amplify noise.
        let wanted = self.vessel.rudder_of(moment, state.u.max(self.slowest));
        self.vessel.rudder().clamp(wanted)
    }
}
