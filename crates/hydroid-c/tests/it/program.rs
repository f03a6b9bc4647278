//! Programs in C that are compiled against the library.

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

/// `rustc --print native-static-libs` on Linux; on macOS these are part of the system library.
pub(crate) const SYSTEM: [&str; 6] = ["-lgcc_s", "-lutil", "-lrt", "-lpthread", "-lm", "-ldl"];

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];

/// A compiler with its flags.
pub(crate) struct Compiler {
    pub(crate) program: &'static str,
    pub(crate) flags: &'static [&'static str],
}

pub(crate) const GCC: Compiler = Compiler {
    program: "cc",
    flags: &["-std=c99", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
};

/// Its sanitizers are packages of their own.
pub(crate) const CLANG: Compiler = Compiler { program: "clang", flags: &["-std=c99", "-O2"] };

pub(crate) const CPP: Compiler = Compiler { program: "c++", flags: &["-x", "c++", "-std=c++11", "-O1"] };

/// Folder of the libraries: cargo builds all kinds of them beside the tests.
pub(crate) fn libraries() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_owned()
}

/// Folder of a source of these tests.
pub(crate) fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it")
}

/// A program in a folder that is removed at the end.
pub(crate) struct Program {
    folder: TempDir,
}

impl Program {
    /// Compiles a source against the static library.
    pub(crate) fn of(compiler: &Compiler, source: &Path) -> Self {
        let library = libraries().join("libhydroid_c.a");
        Self::linked(compiler, source, &[library.to_str().unwrap(), "-pthread"])
    }

    pub(crate) fn linked(compiler: &Compiler, source: &Path, link: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("include");
        let mut command = Command::new(compiler.program);
        command.args(compiler.flags).args(WARNINGS).arg("-I").arg(include).arg(source);
        // Later inputs are not sources of C++.
        command.args(if compiler.flags.contains(&"-x") { &["-x", "none"][..] } else { &[] });
        command.args(link).args(SYSTEM).arg("-o").arg(folder.path().join("program"));
        let output = command.output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {errors}", source.display());
        Self { folder }
    }

    /// Runs the program, which must succeed and write no errors. Gives what it printed.
    pub(crate) fn run(&self, arguments: &[&str]) -> String {
        let output = Command::new(self.folder.path().join("program")).args(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.is_empty(), "{arguments:?}: {} {errors}", output.status);
        String::from_utf8(output.stdout).unwrap()
    }
}

/// Whether a compiler is there.
pub(crate) fn exists(compiler: &Compiler) -> bool {
    let exists = Command::new(compiler.program).arg("--version").output().is_ok();
    if !exists {
        println!("skipped: no {}", compiler.program);
    }
    exists
}
