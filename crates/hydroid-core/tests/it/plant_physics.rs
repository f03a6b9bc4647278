//! Properties of all vessels: energy, mirror symmetry, order of the integrator.

use hydroid_core::craft::{Coriolis, Craft};
use hydroid_core::vessel::{Command, State, rk4};

use crate::plant::Plant;
use proptest::prelude::*;

/// `nu' M nu_dot`, the rate of the kinetic energy.
fn power(plant: &Plant, nu: [f64; 3], acceleration: [f64; 3]) -> f64 {
    let [m11, m22, m23, m33] = plant.craft.hull.mass_matrix();
    let momentum_rate = [
        m11 * acceleration[0],
        m22 * acceleration[1] + m23 * acceleration[2],
        m23 * acceleration[1] + m33 * acceleration[2],
    ];
    nu.iter().zip(momentum_rate).map(|(w, f)| w * f).sum()
}

fn frictionless(coriolis: Coriolis, x_g: f64, y_vdot: f64, y_rdot: f64) -> Plant {
    let mut params = Craft::simple();
    params.hull.coriolis = coriolis;
    params.hull.x_g = x_g;
    params.hull.y_vdot = y_vdot;
    params.hull.y_rdot = y_rdot;
    params.hull.linear = [[0.0; 3]; 3];
    Plant::new(&params)
}

prop_compose! {
    fn any_nu()(u in -6.0..6.0, v in -2.0..2.0, r in -1.5..1.5) -> [f64; 3] { [u, v, r] }
}

proptest! {
    #[test]
    fn without_drag_and_force_energy_changes_by_the_munk_term_alone(
        nu in any_nu(), x_g in -0.3..0.3, y_vdot in -200.0..0.0, y_rdot in -5.0..5.0,
    ) {
        let plant = frictionless(Coriolis::WithoutMunk, x_g, y_vdot, y_rdot);
        let rate = power(&plant, nu, plant.acceleration(nu, 0.0, 0.0));
        let [m11, m22, ..] = plant.craft.hull.mass_matrix();
        let [u, v, r] = nu;
        let expected = -(m11 - m22) * u * v * r;
        prop_assert!((rate - expected).abs() < 1e-9, "{rate} and {expected}");
    }

    #[test]
    fn the_full_coriolis_matrix_does_no_work(
        nu in any_nu(), x_g in -0.3..0.3, y_vdot in -200.0..0.0, y_rdot in -5.0..5.0,
    ) {
        let plant = frictionless(Coriolis::Full, x_g, y_vdot, y_rdot);
        let rate = power(&plant, nu, plant.acceleration(nu, 0.0, 0.0));
        prop_assert!(rate.abs() < 1e-9, "{rate}");
    }

    #[test]
    fn port_mirrors_starboard(
        nu in any_nu(), psi in -10.0..10.0, p_f in -130.0..350.0, pp in -130.0..350.0, rd in -0.5..0.5, full: bool,
    ) {
        for mut params in [Craft::simple(), Craft::hydrofoil()] {
            params.hull.coriolis = if full { Coriolis::Full } else { Coriolis::WithoutMunk };
            let plant = Plant::new(&params);
            let [u, v, r] = nu;
            let starboard = plant.advance(&State { x: 0.0, y: 0.0, psi, u, v, r, p_f }, &Command { pp, rd }, 0.01);
            let mirrored = State { x: 0.0, y: 0.0, psi: -psi, u, v: -v, r: -r, p_f };
            let port = plant.advance(&mirrored, &Command { pp, rd: -rd }, 0.01);
            let back = State { y: -port.y, psi: -port.psi, v: -port.v, r: -port.r, ..port };
            prop_assert_eq!(starboard, back);
        }
    }

    #[test]
    fn one_sigmoid_serves_both_modes(u in -50.0..50.0) {
        let plant = Plant::new(&Craft::hydrofoil());
        let z: f64 = 12.0 * (u - 2.5);
        let (fly, normal) = (1.0 / ((-z).exp() + 1.0), 1.0 / (z.exp() + 1.0));
        prop_assert!((plant.dynamics.flying_weight(u) - fly).abs() < 1e-15);
        prop_assert!((1.0 - plant.dynamics.flying_weight(u) - normal).abs() < 1e-15);
    }
}

#[test]
fn far_from_the_transition_nothing_overflows() {
    let plant = Plant::new(&Craft::hydrofoil());
    for u in [-1e4, 1e4] {
        let rate = plant.acceleration([u, 0.0, 0.0], 0.0, 0.0);
        assert!(rate.iter().all(|x| x.is_finite()), "{rate:?}");
    }
}

#[test]
fn flying_halves_the_steady_drag() {
    let plant = Plant::new(&Craft::hydrofoil());
    // (20 + 18.65 u) u / 2 at 5 m/s.
    let force = 0.5 * (20.0 + 18.65 * 5.0) * 5.0;
    let [surge, ..] = plant.acceleration([5.0, 0.0, 0.0], force, 0.0);
    assert!(surge.abs() < 1e-12, "{surge}");
}

#[test]
fn the_holding_force_holds_at_every_speed() {
    for params in [Craft::simple(), Craft::hydrofoil()] {
        let plant = Plant::new(&params);
        for u in [-2.0, 0.0, 1.0, 2.4, 2.5, 2.55, 3.0, 5.5] {
            let [surge, ..] = plant.acceleration([u, 0.0, 0.0], plant.dynamics.holding_force(u), 0.0);
            assert!(surge.abs() < 1e-13, "{}: {surge} at {u} m/s", params.name);
        }
    }
}

/// Error of the speed after 2 s without a force, whose solution is an exponential.
fn speed_error(steps: u32) -> f64 {
    let plant = Plant::new(&Craft::simple());
    let (h, start) = (2.0 / f64::from(steps), State { u: 2.0, ..State::REST });
    let end = (0..steps).fold(start, |state, _| plant.advance(&state, &Command::default(), h));
    (end.u - 2.0 * (-2.0_f64 * 77.55 / 85.5).exp()).abs()
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    for (coarse, fine) in [(8, 16), (16, 32), (32, 64)] {
        let order = (speed_error(coarse) / speed_error(fine)).log2();
        assert!((order - 4.0).abs() < 0.2, "order {order} from {coarse} to {fine} steps");
    }
    assert!(speed_error(200) < 1e-8);
}

#[test]
fn the_lag_of_the_propeller_is_exact() {
    let command = Command { pp: 100.0, rd: 0.0 };
    let end = Plant::new(&Craft::simple()).advance(&State::REST, &command, 2.0);
    assert!((end.p_f - 100.0 * (1.0 - (-2.0_f64).exp())).abs() < 1e-12, "{}", end.p_f);
}

#[test]
fn the_integrator_keeps_a_circle() {
    let rotate = |x: &[f64; 2]| [-x[1], x[0]];
    let mut x = [1.0, 0.0];
    for _ in 0..1_000 {
        x = rk4::step(rotate, &x, core::f64::consts::TAU / 1_000.0);
    }
    assert!((x[0] - 1.0).abs() < 1e-10 && x[1].abs() < 1e-10, "{x:?}");
}
