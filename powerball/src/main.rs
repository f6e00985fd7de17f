//! The `powerball` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    powerball::commands::main()
}
