//! The `hydroid-ros` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    hydroid_ros::main()
}
