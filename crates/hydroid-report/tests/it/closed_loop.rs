//! The page of a closed-loop run.

use hydroid::closed_loop::{
    self, Conditions, ControlMethod, ControllerOptions, Dispersion, Metrics, Scenario, SpeedOptions, Task,
    Track, monte_carlo,
};
use hydroid::plant::Outside;
use hydroid::progress::silent;
use hydroid_core::craft::Craft;
use hydroid_report::ClosedLoopReport;

#[test]
fn the_page_shows_track_errors_commands_and_many_runs() {
    let vessel = Craft::hydrofoil();
    let course = Track::new(&Task::Circle { radius: 15.0 }, &SpeedOptions::cruise(1.5)).unwrap();
    let mut scene = Scenario::new(vessel.clone(), course);
    scene.duration_s = 20.0;
    let mut steering = ControllerOptions::new(ControlMethod::FeedbackLinearization, &scene.plant, 0.1);
    steering.model = Some(std::sync::Arc::new(hydroid::model::Model::of_vessel(&vessel, 0.1).unwrap()));
    let calm = Conditions::calm(1);
    let mut run =
        closed_loop::run(&scene, &calm, steering.controller(1).unwrap().as_mut(), &mut silent()).unwrap();
    // Computing times are the only values on the page that do not follow from the seed.
    run.samples.iter_mut().for_each(|m| m.time_us = 1.0);
    let metrics = Metrics::of(&run, 5.0);
    let many = monte_carlo(&steering, &scene, &calm, &Dispersion::default(), 3, 5.0, &mut silent()).unwrap();
    let facts = [(String::from("controller"), String::from("fl"))];
    let subject = ClosedLoopReport {
        title: "A circle",
        command: "hydroid control <x>",
        facts: &facts,
        path: &scene.track.path,
        run: &run,
        metrics: &metrics,
        trials: Some(&many),
        outside: &[],
        tuned: None,
    };
    let page = hydroid_report::closed_loop(&subject).unwrap();
    for words in
        ["Monte Carlo", "north [m]", "cross-track error [m]", "PP_cmd [N]", "at a limit", "&lt;x&gt;"]
    {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("NaN"));
    assert_eq!(page, hydroid_report::closed_loop(&subject).unwrap());

    // A loop beyond the logs of its model is not a good one.
    assert!(page.contains("banner good"));
    let (reached, range) = ([0.0, 0.2], [-0.1, 0.1]);
    let outside =
        [Outside { name: String::from("r"), unit: String::from("rad/s"), from_s: 3.0, reached, range }];
    let page = hydroid_report::closed_loop(&ClosedLoopReport { outside: &outside, ..subject }).unwrap();
    assert!(!page.contains("banner good"));
    assert!(page.contains("r goes from 0 to 11.459 deg/s"));
}
