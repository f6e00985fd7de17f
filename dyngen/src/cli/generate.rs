//! `dyngen generate`.

use super::{Failure, Progress, Set, same_file};
use dyngen::{Config, FrictionTerm, Function, GenerateError, Language};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = format!("{}\n\n\
        Example: dyngen generate arm.toml -o arm.rs --parameters minimal --functions \
        regressor,mass_matrix\n         dyngen generate arm.toml --language c -o arm.c\n         \
        dyngen generate arm.toml --language cuda -o arm.cu\n         \
        dyngen generate arm.toml --batch --contract -o arm.rs", list_of_functions()))]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// The file to write; in C its header FILE.h is written next to it.
    #[arg(short, long, value_name = "FILE.rs|FILE.c|FILE.cu|FILE.wgsl")]
    output: PathBuf,
    /// The language: c is C99, double, or float with -DNAME_FLOAT; cuda the same with a kernel for each
    /// function, wgsl with an entry point for each, f32 alone.
    #[arg(long, value_enum, default_value = "rust")]
    language: In,
    /// The parameter set of every function.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// The functions of the list below, separated by commas; its first part where this is left out.
    #[arg(long, value_delimiter = ',', value_parser = function)]
    functions: Option<Vec<Function>>,
    /// Bake parameter values in: a JSON file {"parameter": number, …}, by the set's names or the arm's.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
    /// Friction columns for every joint, separated by commas: viscous, coulomb, tanh:SHAPE (s/rad; or one for
    /// each joint, tanh:216:180:…).
    #[arg(long, value_delimiter = ',', value_name = "TERMS")]
    friction: Vec<FrictionTerm>,
    /// Emit the module `batch` too: the functions over blocks of samples, for the processor's vectors (Rust).
    #[arg(long)]
    batch: bool,
    /// Emit the arm's own consistency tests too (Rust).
    #[arg(long)]
    tests: bool,
    /// Let sums take products in: a*b + c is one operation that rounds once (fused multiply-add), for
    /// processors that have it. Bits are then no longer those of every machine.
    #[arg(long)]
    contract: bool,
    /// Write over a file that dyngen has not generated.
    #[arg(long)]
    force: bool,
    /// Write nothing; fail where a file on disk is not what would be written.
    #[arg(long)]
    check: bool,
    /// Do not say what was written.
    #[arg(short, long)]
    quiet: bool,
}

/// A language on the command line.
#[derive(Clone, Copy, clap::ValueEnum)]
enum In {
    Rust,
    C,
    Cuda,
    Wgsl,
}

/// A function by its name.
pub(super) fn function(name: &str) -> Result<Function, String> {
    let names = Function::ALL.map(Function::name).join(", ");
    Function::parse(name.trim()).ok_or_else(|| format!("there is no function '{name}': there are {names}"))
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let mut config = Config::new(&args.arm)
        .parameters(args.parameters.into())
        .language(match args.language {
            In::Rust => Language::Rust,
            In::C => Language::C,
            In::Cuda => Language::Cuda,
            In::Wgsl => Language::Wgsl,
        })
        .friction(args.friction.clone())
        .batch(args.batch)
        .tests(args.tests)
        .contract(args.contract);
    if let Some(functions) = &args.functions {
        config = config.functions(functions.clone());
    }
    if let Some(values) = &args.values {
        config = config.values(values);
    }
    let failure = |e: GenerateError| match e {
        GenerateError::Model(_) => Failure::refused(e),
        _ => Failure::input(e),
    };
    let files = config.files(&args.output).map_err(failure)?;
    for input in std::iter::once(&args.arm).chain(&args.values) {
        if files.iter().any(|file| same_file(file, input)) {
            let file = input.display();
            return Err(Failure::input(format!("{file} is an input: choose another -o")));
        }
    }
    let foreign = |file: &&PathBuf| {
        file.is_file()
            && std::fs::read(file).is_ok_and(|old| !old.is_empty() && !is_generated(&old))
            && !args.force
            && !args.check
    };
    if let Some(file) = files.iter().find(foreign) {
        let file = file.display();
        return Err(Failure::input(format!(
            "{file} is there already and was not generated: --force writes over it"
        )));
    }
    // What is wrong with the arm file is reported below.
    let progress = super::arm(&args.arm).ok().map(|arm| Progress::new(&arm));
    config.warnings().map_err(failure)?.iter().for_each(|warning| eprintln!("warning: {warning}"));
    progress.iter().for_each(|p| p.say("deriving, proving and writing"));
    if !args.check {
        config.write(&args.output).map_err(failure)?;
        drop(progress);
        if !args.quiet {
            say_what_was_written(args, &files);
        }
        return Ok(ExitCode::SUCCESS);
    }
    for (file, expected) in config.texts(&args.output).map_err(failure)? {
        let name = file.display();
        let actual = std::fs::read_to_string(&file)
            .map_err(|e| Failure::input(format!("{name}: cannot be read: {e}")))?;
        if actual != expected {
            return Err(Failure::refused(format!(
                "{name} is stale: it is not what dyngen writes for {}; run the same command without --check",
                args.arm.display()
            )));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// One line on standard error.
fn say_what_was_written(args: &Args, files: &[PathBuf]) {
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let functions = args.functions.as_ref().map_or_else(|| Function::common().count(), Vec::len);
    eprintln!(
        "wrote {}: functions of {}, {functions} of them, each proven",
        names.join(" and "),
        args.arm.display()
    );
}

/// All functions with what they compute, those of a file that asks for none first.
pub(super) fn list_of_functions() -> String {
    let line = |function: Function| format!("  {:<38} {}\n", function.name(), function.meaning().0);
    let common: String = Function::common().map(line).collect();
    let others: String = Function::ALL.into_iter().skip(Function::common().count()).map(line).collect();
    format!("Functions:\n{common}\nNot in a file unless they are asked for:\n{}", others.trim_end())
}

/// Whether a file begins as generated ones do.
fn is_generated(text: &[u8]) -> bool {
    String::from_utf8_lossy(&text[..text.len().min(HEAD)]).contains("@generated by dyngen")
}

/// Bytes in which a generated file names its maker.
const HEAD: usize = 400;
