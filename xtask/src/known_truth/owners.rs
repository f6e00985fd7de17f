//! What the owners of logs put into them.

use super::Logs;
use crate::textbook;
use powerball::explanation::Explained;
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::Path;

/// Logs of a folder, by file names without `.csv`, and what their owners state about them.
#[derive(Deserialize)]
struct Question {
    folder: String,
    fit: String,
    validate: String,
    truth: String,
}

/// What `benches/sindy.py` asks too.
const QUESTIONS: &str = include_str!("questions.csv");

pub(super) fn write(page: &mut String, data: &Path) -> Result<(), String> {
    page.push_str(
        "## What others put in\n\n\
        | logs: fitted; for validation | truth of their owners | which logs differ, and by what | other \
        names | before → after, % | textbook, % | PySINDy, % (terms) |\n|---|---|---|---|---|---|---|\n",
    );
    let sparse = Sparse::read()?;
    for question in csv::Reader::from_reader(QUESTIONS.as_bytes()).deserialize() {
        let question: Question = question.map_err(|e| format!("questions.csv: {e}"))?;
        let Question { folder, truth, .. } = &question;
        let [fit, validate] = [&question.fit, &question.validate].map(|files| words(files));
        let logs = Logs::read(data, folder, &[&fit[..], &validate].concat())?;
        let explained = logs.explained(fit.len())?;
        let (fitted, judged) = logs.logs.split_at(fit.len());
        let textbook = textbook::held_out(&logs.body()?, fitted, judged)?;
        let [before, after] = [&explained.before, &explained.after].map(|e| percent(&e.validate.relative));
        let _ = writeln!(
            page,
            "| `{folder}`: {}; {} | {truth} | {} | {} | {before} → {after} | {} | {} |",
            fit.join(", "),
            validate.join(", "),
            differs(&explained),
            elsewhere(&explained),
            percent(&textbook),
            sparse.cell(&question)?
        );
        eprintln!("{folder} {fit:?} {validate:?}");
    }
    Ok(())
}

/// What sparse regression leaves of the same questions.
struct Sparse(Vec<SparseRow>);

/// Errors in % and terms of the sparse law by joint, as `benches/sindy.py` writes them.
#[derive(Deserialize)]
struct SparseRow {
    folder: String,
    fit: String,
    validate: String,
    #[serde(rename = "after, %")]
    after: String,
    terms: String,
}

impl Sparse {
    const PATH: &str = "docs/results/sindy.csv";

    fn read() -> Result<Sparse, String> {
        let wrong = |e: csv::Error| format!("{}: {e}; python benches/sindy.py writes it", Self::PATH);
        let rows = csv::Reader::from_path(Self::PATH).map_err(wrong)?.into_deserialize();
        rows.collect::<Result<_, _>>().map(Sparse).map_err(wrong)
    }

    fn cell(&self, asked: &Question) -> Result<String, String> {
        let same = |row: &&SparseRow| {
            [&row.folder, &row.fit, &row.validate] == [&asked.folder, &asked.fit, &asked.validate]
        };
        let row = self.0.iter().find(same).ok_or_else(|| {
            let Question { folder, fit, validate, .. } = asked;
            format!("{} has no row of {folder}: {fit}; {validate}: run python benches/sindy.py", Self::PATH)
        })?;
        Ok(format!("{} ({})", row.after, row.terms))
    }
}

fn words(files: &str) -> Vec<&str> {
    files.split_whitespace().collect()
}

fn percent(shares: &[f64]) -> String {
    let one = |s: &f64| if s.is_finite() { format!("{:.0}", 100.0 * s) } else { "–".into() };
    shares.iter().map(one).collect::<Vec<_>>().join(" ")
}

/// The table of logs in a cell.
fn differs(explained: &Explained) -> String {
    let mut cells: Vec<String> = Vec::new();
    for log in explained.logs.iter().filter(|log| !log.like_the_others) {
        let of = |d: &powerball::explanation::explain::Difference| {
            format!("{} {:.1}–{:.1} s", d.effect, d.start_time, d.end_time)
        };
        let list: Vec<String> = log.differs.iter().map(of).collect();
        let what = if list.is_empty() { "not stated".into() } else { list.join(", ") };
        cells.push(format!("{}: {what}", log.log));
    }
    for effect in explained.effects.iter().filter(|e| e.effect == "payload") {
        let figures = serde_json::to_value(&effect.figures).unwrap_or_default();
        let list = |key: &str| -> Option<Vec<f64>> {
            Some(figures[key].as_array()?.iter().filter_map(serde_json::Value::as_f64).collect())
        };
        if let Some(mass) = figures["mass"].as_f64() {
            cells.push(format!("{mass:.2} kg"));
        }
        if let (Some(moment), Some(link)) = (list("first_moment"), figures["link"].as_u64()) {
            let size = moment.iter().map(|m| m * m).sum::<f64>().sqrt();
            cells.push(format!("{size:.3} kg·m on link {link}"));
        }
    }
    if cells.is_empty() { "none".into() } else { cells.join("; ") }
}

/// What is reported about all logs.
fn elsewhere(explained: &Explained) -> String {
    let all = explained.effects.iter().filter(|e| e.logs.is_empty());
    let of = |e: &powerball::explanation::explain::NamedEffect| {
        let joints: Vec<String> = e.joints.iter().map(ToString::to_string).collect();
        format!("{} ({})", e.effect, joints.join(" "))
    };
    let list: Vec<String> = all.map(of).collect();
    if list.is_empty() { "none".into() } else { list.join(", ") }
}
