//! The study's logs as files for any program, and its score.

use super::case::{Case, Table};
use super::experiment::Bench;
use super::judge::{AS_WELL, Named, Outcome};
use super::{page, range};
use chacha20::ChaCha8Rng;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The benchmark: `--write` makes it, without it the answers are scored.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder of the benchmark: one folder a case, and truth.json
    dir: PathBuf,
    /// Write the cases: arm.toml, fit*.csv and validate*.csv each, and what is in them to DIR/truth.json
    #[arg(long)]
    write: bool,
    /// Tables to write; all that need no measured logs where none is named
    #[arg(long, value_enum, value_delimiter = ',')]
    table: Vec<Table>,
    /// Seeds, as FIRST..END
    #[arg(long, value_parser = range, default_value = "0..1")]
    seeds: Range<u64>,
    /// Where the answers are: ANSWERS/CASE/explained.json; DIR itself where it is not given
    #[arg(long)]
    answers: Option<PathBuf>,
}

/// What is in a case.
#[derive(Debug, Serialize, Deserialize)]
struct Truth {
    /// The folder, which says nothing.
    case: String,
    /// The case of the study.
    of: String,
    table: String,
    /// Names of effects, as the contract lists them, or of laws that are none of them.
    effects: Vec<String>,
    words: Vec<String>,
    /// Visible sizes, over the noise.
    sizes: Vec<f64>,
    /// Held-out errors where nothing is missing, by joint, N·m.
    clean: Vec<f64>,
}

/// What is read of an explained.json.
#[derive(Deserialize)]
struct Answer {
    effects: Vec<Effect>,
    #[serde(default)]
    after: Option<After>,
    #[serde(default)]
    unattributed: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
struct Effect {
    effect: String,
    joints: Vec<usize>,
    #[serde(default)]
    probability: Option<f64>,
    #[serde(default)]
    rivals: Vec<Rival>,
}

#[derive(Deserialize)]
struct Rival {
    effect: String,
    #[serde(default)]
    why_not: String,
}

#[derive(Deserialize)]
struct After {
    validate: Errors,
}

#[derive(Deserialize)]
struct Errors {
    rms: Vec<Option<f64>>,
}

/// Writes the benchmark, or scores answers to it.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    if arguments.write { write(arguments) } else { score(arguments) }
}

fn write(arguments: &Arguments) -> Result<(), String> {
    let truth = arguments.dir.join("truth.json");
    if truth.exists() {
        return Err(format!("{}: is there already; name another folder", truth.display()));
    }
    let tables = match arguments.table.is_empty() {
        true => Table::all().into_iter().filter(|table| !table.measured()).collect(),
        false => arguments.table.clone(),
    };
    if let Some(table) = tables.iter().find(|table| table.measured()) {
        return Err(format!("--table {}: its logs are measured ones and are not written", table.name()));
    }
    let bench = Bench::new()?;
    let mut truths = Vec::new();
    let all = |table| Case::all(table, Some(arguments.seeds.clone()));
    let mut cases: Vec<Case> = tables.into_iter().flat_map(all).collect();
    // Neither a folder's name nor its place says what is in it.
    cases.shuffle(&mut ChaCha8Rng::seed_from_u64(0));
    for (number, case) in cases.into_iter().enumerate() {
        let name = format!("case_{:04}", number + 1);
        let Some(written) = bench.write(&case, &arguments.dir.join(&name))? else { continue };
        println!("{name}");
        truths.push(Truth {
            of: case.name(),
            case: name,
            table: case.table.name(),
            effects: case.kinds,
            words: written.words,
            sizes: written.sizes,
            clean: written.clean,
        });
    }
    let text = serde_json::to_string_pretty(&truths).map_err(|e| e.to_string())?;
    fs::write(&truth, text + "\n").map_err(|e| format!("{}: {e}", truth.display()))
}

fn score(arguments: &Arguments) -> Result<(), String> {
    let truths: Vec<Truth> = read(&arguments.dir.join("truth.json"))?;
    let answers = arguments.answers.as_ref().unwrap_or(&arguments.dir);
    let mut outcomes = Vec::new();
    let mut silent = Vec::new();
    for truth in truths {
        let path = answers.join(&truth.case).join("explained.json");
        match path.exists() {
            true => outcomes.push(outcome(truth, read(&path)?)),
            false => silent.push(truth.case),
        }
    }
    if outcomes.is_empty() {
        return Err(format!(
            "{}: holds no CASE/explained.json of the cases in {}",
            answers.display(),
            arguments.dir.join("truth.json").display()
        ));
    }
    for outcome in &outcomes {
        println!("{}", outcome.line());
    }
    println!("\n{}", page::tables(&outcomes));
    if !silent.is_empty() {
        println!("without an answer, and not counted: {}", silent.join(", "));
    }
    Ok(())
}

fn outcome(truth: Truth, answer: Answer) -> Outcome {
    let named = |effect: Effect| Named {
        effect: effect.effect,
        joints: effect.joints,
        alike: (effect.rivals.into_iter().filter(|r| r.why_not.starts_with(AS_WELL)).map(|r| r.effect))
            .collect(),
        margin: f64::NAN,
        leftover: f64::NAN,
        own_share: None,
        probability: effect.probability,
    };
    let rms = answer.after.map(|after| after.validate.rms).unwrap_or_default();
    let over = (rms.iter().zip(&truth.clean))
        .filter_map(|(after, clean)| Some(after.as_ref()? / clean))
        .fold(f64::NAN, f64::max);
    Outcome {
        case: format!("{} {}", truth.case, truth.of),
        table: truth.table,
        truth: truth.effects,
        truth_joints: Vec::new(),
        law: truth.words,
        sizes: truth.sizes,
        named: answer.effects.into_iter().map(named).collect(),
        unattributed: answer.unattributed.is_some(),
        left_on: Vec::new(),
        fitted_time: f64::NAN,
        over_clean: over,
        contradictions: Vec::new(),
        seconds: f64::NAN,
        refined: None,
    }
}

fn read<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, String> {
    let text = fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(text: &str) -> Answer {
        serde_json::from_str(text).unwrap()
    }

    fn truth(effects: &[&str]) -> Truth {
        Truth {
            case: "case_0001".into(),
            of: "single/spring/0".into(),
            table: "single".into(),
            effects: effects.iter().map(|e| (*e).to_string()).collect(),
            words: Vec::new(),
            sizes: Vec::new(),
            clean: vec![0.5, 1.0],
        }
    }

    #[test]
    fn answers_are_right_wrong_or_of_the_class() {
        let text = r#"{"effects": [{"effect": "asymmetry", "joints": [2], "probability": 0.5, "rivals":
            [{"effect": "spring", "why_not": "fits as well within 10 %"}]}], "unattributed": null,
            "after": {"validate": {"rms": [0.6, null]}}}"#;
        let class = outcome(truth(&["spring"]), answer(text));
        assert!(class.first_right() && class.all_right() && class.false_names() == 0);
        assert!((class.over_clean - 1.2).abs() < 1e-12 && !class.unattributed);
        let wrong = outcome(truth(&["payload"]), answer(text));
        assert!(!wrong.first_right() && wrong.false_names() == 1);
        let nothing = outcome(truth(&[]), answer(r#"{"effects": []}"#));
        assert!(nothing.all_right() && nothing.false_names() == 0);
    }
}
