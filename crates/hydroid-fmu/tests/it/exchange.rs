//! Model exchange: derivatives, their directions, and an integration that agrees with co-simulation.

use hydroid_export::fmu::Role;
use hydroid_fmu::interface::{ERROR, OK, fmi2, fmi3};

use crate::golden::{Golden, difference};
use crate::host::{Api, Instance, Resources, instantiate, reported};
use crate::models;

fn states(instance: &Instance<'_>) -> usize {
    let mut count = 0;
    assert_eq!(unsafe { fmi3::fmi3GetNumberOfContinuousStates(instance.handle, &raw mut count) }, OK);
    count
}

fn rates(instance: &Instance<'_>, x: &[f64]) -> Vec<f64> {
    let mut rates = vec![f64::NAN; x.len()];
    unsafe {
        let c = instance.handle;
        assert_eq!(fmi3::fmi3SetContinuousStates(c, x.as_ptr(), x.len()), OK);
        assert_eq!(fmi3::fmi3GetContinuousStateDerivatives(c, rates.as_mut_ptr(), x.len()), OK);
    }
    rates
}

fn present(instance: &Instance<'_>) -> Vec<f64> {
    let mut x = vec![f64::NAN; states(instance)];
    assert_eq!(unsafe { fmi3::fmi3GetContinuousStates(instance.handle, x.as_mut_ptr(), x.len()) }, OK);
    x
}

#[test]
fn an_integration_of_the_derivatives_is_the_co_simulation() {
    let mut integrated = 0;
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let resources = Resources::of(&model);
        if let Err(reason) = resources.variables.continuous() {
            // Refused with the reason.
            for api in [Api::Exchange2, Api::Exchange3] {
                assert!(instantiate(resources.folder.path(), &resources.token, api).is_null(), "{name}");
            }
            assert!(reported(reason), "{name}");
            continue;
        }
        integrated += 1;
        let instance = Instance::started(&resources, Api::Exchange3, &golden);
        assert_eq!(fmi3::fmi3EnterContinuousTimeMode(instance.handle), OK);
        let steps = Instance::started(&resources, Api::Steps3, &golden);
        let dt = model.description.dt;
        let mut x = present(&instance);
        let parts = 40;
        let h = dt / f64::from(parts);
        let mut worst = 0.0_f64;
        for k in 0..40 {
            instance.inputs(golden.command(k));
            steps.inputs(golden.command(k));
            for _ in 0..parts {
                let along =
                    |a: f64, k: &[f64]| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + a * k).collect() };
                let k1 = rates(&instance, &x);
                let k2 = rates(&instance, &along(0.5 * h, &k1));
                let k3 = rates(&instance, &along(0.5 * h, &k2));
                let k4 = rates(&instance, &along(h, &k3));
                x = (0..x.len()).map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])).collect();
            }
            rates(&instance, &x);
            steps.step(k as f64 * dt, dt);
            let n = golden.outputs;
            worst = worst.max(difference(&instance.row(&golden)[..n], &golden.row(k)[..n]));
            // Hidden states, too, which both kinds show.
            let hidden = resources.variables.continuous().unwrap().hidden().len();
            for i in 0..hidden {
                let apart = difference(&[instance.get(Role::Hidden(i))], &[steps.get(Role::Hidden(i))]);
                worst = worst.max(apart);
            }
            // The pose of co-simulation is of second order in the sample time.
            let apart = difference(&instance.row(&golden)[n..], &golden.row(k)[n..]);
            assert!(apart < 0.02, "{name}, sample {k}: {apart}");
        }
        // The error of the integration with the steps of the model.
        assert!(worst < 2e-4, "{name}: {worst:e}");
    }
    assert!(integrated >= 8, "{integrated}");
}

