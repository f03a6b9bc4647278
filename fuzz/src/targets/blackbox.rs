//! Black boxes.

use hydroid::adapt::{self, adapter};
use hydroid::model::Model;
use hydroid_core::adapt::Adapter;
use hydroid_live::black_box::{BlackBox, ModelFile, Recorder, RecordingOptions, Source, replay};

use crate::live::Live;
use crate::{models, repair, scratch};

/// The recording names its variant in place of the fingerprint of the model. Whatever is read can be shown and replayed, and a
/// recorder that continues it leaves a file that can be read.
pub fn blackbox(bytes: &[u8]) {
    let bytes = repair::black_box(bytes);
    let Ok(black_box) = BlackBox::decode(&bytes) else { return };
    let summary = black_box.summary();
    assert_eq!(summary.samples, black_box.steps().filter(|step| step.is_sample()).count());
    for step in black_box.steps() {
        assert!(step.json().is_object());
    }
    let variant = black_box.head.model.fingerprint.clone();
    let (model, options) = models::variant(&variant);
    let mut steps = 0;
    if replay(&model, &variant, &black_box, |_| steps += 1).is_ok() {
        assert_eq!(steps, black_box.steps().count());
    }
    let path = scratch::path("box");
    std::fs::write(&path, &bytes).expect("the scratch file can be written");
    let Ok(recorder) = recorder(&variant, &model, &options) else { return };
    let mut live = Live::new(&variant, false);
    live.stream().record(recorder);
    live.begin();
    (0..3).for_each(|_| drop(live.clean()));
    live.stream().finish().expect("the recording can be written");
    let again = BlackBox::read(&path).expect("a continued recording can be read");
    assert!(again.steps().count() > 0);
    let _ = replay(&model, &variant, &again, |_| {});
}

fn recorder(variant: &str, model: &Model, options: &adapt::Options) -> Result<Recorder, String> {
    let (mut adapter, _): (Box<dyn Adapter>, _) = adapter(model, options, &[]).map_err(|e| e.to_string())?;
    let settings = RecordingOptions {
        path: scratch::path("box"),
        minutes: 2.0,
        model: ModelFile { file: variant.to_owned(), fingerprint: variant.to_owned() },
    };
    Recorder::new(&settings, model, adapter.as_mut(), options, &variant, Source::Stream("fuzz"))
        .map_err(|e| e.to_string())
}

/// The recording of a variant over some samples; `sessions` of the stream.
pub fn seed(variant: &str, samples: usize, sessions: usize) -> Vec<u8> {
    let path = scratch::path("box");
    let _ = std::fs::remove_file(&path);
    let (model, options) = models::variant(variant);
    for _ in 0..sessions {
        let mut live = Live::new(variant, false);
        live.stream().record(recorder(variant, &model, &options).expect("a new recording"));
        live.begin();
        (0..samples).for_each(|_| drop(live.clean()));
        live.stream().finish().expect("the recording can be written");
    }
    std::fs::read(&path).expect("the recording was written")
}

/// Samples of a seed that are replayed with the same results.
pub fn replayed(bytes: &[u8]) -> Result<usize, String> {
    let black_box = BlackBox::decode(&repair::black_box(bytes))?;
    let variant = black_box.head.model.fingerprint.clone();
    let replayed = replay(&models::variant(&variant).0, &variant, &black_box, |_| {});
    let replayed = replayed.map_err(|error| error.to_string())?;
    replayed.first.map_or(Ok(replayed.samples), |first| Err(format!("{first:?}")))
}
