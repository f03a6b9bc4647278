//! The arguments of `hydroid control` as the options of the library.

use hydroid::adapt::Method;
use hydroid::closed_loop::{ControlMethod, Timing};
use hydroid::config::control::{ClosedLoopOptions, TaskKind as Kind};

use super::super::values::{Learner, NamedNumber};
use super::{Control, ControllerKind, TaskKind, TimingKind};

impl Control {
    /// The options of a closed loop.
    pub fn options(&self) -> ClosedLoopOptions {
        let Control { controller, task, disturbances, adaptation, monte_carlo, .. } = self;
        let by_name =
            |all: &[NamedNumber]| all.iter().map(|given| (given.name.clone(), given.number)).collect();
        ClosedLoopOptions {
            task: match task.task {
                TaskKind::Circle => Kind::Circle,
                TaskKind::LawnMower => Kind::LawnMower,
                TaskKind::Waypoints => Kind::Waypoints,
                TaskKind::Legs => Kind::Legs,
                TaskKind::Station => Kind::Station,
            },
            speed: task.speed,
            turn_speed: task.turn_speed,
            radius: task.radius,
            leg: task.leg,
            spacing: task.spacing,
            legs: task.legs,
            points: task.points.clone().map(|points| points.0),
            waypoints: task.waypoints.clone(),
            heading: task.heading,
            acceleration: task.acceleration,
            duration: task.duration,
            start: task.start.map(|start| start.0),
            controller: match controller.controller {
                ControllerKind::Fl => ControlMethod::FeedbackLinearization,
                ControllerKind::Backstepping => ControlMethod::Backstepping,
                ControllerKind::Cem => ControlMethod::CrossEntropy,
                ControllerKind::Pid => ControlMethod::Autopilot,
            },
            lead: controller.lead,
            tolerance: controller.tolerance,
            evaluate_from: controller.evaluate_from,
            bandwidth: controller.bandwidth.map(|bandwidth| bandwidth.0),
            integral: controller.integral,
            adaptive_augmentation: controller.adaptive_augmentation,
            rate: controller.rate,
            reference: controller.reference.map(|timing| match timing {
                TimingKind::Time => Timing::Clock,
                TimingKind::Path => Timing::Path,
            }),
            horizon: controller.horizon,
            hold: controller.hold,
            candidates: controller.candidates,
            iterations: controller.iterations,
            gauss_newton_steps: controller.gauss_newton_steps,
            cost_weights: controller.cost_weights.map(|weights| weights.0),
            plan_time: controller.plan_time,
            dt: controller.dt,
            rate_limit: by_name(&controller.rate_limit),
            limit: controller.values.limits(),
            neutral: controller.values.neutrals(),
            role: controller.roles.roles(),
            push: controller.push.clone(),
            turn: controller.turn.clone(),
            estimate_current: adaptation.estimate_current,
            adapt: adaptation.adapt,
            learner: adaptation.learner.map(|learner| match learner {
                Learner::LeastSquares => Method::LeastSquares,
                Learner::Kalman => Method::Kalman,
            }),
            no_guard: adaptation.no_guard,
            seed: disturbances.seed,
            noise: disturbances.noise,
            process_noise: disturbances.process_noise,
            current: disturbances.current.0,
            wind: disturbances.wind.0,
            gusts: disturbances.gusts.0,
            mass: disturbances.mass,
            delay: disturbances.delay,
            onset: disturbances.onset,
            runs: monte_carlo.runs,
            mass_variation: monte_carlo.mass_variation,
            current_variation: monte_carlo.current_variation,
            wind_variation: monte_carlo.wind_variation,
        }
    }
}
