//! Sensors that lie in known ways.

use alloc::vec::Vec;

use super::*;

/// White noise of about one.
fn noise(k: u64) -> f64 {
    let mut x = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678;
    let mut sum = 0.0;
    for _ in 0..12 {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sum += (x >> 33) as f64 / f64::from(1_u32 << 31);
    }
    sum - 6.0
}

/// Verdicts of a sensor on `count` samples: what is measured, and what the models expect.
fn verdicts_of(sensor: &mut Sensor, count: u64, sample: impl Fn(u64) -> (f64, [f64; 3])) -> Vec<Verdict> {
    let settings = GuardSettings::new(0.1);
    let judge = |k: u64| {
        let (value, [a, b, c]) = sample(k);
        sensor.judge(value, [a, b, c, f64::NAN], &settings)
    };
    (0..count).map(judge).collect()
}

/// Verdicts on a sensor that measures `truth` with noise of 0.01, of which models expect the truth and two others.
fn verdicts(truth: impl Fn(u64) -> f64, fault: impl Fn(u64, f64) -> f64) -> Vec<Verdict> {
    verdicts_of(&mut Sensor::new(0.01), 400, |k| {
        (fault(k, truth(k) + 0.01 * noise(k)), [truth(k), truth(k) + 0.05, f64::NAN])
    })
}

/// The first offset that was found.
fn found(all: &[Verdict]) -> Option<f64> {
    all.iter().find_map(|v| if let Verdict::Offset { offset } = v { Some(*offset) } else { None })
}

fn wave(k: u64) -> f64 {
    (0.02 * k as f64).sin()
}

/// The wave with noise of 0.01.
fn heard(k: u64) -> f64 {
    wave(k) + 0.01 * noise(k)
}

#[test]
fn noise_is_sound() {
    assert!(verdicts(wave, |_, x| x).iter().all(|verdict| *verdict == Verdict::Sound));
}

#[test]
fn spikes_are_refused_also_side_by_side() {
    let all = verdicts(wave, |k, x| {
        if k == 250 {
            x + 0.5
        } else if k == 251 {
            x - 3.0
        } else {
            x
        }
    });
    for (k, verdict) in all.iter().enumerate() {
        match k {
            250 | 251 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
            _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
        }
    }
}

/// The way back from the first was once taken for the vessel's own, the second for the vessel, and all that followed the third for
/// an offset.
#[test]
fn spikes_with_one_sound_value_between_are_spikes() {
    let all = verdicts(wave, |k, x| match k {
        250 => x + 1.2,
        252 => x - 1.8,
        253 => x + 3.0,
        _ => x,
    });
    for (k, verdict) in all.iter().enumerate() {
        match k {
            250 | 252 | 253 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
            _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
        }
    }
}

/// The second was once believed, as a vessel that moves.
#[test]
fn spikes_side_by_side_to_nearly_the_same_are_spikes() {
    for second in [0.4, 0.3, 0.58] {
        let all = verdicts(wave, |k, x| match k {
            250 => x + 0.5,
            251 => x + second,
            _ => x,
        });
        for (k, verdict) in all.iter().enumerate() {
            match k {
                250 | 251 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
                _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
            }
        }
    }
}

