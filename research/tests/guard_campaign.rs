//! The fault campaign of the guard.

use hydroid::excitation::Excitation;
use hydroid::log::Trajectory;
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;
use hydroid_research::guard::{Campaign, Case, adversary, campaign};
use serde_json::Value;

/// A log of the simple vessel with 1.6 times the drag.
fn log() -> Trajectory {
    let mut vessel = Craft::simple();
    vessel.hull.linear.iter_mut().chain(&mut vessel.hull.quadratic).flatten().for_each(|drag| *drag *= 1.6);
    let options = Options { duration_s: 300.0, seed: 3, ..Options::new(vessel, Excitation::Mixed) };
    simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r"]).unwrap()
}

/// Each day depends on its seed alone, whatever the number of threads and the other seeds.
#[test]
fn a_day_depends_on_its_seed_alone() {
    let model = Model::of_vessel(&Craft::simple(), 0.1).unwrap();
    let cases = [Case::new("simple".to_owned(), model, &[log()])];
    let days = |seeds, threads| -> Campaign {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| campaign(&cases, seeds, true)).unwrap()
    };
    let (all, some) = (days(1..13, 2), days(5..9, 1));
    let rows = |days: &[_]| days.iter().map(|day| serde_json::to_value(day).unwrap()).collect::<Vec<Value>>();
    assert_eq!((all.bad.len(), all.clean.len()), (12, 1));
    assert_eq!(rows(&some.bad)[..], rows(&all.bad)[4..8]);
    assert_eq!(rows(&some.clean), rows(&all.clean));
    // The learner follows a vessel with more drag, the guard costs little there, and every day has errors.
    let clean = &all.clean[0];
    assert!(clean.errors[1] < 0.7 * clean.errors[0] && clean.cost < 1.05, "{clean:?}");
    for day in &all.bad {
        assert!(day.errors.iter().all(|error| *error > 0.0) && !day.faults.is_empty(), "{day:?}");
    }
}

/// A search depends on its seed alone, each finds days of its own, and those of the genetic one are among the faults that it may
/// vary.
#[test]
fn an_adversary_depends_on_its_seed_alone() {
    let model = Model::of_vessel(&Craft::simple(), 0.1).unwrap();
    let cases = [Case::new("simple".to_owned(), model, &[log()])];
    let days = |seeds, threads| -> Vec<Value> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found: Campaign = pool.install(|| adversary(&cases, seeds, 2)).unwrap();
        found.bad.iter().map(|day| serde_json::to_value(day).unwrap()).collect()
    };
    let (both, second) = (days(1..3, 2), days(2..3, 1));
    assert_eq!(both.len(), 8);
    assert_eq!(second, both[4..]);
    for (day, search) in both
        .iter()
        .zip(["during, random", "during, genetic", "later, random", "later, genetic"].iter().cycle())
    {
        assert!(day["faults"].as_str().unwrap().starts_with(search), "{day}");
        assert!(day["errors"].as_array().unwrap().iter().all(|error| error.as_f64().unwrap() > 0.0), "{day}");
    }
}
