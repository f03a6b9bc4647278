//! Files of `tests/golden`.

use std::path::PathBuf;

pub(crate) fn golden(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    folder.join(name).to_string_lossy().into_owned()
}

/// Whether two values are the same, those that are missing included.
pub(crate) fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}
