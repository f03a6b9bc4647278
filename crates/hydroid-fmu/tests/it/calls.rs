//! Wrong calls and damaged resources: errors with a message, never a crash.

use std::ptr::{null, null_mut};

use hydroid::model::Body;
use hydroid_export::fmu::{Role, SAMPLE_TIME_FILE};
use hydroid_fmu::interface::{ERROR, Handle, OK, fmi2, fmi3};

use crate::golden::Golden;
use crate::host::{Api, Instance, Resources, instantiate, reported};
use crate::models;

#[test]
fn handles_that_are_no_instances_are_errors() {
    let model = models::vessel("otter");
    let resources = Resources::of(&model);
    let freed = Instance::new(&resources, Api::Steps3).handle;
    for handle in [null_mut(), freed, 1 as Handle, usize::MAX as Handle] {
        let mut value = 0.0;
        let mut state = null_mut();
        unsafe {
            assert_eq!(fmi3::fmi3GetFloat64(handle, &0, 1, &raw mut value, 1), ERROR);
            assert_eq!(fmi2::fmi2GetReal(handle, &0, 1, &raw mut value), ERROR);
            assert_eq!(fmi3::fmi3GetFMUState(handle, &raw mut state), ERROR);
            assert_eq!(
                fmi3::fmi3DoStep(handle, 0.0, 0.1, 1, null_mut(), null_mut(), null_mut(), null_mut()),
                ERROR
            );
        }
        assert_eq!(fmi2::fmi2DoStep(handle, 0.0, 0.1, 1), ERROR);
        assert_eq!(fmi2::fmi2Reset(handle), ERROR);
        assert_eq!(fmi3::fmi3Terminate(handle), ERROR);
        assert_eq!(fmi3::fmi3EnterStepMode(handle), ERROR);
        assert!(fmi2::fmi2GetStatus(handle, 0, null_mut()) >= 2);
        // Freed twice.
        fmi2::fmi2FreeInstance(handle);
        fmi3::fmi3FreeInstance(handle);
    }
}

#[test]
fn null_pointers_and_unknown_variables_are_errors() {
    let model = models::vessel("otter");
    let (golden, resources) = (Golden::of(&model), Resources::of(&model));
    let instance = Instance::started(&resources, Api::Steps3, &golden);
    let c = instance.handle;
    let mut value = 0.0;
    unsafe {
        assert_eq!(fmi3::fmi3GetFloat64(c, null(), 1, &raw mut value, 1), ERROR);
        assert_eq!(fmi3::fmi3GetFloat64(c, &0, 1, null_mut(), 1), ERROR);
        assert_eq!(fmi3::fmi3GetFloat64(c, &0, 1, &raw mut value, 2), ERROR);
        assert_eq!(fmi3::fmi3GetFloat64(c, null(), usize::MAX, null_mut(), usize::MAX), ERROR);
        assert_eq!(fmi3::fmi3GetFloat64(c, null(), 0, null_mut(), 0), OK);
        assert_eq!(fmi3::fmi3SetFloat64(c, &1, 1, null(), 1), ERROR);
        assert_eq!(fmi3::fmi3GetFMUState(c, null_mut()), ERROR);
        assert_eq!(fmi3::fmi3FreeFMUState(c, null_mut()), OK);
        assert_eq!(fmi3::fmi3SerializedFMUStateSize(c, null_mut(), null_mut()), ERROR);
        assert_eq!(fmi3::fmi3DeserializeFMUState(c, null(), 40, &mut null_mut()), ERROR);
        for reference in [u32::MAX, 10_000] {
            assert_eq!(fmi3::fmi3GetFloat64(c, &raw const reference, 1, &raw mut value, 1), ERROR);
            assert_eq!(instance.try_set(reference, 1.0), ERROR);
        }
        assert_eq!(fmi3::fmi3GetInt32(c, &0, 1, null_mut(), 1), ERROR);
        assert_eq!(fmi3::fmi3GetInt32(c, null(), 0, null_mut(), 0), OK);
        assert_eq!(fmi3::fmi3GetNumberOfContinuousStates(c, null_mut()), ERROR);
        assert_eq!(fmi3::fmi3GetNumberOfEventIndicators(c, null_mut()), OK);
    }
    assert!(reported("there is no variable with the value reference 10000"));
    // Texts that are missing.
    unsafe {
        let instance = fmi2::fmi2Instantiate(null(), 1, null(), null(), null(), 0, 0);
        assert!(instance.is_null());
        let none = null_mut();
        let (flags, path) = ((0, 0, 0, 0), null());
        let (a, b, e, d) = flags;
        let instance =
            fmi3::fmi3InstantiateCoSimulation(path, path, path, a, b, e, d, null(), 0, none, None, null());
        assert!(instance.is_null());
        let instance = fmi3::fmi3InstantiateScheduledExecution(
            path,
            path,
            path,
            0,
            0,
            none,
            None,
            null(),
            null(),
            null(),
        );
        assert!(instance.is_null());
    }
}

