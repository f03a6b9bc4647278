//! Model files.

use std::path::Path;

use hydroid::model::decode;

use crate::{exercise, repair};

/// What is read as a model is used and written again.
pub fn model_file(bytes: &[u8]) {
    if let Ok(model) = decode(&repair::safetensors(bytes), Path::new("fuzz.safetensors")) {
        exercise::model(&model);
    }
}
