//! Experiments on simulated boats of many sizes: they stay within the fence, end in time, and explore the commands.

use super::simulated_boats::{BOATS, Boat, Drive, Sim, run};
use hydroid_live::experiment::{Experiment, Explored, Fence, Kind, Seen, Step};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const KINDS: [&str; 7] = ["zigzag-20", "zigzag-10", "circle", "chirp", "prbs", "acceleration", "auto"];

/// Numbers of boats in the surveys.
const RANDOM_BOATS: usize = 60;
const SMALL_FENCES: usize = 75;

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
    let (runs, aborted) = sail(&KINDS, 0..3);
    assert!(aborted.len() * 50 <= runs, "{aborted:?}");
}

/// Boats with time constants of 0.5 to 20 s, speeds of 1.2 to 8 m/s and turning circles of one third to three times what the
/// yaw response suggests, all distributed log-uniformly.
fn random_boats(count: usize) -> Vec<Boat> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let boat = |_| {
        let mut log = |low: f64, high: f64| low * (high / low).powf(rng.random_range(0.0..1.0));
        let (push_s, turn_s, speed) = (log(0.5, 20.0), log(0.5, 20.0), log(1.2, 8.0));
        let radius = (speed * turn_s * log(0.3, 3.0)).max(1.0);
        let lag_s = 0.1 * push_s.min(turn_s) * log(0.3, 3.0);
        Boat {
            name: "random",
            drive: if rng.random() { Drive::Rudder } else { Drive::Twin },
            astern: rng.random(),
            speed,
            push_s,
            turn_s,
            yaw_rate: (speed / radius).min(1.5),
            quadratic: rng.random(),
            lag_s,
        }
    };
    (0..count).map(boat).collect()
}

/// No boat leaves a fence of twelve turning circles, in a current of up to 0.5 m/s with gusts, and few experiments are aborted.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn random_boats_stay_within_the_fence() {
    let boats = random_boats(RANDOM_BOATS);
    let (mut aborted, mut sufficient) = (Vec::new(), 0);
    for (k, &boat) in boats.iter().enumerate() {
        let settings = boat.settings(k as u64);
        let mut sim = Sim::new(boat, &settings, 0.4 * boat.speed.min(1.25), true);
        let report = run(kind(KINDS[k % KINDS.len()]), &settings, &mut sim);
        let what = format!("boat {k}: {:?} {boat:?}", report.end);
        assert!(report.least_margin >= 0.0, "{what} left the fence: {}", report.least_margin);
        sufficient += usize::from(report.explored.is_sufficient());
        if matches!(report.end, Step::Abort(_)) {
            aborted.push(what);
        }
    }
    assert!(aborted.len() * 10 <= boats.len(), "{aborted:?}");
    assert!(
        sufficient * 4 >= boats.len(),
        "{sufficient} of {} experiments gave sufficient data",
        boats.len()
    );
}

/// A boat whose fence is too small for it, from one to seven turning circles, says so while it is inside.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn fences_that_are_too_small_end_experiments_inside() {
    let boats = random_boats(SMALL_FENCES);
    let mut left = Vec::new();
    for (k, &boat) in boats.iter().enumerate() {
        let mut settings = boat.settings(k as u64);
        settings.max_speed_m_s = boat.speed;
        let radius = ([1.0, 2.0, 3.0, 5.0, 7.0][k % 5] * boat.radius()).max(4.0 * boat.speed);
        settings.fence = Fence::Circle { north: 10.0, east: -20.0, radius };
        let mut sim = Sim::new(boat, &settings, 0.2 * boat.speed.min(1.25), true);
        (sim.north, sim.east) = (10.0, -20.0);
        let report = run(kind(KINDS[k / 5 % KINDS.len()]), &settings, &mut sim);
        if report.least_margin < 0.0 || format!("{:?}", report.end).contains("has left the fence") {
            left.push(format!("boat {k}: {:?} {boat:?} F {radius}", report.end));
        }
    }
    // The time constant of a sluggish boat may be estimated too small from half a circle.
    assert!(left.len() * 50 <= boats.len(), "{left:?}");
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
