//! `dyngen completions` and `dyngen man`: what a shell and `man` know of this program.

use super::{Cli, Failure};
use clap::CommandFactory;
use clap_complete::Shell;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Prints what completes this program's words in a shell.
#[derive(clap::Args)]
#[command(after_help = "Example, for bash:\n  dyngen completions bash > \
    ~/.local/share/bash-completion/completions/dyngen")]
pub(super) struct Completions {
    /// The shell.
    shell: Shell,
}

pub(super) fn completions(args: &Completions) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "dyngen", &mut script);
    // A closed pipe is no error.
    let _ = std::io::stdout().write_all(&script);
    Ok(ExitCode::SUCCESS)
}

/// Writes a man page for this program and each of its commands.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  dyngen man ~/.local/share/man/man1 && man dyngen-generate")]
pub(super) struct Man {
    /// The folder; made if missing.
    folder: PathBuf,
}

pub(super) fn man(args: &Man) -> Result<ExitCode, Failure> {
    let folder = args.folder.display();
    std::fs::create_dir_all(&args.folder)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), &args.folder))
        .map_err(|e| Failure::input(format!("{folder}: cannot be written: {e}")))?;
    Ok(ExitCode::SUCCESS)
}
