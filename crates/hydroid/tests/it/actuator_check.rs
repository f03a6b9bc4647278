//! Faults of actuators that are found by the answers of a vessel.

use hydroid::closed_loop::{ActuatorCheck, ActuatorFault, limits_of};
use hydroid::config::control::NamedModel;
use hydroid::evaluate::PredictionBands;
use hydroid::model::Model;

/// Deviations of the measured `u`, `v` and `r`.
const NOISE: [f64; 3] = [0.02, 0.02, 0.01];

/// Two thrusters, with the bands of these deviations.
fn boat() -> Model {
    let mut model = NamedModel::read("../../vessels/otter.toml".as_ref()).unwrap().model;
    let widths: Vec<f64> = NOISE.iter().map(|deviation| 2.0 * deviation).collect();
    let horizons = vec![1, 100];
    let half_widths = vec![vec![widths; horizons.len()]; 3];
    model.description.bands = Some(PredictionBands { levels: vec![0.5, 0.8, 0.9], horizons, half_widths });
    model
}

fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

/// Time from a fault to the alarm \[s\] and the fault that is found, of a vessel with commands that change every four seconds, and
/// that act by a part.
fn alarm(model: &Model, seed: u64, fault: Option<ActuatorFault>, part: f64) -> Option<(f64, ActuatorFault)> {
    let limits = limits_of(model).unwrap();
    let mut check = ActuatorCheck::new(model, &limits, 1.5).unwrap();
    let (mut vessel, dt, mut uniform) = (model.session(), model.description.dt, uniform(seed));
    let mut y = vec![0.0; vessel.outputs()];
    vessel.observe(&y);
    check.reset();
    let (begins_s, ends_s) = (60.0, if fault.is_some() { 120.0 } else { 600.0 });
    let mut command: Vec<f64> = limits.iter().map(|limits| limits.rest).collect();
    let mut t_s = 0.0;
    let mut held_s = 0.0;
    while t_s < ends_s {
        vessel.output(&mut y);
        let noisy = y.iter().zip(NOISE).map(|(y, deviation)| y + deviation * 12.0_f64.sqrt() * uniform());
        check.observe(f64::NAN, &noisy.collect::<Vec<f64>>());
        if let Some(found) = check.found() {
            return Some((t_s - begins_s, found));
        }
        held_s += dt;
        if held_s > 4.0 {
            held_s = 0.0;
            for (command, limits) in command.iter_mut().zip(&limits) {
                *command = limits.low + (limits.high - limits.low) * (uniform() + 0.5);
            }
        }
        check.advance(&command);
        let mut acting: Vec<f64> = command.iter().map(|command| part * command).collect();
        if let Some(fault) = fault.filter(|_| t_s >= begins_s) {
            fault.apply(&mut acting, &limits);
        }
        vessel.advance(&acting);
        t_s += dt;
    }
    None
}

#[test]
fn each_fault_of_an_actuator_is_found_and_named() {
    let model = boat();
    let all = ActuatorFault::all(&limits_of(&model).unwrap());
    assert_eq!(all.len(), 5);
    for fault in all {
        let alarms: Vec<_> = (0..20).map(|seed| alarm(&model, seed, Some(fault), 1.0)).collect();
        let right = |alarm: &&Option<(f64, ActuatorFault)>| alarm.is_some_and(|(_, found)| found == fault);
        let soon =
            |alarm: &&Option<(f64, ActuatorFault)>| alarm.is_some_and(|(t_s, _)| (0.0..15.0).contains(&t_s));
        println!("{fault:?}: {alarms:?}");
        assert!(alarms.iter().filter(soon).count() >= 19, "{fault:?}: {alarms:?}");
        assert!(alarms.iter().filter(right).count() >= 18, "{fault:?}: {alarms:?}");
    }
}

/// More than three hours, of which two by a vessel whose thrust is a tenth weaker or stronger than that of its model.
#[test]
fn a_sound_vessel_raises_no_alarm() {
    let model = boat();
    for part in [1.0, 0.95, 1.05] {
        for seed in 100..107 {
            assert_eq!(alarm(&model, seed, None, part), None, "part {part}, seed {seed}");
        }
    }
}

#[test]
fn a_model_without_bands_is_not_watched() {
    let mut model = boat();
    let limits = limits_of(&model).unwrap();
    model.description.bands = None;
    assert!(ActuatorCheck::new(&model, &limits, 1.5).is_none());
}
