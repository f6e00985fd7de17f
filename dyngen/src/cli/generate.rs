//! `dyngen generate`.

use super::{Failure, Progress, Set, same_file};
use dyngen::{Arm, Config, FrictionTerm, Function, GenerateError};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen generate arm.toml -o arm.rs --parameters minimal --functions \
        regressor,mass_matrix")]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// The file to write.
    #[arg(short, long, value_name = "FILE.rs")]
    output: PathBuf,
    /// The parameter set of every function.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// The functions, separated by commas; those that most controllers need where this is left out.
    #[arg(long, value_delimiter = ',', value_parser = function)]
    functions: Option<Vec<Function>>,
    /// Bake parameter values in: a JSON file {"parameter": number, …}, by the set's names or the arm's.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
    /// Friction columns for every joint, separated by commas: viscous, coulomb, tanh:SHAPE (s/rad; or one for
    /// each joint, tanh:216:180:…).
    #[arg(long, value_delimiter = ',', value_name = "TERMS")]
    friction: Vec<FrictionTerm>,
    /// Emit the module `batch` too: the functions over blocks of samples, for the processor's vectors.
    #[arg(long)]
    batch: bool,
    /// Emit the arm's own consistency tests too.
    #[arg(long)]
    tests: bool,
    /// Write nothing; fail where the file on disk is not what would be written.
    #[arg(long)]
    check: bool,
}

/// A function by its name.
pub(super) fn function(name: &str) -> Result<Function, String> {
    let names = Function::ALL.map(Function::name).join(", ");
    Function::parse(name.trim()).ok_or_else(|| format!("there is no function '{name}': there are {names}"))
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let mut config = Config::new(&args.arm)
        .parameters(args.parameters.into())
        .friction(args.friction.clone())
        .batch(args.batch)
        .tests(args.tests);
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
    for input in std::iter::once(&args.arm).chain(&args.values) {
        if same_file(&args.output, input) {
            let file = input.display();
            return Err(Failure::input(format!("{file} is an input: choose another -o")));
        }
    }
    // What is wrong with the arm file is told below.
    let progress = Arm::read(&args.arm).ok().map(|arm| Progress::new(&arm));
    progress.iter().for_each(|p| p.say("deriving, proving and writing"));
    if !args.check {
        config.write(&args.output).map_err(failure)?;
        return Ok(ExitCode::SUCCESS);
    }
    let expected = config.source().map_err(failure)?;
    let file = args.output.display();
    let actual = std::fs::read_to_string(&args.output)
        .map_err(|e| Failure::input(format!("{file}: cannot be read: {e}")))?;
    if actual == expected {
        return Ok(ExitCode::SUCCESS);
    }
    Err(Failure::refused(format!(
        "{file} is stale: it is not what dyngen writes for {}; run the same command without --check",
        args.arm.display()
    )))
}