/// What followed a spike was once taken for another one, and that for an offset.
#[test]
fn a_vessel_that_turns_behind_a_spike_has_no_offset() {
    // All models are off by some five usual deviations from there on.
    let all = verdicts(wave, |k, x| match k {
        250 => x + 0.5,
        251.. => x + 0.07,
        _ => x,
    });
    assert!(matches!(all[250], Verdict::Spike { .. }));
    assert!(all[251..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}

#[test]
fn an_offset_is_found_and_taken_off() {
    let all = verdicts(wave, |k, x| if k >= 200 { x + 0.2 } else { x });
    let Some(Verdict::Offset { offset }) = all.iter().find(|v| matches!(v, Verdict::Offset { .. })) else {
        panic!("{:?}", &all[195..230]);
    };
    assert!((offset - 0.2).abs() < 0.02, "{offset}");
    assert!(all[230..].iter().all(|verdict| *verdict == Verdict::Sound));
}

#[test]
fn a_model_that_is_lost_meanwhile_excuses_no_offset() {
    let all = verdicts_of(&mut Sensor::new(0.01), 230, |k| {
        let offset = if k >= 200 { 0.3 } else { 0.0 };
        // From the second sample on it expects what is said, by chance.
        let chance = if k > 200 { 0.3 } else { 0.05 };
        (heard(k) + offset, [wave(k), wave(k) + chance, wave(k)])
    });
    assert!(all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[198..215]);
}

#[test]
fn a_sensor_that_repeats_itself_is_stuck_and_comes_back() {
    let held = core::cell::Cell::new(0.0);
    let all = verdicts(wave, |k, x| {
        if !(200..260).contains(&k) {
            held.set(x);
        }
        held.get()
    });
    assert!(all[202..260].iter().all(|v| matches!(v, Verdict::Stuck { .. })), "{:?}", &all[198..206]);
    assert!(all[260..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[258..270]);
}

#[test]
fn a_coarse_sensor_is_not_stuck() {
    let all = verdicts(wave, |_, x| (x / 0.05).round() * 0.05);
    let stuck = all.iter().filter(|verdict| matches!(verdict, Verdict::Stuck { .. })).count();
    assert_eq!(stuck, 0);
}

#[test]
fn a_vessel_that_does_what_no_model_expects_is_believed() {
    // Speed rises by 2 m/s within a second, of which the models know nothing.
    let all = verdicts(wave, |k, x| x + 0.2 * (k.saturating_sub(200).min(10)) as f64);
    let refused = all.iter().filter(|v| matches!(v, Verdict::Spike { .. })).count();
    assert!(refused <= 4, "{refused} refused: {:?}", &all[198..215]);
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })));
}

/// Models that are told nothing drift; while they cross what is measured, an offset was once taken for the vessel.
#[test]
fn an_offset_that_models_drift_across_is_found() {
    let all = verdicts_of(&mut Sensor::new(0.01), 230, |k| {
        let offset = if k >= 200 { -0.8 } else { 0.0 };
        // All fall by 1.4 m/s^2 and more from then on, one of them slower.
        let fall = 0.14 * k.saturating_sub(199).min(10) as f64;
        (heard(k) + offset, [wave(k) - 0.5 * fall, wave(k) - fall, wave(k) - 1.5 * fall])
    });
    assert!(found(&all).is_some_and(|offset| (offset + 0.8).abs() < 0.05), "{:?}", &all[198..215]);
}

/// A vessel that takes off was once taken for an offset: it stayed about as far off as at first, from one measurement to the next.
#[test]
fn what_swells_and_ebbs_is_no_offset() {
    let off = [0.1, 0.118, 0.118, 0.105, 0.09, 0.075, 0.068, 0.068, 0.068];
    let fault = |k, x| if k < 250 { x } else { x + off[(250..258).position(|at| at == k).unwrap_or(8)] };
    let all = verdicts(|_| 0.5, fault);
    assert_eq!(found(&all), None, "{:?}", &all[248..262]);
    assert!(matches!(all[255], Verdict::Spike { .. }), "or nothing was tried: {:?}", &all[248..262]);
}

/// A spike on a vessel that takes off, of which only the learner knows: it was once an offset of what it had not learned yet.
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
    assert!(matches!(all[250], Verdict::Spike { .. }), "or nothing was tried: {:?}", all[250]);
}

/// The same where the vessel slows down as well, so that nobody finds it off by the same from one sample to the next.
#[test]
fn an_offset_of_a_vessel_that_slows_down_is_found() {
    let fall = |k: u64, rate: f64| rate * k.saturating_sub(200).min(12) as f64;
    let all = verdicts_of(&mut Sensor::new(0.01), 230, |k| {
        let offset = if k >= 200 { -0.8 } else { 0.0 };
        let expected = [0.18, 0.25, 0.3].map(|rate| -fall(k, rate));
        (offset - fall(k, 0.1) + 0.01 * noise(k), expected)
    });
    assert!(found(&all).is_some_and(|offset| (offset + 0.8).abs() < 0.25), "{:?}", &all[198..215]);
}

/// What came back from two spikes side by side was once taken for a third one, and that for an offset.
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

