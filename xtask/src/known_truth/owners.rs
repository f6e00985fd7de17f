//! What the owners of logs put into them.

use super::Logs;
use crate::textbook;
use powerball::explanation::Explained;
use std::fmt::Write as _;
use std::path::Path;

struct Question {
    folder: &'static str,
    fit: &'static [&'static str],
    validate: &'static [&'static str],
    truth: &'static str,
}

const QUESTIONS: [Question; 9] = [
    Question {
        folder: "ur5_pushes",
        fit: &["no7", "no8", "no9_pushed"],
        validate: &["no9"],
        truth: "a hand pushes no9_pushed at 4.4–5.3, 5.9–6.8, 10.4–11.2, 12.0–13.1 and 13.8–14.6 s",
    },
    Question {
        folder: "ur5_pushes",
        fit: &["no6", "no7", "no8"],
        validate: &["no9_pushed"],
        truth: "the same, in the validation log only",
    },
    Question { folder: "ur5_pushes", fit: &["no6", "no8", "no9"], validate: &["no7"], truth: "nothing" },
    Question {
        folder: "psm_masses",
        fit: &["clean", "ins105"],
        validate: &["other"],
        truth: "105 g on link 2 in ins105, first moment 0.056 kg·m",
    },
    Question {
        folder: "psm_masses",
        fit: &["clean"],
        validate: &["ins105"],
        truth: "the same, in the validation log only",
    },
    Question { folder: "psm_masses", fit: &["clean"], validate: &["other"], truth: "nothing" },
    Question {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_12b", "fourier_14_load"],
        validate: &["fourier_14"],
        truth: "about 2.8 kg on the flange in fourier_14_load",
    },
    Question {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_7", "fourier_8"],
        validate: &["fourier_14_load", "fourier_5"],
        truth: "the same, in a validation log only",
    },
    Question {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_7"],
        validate: &["fourier_5"],
        truth: "nothing",
    },
];

pub(super) fn write(page: &mut String, data: &Path) -> Result<(), String> {
    page.push_str(
        "## What others put in\n\n| logs: fitted; for validation | truth of their owners | which logs differ, and by what | other names | before → after, % | textbook, % | PySINDy, % (terms) |\n|---|---|---|---|---|---|---|\n",
    );
    let sparse = Sparse::read()?;
    for Question { folder, fit, validate, truth } in QUESTIONS {
        let logs = Logs::read(data, folder, &[fit, validate].concat())?;
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
            sparse.cell(&[folder, &fit.join(" "), &validate.join(" ")])
        );
        eprintln!("{folder} {fit:?} {validate:?}");
    }
    Ok(())
}

/// What sparse regression leaves of the same questions, as `benches/sindy.py` wrote it.
struct Sparse(String);

impl Sparse {
    fn read() -> Result<Sparse, String> {
        let path = "docs/results/sindy.csv";
        std::fs::read_to_string(path).map(Sparse).map_err(|e| format!("{path}: {e}"))
    }

    /// Errors with the sparse law, and how many terms it has, by joint.
    fn cell(&self, question: &[&str; 3]) -> String {
        let rows = self.0.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let mut asked = rows.filter(|row| row.len() == 7 && row[..3] == question[..]);
        asked.next().map_or_else(|| "–".into(), |row| format!("{} ({})", row[4], row[5]))
    }
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
        let what = if list.is_empty() { "not said".into() } else { list.join(", ") };
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

/// What is said of all logs.
fn elsewhere(explained: &Explained) -> String {
    let all = explained.effects.iter().filter(|e| e.logs.is_empty());
    let of = |e: &powerball::explanation::explain::NamedEffect| {
        let joints: Vec<String> = e.joints.iter().map(ToString::to_string).collect();
        format!("{} ({})", e.effect, joints.join(" "))
    };
    let list: Vec<String> = all.map(of).collect();
    if list.is_empty() { "none".into() } else { list.join(", ") }
}
