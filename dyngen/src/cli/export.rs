//! `dyngen export`.

use super::Failure;
use super::import::{lock, refuse_to_replace, write};
use dyngen::Arm;
use dyngen::export::{self, Known};
use dyngen::import::{ImportError, Options, Source};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Example: dyngen export robot.urdf --arm arm.toml --values identified.json --friction \
    identified.json --to urdf -o identified.urdf"
)]
pub(super) struct Args {
    /// The robot description that the arm was imported from.
    original: PathBuf,
    /// The arm file.
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// What `powerball identify` wrote, or values of every parameter of the arm.
    #[arg(long, value_name = "FILE.json")]
    values: PathBuf,
    /// What `powerball identify` or `explain` wrote: damping and friction of the joints, and for MuJoCo
    /// effects, or position servos.
    #[arg(long, value_name = "FILE.json")]
    friction: Option<PathBuf>,
    /// Write damping too that is not larger than its own standard error; without this the original's stays.
    #[arg(long)]
    uncertain: bool,
    /// The format of the original.
    #[arg(long, value_enum)]
    to: Format,
    /// The file to write.
    #[arg(short, long, value_name = "NEW")]
    output: PathBuf,
    /// Replace a file that is there already; never the original.
    #[arg(long)]
    force: bool,
    /// The link that stands still, as for the import.
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// The link that ends the chain; where the arm file names its joints the last of them says it.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// A joint that is held at a position, as for the import; may be repeated.
    #[arg(long, value_name = "JOINT=VALUE", value_parser = lock)]
    lock: Vec<(String, f64)>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    Urdf,
    Mjcf,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    refuse_to_replace(&args.output, &args.original, args.force)?;
    let read = |path: &Path| {
        let text = dyngen::file::text(path);
        text.map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))
    };
    let name = |path: &Path| path.display().to_string();
    let arm = Arm::read(&args.arm).map_err(Failure::input)?;
    let source = Source::read(&args.original).map_err(Failure::input)?;
    let values = read(&args.values)?;
    let friction = args.friction.as_ref().map(|path| Ok((read(path)?, name(path)))).transpose()?;
    let friction = friction.as_ref().map(|(text, file)| (text.as_str(), file.as_str()));
    let mut known = Known::read(&arm, (&values, &name(&args.values)), friction).map_err(Failure::refused)?;
    let left = if args.uncertain { Vec::new() } else { known.without_uncertain_damping(&arm) };
    let options = Options {
        base: args.base.clone(),
        tip: args.tip.clone(),
        lock: args.lock.clone(),
        ..Options::default()
    };
    let file = &source.file;
    let (asked, other) = match args.to {
        Format::Urdf => (false, "a MuJoCo model: --to mjcf"),
        Format::Mjcf => (true, "no MuJoCo model: --to urdf"),
    };
    if source.is_mjcf() != asked {
        return Err(Failure::input(format!("{file}: this is {other}")));
    }
    let exported = export::source(&source, &arm, &known, &options).map_err(|e| match e {
        ImportError::Unreadable(_) => Failure::input(e),
        ImportError::Refused(_) => Failure::refused(e),
    })?;
    for note in left.iter().chain(&exported.notes) {
        eprintln!("{file}: note: {note}");
    }
    write(&[(&args.output, &source.bytes(&exported.text))])?;
    Ok(ExitCode::SUCCESS)
}
