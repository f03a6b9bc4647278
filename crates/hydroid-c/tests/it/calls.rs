//! Wrong calls, and calls of several threads.

use hydroid::model::{Model, write};
use tempfile::TempDir;

use crate::along::model;
use crate::program::{CPP, GCC, Program, exists, sources};

fn errors(program: &Program) {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&model("equations"), &path("model")).unwrap();
    std::fs::write(path("damaged"), b"\x10\0\0\0\0\0\0\0{}").unwrap();
    let mut still: Model = model("equations");
    still.description.outputs[0].channel.name = String::from("speed");
    write(&still, &path("still")).unwrap();
    write(&model("affine"), &path("affine")).unwrap();
    let files = ["model", "damaged", "still", "affine"].map(|name| path(name).to_str().unwrap().to_owned());
    program.run(&files.each_ref().map(String::as_str));
}

#[test]
fn wrong_calls_have_a_status_and_a_message() {
    errors(&Program::of(&GCC, &sources().join("errors.c")));
}

#[test]
fn wrong_calls_have_them_in_cpp() {
    if exists(&CPP) {
        errors(&Program::of(&CPP, &sources().join("errors.c")));
    }
}

#[test]
fn threads_have_handles_and_messages_of_their_own() {
    let program = Program::of(&GCC, &sources().join("threads.c"));
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model");
    write(&model("equations"), &path).unwrap();
    program.run(&[path.to_str().unwrap()]);
}
