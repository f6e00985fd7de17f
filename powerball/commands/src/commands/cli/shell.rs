//! `powerball completions` and `powerball man`: completions for a shell and manual pages of this program.

use super::{Cli, Failure, output};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::path::PathBuf;

/// Print what completes this program's words in a shell.
#[derive(Args, Debug)]
#[command(after_help = "Example, for bash:\n  powerball completions bash > \
    ~/.local/share/bash-completion/completions/powerball")]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "powerball", &mut script);
        output::data(String::from_utf8_lossy(&script).trim_end());
        Ok(())
    }
}

/// Write a man page for this program and each of its commands.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball man ~/.local/share/man/man1 && man powerball-identify")]
pub(crate) struct Man {
    /// The folder; made if missing.
    folder: PathBuf,
}

impl Man {
    pub(crate) fn run(self) -> Result<(), Failure> {
        output::make_folder(&self.folder)?;
        clap_mangen::generate_to(Cli::command(), &self.folder)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", self.folder.display())))
    }
}
