//! Unexpected motion of the vessel is no sensor fault.

use super::*;

#[test]
fn a_vessel_that_turns_behind_a_spike_has_no_offset() {
    // All models deviate by about five times the RMS from there on.
    let all = verdicts(wave, |k, x| match k {
        250 => x + 0.5,
        251.. => x + 0.07,
        _ => x,
    });
    assert!(matches!(all[250], Verdict::Spike { .. }));
    assert!(all[251..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}

#[test]
fn a_vessel_that_does_what_no_model_expects_is_believed() {
    // The speed rises by 2 m/s within a second, and the models do not expect it.
    let all = verdicts(wave, |k, x| x + 0.2 * (k.saturating_sub(200).min(10)) as f64);
    let refused = all.iter().filter(|v| matches!(v, Verdict::Spike { .. })).count();
    assert!(refused <= 4, "{refused} refused: {:?}", &all[198..215]);
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })));
}

/// At take-off the deviation is about constant from one measurement to the next.
#[test]
fn what_swells_and_ebbs_is_no_offset() {
    let off = [0.1, 0.118, 0.118, 0.105, 0.09, 0.075, 0.068, 0.068, 0.068];
    let fault = |k, x| if k < 250 { x } else { x + off[(250..258).position(|at| at == k).unwrap_or(8)] };
    let all = verdicts(|_| 0.5, fault);
    assert_eq!(found(&all), None, "{:?}", &all[248..262]);
    assert!(matches!(all[255], Verdict::Spike { .. }), "no outlier: {:?}", &all[248..262]);
}

/// A spike at take-off, which only the learner predicts, is no offset.
#[test]
fn a_spike_on_a_vessel_that_takes_off_is_no_offset() {
    let way = |k: u64| if k < 250 { wave(k) } else { wave(k) + 0.22 + 0.12 * (k - 250) as f64 };
    let all = verdicts_of(&mut Sensor::new(0.01), 280, |k| {
        let spike = if k == 250 { 0.28 } else { 0.0 };
        let unknown = 0.12 * (-(k.saturating_sub(250) as f64) / 6.0).exp();
        let learner = if k < 250 { wave(k) } else { way(k) - unknown };
        (way(k) + 0.01 * noise(k) + spike, [learner, learner - 0.02, wave(k)])
    });
    assert_eq!(found(&all), None, "{:?}", &all[248..262]);
    assert!(matches!(all[250], Verdict::Spike { .. }), "no outlier: {:?}", all[250]);
}

#[test]
fn a_vessel_that_moved_on_behind_two_spikes_has_no_offset() {
    let all = verdicts(wave, |k, x| match k {
        250 => x + 3.5,
        251 => x + 1.9,
        252.. => x + 0.12 + 0.02 * (k - 252).min(5) as f64,
        _ => x,
    });
    assert!(all[250..252].iter().all(|v| matches!(v, Verdict::Spike { .. })), "{:?}", &all[248..254]);
    assert!(all[252..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[250..262]);
}

#[test]
fn a_spike_on_a_vessel_that_gathers_way_is_refused() {
    let gathers = |k: u64| wave(k) + 0.12 * (k.saturating_sub(245).min(15)) as f64;
    let all = verdicts(gathers, |k, x| if k == 250 { x - 0.38 } else { x });
    for (k, verdict) in all.iter().enumerate() {
        match k {
            250 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
            _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
        }
    }
}

/// One model finds a constant deviation, another none: a small jump is no offset.
#[test]
fn a_turn_that_one_model_sees_late_leaves_no_offset() {
    let all = verdicts_of(&mut Sensor::new(0.01), 300, |k| {
        let turned = if k >= 250 { 0.11 } else { 0.0 };
        let seen = 0.02 * k.saturating_sub(249).min(5) as f64;
        (heard(k) + turned, [wave(k), wave(k) + seen, wave(k)])
    });
    assert!(matches!(all[250], Verdict::Spike { .. }), "{:?}", all[250]);
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[248..262]);
    assert!(all[258..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}

/// An unexpected deviation no larger than a small spike is motion as soon as it grows. A constant one is an offset if
/// most models agree.
#[test]
fn a_vessel_that_begins_to_turn_is_believed_and_a_small_offset_is_found() {
    let after = |more: f64, drift: f64| {
        let all = verdicts_of(&mut Sensor::new(0.01), 300, |k| {
            let since = k.saturating_sub(250) as f64;
            let off = if k >= 250 { 0.07 + more * since } else { 0.0 };
            (heard(k) + off, [0.0, drift, drift].map(|drift| wave(k) + drift * since))
        });
        assert!(matches!(all[250], Verdict::Spike { .. }), "{:?}", &all[248..262]);
        all
    };
    let all = after(0.02, 0.0);
    assert!(all[251..254].iter().any(|v| matches!(v, Verdict::Believed { .. })), "{:?}", &all[248..262]);
    for drift in [0.02, -0.02] {
        assert_eq!(found(&after(0.0, drift)), None);
    }
    let all = after(0.0, 0.0);
    assert!(found(&all).is_some_and(|offset| (offset - 0.07).abs() < 0.02), "{:?}", &all[248..262]);
}

/// A take-off that starts with a large jump and becomes steady.
#[test]
fn a_vessel_that_takes_off_has_no_offset() {
    let faster = |k: u64| [0.0, 0.15, 0.27, 0.47, 0.49, 0.5][k.saturating_sub(249).min(5) as usize];
    let all = verdicts(wave, |k, x| x + faster(k));
    assert!(matches!(all[250], Verdict::Spike { .. }), "{:?}", &all[248..262]);
    assert!(matches!(all[252], Verdict::Believed { .. }), "{:?}", &all[248..262]);
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[248..262]);
}

/// After a spike that is larger than the first change of the take-off.
#[test]
fn a_vessel_that_takes_off_behind_a_spike_has_no_offset() {
    let faster = |k: u64| 0.15 * k.saturating_sub(249).min(10) as f64;
    let all = verdicts(wave, |k, x| x + faster(k) + if k == 250 { 2.0 } else { 0.0 });
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[248..262]);
    let refused = all[250..].iter().filter(|v| matches!(v, Verdict::Spike { .. })).count();
    assert!(refused <= 4, "{refused} refused: {:?}", &all[248..262]);
}

/// A turn starts after a spike: models without measurements deviate by half of the spike.
#[test]
fn a_small_spike_before_a_turn_leaves_no_offset() {
    let all = verdicts(wave, |k, x| match k {
        250 => x - 0.2,
        251.. => x + 0.08,
        _ => x,
    });
    assert!(all[251..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}
