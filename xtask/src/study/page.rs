//! The tables of a study, in Markdown.

use super::case::Table;
use super::judge::Outcome;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const BEGIN: &str = "<!-- study: begin -->";
const END: &str = "<!-- study: end -->";

/// A held-out error of at most this many times that of the clean logs has reached it: the goal of 10 %.
const REACHED: f64 = 1.1;

/// All tables that the outcomes fill.
pub(super) fn tables(outcomes: &[Outcome]) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "| table | cases | right name first | all named | a false name | nothing named | held-out error over \
            clean, median | at most 1.1 |"
    );
    let _ = writeln!(out, "|---|---|---|---|---|---|---|---|");
    for table in Table::all() {
        let mine: Vec<&Outcome> = outcomes.iter().filter(|o| o.table == table.name()).collect();
        if !mine.is_empty() {
            let _ = writeln!(out, "| {} | {} |", table.words(), counts(&mine));
        }
    }
    let alike: Vec<&Outcome> = outcomes.iter().filter(|o| o.refined.is_some()).collect();
    if !alike.is_empty() {
        let _ = writeln!(out, "\n### {}\n\n{}", capital(Table::Alike.words()), super::alike::table(&alike));
    }
    let stated = |o: &&Outcome| o.named.iter().any(|n| n.probability.is_some());
    let stated: Vec<&Outcome> = outcomes.iter().filter(stated).collect();
    if !stated.is_empty() {
        let _ = writeln!(
            out,
            "\n### Whether names are right as often as is stated\n\n{}",
            super::reliability::table(&stated)
        );
    }
    for table in Table::all().into_iter().filter(|table| *table != Table::Alike) {
        let mut kinds: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
        for outcome in outcomes.iter().filter(|o| o.table == table.name() && o.truth.len() == 1) {
            kinds.entry(outcome.truth.join(" + ")).or_default().push(outcome);
        }
        if kinds.len() < 2 {
            continue;
        }
        let _ = writeln!(out, "\n### {}\n", capital(table.words()));
        let _ = writeln!(
            out,
            "| truth | cases | right name first | all named | a false name | nothing named | held-out error \
                over clean, median | at most 1.1 | false names |"
        );
        let _ = writeln!(out, "|---|---|---|---|---|---|---|---|---|");
        for (kind, mine) in kinds {
            let mut wrong: BTreeMap<&str, usize> = BTreeMap::new();
            for outcome in &mine {
                for named in outcome.named.iter().filter(|n| !outcome.truth.contains(&n.effect)) {
                    *wrong.entry(&named.effect).or_default() += 1;
                }
            }
            let wrong: Vec<String> = wrong.iter().map(|(name, count)| format!("{name} {count}")).collect();
            let _ = writeln!(out, "| {kind} | {} | {} |", counts(&mine), wrong.join(", "));
        }
    }
    out
}

fn counts(mine: &[&Outcome]) -> String {
    let count = |what: &dyn Fn(&Outcome) -> bool| {
        let count = mine.iter().filter(|o| what(o)).count();
        format!("{count} ({:.0} %)", 100.0 * count as f64 / mine.len() as f64)
    };
    let mut over: Vec<f64> = mine.iter().map(|o| o.over_clean).collect();
    over.sort_by(f64::total_cmp);
    let nothing = count(&|o| o.named.is_empty());
    let empty = mine.iter().all(|o| o.truth.is_empty());
    let (first, all) = if empty {
        ("".to_string(), "".to_string())
    } else {
        (count(&|o| o.first_right()), count(&|o| o.all_right()))
    };
    let wrong = count(&|o| o.false_names() > 0);
    let median = over[over.len() / 2];
    let reached = count(&|o| o.over_clean <= REACHED);
    format!("{} | {first} | {all} | {wrong} | {nothing} | {median:.2} | {reached}", mine.len())
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// Puts the tables between the page's markers.
pub(super) fn write(path: &Path, tables: &str) -> Result<(), String> {
    let named = |e: std::io::Error| format!("{}: {e}", path.display());
    let page = fs::read_to_string(path).map_err(named)?;
    let (Some(begin), Some(end)) = (page.find(BEGIN), page.find(END)) else {
        return Err(format!("{}: has no lines {BEGIN} and {END} to write between", path.display()));
    };
    let page = format!("{}\n\n{}\n{}", &page[..begin + BEGIN.len()], tables.trim_end(), &page[end..]);
    fs::write(path, page).map_err(named)
}
