//! `powerball profile`: an arm's constant tables from its drives' DCF and one TOML.

use super::{Failure, output};
use clap::Args;
use powerball_bus::driver::import;
use std::path::{Path, PathBuf};

/// Make the bus driver's constant tables of an arm: a Rust file.
///
/// The DCF (or EDS) is the drive maker's; the TOML adds the data of the arm: nodes, rate, mapping, limits,
/// scales. Without counts per degree in the TOML they are computed from 0x608F, 0x6091 and 0x6092 of the DCF;
/// a mode that the TOML leaves out is not required of the drives.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  powerball profile --dcf Schunk_0_63.dcf --arm powerball/lwa4p_bus.toml \
        --constant LWA4P -o lwa4p.rs")]
pub(crate) struct ProfileCommand {
    /// The drive's DCF or EDS.
    #[arg(long, value_name = "FILE")]
    dcf: PathBuf,
    /// More DCFs, whose values replace those of the first.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    overlay: Vec<PathBuf>,
    /// The arm's TOML.
    #[arg(long, value_name = "FILE")]
    arm: PathBuf,
    /// Name of the constant.
    #[arg(long, default_value = "ARM")]
    constant: String,
    /// Name of the source in the file's head; by default the file names.
    #[arg(long)]
    source: Option<String>,
    /// File to write.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

impl ProfileCommand {
    pub(super) fn run(self) -> Result<(), Failure> {
        let dcf = read(&self.dcf)?;
        let overlays = self.overlay.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
        let toml = String::from_utf8(read(&self.arm)?)
            .map_err(|e| Failure::Unusable(format!("{}: {}", self.arm.display(), no_text(e.as_bytes()))))?;
        let name =
            |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let files = || {
            let all = [&self.dcf].into_iter().chain(&self.overlay).chain([&self.arm]);
            all.map(|path| name(path)).collect::<Vec<_>>().join(", ")
        };
        let source = self.source.clone().unwrap_or_else(files);
        let made = import::rust_source(&dcf, &overlays, &toml, &self.constant, &source).map_err(|error| {
            let file = match error {
                import::ImportError::Dcf(_) | import::ImportError::Drive(_) => name(&self.dcf),
                import::ImportError::Overlay(k, _) => {
                    self.overlay.get(k).map_or_else(String::new, |p| name(p))
                }
                import::ImportError::Toml(_) => name(&self.arm),
                import::ImportError::Mismatch(_) => format!("{} and {}", name(&self.dcf), name(&self.arm)),
            };
            Failure::Unusable(format!("{file}: {error}"))
        })?;
        output::write_file(&self.out, made.as_bytes())
    }
}

/// Why a TOML's bytes are not text.
fn no_text(bytes: &[u8]) -> &'static str {
    match bytes {
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => "is UTF-16; TOML is UTF-8: save it as UTF-8",
        _ => "not UTF-8",
    }
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    dyngen::file::read(path).map_err(|error| Failure::Unusable(format!("{}: {error}", path.display())))
}
