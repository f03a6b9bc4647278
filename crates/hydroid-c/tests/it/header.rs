//! The header is the one that cbindgen makes of the sources.

use std::path::{Path, PathBuf};

use cbindgen::{Builder, Config};

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn generated() -> String {
    let config = Config::from_file(folder().join("cbindgen.toml")).unwrap();
    // Types in the order of the modules; the modules of the interface follow from it.
    let sources = ["error", "model", "session", "learning", "simulation", "interface/mod"];
    let builder = Builder::new().with_config(config);
    let path = |name: &str| folder().join("src").join(format!("{name}.rs"));
    let builder = sources.iter().fold(builder, |builder, name| builder.with_src(path(name)));
    let mut text = Vec::new();
    builder.generate().unwrap().write(&mut text);
    String::from_utf8(text).unwrap()
}

pub(crate) fn path() -> PathBuf {
    folder().join("include/hydroid.h")
}

#[test]
fn the_header_is_that_of_the_sources() {
    let generated = generated();
    if std::env::var_os("HYDROID_WRITE_HEADER").is_some() {
        std::fs::write(path(), &generated).unwrap();
    }
    let committed = std::fs::read_to_string(path()).unwrap();
    assert!(
        generated == committed,
        "include/hydroid.h is not that of the sources: HYDROID_WRITE_HEADER=1 cargo test -p hydroid-c the_header writes it"
    );
}
