//! `dyngen verify`.

use super::{Failure, Progress, arm, print};
use dyngen::emit::{self, Options};
use dyngen::verify::{Difference, Error, Report, Verifier};
use dyngen::{Arm, Function, Language, Model, SetKind, Values};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen generate arm.toml -o arm.rs && dyngen verify arm.rs arm.toml")]
pub(super) struct Args {
    /// The generated file; in C, CUDA or WGSL where its name ends in .c, .cu or .wgsl.
    file: PathBuf,
    /// The arm file that it was generated from.
    arm: PathBuf,
    /// The values that must be baked into the file: a JSON file {"parameter": number, …}. Without it those
    /// that the file itself names are taken.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let file = args.file.display();
    let text =
        dyngen::file::text(&args.file).map_err(|e| Failure::input(format!("{file}: cannot be read: {e}")))?;
    let failure = |e: Error| match e {
        Error::Unreadable(e) => Failure::input(format!("{file}:{e}")),
        e => Failure::refused(format!("{file}, {}: {e}", args.arm.display())),
    };
    let arm = arm(&args.arm)?;
    let progress = Progress::new(&arm);
    progress.say("deriving, reading and proving");
    let verifier = Verifier::new(arm.clone(), Language::of(&args.file), &text).map_err(failure)?;
    if let Some(path) = &args.values {
        check_values(&verifier, arm.clone(), path)?;
    }
    let mut report = verifier.verify(&text, None).map_err(failure)?;
    if let Some(difference) = &mut report.difference
        && let Some(line) = written_otherwise(&verifier, arm, &text, &difference.function)
    {
        difference.line = line;
    }
    drop(progress);
    let output = match args.json {
        true => in_json(args, &report),
        false => in_words(args, &report),
    };
    print(&output)?;
    Ok(if report.difference.is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The first line of a function that is not what dyngen writes, in Rust: no part of the proof, but where to
/// look.
fn written_otherwise(verifier: &Verifier, arm: Arm, text: &str, function: &str) -> Option<usize> {
    let has = |f: &Function| text.contains(&format!("pub fn {f}_with<"));
    let options = Options {
        parameters: SetKind::parse(verifier.set())?,
        functions: Function::ALL.into_iter().filter(has).collect(),
        values: verifier.values().map(<[f64]>::to_vec),
        ..Options::default()
    };
    let fresh = emit::source(&Model::derive(arm).ok()?, &options).ok()?;
    let (module, name) = function.rsplit_once("::").unwrap_or(("", function));
    let (module, name) = (format!("pub mod {module} {{"), name.strip_suffix("_with").unwrap_or(name));
    let inside = if module == "pub mod  {" { "" } else { &module };
    let (with, plain) = (format!("pub fn {name}_with<"), format!("pub fn {name}<"));
    [("", "pub fn new("), ("", "pub fn prepare<"), (inside, &with), (inside, &plain)].iter().find_map(
        |(inside, head)| {
            let (here, there) = (lines(text, inside, head)?, lines(&fresh, inside, head)?);
            let other = here.iter().zip(&there).find(|((_, a), (_, b))| a != b);
            other.map(|((line, _), _)| *line)
        },
    )
}

/// The lines of a function with their numbers, from its head within what begins with `inside`.
fn lines<'t>(text: &'t str, inside: &str, head: &str) -> Option<Vec<(usize, &'t str)>> {
    let from = text.find(inside)?;
    let at = from + text[from..].find(head)?;
    let indent = text[..at].rsplit('\n').next()?;
    let first = text[..at].matches('\n').count() + 1;
    let inner = |line: &&str| line.strip_prefix(indent) != Some("}");
    Some(text[at..].lines().take_while(inner).enumerate().map(|(k, line)| (first + k, line)).collect())
}

/// Whether the file's values are those of the JSON file.
fn check_values(verifier: &Verifier, arm: Arm, path: &Path) -> Result<(), Failure> {
    let model = Model::derive(arm).map_err(Failure::refused)?;
    let kind = SetKind::parse(verifier.set()).unwrap_or(SetKind::Minimal);
    let set = model.set(kind).map_err(Failure::refused)?;
    let values = Values::read(path).and_then(|v| v.of_set(&model, set)).map_err(Failure::input)?;
    match verifier.values() {
        None => Err(Failure::refused(format!("{}: no values are baked into the file", path.display()))),
        Some(found) => match found.iter().zip(&values).position(|(a, b)| a != b) {
            Some(k) => Err(Failure::refused(format!(
                "{}: {} is {}, and {} is baked into the file",
                path.display(),
                set.names()[k],
                values[k],
                found[k]
            ))),
            None => Ok(()),
        },
    }
}

fn in_words(args: &Args, report: &Report) -> String {
    let mut text: String = report.proven.iter().map(|name| format!("proven: {name}\n")).collect();
    text += &report.not_checked.iter().map(|name| format!("not checked: {name}\n")).collect::<String>();
    if let Some(Difference { function, entry, line, message }) = &report.difference {
        let entry = entry.map_or(String::new(), |(i, j)| format!(" (row {}, column {})", i + 1, j + 1));
        text += &format!("{}:{line}: {function}{entry} {message}\n", args.file.display());
    }
    text
}

fn in_json(args: &Args, report: &Report) -> String {
    let difference = report.difference.as_ref().map(|d| {
        serde_json::json!({
            "function": d.function,
            "entry": d.entry.map(|(i, j)| [i + 1, j + 1]),
            "line": d.line,
            "message": d.message,
        })
    });
    let object = serde_json::json!({
        "file": args.file,
        "arm": args.arm,
        "proven": report.proven,
        "not_checked": report.not_checked,
        "difference": difference,
    });
    format!("{object}\n")
}
