//! `dyngen import`.

use super::{Failure, same_file};
use dyngen::arm::Convention;
use dyngen::import::{self, Options};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen import robot.urdf --tip tool0 -o arm.toml")]
pub(super) struct Args {
    /// The URDF file (xacro has to be run before), or a MuJoCo model.
    urdf: PathBuf,
    /// The link that stands still; the root where it is left out.
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// A joint that is held at a position, rad or m; may be repeated.
    #[arg(long, value_name = "JOINT=VALUE", value_parser = lock)]
    lock: Vec<(String, f64)>,
    /// The link that ends the chain; needed where the robot is a tree.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// The arm file to write; the inertial values go next to it, as FILE.values.json.
    #[arg(short, long, value_name = "FILE.toml")]
    output: PathBuf,
    /// Replace an arm file or values that are there already.
    #[arg(long)]
    force: bool,
    /// Where frame i sits: on joint i (modified) or at the far end of link i (standard).
    #[arg(long, value_enum, default_value = "modified")]
    convention: Frames,
    /// Keep every digit: do not take rounded numbers such as 1.5708 for what they were rounded from.
    #[arg(long)]
    exact: bool,
    /// Show every note: else of several of one kind the first two are shown.
    #[arg(short, long)]
    verbose: bool,
    /// Angles this close to a multiple of pi/12 are taken for it, rad.
    #[arg(long, value_name = "RAD", default_value = "1e-9", value_parser = tolerance)]
    angle_tolerance: f64,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Frames {
    Modified,
    Standard,
}

pub(super) fn lock(text: &str) -> Result<(String, f64), String> {
    let (joint, value) = text.rsplit_once('=').ok_or("must be JOINT=VALUE, such as finger=0.02")?;
    let number = value.parse().ok().filter(|x: &f64| x.is_finite());
    Ok((joint.to_string(), number.ok_or_else(|| format!("'{value}' is no number of rad or m"))?))
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|x| (0.0..=0.01).contains(x));
    value.ok_or_else(|| "must be a number of radians from 0 to 0.01".to_string())
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let source = import::Source::read(&args.urdf).map_err(Failure::input)?;
    let file = &source.file;
    let convention = match args.convention {
        Frames::Modified => Convention::Modified,
        Frames::Standard => Convention::Standard,
    };
    let options = Options {
        base: args.base.clone(),
        lock: args.lock.clone(),
        tip: args.tip.clone(),
        convention,
        angle_tolerance: args.angle_tolerance,
        exact: args.exact,
    };
    let imported = import::source(&source, &options).map_err(Failure::input)?;
    let notes: Vec<String> = imported.notes.iter().chain(&imported.arm.notes()).cloned().collect();
    for note in if args.verbose { notes } else { shortened(notes) } {
        eprintln!("{file}: note: {note}");
    }
    let values = args.output.with_extension("values.json");
    for path in [&args.output, &values] {
        refuse_to_replace(path, &args.urdf, args.force)?;
    }
    let json = imported.values_json();
    let mut files: Vec<(&Path, &[u8])> = vec![(&args.output, imported.text.as_bytes())];
    if !imported.values.is_empty() {
        files.push((&values, json.as_bytes()));
    }
    write(&files)?;
    Ok(ExitCode::SUCCESS)
}

/// Of notes that begin alike, up to a colon, the first two, and how many more there are.
fn shortened(notes: Vec<String>) -> Vec<String> {
    const SHOWN: usize = 2;
    let kind = |note: &str| note.split_once(": ").map(|(kind, _)| kind.to_string());
    let mut short: Vec<String> = Vec::new();
    for group in notes.chunk_by(|a, b| kind(a).is_some() && kind(a) == kind(b)) {
        // One more line that says so saves nothing in place of one note.
        let shown = if group.len() > SHOWN + 1 { SHOWN } else { group.len() };
        short.extend_from_slice(&group[..shown]);
        if let (Some(kind), true) = (kind(&group[0]), shown < group.len()) {
            short.push(format!("{kind}: {} more (--verbose shows them)", group.len() - shown));
        }
    }
    short
}

/// Edited files are not lost by accident, and the original is never written over.
pub(super) fn refuse_to_replace(path: &Path, original: &Path, force: bool) -> Result<(), Failure> {
    let place = path.display();
    if same_file(path, original) {
        return Err(Failure::input(format!("{place} is the file that is imported: choose another -o")));
    }
    if path.exists() && !force {
        return Err(Failure::input(format!(
            "{place} is there already and may have been edited: --force replaces it, or choose another -o"
        )));
    }
    Ok(())
}

/// Writes all files or none: each is complete on the disk before the first takes its name.
pub(super) fn write(files: &[(&Path, &[u8])]) -> Result<(), Failure> {
    let partial = |path: &Path| {
        let mut name = path.as_os_str().to_os_string();
        name.push(".partial");
        PathBuf::from(name)
    };
    let put = |step: &dyn Fn(&Path, &[u8]) -> std::io::Result<()>| {
        files.iter().try_for_each(|(path, text)| {
            step(path, text)
                .map_err(|e| Failure::input(format!("{}: cannot be written: {e}", path.display())))
        })
    };
    let written = put(&|path, text| std::fs::write(partial(path), text))
        .and_then(|()| put(&|path, _| std::fs::rename(partial(path), path)));
    if written.is_err() {
        for (path, _) in files {
            // Nothing more can be done about a part that cannot be removed either.
            let _ = std::fs::remove_file(partial(path));
        }
    }
    written
}
