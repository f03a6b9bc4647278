//! Experiments on simulated boats of many sizes: they stay within the fence, end in time, and explore the commands.

use super::simulated_boats::{BOATS, Sim, run};
use hydroid_live::experiment::{Experiment, Explored, Fence, Kind, Seen, Step};

const KINDS: [&str; 7] = ["zigzag-20", "zigzag-10", "circle", "chirp", "prbs", "acceleration", "auto"];

fn kind(name: &str) -> Kind {
    name.parse().unwrap()
}

/// Runs experiments with all boats in a current of 0.5 m/s with gusts; gives the number of runs, and those that were
/// aborted.
fn sail(kinds: &[&str], seeds: std::ops::Range<u64>) -> (usize, Vec<String>) {
    let (mut runs, mut aborted) = (0, Vec::new());
    for boat in BOATS {
        for name in kinds {
            for seed in seeds.clone() {
                let settings = boat.settings(seed);
                let mut sim = Sim::new(boat, &settings, 0.5, true);
                let report = run(kind(name), &settings, &mut sim);
                let what = format!("{} {name} {seed}: {:?}", boat.name, report.end);
                assert!(report.least_margin > 0.0, "{what} left the fence: {}", report.least_margin);
                assert!(report.seconds < settings.duration_s + 1.0, "{what}");
                runs += 1;
                if matches!(report.end, Step::Abort(_)) {
                    aborted.push(what);
                }
            }
        }
    }
    (runs, aborted)
}

#[test]
fn boats_of_all_sizes_stay_within_the_fence() {
    let (_, aborted) = sail(&["auto", "circle"], 0..1);
    assert!(aborted.is_empty(), "{aborted:?}");
}

/// A boat of 1.2 m/s may meet a drift against which it cannot return.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn boats_of_all_sizes_stay_within_the_fence_for_many_seeds() {
    let (runs, aborted) = sail(&KINDS, 0..5);
    assert!(aborted.len() * 50 <= runs, "{aborted:?}");
}

#[test]
fn the_automatic_experiment_explores_what_identification_needs() {
    let boat = BOATS.into_iter().find(|boat| boat.name == "twin").unwrap();
    let mut settings = boat.settings(3);
    settings.duration_s = 1_200.0;
    let report = run(Kind::Auto, &settings, &mut Sim::new(boat, &settings, 0.2, true));
    assert!(report.explored.is_sufficient(), "{}", report.explored.text());
    let [push_s, turn_s] = report.scales.unwrap();
    assert!((push_s / boat.push_s).ln().abs() < 0.7, "{push_s} s instead of {} s", boat.push_s);
    assert!((turn_s / boat.turn_s).ln().abs() < 0.7, "{turn_s} s instead of {} s", boat.turn_s);
}

#[test]
fn what_cannot_be_done_is_refused_or_aborted() {
    let boat = BOATS[1];
    let settings = boat.settings(0);
    let explored = Explored::new(&settings.inputs, &settings.push, &settings.turn).unwrap();
    let mut small = settings.clone();
    small.fence = Fence::Circle { north: 0.0, east: 0.0, radius: 5.0 };
    let error = Experiment::new(Kind::Circle, small, &explored).err().unwrap();
    assert!(error.contains("fence"), "{error}");
    let mut none = settings.clone();
    none.turn.clear();
    assert!(Experiment::new(Kind::Circle, none, &explored).is_err());

    let start = Seen { t: 0.0, north: 10.0, east: -20.0, psi: 0.0, u: 0.0, v: 0.0, r: 0.0 };
    // Outside of the fence; position unknown; too fast; time going back.
    let faults: [fn(Seen, f64) -> Seen; 4] = [
        |seen, _| Seen { north: 1e4, ..seen },
        |seen, _| Seen { north: f64::NAN, ..seen },
        |seen, _| Seen { u: 50.0, ..seen },
        |seen, s| Seen { t: seen.t - 100.0 - s, ..seen },
    ];
    for (k, fault) in faults.iter().enumerate() {
        let mut experiment = Experiment::new(Kind::Auto, settings.clone(), &explored).unwrap();
        assert!(matches!(experiment.step(&start), Step::Command(_)));
        let aborted = (1..200).any(|step| {
            let s = 0.1 * f64::from(step);
            matches!(experiment.step(&fault(Seen { t: s, ..start }, s)), Step::Abort(_))
        });
        assert!(aborted, "fault {k}");
    }
}

#[test]
fn names_of_experiments_are_read_as_they_are_written() {
    for name in KINDS {
        assert_eq!(kind(name).to_string(), name);
    }
    let error = "zigzag".parse::<Kind>().unwrap_err();
    assert!(error.contains("zigzag-20"), "{error}");
}
