//! The autopilot in closed loop on the true plants.

use hydroid_core::actuator::Limits;
use hydroid_core::control::{
    AffinePlant, Autopilot, AutopilotOptions, Controller, Estimate, HeadingGains, SpeedGains, Status,
};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{
    LineOfSightOptions, Path, PathReference, Reference, Side, SpeedLimits, SpeedProfile,
};
use hydroid_core::vessel::State;
use proptest::prelude::*;

use crate::controllers::helm::{DT, Moment, Mover, Sea, rms, sail};

/// The simple vessel at 1.5 m/s: `N = u RD`, so that `K = 1.5 / 82.88` and `T = 41.4 / 82.88`.
fn settings(integral: f64) -> AutopilotOptions {
    AutopilotOptions {
        line_of_sight: LineOfSightOptions { lookahead: 5.0, integral },
        heading: HeadingGains::nomoto(1.5 / 82.88, 41.4 / 82.88, 1.0, 1.2, 1.5),
        speed: SpeedGains { proportional: 40.0, integral: 8.0, trim: [0.0, 77.55] },
        steerage: 0.3,
        tolerance: 3.0,
    }
}

fn sailed(
    path: &Path,
    speed: f64,
    wind: [f64; 2],
    noise: f64,
    law: AutopilotOptions,
    start: State,
) -> Vec<Moment> {
    let vessel = Craft::simple();
    let profile = SpeedProfile::new(path, &SpeedLimits::cruise(speed)).unwrap();
    let sea = Sea {
        vessel: &vessel,
        path,
        profile: &profile,
        duration_s: 240.0,
        noise,
        seed: 9,
        wind,
        force: false,
    };
    let mut controller =
        Autopilot::new(AffinePlant::limits(&vessel).first_chunk().unwrap(), DT, law).unwrap();
    sail(&sea, &mut controller, Mover::Vessel(PathReference::new(0.0, 6.0)), start, 0.0)
}

#[test]
fn the_gains_place_the_poles() {
    let (gain, time, omega, zeta) = (0.03, 1.7, 0.8, 0.9);
    let gains = HeadingGains::nomoto(gain, time, omega, zeta, 2.0);
    assert!(((1.0 + gain * gains.derivative) / time - 2.0 * zeta * omega).abs() < 1e-12);
    assert!((gain * gains.proportional / time - omega * omega).abs() < 1e-12);
    assert!((gain * gains.turn - 1.0).abs() < 1e-12);
}

#[test]
fn a_lawn_mower_is_followed_and_its_speed_kept() {
    let path = Path::lawn_mower([0.0, 0.0], 0.4, 60.0, 24.0, 4, 12.0, Side::Starboard).unwrap();
    let run = sailed(&path, 1.5, [0.0; 2], 1.0, settings(0.1), State { psi: 0.4, y: 1.0, ..State::REST });
    assert_eq!(run[0].status, Status::Singular, "no steering without way");
    let (off, slow) = (rms(&run, 20.0, |m| m.cross_track), rms(&run, 20.0, |m| m.speed - m.state.u));
    println!("cross-track {off:.3} m, speed {slow:.4} m/s");
    assert!(off < 0.3 && slow < 0.03);
    assert!(run.iter().filter(|m| m.t > 5.0).all(|m| m.status <= Status::Saturated));
}

/// The integral of the line of sight compensates cross drift, that of the speed the braking by the wind.
#[test]
fn integral_action_rejects_the_wind() {
    let path = Path::legs(&[[0.0, 0.0], [1_000.0, 0.0]]).unwrap();
    let start = State { u: 1.5, p_f: 116.0, ..State::REST };
    let wind = [-0.05, 0.06];
    let off =
        |integral| rms(&sailed(&path, 1.5, wind, 0.0, settings(integral), start), 200.0, |m| m.cross_track);
    let (without, with) = (off(0.0), off(0.1));
    println!("without {without:.3} m, with {with:.4} m");
    assert!(without > 0.15 && with < 0.02 * without);
    let run = sailed(&path, 1.5, wind, 0.0, settings(0.1), start);
    assert!(rms(&run, 200.0, |m| m.speed - m.state.u) < 1e-3);
}

