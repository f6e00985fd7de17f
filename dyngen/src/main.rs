//! The `dyngen` command.
fn main() {}