/// A filter that is told nothing may be elsewhere at once: where the vessel was before the spike it is not off.
#[test]
fn models_that_leave_at_a_spike_make_no_offset_of_it() {
    for second in [0.0, 2.5] {
        let all = verdicts_of(&mut Sensor::new(0.01), 300, |k| {
            let value = match k {
                250 => heard(k) + 0.6,
                252 => heard(k) + second,
                _ => heard(k),
            };
            let gone = if (251..270).contains(&k) { 0.4 } else { 0.0 };
            (value, [wave(k) - gone, wave(k) - 1.2 * gone, wave(k) - 1.5 * gone])
        });
        for (k, verdict) in all.iter().enumerate() {
            match k {
                250 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
                252 if second > 0.0 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
                _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
            }
        }
    }
}

/// The vessel goes on slowing down by more than half as much a sample as the sensor is off by, which no model expects: it is no way back, no
/// other spike, and taken off is what the sensor is off by.
#[test]
fn an_offset_of_a_vessel_that_slows_down_fast_is_found() {
    let settings = GuardSettings::new(0.1);
    let mut sensor = Sensor::new(0.01);
    let slow = |k: u64| wave(k) - 0.15 * k.saturating_sub(240).min(20) as f64;
    let all = (0..300).map(|k| {
        let value = slow(k) + 0.01 * noise(k) - if k >= 250 { 0.25 } else { 0.0 };
        let late = slow(k.saturating_sub(3));
        let lost = slow(k.min(249));
        sensor.judge(value, [late, late, lost, slow(k)], &settings)
    });
    let offset = found(&all.collect::<Vec<_>>()).unwrap();
    assert!((offset + 0.25).abs() < 0.03, "{offset}");
}

/// That the vessel gathered way before a spike once hid it, and the way back from it was taken for one.
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

/// One model finds the vessel off by the same for as long as it takes, another finds it where it expects it: no offset comes of a small jump.
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

/// What no model expects and is no larger than a small spike is believed as soon as it goes farther. What stays is an offset, if most find it
/// the same: the vessel, if models drift meanwhile.
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

/// It takes off, which the models do not expect, and then goes steadily: that was once an offset, for it had begun with a large jump.
#[test]
fn a_vessel_that_takes_off_has_no_offset() {
    let faster = |k: u64| [0.0, 0.15, 0.27, 0.47, 0.49, 0.5][k.saturating_sub(249).min(5) as usize];
    let all = verdicts(wave, |k, x| x + faster(k));
    assert!(matches!(all[250], Verdict::Spike { .. }), "{:?}", &all[248..262]);
    assert!(matches!(all[252], Verdict::Believed { .. }), "{:?}", &all[248..262]);
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[248..262]);
}

/// The same behind a spike: that it begins by less than the spike was is no return.
#[test]
fn a_vessel_that_takes_off_behind_a_spike_has_no_offset() {
    let faster = |k: u64| 0.15 * k.saturating_sub(249).min(10) as f64;
    let all = verdicts(wave, |k, x| x + faster(k) + if k == 250 { 2.0 } else { 0.0 });
    assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[248..262]);
    let refused = all[250..].iter().filter(|v| matches!(v, Verdict::Spike { .. })).count();
    assert!(refused <= 4, "{refused} refused: {:?}", &all[248..262]);
}

/// The third was once believed, because it was farther off than the second, and what came back was an offset of five metres a second.
#[test]
fn three_spikes_side_by_side_are_spikes() {
    for [first, second, third] in [[5.0, -0.3, 5.2], [5.0, 0.3, 5.2], [0.3, 2.0, -4.0], [-3.0, 0.4, -2.0]] {
        let all = verdicts(wave, |k, x| match k {
            250 => x + first,
            251 => x + second,
            252 => x + third,
            _ => x,
        });
        for (k, verdict) in all.iter().enumerate() {
            match k {
                250..=252 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
                _ => assert_eq!(*verdict, Verdict::Sound, "{k}: {:?}", &all[248..258]),
            }
        }
    }
}

