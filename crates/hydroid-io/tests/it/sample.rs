//! Sample files of the data folder, and what they contain.

use std::path::PathBuf;

/// A file of `fleet/formats`; `None`, with a message, if there is no data folder.
pub(crate) fn file(name: &str) -> Option<String> {
    let Ok(data) = std::env::var("HYDROID_DATA") else {
        println!("skipped: no HYDROID_DATA");
        return None;
    };
    let path = PathBuf::from(data).join("fleet/formats").join(name);
    assert!(path.exists(), "{} is missing", path.display());
    Some(path.to_string_lossy().into_owned())
}
