//! Nothing allocates along a run.

use hydroid::model::write;
use tempfile::TempDir;

use crate::along::{in_current, model};
use crate::program::{Compiler, Program, libraries, sources};

const NAMES: [&str; 8] = [
    "equations with past outputs",
    "equations behind a limit of the rate",
    "gru on equations",
    "lstm on nothing, without feedback",
    "direct on equations",
    "committee",
    "otter",
    "hydrofoil",
];

#[test]
#[cfg_attr(not(target_os = "linux"), ignore = "needs the linker of GNU")]
fn nothing_allocates_along_a_run() {
    // The linker replaces the functions of the C library.
    let compiler = Compiler { program: "cc", flags: &["-std=c99", "-O1"] };
    let library = libraries().join("libhydroid_c.a");
    let wrapped = ["malloc", "calloc", "realloc", "posix_memalign", "aligned_alloc"];
    let wrapped: Vec<String> = wrapped.iter().map(|name| format!("-Wl,--wrap={name}")).collect();
    let mut link = vec![library.to_str().unwrap()];
    link.extend(wrapped.iter().map(String::as_str));
    let program = Program::linked(&compiler, &sources().join("allocations.c"), &link);
    let folder = TempDir::new().unwrap();
    let models = NAMES.iter().map(|name| model(name)).chain([in_current(model("equations"))]);
    let paths: Vec<String> = models
        .enumerate()
        .map(|(at, model)| {
            let path = folder.path().join(format!("{at} {}", model.description.name));
            write(&model, &path).unwrap();
            path.to_str().unwrap().to_owned()
        })
        .collect();
    program.run(&paths.iter().map(String::as_str).collect::<Vec<_>>());
}
