//! The `dyngen` command: describe, generate, eval, check.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
