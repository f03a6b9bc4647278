//! A boat's computer without an operating system: see `Cargo.toml`.
#![no_std]

extern crate alloc;

use alloc::sync::Arc;
use alloc::vec;
use core::alloc::{GlobalAlloc, Layout};
use core::panic::PanicInfo;

use hydroid_core::adapt::{Learning};
use hydroid_core::adapt::kalman::{KalmanNetwork, KalmanPlant, LearnablePlant, FilterOptions};
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::control::{
    AffinePlant, Controller, Estimate, FeedbackLinearization, FeedbackLinearizationOptions,
};
use hydroid_core::guidance::{Path, Side, SpeedLimits, SpeedProfile, TimedReference};
use hydroid_core::model::recurrent::{
    BaseModel, Cell, Network, Recurrent, Rollout, Scaling,
};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::{Predictor, Workspace};

struct NoMemory;

// SAFETY: it never gives memory out, which an allocator may do.
unsafe impl GlobalAlloc for NoMemory {
    unsafe fn alloc(&self, _: Layout) -> *mut u8 {
        core::ptr::null_mut()
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static ALLOCATOR: NoMemory = NoMemory;

#[panic_handler]
fn halt(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// Calls plants and models, so that they are linked.
#[unsafe(no_mangle)]
pub extern "C" fn hydroid_step(pp: f64, rd: f64) -> f64 {
    let (mut nu, mut positions) = ([0.0; 3], [0.0; 2]);
    Dynamics::new(&Craft::hydrofoil()).advance(&mut nu, &mut positions, &[pp, rd], 0.01, 1);
    let Ok(equations) = Equations::new(vec![Term::monomial(&[0])], vec![-1.0], 1, 0, 0.1, 1) else {
        return f64::NAN;
    };
    let mut session = EquationsSession::new(Arc::new(equations));
    session.observe(&nu[..1]);
    let mut y = [0.0];
    session.rollout(&[], &mut Workspace::new(), &mut y);
    y[0] + recurrent(rd) + batch(rd) + vessel(pp, rd) + steer(pp) + plan(rd)
}

/// A vessel that is steered along a path.
fn steer(u: f64) -> f64 {
    let vessel = Craft::hydrofoil();
    let Ok(model) = AffinePlant::new(&vessel) else { return f64::NAN };
    let limits = AffinePlant::limits(&vessel);
    let settings = FeedbackLinearizationOptions::new(1.5);
    let Ok(mut law) = FeedbackLinearization::new(model, &limits, 0.1, settings) else { return f64::NAN };
    let Ok(path) = Path::circle([0.0; 2], 20.0, Side::Starboard, 0.0) else { return f64::NAN };
    let Ok(profile) = SpeedProfile::new(&path, &SpeedLimits::cruise(2.0)) else { return f64::NAN };
    let mut command = [0.0; 2];
    let estimate = Estimate { eta: [20.0, 0.0, 1.5], nu: [u, 0.0, 0.0], current: [0.0; 2], actuators: &[] };
    law.command(&estimate, &TimedReference::new(&profile).reference(&path, &profile), &mut command);
    command[0]
}

/// A plan on a vessel.
fn plan(u: f64) -> f64 {
    let vessel = Craft::hydrofoil();
    let Ok(model) = CraftModel::new(vessel.clone(), 0.1) else { return f64::NAN };
    let limits = AffinePlant::limits(&vessel);
    let (settings, cost) = (PlannerOptions::new(1), Cost::tracking(2));
    let Ok(mut planner) = Planner::new(settings, cost, &limits, 3, 0.1, 5.0) else { return f64::NAN };
    let Ok(path) = Path::circle([0.0; 2], 20.0, Side::Starboard, 0.0) else { return f64::NAN };
    let Ok(profile) = SpeedProfile::new(&path, &SpeedLimits::cruise(2.0)) else { return f64::NAN };
    let references = [TimedReference::new(&profile).reference(&path, &profile); 20];
    let mut session = CraftSession::new(&model);
    session.observe(&[u, 0.0, 0.0]);
    let mut command = [0.0; 2];
    planner.command(&session, [20.0, 0.0, 1.5], &references, &mut || true, &mut command).cost
}

/// A vessel that learns its parameters.
fn vessel(pp: f64, rd: f64) -> f64 {
    let Ok(model) = CraftModel::new(Craft::hydrofoil(), 0.1) else { return f64::NAN };
    let weights = LearnablePlant::new(&model).places().len();
    let options = FilterOptions::uniform(weights, 0.01, 1e-7, (1.0, 1e-6), &[1e-4; 3]);
    let Ok(mut session) = KalmanPlant::new(&model, options) else { return f64::NAN };
    session.observe(&[0.0; 3]);
    session.advance(&[pp, rd]);
    session.observe(&[0.0; 3]);
    session.weights().iter().sum()
}

/// A network with a filter on its state.
fn recurrent(rd: f64) -> f64 {
    let network = Network { cell: Cell::Gru { hidden: 4 }, inputs: 1, outputs: 1, read_out: true };
    let one = || vec![1.0];
    let model = Recurrent {
        network,
        weights: vec![0.1; network.weights()],
        scaling: Scaling {
            output_mean: one(),
            output_scale: one(),
            input_mean: one(),
            input_scale: one(),
            correction_scale: one(),
        },
        base: BaseModel::Nothing,
        feedback: false,
        wash_out: 10,
    };
    let Ok(mut session) = KalmanNetwork::state_filter(Arc::new(model), 1e-4, 1.0, &[1.0]) else { return f64::NAN };
    session.advance(&[rd]);
    session.observe(&[rd]);
    let mut y = [0.0];
    session.output(&mut y);
    y[0]
}

/// A network in batches.
fn batch(rd: f64) -> f64 {
    let network = Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true };
    let mut rollout = Rollout::new(&network, 1);
    rollout.input_mut().fill(rd);
    rollout.step();
    rollout.output()[0]
}
