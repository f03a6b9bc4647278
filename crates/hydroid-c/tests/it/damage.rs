//! Memories and snapshots with any numbers: an error or a session that goes on, and no crash.

use std::ffi::CString;

use hydroid_c::Status;
use hydroid_c::interface::learning::{
    hydroid_session_load, hydroid_session_memory_len, hydroid_session_save,
};
use hydroid_c::interface::model::{hydroid_model_adapter, hydroid_model_free, hydroid_model_read};
use hydroid_c::interface::session::{
    hydroid_session_advance, hydroid_session_free, hydroid_session_observe, hydroid_session_restore,
    hydroid_session_rollout, hydroid_session_snapshot, hydroid_session_snapshot_len,
};
use tempfile::TempDir;

use crate::along::{in_current, model};
use crate::models::drawn;

const NOISE: [f64; 3] = [0.01; 3];

const HOSTILE: [f64; 9] =
    [f64::NAN, f64::INFINITY, -1.0, 1e300, -1e300, 0.5, 1e18, f64::MIN_POSITIVE, 4_294_967_296.0];

/// Numbers of which about one in `every` is another one, and the place of the first that is kept.
fn damaged(numbers: &[f64], kept: usize, every: f64, stream: f64) -> Vec<f64> {
    let (place, choice) = (drawn(numbers.len(), stream), drawn(numbers.len(), stream + 0.5));
    let of = |at: usize| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let hostile = HOSTILE[((choice[at] + 1.0) * 4.4) as usize];
        let is_hit = at >= kept && (place[at] + 1.0) * every < 2.0;
        if is_hit { hostile } else { numbers[at] }
    };
    (0..numbers.len()).map(of).collect()
}

#[test]
fn damaged_memories_are_errors_or_memories() {
    let names = ["equations with lags", "gru on hold", "direct on hold", "committee", "hydrofoil"];
    let models = names.iter().map(|name| model(name)).chain([in_current(model("equations"))]);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model");
    let c_path = CString::new(path.to_str().unwrap()).unwrap();
    let (mut refused, mut taken) = (0, 0);
    for model in models {
        hydroid::model::write(&model, &path).unwrap();
        for round in 0..40 {
            let mut of = std::ptr::null_mut();
            let mut session = std::ptr::null_mut();
            let guarded = round % 2 == 1;
            // SAFETY: handles that are used before they are freed, and arrays with their lengths.
            unsafe {
                assert_eq!(hydroid_model_read(c_path.as_ptr(), &raw mut of), Status::Ok);
                let options = std::ptr::null();
                let made = hydroid_model_adapter(of, guarded, options, NOISE.as_ptr(), 3, &raw mut session);
                assert_eq!(made, Status::Ok);
                hydroid_model_free(of);
            }
            let step = |k: usize| {
                let (y, c) = (drawn(3, k as f64), drawn(2, 0.5 + k as f64));
                let mut ahead = [0.0; 30];
                // SAFETY: as above.
                let statuses = unsafe {
                    [
                        hydroid_session_observe(session, y.as_ptr(), 3),
                        hydroid_session_rollout(session, drawn(20, 0.0).as_ptr(), 20, ahead.as_mut_ptr(), 30),
                        hydroid_session_advance(session, c.as_ptr(), 2),
                    ]
                };
                assert_eq!(statuses, [Status::Ok; 3], "{} {round} {k}", model.description.name);
            };
            (0..25).for_each(step);
            // SAFETY: as above.
            let numbers = unsafe {
                let mut numbers = vec![0.0; hydroid_session_memory_len(session)];
                assert_eq!(hydroid_session_save(session, numbers.as_mut_ptr(), numbers.len()), Status::Ok);
                numbers
            };
            // One number in many, or many of them.
            let every = if round % 4 < 2 { numbers.len() as f64 } else { 3.0 };
            let numbers = damaged(&numbers, 2, every, f64::from(round));
            // SAFETY: as above.
            match unsafe { hydroid_session_load(session, numbers.as_ptr(), numbers.len()) } {
                Status::Ok => taken += 1,
                Status::Memory => refused += 1,
                other => panic!("{} {round}: {other:?}", model.description.name),
            }
            (25..50).for_each(step);
            // SAFETY: as above.
            unsafe {
                let mut numbers = vec![0.0; hydroid_session_snapshot_len(session)];
                let length = numbers.len();
                assert_eq!(hydroid_session_snapshot(session, numbers.as_mut_ptr(), length), Status::Ok);
                let numbers = damaged(&numbers, 0, every, f64::from(round));
                assert_eq!(hydroid_session_restore(session, numbers.as_ptr(), length), Status::Ok);
            }
            (50..60).for_each(step);
            // SAFETY: the session is not used any more.
            unsafe { hydroid_session_free(session) };
        }
    }
    assert!(refused > 20 && taken > 20, "{refused} refused, {taken} taken");
}
