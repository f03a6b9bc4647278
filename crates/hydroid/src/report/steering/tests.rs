//! The page of a voyage.

use super::*;
use crate::progress::silent;
use crate::steer::{Conditions, Course, Kind, Pace, Scene, Spread, Steering, Task, fleet, sail};
use hydroid_core::vessel::VesselParams;

#[test]
fn the_page_shows_track_errors_commands_and_many_voyages() {
    let vessel = VesselParams::hydrofoil();
    let course = Course::new(&Task::Circle { radius: 15.0 }, &Pace::cruise(1.5)).unwrap();
    let mut scene = Scene::new(vessel.clone(), course);
    scene.duration_s = 20.0;
    let mut steering = Steering::new(Kind::FeedbackLinearization, &vessel, 0.1);
    steering.model = Some(std::sync::Arc::new(crate::model::Model::of_vessel(&vessel, 0.1).unwrap()));
    let calm = Conditions::calm(1);
    let mut voyage = sail(&scene, &calm, steering.helm(1).unwrap().as_mut(), &mut silent()).unwrap();
    // The only thing on the page that no seed decides.
    voyage.moments.iter_mut().for_each(|m| m.time_us = 1.0);
    let metrics = Metrics::of(&voyage, 5.0);
    let many = fleet(&steering, &scene, &calm, &Spread::default(), 3, 5.0, &mut silent()).unwrap();
    let facts = [(String::from("controller"), String::from("fl"))];
    let subject = Steered {
        title: "A circle",
        command: "hydroid control <x>",
        facts: &facts,
        vessel: &vessel,
        path: &scene.course.path,
        voyage: &voyage,
        metrics: &metrics,
        fleet: Some(&many),
        tuned: None,
    };
    let page = steering_page(&subject);
    for words in
        ["Monte Carlo", "north [m]", "cross-track error [m]", "PP_cmd [N]", "at a limit", "&lt;x&gt;"]
    {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("NaN"));
    assert_eq!(page, steering_page(&subject));
}

fn steering_page(subject: &Steered<'_>) -> String {
    steering(subject).unwrap()
}
