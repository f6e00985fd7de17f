//! Whether the evidence for a candidate is enough: the rule that accepts or refuses.

use super::evidence::Evidence;
use crate::explanation::rule::Rule;

/// Why a candidate is refused, `None` where it passes. `tests` counts what was tried over joints and
/// candidates.
pub(crate) fn refusal(rule: &Rule, evidence: &Evidence, tests: f64, local: bool) -> Option<String> {
    if evidence.score < rule.least_score {
        return Some(format!("explains too little (score {:.1} of {})", evidence.score, rule.least_score));
    }
    let p = (evidence.p_value * tests).min(1.0);
    if p > rule.family_wise {
        return Some(format!(
            "not significant between independent blocks (p = {p:.2} over all that was tried)"
        ));
    }
    let folds = &evidence.fold_gains;
    let good = folds.iter().filter(|g| **g > 0.0).count();
    let mean = folds.iter().sum::<f64>() / folds.len().max(1) as f64;
    if (good as f64) < rule.folds_that_must_gain * folds.len() as f64 {
        return Some(format!("the held-out error falls in {good} of {} folds only", folds.len()));
    }
    if mean < rule.least_gain {
        return Some(format!("the held-out squared error falls by {:.1} % only", 100.0 * mean));
    }
    if let Some(worst) = folds.iter().copied().reduce(f64::min).filter(|w| *w < rule.worst_fold) {
        return Some(format!("one held-out fold is {:.0} % worse", -100.0 * worst));
    }
    // A push is where errors are larger than elsewhere, and explains that.
    if let Some(left) = evidence.event_left.filter(|left| *left > rule.event_left) {
        return Some(match left.is_finite() {
            true => {
                format!("leaves {:.0} % of what its time has more than others of squared error", 100.0 * left)
            }
            false => "its time has no larger error than others".to_string(),
        });
    }
    // What happens in some logs only need not happen in the validation set.
    if evidence.validation_gain <= 0.0 && !local {
        return Some(format!(
            "does not lower the error on the other path ({:+.1} %)",
            -100.0 * evidence.validation_gain
        ));
    }
    None
}
