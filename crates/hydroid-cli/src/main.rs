//! The `hydroid` command.

fn main() {}
