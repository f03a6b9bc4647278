//! Single and adjacent spikes leave no offset.

use super::*;

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

/// A filter without measurements may jump: its deviation from the vessel before the spike is no offset.
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

/// A small spike after a large one, then the vessel: a last step that is smaller than the one before is no offset.
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

/// The return from a spike before screening is no jump of the sensor.
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

/// A rejected value does not change the mean of the innovations.
#[test]
fn a_spike_before_an_outage_hides_no_other() {
    let all = verdicts(wave, |k, x| match k {
        250 => x + 5.0,
        251..256 => f64::NAN,
        258 => x + 0.2,
        _ => x,
    });
    for (k, verdict) in all.iter().enumerate() {
        match k {
            250 | 258 => assert!(matches!(verdict, Verdict::Spike { .. }), "{k}: {verdict:?}"),
            251..256 => assert_eq!(*verdict, Verdict::Missing, "{k}"),
            _ => assert_eq!(*verdict, Verdict::Sound, "{k}"),
        }
    }
}