/// An unreachable speed: the integral does not wind up, and the vessel slows down on demand.
#[test]
fn saturation_causes_no_windup() {
    let vessel = Craft::simple();
    let mut controller =
        Autopilot::new(AffinePlant::limits(&vessel).first_chunk().unwrap(), DT, settings(0.1)).unwrap();
    let path = Path::legs(&[[0.0, 0.0], [1_000.0, 0.0]]).unwrap();
    let seen = Estimate { eta: [0.0; 3], nu: [3.0, 0.0, 0.0], current: [0.0; 2], actuators: &[] };
    let mut command = [0.0; 2];
    for _ in 0..3_000 {
        let status = controller.command(&seen, &Reference::new(0.0, &path.at(0.0), 5.0, 0.0), &mut command);
        assert_eq!((status, command[0]), (Status::Saturated, 240.0));
    }
    controller.command(&seen, &Reference::new(0.0, &path.at(0.0), 2.0, 0.0), &mut command);
    assert!(command[0] < 200.0, "{command:?}");
    let nothing = Estimate { eta: [f64::NAN; 3], ..seen };
    let before = command;
    let reference = Reference::new(0.0, &path.at(0.0), 2.0, 0.0);
    assert_eq!(controller.command(&nothing, &reference, &mut command), Status::Blind);
    assert_eq!(before, command);
    assert!(
        Autopilot::new(
            AffinePlant::limits(&vessel).first_chunk().unwrap(),
            DT,
            AutopilotOptions { steerage: 0.0, ..settings(0.1) }
        )
        .is_err()
    );
    let blind = LineOfSightOptions { lookahead: -1.0, integral: 0.0 };
    let told = Autopilot::new(
        AffinePlant::limits(&vessel).first_chunk().unwrap(),
        DT,
        AutopilotOptions { line_of_sight: blind, ..settings(0.1) },
    );
    assert!(told.unwrap_err().to_string().starts_with("the look-ahead distance"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn commands_keep_their_limits_and_failures_have_a_status(
        seed in 0u64..1000, speed in 0.2..6.0f64, tight in 0.05..1.0f64, rate in 0.05..5.0f64,
        (x, y, psi) in (-60.0..60.0f64, -60.0..60.0f64, -4.0..4.0f64), u in -1.0..4.0f64,
    ) {
        let vessel = Craft::hydrofoil();
        let path = Path::lawn_mower([0.0, 0.0], 0.3, 40.0, 20.0, 4, 9.0, Side::Port).unwrap();
        let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
        let limits = [
            Limits::between([-130.0 * tight, 350.0 * tight]).with_rate(200.0 * rate),
            Limits::between([-0.5 * tight, 0.4 * tight]).with_rate(rate),
        ];
        let law = settings(0.1);
        let mut controller = Autopilot::new(&limits, DT, law).unwrap();
        let sea = Sea {
            vessel: &vessel, path: &path, profile: &profile, duration_s: 40.0, noise: 1.0, seed, wind: [0.05, -0.02], force: false,
        };
        let mut last = [0.0; 2];
        let start = State { x, y, psi, u, ..State::REST };
        for moment in sail(&sea, &mut controller, Mover::Vessel(PathReference::new(0.0, 6.0)), start, 0.0) {
            for i in 0..2 {
                prop_assert!((limits[i].low..=limits[i].high).contains(&moment.command[i]));
                prop_assert!((moment.command[i] - last[i]).abs() <= limits[i].rate * DT * (1.0 + 1e-9));
            }
            last = moment.command;
            prop_assert!(moment.state.is_finite());
            prop_assert!(moment.error <= law.tolerance || moment.status >= Status::Lost);
        }
    }
}
