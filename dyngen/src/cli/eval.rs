//! `dyngen eval`.

use super::{Failure, Set, arm, generate, model, print};
use dyngen::dynamics::function::Argument;
use dyngen::{Evaluator, Function, Model, Samples, SetKind, Values};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = format!("{}\n\n\
    Example: dyngen eval arm.toml --function inverse_dynamics --states states.csv --values values.json",
    generate::list_of_functions()))]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// The function to evaluate, of the list below.
    #[arg(long, value_parser = generate::function)]
    function: Function,
    /// States: a CSV file with a header line and the columns q1…, dq1…, ddq1… (tau1… for forward dynamics,
    /// dqr1… and ddqr1… for reference motions, e1… for products, f1 to f6 for a wrench on the tool).
    #[arg(long, value_name = "FILE.csv")]
    states: PathBuf,
    /// The frame of the arm file at which a function of the tool is asked for.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// The parameter set.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// Parameter values: a JSON file {"parameter": number, …}, by the set's names or the arm's.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let function = args.function;
    let (model, kind) = match function.is_kinematic() {
        true => (Model::kinematic(arm(&args.arm)?), SetKind::Full),
        false => (model(&args.arm)?, args.parameters.into()),
    };
    let model = match &args.frame {
        None => model,
        Some(_) if !function.is_of_tool() => {
            return Err(Failure::input(format!("--frame: {function} is not of a frame")));
        }
        Some(name) => model.at_frame(name).ok_or_else(|| {
            let names: Vec<&str> = model.arm().frames.iter().map(|frame| frame.name.as_str()).collect();
            Failure::input(format!("--frame: the arm has no frame '{name}': it has {}", names.join(", ")))
        })?,
    };
    let set = model.set(kind).map_err(Failure::refused)?;
    let parameters = match (&args.values, function.takes(Argument::Parameters)) {
        (Some(path), true) => {
            Values::read(path).and_then(|v| v.of_set(&model, set)).map_err(Failure::input)?
        }
        (None, true) => {
            return Err(Failure::input(format!(
                "{function} depends on parameter values: give them with --values FILE.json"
            )));
        }
        _ => Vec::new(),
    };
    let states = States::read(&args.states)?;
    let names = model.arm().joint_names();
    let columns = |argument: Argument| match (function.takes(argument), argument.parts()) {
        (false, _) => Ok(Vec::new()),
        (true, None) => states.columns(argument.name(), &names, "the arm has", "joints"),
        (true, Some(parts)) => {
            let parts: Vec<String> = parts.iter().map(ToString::to_string).collect();
            states.columns(argument.name(), &parts, "it has", "numbers")
        }
    };
    let samples = Samples {
        q: &columns(Argument::Positions)?,
        dq: &columns(Argument::Velocities)?,
        ddq: &columns(Argument::Accelerations)?,
        dqr: &columns(Argument::ReferenceVelocities)?,
        ddqr: &columns(Argument::ReferenceAccelerations)?,
        tau: &columns(Argument::Torques)?,
        e: &columns(Argument::Errors)?,
        f: &columns(Argument::Wrench)?,
        payload: &columns(Argument::Payload)?,
        vq: &columns(Argument::PositionDirection)?,
        vdq: &columns(Argument::VelocityDirection)?,
        parameters: &parameters,
    };
    let evaluator = Evaluator::new(&model, function, set.kind).map_err(Failure::refused)?;
    let mut out = vec![0.0; states.rows.len() * evaluator.outputs()];
    evaluator.run(&samples, &mut out);
    let width = evaluator.outputs().max(1);
    if let Some(wrong) = out.iter().position(|x| !x.is_finite()) {
        return Err(not_finite(&states, function, wrong / width));
    }
    let mut text = header(function, evaluator.shape()).join(",");
    text.push('\n');
    for row in out.chunks(width) {
        for (i, value) in row.iter().enumerate() {
            let separator = if i == 0 { "" } else { "," };
            // The shortest text that reads back as the same number. A String takes every write.
            let _ = write!(text, "{separator}{value:?}");
        }
        text.push('\n');
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Why a result is no number: nothing of it is printed.
fn not_finite(states: &States, function: Function, row: usize) -> Failure {
    let line = states.rows.get(row).map_or(0, |(line, _)| *line);
    let why = function.why_not_finite();
    Failure::refused(format!("{}:{line}: {function} is not finite: {why}", states.file))
}

/// Names of the result's columns: tau1 …, and for a matrix Y1_1 (row, column).
fn header(function: Function, (rows, columns): (usize, usize)) -> Vec<String> {
    let letter = function.letter();
    let name = |k: usize| {
        if columns == 1 {
            format!("{letter}{}", k + 1)
        } else {
            format!("{letter}{}_{}", k / columns + 1, k % columns + 1)
        }
    };
    (0..rows * columns).map(name).collect()
}

/// A table of states.
struct States {
    file: String,
    header: Vec<String>,
    rows: Vec<(u64, Vec<f64>)>,
}

impl States {
    fn read(path: &Path) -> Result<States, Failure> {
        let file = path.display().to_string();
        let unreadable = |e: csv::Error| Failure::input(format!("{file}: the states cannot be read: {e}"));
        let opened = dyngen::file::open(path).map_err(|e| unreadable(e.into()))?;
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(opened);
        let header: Vec<String> = reader.headers().map_err(unreadable)?.iter().map(str::to_string).collect();
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(unreadable)?;
            let line = record.position().map_or(0, csv::Position::line);
            let mut row = Vec::with_capacity(record.len());
            for (column, field) in record.iter().enumerate() {
                let value = field.parse::<f64>().ok().filter(|x| x.is_finite());
                row.push(value.ok_or_else(|| {
                    let name = header.get(column).map_or("?", String::as_str);
                    Failure::input(format!("{file}:{line}: {name} must be a finite number, found '{field}'"))
                })?);
            }
            rows.push((line, row));
        }
        Ok(States { file, header, rows })
    }

    /// The columns name1 … of every row, one row after another; a joint's number or its name may say which.
    fn columns(&self, name: &str, joints: &[String], owner: &str, items: &str) -> Result<Vec<f64>, Failure> {
        let n = joints.len();
        let place = |i: usize| {
            let titles = [format!("{name}{i}"), format!("{name}.{}", joints[i - 1])];
            self.header.iter().position(|h| titles.contains(h))
        };
        let places: Vec<Option<usize>> = (1..=n).map(place).collect();
        let missing: Vec<String> =
            (1..=n).filter(|i| places[i - 1].is_none()).map(|i| format!("{name}{i}")).collect();
        if !missing.is_empty() {
            return Err(Failure::input(format!(
                "{}:1: the states have no column {}; {owner} {n} {items}",
                self.file,
                missing.join(", ")
            )));
        }
        let more = format!("{name}{}", n + 1);
        if self.header.contains(&more) {
            return Err(Failure::input(format!(
                "{}:1: the states have a column {more}; {owner} {n} {items}: another arm's states",
                self.file
            )));
        }
        let places: Vec<usize> = places.into_iter().flatten().collect();
        Ok(self.rows.iter().flat_map(|(_, row)| places.iter().map(|p| row[*p])).collect())
    }
}
