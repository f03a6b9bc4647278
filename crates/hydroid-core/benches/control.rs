//! Speed of a control step: the whole of it, from estimate to command.

#[path = "../tests/steer/written.rs"]
mod written;

use divan::{Bencher, black_box};
use hydroid_core::control::{
    AffineEquations, AffinePlant, Autopilot, AutopilotSettings, Backstepping, BacksteppingSettings,
    Controller, Estimate, FeedbackLinearization, FeedbackLinearizationSettings, HeadingGains, SpeedGains,
};
use hydroid_core::guidance::{LineOfSightSettings, Path, Reference, Side};
use hydroid_core::vessel::VesselParams;
use written::{Force, equations};

fn main() {
    divan::main();
}

/// Known parameters; equations with a hidden lag (of the hydrofoil gated); the same with the force as an output.
const MODELS: [&str; 6] = [
    "simple, plant",
    "simple, equations",
    "simple, equations, force measured",
    "hydrofoil, plant",
    "hydrofoil, gated equations",
    "hydrofoil, gated equations, force measured",
];

fn vessel(name: &str) -> VesselParams {
    if name.starts_with("simple") { VesselParams::simple() } else { VesselParams::hydrofoil() }
}

fn model(name: &str) -> AffineEquations {
    let force = if name.ends_with("measured") { Force::Measured } else { Force::Hidden };
    AffineEquations::new(&equations(&vessel(name), force), [0, 1, 2]).expect("written so that it is affine")
}

/// Steps near the transition, turning: nothing in them is zero.
fn run(bencher: Bencher, controller: &mut dyn Controller) {
    let path = Path::circle([0.0, 0.0], 20.0, Side::Starboard, 0.0).expect("a circle");
    let reference = Reference::new(3.0, &path.at(3.0), 2.4, 0.02);
    let estimate = Estimate { eta: [20.1, 1.2, 1.6], nu: [2.4, -0.05, 0.12], actuators: &[] };
    let mut command = [0.0; 2];
    bencher.bench_local(|| controller.command(black_box(&estimate), black_box(&reference), &mut command));
}

#[divan::bench(args = MODELS, sample_size = 1_000)]
fn feedback_linearization(bencher: Bencher, name: &str) {
    let (vessel, settings) = (vessel(name), FeedbackLinearizationSettings::new(1.5));
    let limits = AffinePlant::limits(&vessel);
    if name.ends_with("plant") {
        let plant = AffinePlant::new(&vessel).expect("built in");
        run(bencher, &mut FeedbackLinearization::new(plant, &limits, 0.1, settings).expect("possible"));
    } else {
        run(bencher, &mut FeedbackLinearization::new(model(name), &limits, 0.1, settings).expect("possible"));
    }
}

#[divan::bench(args = MODELS, sample_size = 1_000)]
fn backstepping(bencher: Bencher, name: &str) {
    let (vessel, settings) = (vessel(name), BacksteppingSettings::new(1.5));
    let limits = AffinePlant::limits(&vessel);
    if name.ends_with("plant") {
        let plant = AffinePlant::new(&vessel).expect("built in");
        run(bencher, &mut Backstepping::new(plant, &limits, 0.1, settings).expect("possible"));
    } else {
        run(bencher, &mut Backstepping::new(model(name), &limits, 0.1, settings).expect("possible"));
    }
}

#[divan::bench(sample_size = 1_000)]
fn autopilot(bencher: Bencher) {
    let settings = AutopilotSettings {
        line_of_sight: LineOfSightSettings { lookahead: 5.0, integral: 0.1 },
        heading: HeadingGains::nomoto(1.2, 0.6, 1.0, 1.0, 2.0),
        speed: SpeedGains { proportional: 40.0, integral: 5.0, drag: [20.0, 18.0] },
        steerage: 0.3,
        tolerance: 3.0,
    };
    let limits = AffinePlant::limits(&VesselParams::hydrofoil());
    run(bencher, &mut Autopilot::new(&limits, 0.1, settings).expect("possible"));
}
