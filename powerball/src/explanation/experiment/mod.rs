//! Experiments that tell names apart which logs leave open: designed, recorded, judged.
//!
//! `design` searches the path along which the open names predict torques that differ most, `decide` asks old
//! and new logs which of them is right, and [`learn`] explains everything again without what was ruled out.

mod decide;
mod design;
mod new_log;

pub use decide::{Decision, decide};
pub use design::{Design, design};
pub use new_log::{HELD_OUT, split_off};

use crate::explanation::explain::{ExplainError, Explained, Options, RuledOut, explain_with};
use crate::identification::excite;
use crate::identification::motion::Motion;
use crate::logs::log::Log;
use crate::logs::regression::{DataOptions, RigidBody};
use serde_json::{Value, json};

/// Name of the trajectory's file beside explained.json.
pub const TRAJECTORY: &str = "next_experiment.csv";

/// A difference of so many units of χ² can be seen through the noise: a likelihood ratio of 150.
const VISIBLE: f64 = 10.0;

/// Designs the experiment for what an explanation leaves open, and says so in its `next_experiment`; `None`
/// where nothing is open or the arm file has no limits to move within.
pub fn propose(
    body: &RigidBody,
    explained: &mut Explained,
    options: &DataOptions,
    progress: &dyn Fn(&str),
) -> Option<Motion> {
    let open = explained.open.clone()?;
    progress("designing the experiment that tells the open names apart");
    let names = open.names();
    match design(body, &open, options) {
        Ok(design) => {
            let advice = advice(&names, &design);
            explained.next_experiment = Some(json!({
                "to_tell_apart": names,
                "joints": open.hypotheses[0].joints.iter().map(|j| j + 1).collect::<Vec<_>>(),
                "trajectory": TRAJECTORY,
                "expected_difference": design.expected,
                "expected_evidence": design.evidence,
                "of_a_usual_path": design.usual,
                "duration": design.motion.duration(),
                "advice": advice,
            }));
            Some(design.motion)
        }
        Err(e) => {
            if let Some(Value::Object(next)) = &mut explained.next_experiment {
                next.insert("trajectory".into(), Value::Null);
                next.insert("no_trajectory".into(), json!(no_trajectory(&e)));
            }
            None
        }
    }
}

fn no_trajectory(e: &excite::Error) -> String {
    format!("no path could be searched: {e}")
}

fn advice(names: &[&str], design: &Design) -> String {
    let both = names.join(" and ");
    let how = format!(
        "follow {TRAJECTORY} (powerball record --trajectory {TRAJECTORY} --out new.csv) and explain again \
            with new.csv among the logs; \
         --experiment does both"
    );
    if design.evidence >= VISIBLE {
        format!("to tell {both} apart, {how}")
    } else {
        format!(
            "{both} predict nearly the same torques as fitted, on every path within the limits (χ² {:.1} on \
                the best one found): \
             where the new log does not speak for one of them, the one with fewer numbers is meant; {how}",
            design.evidence
        )
    }
}

/// What is learnt from the log of an experiment: which of the open names is right, and the explanation of
/// everything again.
///
/// The last part of the new log takes no part in any fit.
///
/// # Errors
/// As [`crate::explanation::explain::explain`].
pub fn learn(
    body: &RigidBody,
    (fit, held_out): (&[Log], &[Log]),
    new: Log,
    before: &Explained,
    options: &DataOptions,
    told: &Options,
    progress: &dyn Fn(&str),
) -> Result<Explained, ExplainError> {
    let file = new.file.clone();
    let others: Vec<&Log> = fit.iter().chain(held_out).collect();
    let (to_fit, to_judge) = split_off(new, &others);
    let fit: Vec<Log> = fit.iter().cloned().chain([to_fit]).collect();
    let held_out: Vec<Log> = held_out.iter().cloned().chain([to_judge]).collect();
    let Some(open) = before.open.as_ref() else {
        return explain_with(body, &fit, &held_out, options, told, progress);
    };
    progress("asking the new log which of the open names is right");
    let decision = decide(body, open, &fit, &held_out, options)?;
    let losers = (open.hypotheses.iter())
        .filter(|h| decision.winner.is_some_and(|winner| winner != h.name))
        .map(|h| RuledOut {
            effect: h.name.to_string(),
            joints: h.joints.clone(),
            in_favour_of: decision.winner.unwrap_or_default().to_string(),
            why_not: format!("ruled out by the experiment: {}", decision.why),
        });
    let told = Options { ruled_out: told.ruled_out.iter().cloned().chain(losers).collect(), ..told.clone() };
    let mut explained = explain_with(body, &fit, &held_out, options, &told, progress)?;
    explained.experiment = Some(json!({
        "to_tell_apart": open.names(),
        "log": file,
        "decided": decision.winner,
        "why": decision.why,
        "evidence": decision.evidence,
        "p_value": decision.p_value,
        "held_out_evidence": decision.held_out,
        "named_before": before.effects.iter().map(|e| e.effect.clone()).collect::<Vec<_>>(),
    }));
    Ok(explained)
}

#[cfg(test)]
mod tests;