#[test]
fn directional_derivatives_are_those_of_differences() {
    for (name, model) in models::all() {
        let golden = Golden::of(&model);
        let resources = Resources::of(&model);
        if resources.variables.continuous().is_err() {
            continue;
        }
        let instance = Instance::started(&resources, Api::Exchange3, &golden);
        let mut x = present(&instance);
        x.iter_mut().enumerate().for_each(|(i, x)| *x += 0.03 * (i as f64 + 1.0));
        let c = golden.command(3).to_vec();
        instance.inputs(&c);
        rates(&instance, &x);
        let unknowns: Vec<u32> = (0..x.len()).map(|i| resources.reference(Role::Derivative(i))).collect();
        let mut knowns: Vec<u32> =
            (0..x.len()).map(|i| resources.reference(resources.variables.state(i))).collect();
        knowns.extend((0..c.len()).map(|i| resources.reference(Role::Input(i))));
        for (column, known) in knowns.iter().enumerate() {
            let mut sensitivity = vec![f64::NAN; x.len()];
            let status = unsafe {
                fmi3::fmi3GetDirectionalDerivative(
                    instance.handle,
                    unknowns.as_ptr(),
                    unknowns.len(),
                    known,
                    1,
                    &2.0,
                    1,
                    sensitivity.as_mut_ptr(),
                    sensitivity.len(),
                )
            };
            assert_eq!(status, OK);
            let at = |shift: f64| {
                let (mut x, mut c) = (x.clone(), c.clone());
                match column.checked_sub(x.len()) {
                    None => x[column] += shift,
                    Some(input) => c[input] += shift,
                }
                instance.inputs(&c);
                rates(&instance, &x)
            };
            let size = if column < x.len() { x[column] } else { c[column - x.len()] };
            let step = 1e-6 * size.abs().max(1.0);
            let (low, high) = (at(-step), at(step));
            instance.inputs(&c);
            rates(&instance, &x);
            for i in 0..x.len() {
                let slope = (high[i] - low[i]) / step;
                let apart = (sensitivity[i] - slope).abs() / slope.abs().max(1.0);
                assert!(apart < 1e-5, "{name}: d{i}/d{column} {} {slope}", sensitivity[i]);
            }
        }
        // Outputs are states.
        let output = resources.reference(Role::Output(0));
        let mut value = f64::NAN;
        let status = unsafe {
            let c = instance.handle;
            fmi2::fmi2GetDirectionalDerivative(
                c,
                &raw const output,
                1,
                &raw const output,
                1,
                &3.0,
                &raw mut value,
            )
        };
        assert_eq!((status, value), (OK, 3.0));
        let parameter = resources.reference(Role::StartOutput(0));
        let status = unsafe {
            let c = instance.handle;
            fmi2::fmi2GetDirectionalDerivative(
                c,
                &raw const output,
                1,
                &raw const parameter,
                1,
                &3.0,
                &raw mut value,
            )
        };
        assert_eq!(status, ERROR);
    }
}

#[test]
fn the_modes_of_model_exchange_change_in_order() {
    let model = models::vessel("otter");
    let (golden, resources) = (Golden::of(&model), Resources::of(&model));
    let instance = Instance::started(&resources, Api::Exchange2, &golden);
    let c = instance.handle;
    let mut info = fmi2::EventInfo { new_discrete_states_needed: 7, ..fmi2::EventInfo::default() };
    unsafe {
        assert_eq!(fmi2::fmi2NewDiscreteStates(c, &raw mut info), OK);
        assert_eq!(info, fmi2::EventInfo::default());
        assert_eq!(fmi2::fmi2EnterContinuousTimeMode(c), OK);
        assert_eq!(fmi2::fmi2NewDiscreteStates(c, &raw mut info), ERROR);
        let (mut event, mut end) = (7, 7);
        assert_eq!(fmi2::fmi2CompletedIntegratorStep(c, 1, &raw mut event, &raw mut end), OK);
        assert_eq!((event, end), (0, 0));
        assert_eq!(fmi2::fmi2SetTime(c, 2.5), OK);
        assert_eq!(instance.get(Role::Time), 2.5);
        assert_eq!(fmi2::fmi2SetTime(c, f64::NAN), ERROR);
        assert_eq!(fmi2::fmi2DoStep(c, 0.0, 0.1, 1), ERROR);
        let x = [f64::NAN; 9];
        assert_eq!(fmi2::fmi2SetContinuousStates(c, x.as_ptr(), 1), ERROR);
        let count = resources.variables.continuous().unwrap().states();
        assert_eq!(fmi2::fmi2SetContinuousStates(c, x.as_ptr(), count), ERROR);
        let mut nominals = vec![0.0; count];
        assert_eq!(fmi2::fmi2GetNominalsOfContinuousStates(c, nominals.as_mut_ptr(), count), OK);
        assert!(nominals.iter().all(|nominal| *nominal > 0.0));
        assert_eq!(fmi2::fmi2GetEventIndicators(c, std::ptr::null_mut(), 0), OK);
        assert_eq!(fmi2::fmi2GetEventIndicators(c, std::ptr::null_mut(), 1), ERROR);
        assert_eq!(fmi2::fmi2Terminate(c), OK);
        assert_eq!(fmi2::fmi2EnterEventMode(c), ERROR);
    }
}
