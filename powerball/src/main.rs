//! The `powerball` command.
fn main() {}
