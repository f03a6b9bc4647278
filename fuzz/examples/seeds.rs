//! Writes the seeds that contain numbers of this version: `cargo run --release -p hydroid-fuzz --example seeds`.

use std::path::Path;

use hydroid::model::encode;
use hydroid_fuzz::models::{NAMES, model};
use hydroid_fuzz::targets::{blackbox, checkpoint, stream_state};

fn main() {
    let write = |target: &str, name: &str, bytes: &[u8]| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(target);
        std::fs::create_dir_all(&folder).expect("the folder can be created");
        std::fs::write(folder.join(format!("seed-{name}")), bytes).expect("the seed can be written");
    };
    for name in NAMES {
        let target = if name == "vessel" { "vessel_file" } else { "model_file" };
        write(target, name, &encode(&model(name)).expect("a valid model"));
    }
    // Of each learner one, some of them guarded: large covariances would fill the repository.
    for variant in [
        "equations",
        "equations+guard",
        "equations+kalman+guard",
        "mixture",
        "gru",
        "rnn+guard",
        "direct",
        "committee",
        "vessel",
    ] {
        write("stream_state", variant, &stream_state::seed(variant));
        if !["gru", "rnn+guard"].contains(&variant) {
            write("blackbox", variant, &blackbox::seed(variant, 3, 1));
        }
    }
    write("blackbox", "sessions", &blackbox::seed("slow", 8, 2));
    for epochs in 1..3 {
        write("checkpoint", &epochs.to_string(), &checkpoint::seed(epochs));
    }
}
