//! Names that are easily taken for each other, and the experiment that tells them apart.

use super::judge::{Named, Outcome, named};
use powerball::explanation::experiment::{learn, propose};
use powerball::explanation::explain::Trajectory;
use powerball::explanation::{ExplainOptions, Explained};
use powerball::identification::motion::Motion;
use powerball::logs::log::Log;
use powerball::logs::regression::RigidArm;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Pairs that are alike on most paths.
pub(super) const PAIRS: [[&str; 2]; 5] = [
    ["asymmetry", "spring"],
    ["encoder_offset", "broken_symmetry"],
    ["load_friction", "torque_constant"],
    ["hysteresis", "time_delay"],
    ["joint_elasticity", "backlash"],
];

/// What an experiment did to an answer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Settled {
    /// The names that the first explanation gave.
    pub(super) before: Vec<Named>,
    /// The names that it left open; empty where there was nothing to tell apart.
    pub(super) open: Vec<String>,
    /// The name that the experiment decided for.
    pub(super) decided: Option<String>,
    /// χ² by which the wrong name was expected to fall behind.
    pub(super) expected: f64,
    /// χ² by which it fell.
    pub(super) evidence: f64,
}

/// Where an explanation leaves names open: designs the experiment, has it recorded, and explains again.
pub(super) fn refine(
    body: &RigidArm,
    (to_fit, held_out): (&[Log], &[Log]),
    mut explained: Explained,
    record: impl FnOnce(&Motion) -> Log,
) -> Result<(Explained, Settled), String> {
    let options = ExplainOptions::default();
    let mut refined =
        Settled { before: named(&explained), open: Vec::new(), decided: None, expected: 0.0, evidence: 0.0 };
    let Some(motion) = propose(body, &mut explained, &options) else {
        return Ok((explained, refined));
    };
    if let Some(Trajectory::Designed { expected_evidence, .. }) =
        explained.next_experiment.as_ref().map(|next| &next.trajectory)
    {
        refined.expected = *expected_evidence;
    }
    refined.open = explained.open.iter().flat_map(|o| o.names()).map(ToString::to_string).collect();
    let new = record(&motion);
    let explained = learn(body, (to_fit, held_out), new, &explained, &options).map_err(|e| e.to_string())?;
    if let Some(experiment) = &explained.experiment {
        refined.evidence = experiment.evidence;
        refined.decided = experiment.decided.map(ToString::to_string);
    }
    Ok((explained, refined))
}

/// The table of what experiments did.
pub(super) fn table(outcomes: &[&Outcome]) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "| truth | easily taken for | cases | first answer: the name alone | a class with it | other | \
            experiments \
         | decided right | wrong | not | last answer: the name alone | a class with it | other |"
    );
    let _ = writeln!(out, "|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut total = [0; 10];
    for pair in PAIRS {
        for (truth, other) in [(pair[0], pair[1]), (pair[1], pair[0])] {
            let mut row = [0; 10];
            for outcome in outcomes.iter().filter(|o| o.truth.iter().any(|t| t == truth)) {
                let Some(refined) = &outcome.refined else { continue };
                row[0] += 1;
                row[1 + answer(&refined.before, truth)] += 1;
                if !refined.open.is_empty() {
                    row[4] += 1;
                    if let Some(name) = &refined.decided {
                        row[if name == truth { 5 } else { 6 }] += 1;
                    }
                }
                row[7 + answer(&outcome.named, truth)] += 1;
            }
            if row[0] > 0 {
                line(&mut out, truth, other, &row);
                total.iter_mut().zip(row).for_each(|(t, r)| *t += r);
            }
        }
    }
    line(&mut out, "all", "", &total);
    out
}

fn line(out: &mut String, truth: &str, other: &str, row: &[usize; 10]) {
    let undecided = row[4] - row[5] - row[6];
    let _ = writeln!(
        out,
        "| {truth} | {other} | {} | {} | {} | {} | {} | {} | {} | {undecided} | {} | {} | {} |",
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9]
    );
}

/// 0: the truth alone, 1: a class that holds it, 2: anything else.
fn answer(named: &[Named], truth: &str) -> usize {
    match named {
        [one] if one.effect == truth && one.alike.is_empty() => 0,
        [one] if one.effect == truth || one.alike.iter().any(|a| a == truth) => 1,
        _ => 2,
    }
}
