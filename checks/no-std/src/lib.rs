//! A boat's computer without an operating system: see `Cargo.toml`.
#![no_std]

extern crate alloc;

use alloc::sync::Arc;
use alloc::vec;
use core::alloc::{GlobalAlloc, Layout};
use core::panic::PanicInfo;

use hydroid_core::model::recurrent::{Cell, Network, Rollout};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::vessel::{Command, Plant, State, VesselParams};

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
    let Ok(plant) = Plant::new(&VesselParams::hydrofoil()) else { return f64::NAN };
    let state = plant.advance(&State::REST, &Command { pp, rd }, 0.01);
    let Ok(equations) = Equations::new(vec![Term::monomial(&[0])], vec![-1.0], 1, 0, 0.1, 1) else {
        return f64::NAN;
    };
    let mut session = EquationsSession::new(Arc::new(equations));
    session.observe(&[state.u]);
    let mut y = [0.0];
    session.rollout(&[], &mut Workspace::new(), &mut y);
    let network = Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true };
    let mut rollout = Rollout::new(&network, 1);
    rollout.input_mut().fill(y[0]);
    rollout.step();
    y[0] + rollout.output()[0]
}