#[test]
fn calls_out_of_order_and_impossible_numbers_are_errors() {
    let model = models::vessel("tug");
    let (golden, resources) = (Golden::of(&model), Resources::of(&model));
    for api in [Api::Steps2, Api::Steps3] {
        let instance = Instance::new(&resources, api);
        let dt = model.description.dt;
        assert_eq!(instance.try_step(0.0, dt), ERROR);
        assert_eq!(fmi3::fmi3ExitInitializationMode(instance.handle), ERROR);
        assert_eq!(fmi3::fmi3EnterInitializationMode(instance.handle, 0, 0.0, f64::NAN, 0, 0.0), ERROR);
        instance.start(&golden);
        assert_eq!(fmi3::fmi3EnterInitializationMode(instance.handle, 0, 0.0, 0.0, 0, 0.0), ERROR);
        for (t, h) in [
            (0.0, 0.0),
            (0.0, -dt),
            (0.0, f64::NAN),
            (0.0, f64::INFINITY),
            (0.0, 1e300),
            (f64::NAN, dt),
            (5.0, dt),
            (-dt, dt),
        ] {
            assert_eq!(instance.try_step(t, h), ERROR, "{t} {h}");
        }
        let input = resources.reference(Role::Input(0));
        for value in [f64::NAN, f64::INFINITY] {
            assert_eq!(instance.try_set(input, value), ERROR);
        }
        // Calculated variables, and parameters after the start.
        for role in [Role::Output(0), Role::Pose(2), Role::Hidden(0), Role::Derivative(0), Role::Time] {
            assert_eq!(instance.try_set(resources.reference(role), 1.0), ERROR, "{role:?}");
        }
        assert_eq!(instance.try_set(resources.reference(Role::StartOutput(0)), 1.0), ERROR);
        assert_eq!(fmi3::fmi3EnterContinuousTimeMode(instance.handle), ERROR);
        // All that failed changed nothing.
        instance.inputs(golden.command(0));
        instance.step(0.0, dt);
        assert!(crate::golden::difference(&instance.row(&golden), &golden.row(0)) < 1e-12);
        assert_eq!(fmi3::fmi3Terminate(instance.handle), OK);
        assert_eq!(instance.try_step(dt, dt), ERROR);
    }
    assert!(reported("the time of the FMU is"));
}

/// Regression test: at a start time that a sample does not change, a step never ended.
#[test]
fn a_time_in_which_samples_vanish_is_an_error() {
    let resources = Resources::of(&models::vessel("otter"));
    for (start, expected) in [(1e300, ERROR), (1e12, ERROR), (-1e18, ERROR), (1.7e9, OK), (-50.0, OK)] {
        let instance = Instance::new(&resources, Api::Steps3);
        assert_eq!(fmi3::fmi3EnterInitializationMode(instance.handle, 0, 0.0, start, 0, 0.0), OK);
        assert_eq!(fmi3::fmi3ExitInitializationMode(instance.handle), OK);
        assert_eq!(instance.try_step(start, 0.1), expected, "{start}");
        if expected == OK {
            // Times with the rounding of an importer that adds up its steps.
            let times: Vec<f64> = (1..400).map(|k| start + f64::from(k) * 0.1).collect();
            assert!(times.iter().all(|t| instance.try_step(*t, 0.1) == OK));
            assert!((instance.get(Role::Time) - start - 40.0).abs() < 1e-5);
        }
    }
    assert!(reported("too large for samples"));
}

#[test]
fn a_model_that_diverges_is_an_error_with_its_time() {
    let model = models::model(Body::Equations(models::equations(Vec::new())));
    let (golden, resources) = (Golden::of(&model), Resources::of(&model));
    let instance = Instance::started(&resources, Api::Steps3, &golden);
    instance.inputs(&[1e300, 0.0]);
    let statuses: Vec<i32> = (0..5).map(|k| instance.try_step(f64::from(k) * 0.1, 0.1)).collect();
    assert!(statuses.contains(&ERROR), "{statuses:?}");
    assert!(reported("diverged"));
    assert_eq!(fmi3::fmi3Reset(instance.handle), OK);
    instance.start(&golden);
    instance.inputs(golden.command(0));
    instance.step(0.0, 0.1);
}

#[test]
fn damaged_resources_are_errors() {
    for model in [models::vessel("otter"), models::all().swap_remove(9).1] {
        let resources = Resources::of(&model);
        let path = resources.folder.path().join(resources.model_file);
        let whole = std::fs::read(&path).unwrap();
        let refused = |what: &str| {
            for api in [Api::Steps2, Api::Steps3] {
                let handle = instantiate(resources.folder.path(), &resources.token, api);
                assert!(handle.is_null(), "{what} {api:?}");
            }
        };
        for length in (0..whole.len()).step_by(whole.len() / 40 + 1) {
            std::fs::write(&path, &whole[..length]).unwrap();
            refused("truncated");
        }
        for at in (0..whole.len()).step_by(whole.len() / 40 + 1) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0xff;
            std::fs::write(&path, &damaged).unwrap();
            refused("a changed byte");
        }
        assert!(reported("damaged"));
        std::fs::write(&path, b"\x00\xffgarbage").unwrap();
        refused("garbage");
        std::fs::remove_file(&path).unwrap();
        refused("missing");
        assert!(reported("cannot read"));
        std::fs::write(&path, &whole).unwrap();
        let time = resources.folder.path().join(SAMPLE_TIME_FILE);
        let text = std::fs::read(&time).unwrap();
        for bad in ["", "-0.1", "nan", "0.2", "\u{1F6A2}"] {
            std::fs::write(&time, bad).unwrap();
            refused(bad);
        }
        std::fs::write(&time, &text).unwrap();
        assert!(instantiate(resources.folder.path(), "hydroid-0000000000000000", Api::Steps3).is_null());
        assert!(instantiate(&resources.folder.path().join("none"), &resources.token, Api::Steps3).is_null());
        // The whole one is fine, also from a folder with a space in its name.
        let spaced = resources.folder.path().join("a b%");
        std::fs::create_dir(&spaced).unwrap();
        std::fs::write(spaced.join(resources.model_file), &whole).unwrap();
        std::fs::write(spaced.join(SAMPLE_TIME_FILE), &text).unwrap();
        for api in [Api::Steps2, Api::Steps3] {
            let handle = instantiate(&spaced, &resources.token, api);
            assert!(!handle.is_null());
            fmi2::fmi2FreeInstance(handle);
        }
    }
}
