//! States: kept, restored, serialised, damaged.

use std::ptr::null_mut;

use hydroid_export::fmu::Role;
use hydroid_fmu::interface::{ERROR, Handle, OK, fmi2, fmi3};

use crate::golden::{Golden, difference};
use crate::host::{Api, Instance, Resources, reported};
use crate::models;

fn state_of(instance: &Instance<'_>) -> Handle {
    let mut state = null_mut();
    let status = unsafe {
        if instance.api.is_second() {
            fmi2::fmi2GetFMUstate(instance.handle, &raw mut state)
        } else {
            fmi3::fmi3GetFMUState(instance.handle, &raw mut state)
        }
    };
    assert_eq!(status, OK);
    state
}

fn bytes_of(instance: &Instance<'_>, state: Handle) -> Vec<u8> {
    let mut size = 0;
    let c = instance.handle;
    unsafe {
        assert_eq!(fmi3::fmi3SerializedFMUStateSize(c, state, &raw mut size), OK);
        let mut bytes = vec![0; size];
        assert_eq!(fmi3::fmi3SerializeFMUState(c, state, bytes.as_mut_ptr(), size), OK);
        assert_eq!(fmi3::fmi3SerializeFMUState(c, state, bytes.as_mut_ptr(), size - 1), ERROR);
        bytes
    }
}

fn deserialize(instance: &Instance<'_>, bytes: &[u8]) -> Result<Handle, i32> {
    let mut state = null_mut();
    let status = unsafe {
        fmi3::fmi3DeserializeFMUState(instance.handle, bytes.as_ptr(), bytes.len(), &raw mut state)
    };
    if status == OK { Ok(state) } else { Err(status) }
}

fn run(instance: &Instance<'_>, golden: &Golden, dt: f64, samples: std::ops::Range<usize>) {
    for k in samples {
        instance.inputs(golden.command(k));
        instance.step(k as f64 * dt, dt);
    }
}

#[test]
fn a_state_continues_a_run_in_the_same_and_in_another_instance() {
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let dt = model.description.dt;
        let resources = Resources::of(&model);
        let first = Instance::started(&resources, Api::Steps3, &golden);
        run(&first, &golden, dt, 0..60);
        // In the middle of a sample, with an input that changed.
        first.inputs(golden.command(60));
        first.step(60.0 * dt, 0.375 * dt);
        first.inputs(golden.command(61));
        let present = first.row(&golden);
        let state = state_of(&first);
        let bytes = bytes_of(&first, state);
        let finish = |instance: &Instance<'_>| {
            instance.step(60.375 * dt, 0.625 * dt);
            run(instance, &golden, dt, 61..120);
            instance.row(&golden)
        };
        let expected = finish(&first);
        assert_eq!(fmi3::fmi3SetFMUState(first.handle, state), OK);
        assert_eq!(first.row(&golden), present, "{name}");
        assert_eq!(finish(&first), expected, "{name}");
        let second = Instance::new(&resources, Api::Steps3);
        let copy = deserialize(&second, &bytes).unwrap();
        assert_eq!(fmi3::fmi3SetFMUState(second.handle, copy), OK);
        assert_eq!(second.row(&golden), present, "{name}");
        assert_eq!(finish(&second), expected, "{name}");
        assert_eq!(bytes_of(&second, copy), bytes);
        // A state that was overwritten is the new one; a freed one is unknown.
        let mut again = state;
        assert_eq!(unsafe { fmi3::fmi3GetFMUState(first.handle, &raw mut again) }, OK);
        assert_eq!(again, state);
        assert_ne!(bytes_of(&first, state), bytes);
        assert_eq!(unsafe { fmi3::fmi3FreeFMUState(first.handle, &raw mut again) }, OK);
        assert!(again.is_null());
        assert_eq!(fmi3::fmi3SetFMUState(first.handle, state), ERROR);
        assert!(reported("freed"));
        assert!(difference(&golden.row(59), &present) > 0.0);
    }
}

/// States that nobody wrote, with a right checksum: whatever they contain, calls return.
#[test]
fn forged_states_do_not_crash() {
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let dt = model.description.dt;
        let resources = Resources::of(&model);
        let instance = Instance::started(&resources, Api::Steps3, &golden);
        run(&instance, &golden, dt, 0..5);
        let whole = bytes_of(&instance, state_of(&instance));
        let (head, tail) = (26, 8);
        let mut refused = 0;
        for at in (head..whole.len() - tail).step_by(8) {
            for number in [f64::NAN, f64::INFINITY, -1.0, 1e300, 0.5, 1e6] {
                let mut forged = whole[..whole.len() - tail].to_vec();
                forged[at..at + 8].copy_from_slice(&number.to_le_bytes());
                forged.extend(xxhash_rust::xxh3::xxh3_64(&forged).to_le_bytes());
                let mut state = deserialize(&instance, &forged).unwrap();
                if fmi3::fmi3SetFMUState(instance.handle, state) == OK {
                    let t = instance.get(Role::Time);
                    let _ = instance.try_step(if t.is_finite() { t } else { 0.0 }, dt);
                } else {
                    refused += 1;
                }
                assert_eq!(unsafe { fmi3::fmi3FreeFMUState(instance.handle, &raw mut state) }, OK);
            }
        }
        assert!(refused > 5, "{name}: {refused}");
        // A whole state brings the run back.
        let state = deserialize(&instance, &whole).unwrap();
        assert_eq!(fmi3::fmi3SetFMUState(instance.handle, state), OK);
        run(&instance, &golden, dt, 5..10);
        assert!(difference(&instance.row(&golden), &golden.row(9)) < 1e-12, "{name}");
    }
}

#[test]
fn damaged_states_are_errors_and_change_nothing() {
    let model = models::vessel("tug");
    let golden = Golden::of(&model);
    let resources = Resources::of(&model);
    let instance = Instance::started(&resources, Api::Steps3, &golden);
    run(&instance, &golden, model.description.dt, 0..5);
    let present = instance.row(&golden);
    let bytes = bytes_of(&instance, state_of(&instance));
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        assert_eq!(deserialize(&instance, &damaged), Err(ERROR), "byte {at}");
    }
    for length in 0..bytes.len() {
        assert_eq!(deserialize(&instance, &bytes[..length]), Err(ERROR));
    }
    assert!(reported("damaged"));
    // States of other models and kinds, which are whole.
    let other = models::vessel("otter");
    let (golden_of_other, resources_of_other) = (Golden::of(&other), Resources::of(&other));
    let foreign = Instance::started(&resources_of_other, Api::Steps3, &golden_of_other);
    assert_eq!(deserialize(&instance, &bytes_of(&foreign, state_of(&foreign))), Err(ERROR));
    let exchange = Instance::started(&resources, Api::Exchange3, &golden);
    assert_eq!(deserialize(&instance, &bytes_of(&exchange, state_of(&exchange))), Err(ERROR));
    assert!(reported("another FMU"));
    assert_eq!(instance.row(&golden), present);
    assert!(instance.get(Role::Time) > 0.0);
}
