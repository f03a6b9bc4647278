//! The `hydroid` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    hydroid_cli::main()
}
