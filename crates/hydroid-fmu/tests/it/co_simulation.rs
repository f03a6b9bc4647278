//! Co-simulation of all kinds of models: the rollouts of the models, whatever the communication steps are.

use hydroid::model::Body;
use hydroid_export::fmu::Role;

use crate::golden::{Golden, SAMPLES, difference};
use crate::host::{Api, Instance, Resources};
use crate::models;

#[test]
fn each_kind_of_model_moves_as_its_own_rollout() {
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let dt = model.description.dt;
        let resources = Resources::of(&model);
        for api in [Api::Steps2, Api::Steps3] {
            let instance = Instance::started(&resources, api, &golden);
            let mut worst = 0.0_f64;
            for k in 0..SAMPLES {
                instance.inputs(golden.command(k));
                instance.step(k as f64 * dt, dt);
                worst = worst.max(difference(&instance.row(&golden), &golden.row(k)));
            }
            assert!(worst < 1e-12, "{name} {api:?}: {worst:e}");
            // The run is one that moves.
            assert!(difference(&golden.row(SAMPLES - 1), &golden.row(SAMPLES / 2)) > 1e-3, "{name}");
        }
    }
}

#[test]
fn communication_steps_of_any_length_give_the_same_samples() {
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let dt = model.description.dt;
        let resources = Resources::of(&model);
        let instance = Instance::started(&resources, Api::Steps3, &golden);
        // Shares of a sample, which end at 7, 14 .. samples, where the input may change.
        let shares = [0.25, 0.25, 0.5, 1.5, 0.125, 2.375, 1.0 / 3.0, 2.0 / 3.0, 1.0];
        let mut held = golden.commands.clone();
        let m = golden.inputs;
        for k in 0..SAMPLES {
            let block = k / 7 * 7;
            held.copy_within(block * m..(block + 1) * m, k * m);
        }
        let golden = Golden { commands: held, ..golden };
        let reference = Instance::started(&resources, Api::Steps2, &golden);
        for block in 0..20 {
            let first = block * 7;
            instance.inputs(golden.command(first));
            let mut passed = 0.0;
            for share in shares {
                instance.step((first as f64 + passed) * dt, share * dt);
                passed += share;
            }
            assert!((passed - 7.0_f64).abs() < 1e-12);
            for k in first..first + 7 {
                reference.inputs(golden.command(first));
                reference.step(k as f64 * dt, dt);
            }
            let apart = difference(&instance.row(&golden), &reference.row(&golden));
            assert!(apart < 1e-11, "{name}, block {block}: {apart:e}");
        }
    }
}

#[test]
fn the_command_of_a_sample_is_the_mean_of_its_inputs() {
    let model = models::model(Body::Equations(models::equations(vec![models::lag()])));
    let golden = Golden::of(&model);
    let resources = Resources::of(&model);
    let (whole, parts) = (
        Instance::started(&resources, Api::Steps3, &golden),
        Instance::started(&resources, Api::Steps3, &golden),
    );
    let dt = model.description.dt;
    for k in 0..50 {
        let t = f64::from(k) * dt;
        whole.inputs(&[2.0, 0.3]);
        whole.step(t, dt);
        // 0.25 x 5 + 0.5 x 1 + 0.25 x 1 = 2, and the rudder likewise.
        for (at, share, c) in [(0.0, 0.25, [5.0, 0.0]), (0.25, 0.5, [1.0, 0.5]), (0.75, 0.25, [1.0, 0.2])] {
            parts.inputs(&c);
            parts.step(t + at * dt, share * dt);
        }
        let apart = difference(&parts.row(&golden), &whole.row(&golden));
        assert!(apart < 1e-12, "sample {k}: {apart:e}");
    }
}

#[test]
fn outputs_between_samples_are_on_the_chord() {
    let model = models::vessel("otter");
    let golden = Golden::of(&model);
    let resources = Resources::of(&model);
    let instance = Instance::started(&resources, Api::Steps3, &golden);
    let dt = model.description.dt;
    instance.inputs(golden.command(0));
    let start = instance.row(&golden);
    let mut rows = Vec::new();
    for k in 0..4 {
        instance.step(0.25 * f64::from(k) * dt, 0.25 * dt);
        rows.push(instance.row(&golden));
        let time = instance.get(Role::Time);
        assert!((time - 0.25 * f64::from(k + 1) * dt).abs() < 1e-15);
    }
    let end = rows[3].clone();
    for (k, row) in rows.iter().enumerate() {
        let share = 0.25 * (k + 1) as f64;
        let chord: Vec<f64> = start.iter().zip(&end).map(|(a, b)| a + share * (b - a)).collect();
        assert!(difference(row, &chord) < 1e-13);
    }
    assert!(difference(&start, &end) > 1e-3);
}

#[test]
fn instances_are_independent_and_a_reset_repeats_the_run() {
    for (name, model) in models::all().into_iter().step_by(3) {
        let golden = Golden::of(&model);
        let dt = model.description.dt;
        let resources = Resources::of(&model);
        let first = Instance::started(&resources, Api::Steps2, &golden);
        let second = Instance::started(&resources, Api::Steps3, &golden);
        for k in 0..60 {
            first.inputs(golden.command(k));
            first.step(k as f64 * dt, dt);
            // The second one waits for every other sample.
            if k % 2 == 0 {
                second.inputs(golden.command(k / 2));
                second.step((k / 2) as f64 * dt, dt);
            }
        }
        assert!(difference(&first.row(&golden), &golden.row(59)) < 1e-12, "{name}");
        assert!(difference(&second.row(&golden), &golden.row(29)) < 1e-12, "{name}");
        assert_eq!(hydroid_fmu::interface::fmi2::fmi2Reset(first.handle), 0);
        first.start(&golden);
        for k in 0..30 {
            first.inputs(golden.command(k));
            first.step(k as f64 * dt, dt);
        }
        assert_eq!(first.row(&golden), second.row(&golden), "{name}");
    }
}
