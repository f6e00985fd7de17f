//! Experiments that distinguish the names that logs leave open: designed, recorded, judged.
//!
//! `design` searches the path along which the open names predict torques that differ most, `decide` tests on
//! old and new logs which of them is right, and [`learn`] explains everything again without what was ruled
//! out.

mod decide;
mod design;

use super::explain::{Experiment, Explained, Hypothesis, Open, Trajectory, explain_body};
use super::options::{ExplainError, ExplainOptions, RuledOut};
pub use decide::{Decision, HELD_OUT, decide, split_off};
pub use design::{DesignedExperiment, design};
use powerball_logs::log::Log;
use powerball_logs::motion::Motion;
use powerball_logs::regression::RigidArm;

/// Name of the trajectory's file next to explained.json.
pub const TRAJECTORY: &str = "next_experiment.csv";

/// Designs the experiment for the open names of an explanation, and writes it to its `next_experiment`;
/// `None` if nothing is open or the arm file has no limits to move within.
pub fn propose(body: &RigidArm, explained: &mut Explained, options: &ExplainOptions<'_>) -> Option<Motion> {
    let open = explained.open.clone()?;
    options.progress.say("designing the experiment that distinguishes the open names");
    let designed = design(body, &open, &options.data);
    let next = explained.next_experiment.as_mut()?;
    match designed {
        Ok(design) => {
            next.advice = advice(&open, &design, options.rule.least_score);
            next.trajectory = Trajectory::Designed {
                joints: open.hypotheses[0].joints.clone(),
                trajectory: TRAJECTORY,
                expected_difference: design.expected,
                expected_evidence: design.evidence,
                of_a_usual_path: design.usual,
                duration: design.motion.duration(),
            };
            Some(design.motion)
        }
        Err(e) => {
            let no_trajectory = format!("no path could be searched: {e}");
            next.trajectory = Trajectory::None { trajectory: None, no_trajectory };
            None
        }
    }
}

fn advice(open: &Open, design: &DesignedExperiment, visible: f64) -> String {
    let both = open.names().join(" and ");
    let how = format!(
        "follow {TRAJECTORY} (powerball record --trajectory {TRAJECTORY} --out new.csv) and explain again \
         with new.csv among the logs; --experiment does both"
    );
    if design.evidence >= visible {
        format!("to distinguish {both}, {how}")
    } else {
        format!(
            "{both} predict nearly the same torques on every path within the limits (on the best path found \
             the wrong one is expected to fit worse by χ² = {:.1}, and {visible:.0} would be clear): if the \
             new log does not decide, the one with fewer numbers is taken; {how}",
            design.evidence
        )
    }
}

/// Uses the log of an experiment: decides which of the open names is right, and explains all logs again.
///
/// The last part of the new log takes no part in any fit.
///
/// # Errors
/// The errors of [`explain_body`].
pub fn learn(
    body: &RigidArm,
    (fit, held_out): (&[Log], &[Log]),
    new: Log,
    before: &Explained,
    options: &ExplainOptions<'_>,
) -> Result<Explained, ExplainError> {
    let file = new.file.clone();
    let others: Vec<&Log> = fit.iter().chain(held_out).collect();
    let (to_fit, to_judge) = split_off(new, &others);
    let fit: Vec<Log> = fit.iter().cloned().chain([to_fit]).collect();
    let held_out: Vec<Log> = held_out.iter().cloned().chain([to_judge]).collect();
    let Some(open) = before.open.as_ref() else {
        return explain_body(body, &fit, &held_out, options);
    };
    options.progress.say("testing on the new log which of the open names is right");
    let decision = decide(body, open, &fit, &held_out, options)?;
    let mut result = options.clone();
    result.ruled_out.extend(ruled_out(open, &decision));
    let mut explained = explain_body(body, &fit, &held_out, &result)?;
    explained.experiment = Some(Experiment {
        to_tell_apart: open.names(),
        log: file,
        decided: decision.winner,
        why: decision.why,
        evidence: decision.evidence,
        p_value: decision.p_value,
        held_out_evidence: decision.held_out,
        named_before: before.effects.iter().map(|e| e.effect.clone()).collect(),
    });
    Ok(explained)
}

/// The open names that lost.
fn ruled_out<'o>(open: &'o Open, decision: &'o Decision) -> impl Iterator<Item = RuledOut> + 'o {
    let loser = |h: &Hypothesis, winner: &str| RuledOut {
        effect: h.name.to_string(),
        joints: h.joints.clone(),
        in_favour_of: winner.to_string(),
        why_not: format!("ruled out by the experiment: {}", decision.why),
    };
    let losers = move |winner: &'static str| open.hypotheses.iter().filter(move |h| h.name != winner);
    let of = move |winner| losers(winner).map(move |h| loser(h, winner));
    decision.winner.into_iter().flat_map(of)
}

#[cfg(test)]
mod tests;