/// An offset is known better than one measurement is: what was expected before is the mean of some.
#[test]
fn an_offset_is_known_to_less_than_the_noise() {
    let mut square = 0.0;
    for at in 200..250 {
        let all = verdicts(wave, |k, x| if k >= at { x + 0.2 } else { x });
        square += (found(&all).expect("an offset") - 0.2).powi(2) / 50.0;
    }
    assert!(square.sqrt() < 0.009, "{}", square.sqrt());
}

/// At the start of a run models are off by metres a second, and jump to where the vessel is or do not: nothing is judged by that.
#[test]
fn models_that_find_their_states_excuse_nothing_and_accuse_nobody() {
    let mut sensor = Sensor::new(0.01);
    for run in 0..2 {
        sensor.reset();
        let all = verdicts_of(&mut sensor, 230, |k| {
            let offset = if run == 0 && k >= 200 { 0.15 } else { 0.0 };
            let off = if k < 15 && k != 1 { 2.0 - 0.1 * k as f64 } else { 0.0 };
            (heard(k) + offset, [wave(k) + off; 3])
        });
        let found = all.iter().position(|v| matches!(v, Verdict::Offset { .. }));
        assert_eq!(found, (run == 0).then_some(207), "{:?}", &all[..30]);
        assert!(all[..200].iter().all(|verdict| *verdict == Verdict::Sound));
        sensor.offset = 0.0;
    }
}

/// A small spike behind a large one, and then the vessel: that the last step is small beside the one before is no offset.
#[test]
fn two_spikes_of_two_sizes_leave_no_offset() {
    for (first, second) in [(3.0, -0.5), (3.0, 0.5), (-0.3, 2.0), (1.0, 0.9), (-4.0, 1.0), (1.0, 1.4)] {
        let all = verdicts(wave, |k, x| match k {
            250 => x + first,
            251 => x + second,
            _ => x,
        });
        assert!(all[252..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
    }
}

/// The way back from a spike that was not judged is no jump of the sensor.
#[test]
fn a_spike_in_the_first_samples_leaves_no_offset() {
    let mut sensor = Sensor::new(0.01);
    for run in 0..2 {
        sensor.reset();
        let all = verdicts_of(&mut sensor, 230, |k| {
            let spike = if run == 1 && k == SETTLING as u64 - 1 { 0.8 } else { 0.0 };
            (heard(k) + spike, [wave(k); 3])
        });
        assert!(!all.iter().any(|v| matches!(v, Verdict::Offset { .. })), "{:?}", &all[15..35]);
        assert!(all[30..].iter().all(|verdict| *verdict == Verdict::Sound));
    }
}

/// A vessel that begins to turn behind a spike: models that were told nothing are off by half of the spike.
#[test]
fn a_small_spike_before_a_turn_leaves_no_offset() {
    let all = verdicts(wave, |k, x| match k {
        250 => x - 0.2,
        251.. => x + 0.08,
        _ => x,
    });
    assert!(all[251..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}

#[test]
fn models_that_jump_accuse_no_sensor() {
    let all = verdicts_of(&mut Sensor::new(0.01), 230, |k| {
        let off = if k >= 200 { 1.0 } else { 0.0 };
        (heard(k), [wave(k) - off; 3])
    });
    assert!(all.iter().all(|verdict| *verdict == Verdict::Sound));
}

/// Nine deviations of the noise are found nearly always, and nothing is where nothing is; once seven of them were too few to see one.
#[test]
fn small_offsets_are_found_among_noise() {
    let found_at = |from: u64, size: f64| {
        let all = verdicts_of(&mut Sensor::new(0.01), from + 50, |k| {
            let off = if k >= from { size } else { 0.0 };
            (0.01 * noise(k) + off, [0.0; 3])
        });
        found(&all)
    };
    let starts = || (0..40).map(|i| 210 + 37 * i);
    let near = |size: f64| {
        starts().filter_map(|from| found_at(from, size)).filter(|o| (o - size).abs() < 0.03).count()
    };
    assert!(near(0.09) >= 34, "{}", near(0.09));
    assert!(near(-0.07) >= 24, "{}", near(-0.07));
    // What is no more than two measurements of the same may differ by is none.
    assert_eq!(starts().filter_map(|from| found_at(from, 0.03)).count(), 0);
}
