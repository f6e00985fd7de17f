//! What these logs cannot show, and what to record instead.

use super::super::findings::Findings;
use crate::identification::estimate::Solver;

/// Said where each joint was fitted by itself.
const PER_JOINT: &str = "the logs repeat one path, and joints by themselves predict the held-out logs \
    better than a rigid body that all joints share: each joint was given inertial parameters of its own, \
    an offset and a slope with its position, all errors here are of that model, and effects of the body \
    (payload, base tilt, broken symmetries) were not considered; model.json holds one body for all, whose \
    errors are larger";
/// Said where the logs to judge on are repeats.
const ONE_PATH: &str = "the logs of --validate run the same path as those of --log: what depends on \
    positions (springs, zeros, gravity, broken symmetries, slow ripple) was not considered; record another \
    path";
/// Accepted surrogates that may be chance, whatever their share.
const FEW: usize = 2;

/// Everything that a reader should know before believing the result.
pub(crate) fn warnings(findings: &Findings<'_>) -> Vec<String> {
    let (study, fit, rule) = (&findings.study, &findings.model.fit, findings.study.rule());
    let mut warnings: Vec<String> = Vec::new();
    for note in study.data.notes.iter().chain(&study.validation.notes) {
        if !warnings.contains(note) {
            warnings.push(note.clone());
        }
    }
    // What is known beforehand of an arm is no measurement.
    let (gram, _, _) = fit.gram.sum(&fit.weights, |_| true);
    let measured = Solver::new(&gram, |c| fit.free[c]);
    let is_seen =
        |c: usize| measured.kept().iter().any(|k| *k < fit.design.inertial && k % fit.design.set == c);
    let names = study.data.body.names().iter().enumerate();
    let unseen: Vec<&str> = names.filter(|(c, _)| !is_seen(*c)).map(|(_, name)| name.as_str()).collect();
    if !unseen.is_empty() {
        warnings.push(format!(
            "these logs do not determine {}: an effect that resembles them cannot be told from them; \
             record a motion that excites them (powerball excite)",
            unseen.join("; ")
        ));
    }
    let seconds = study.fitted_time();
    if seconds < rule.least_time {
        warnings.push(format!(
            "the logs to fit hold {seconds:.0} s: too little to tell small effects from chance; record \
             several paths of 20 s or more"
        ));
    }
    if study.data.per_joint {
        warnings.push(PER_JOINT.to_string());
    }
    if study.one_path {
        warnings.push(ONE_PATH.to_string());
    }
    warnings.extend(findings.initial_fit.clock.note().map(str::to_string));
    let chance = &findings.false_positives;
    if chance.accepted as f64 > rule.many_accepted * chance.surrogates as f64 && chance.accepted > FEW {
        warnings.push(format!(
            "{} of {} effects that cannot be there were accepted: what the model leaves on these logs is \
             large and smooth, and names given here may be wrong; see what is unattributed, and whether \
             the logs and the arm file belong together",
            chance.accepted, chance.surrogates
        ));
    }
    warnings
}
