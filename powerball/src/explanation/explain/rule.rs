//! Every threshold of the rule, with its reason.

use super::evidence::Evidence;

/// Least penalised gain, in units of χ² of independent samples: e^(−10/2) is a likelihood ratio of 150 after
/// the penalties for coefficients and for having searched.
pub(super) const LEAST_SCORE: f64 = 10.0;
/// Penalty for each coefficient: what one coefficient gains by chance, twice over (Akaike).
pub(super) const PER_COEFFICIENT: f64 = 2.0;
/// Probability of accepting anything at all where nothing is missing, over all joints and candidates.
pub(super) const FAMILY_WISE: f64 = 0.01;
/// The held-out squared error must fall by this share on average over folds: 1 % of the rms, below which no
/// user would notice.
pub(super) const LEAST_GAIN: f64 = 0.02;
/// … and it must fall at all in this share of the folds: four of five.
pub(super) const FOLDS_THAT_MUST_GAIN: f64 = 0.8;
/// No fold may lose more than this share of its squared error.
pub(super) const WORST_FOLD: f64 = -0.05;
/// Share of the placebos whose score a candidate must exceed.
pub(super) const PLACEBO_LEVEL: f64 = 0.99;
/// A term of the class of an accepted one, on the same joint, that gains less than this share of it mends
/// that one's law and is no effect of its own.
pub(super) const MENDS_ONLY: f64 = 0.15;
/// The same for a term of another class: laws are wrong by a few percent, and that shows in any guise.
pub(super) const MENDS_ANY: f64 = 0.05;
/// A family with fewer columns is preferred where the better one's score is larger by less than this share or
/// [`AS_GOOD_SCORE`]: these data do not tell the two apart.
pub(super) const AS_GOOD: f64 = 0.02;
/// See [`AS_GOOD`]: a likelihood ratio of 4.
pub(super) const AS_GOOD_SCORE: f64 = 3.0;
/// Two names whose gains differ by less than this factor cannot be told apart by these data.
pub(super) const LEAST_MARGIN: f64 = 1.1;
/// Two names of which one explains this share of what the other does are words for the same part of a
/// residual. Names for the same thing share 98 % and more of it, names for different things less than 70 %
/// (noise-free trials on other data).
pub(super) const SAME_PART: f64 = 0.9;
/// A name that is not told apart ([`LEAST_MARGIN`]) from the next best one for another part ([`SAME_PART`])
/// is not given where it leaves more than this share of the excess over the noise floor: then something else
/// is there, and what fits best only resembles it. The share is that of an earlier trial on other data.
pub(super) const MUCH_LEFT: f64 = 0.35;
/// An effect of which this share is missing in some octave, and by more than [`MISSING_ERRORS`], is not the
/// effect that it is called: most of it is not there.
pub(super) const LEAST_MISSING: f64 = 0.5;
/// See [`LEAST_MISSING`]: standard errors that chance exceeds once in 800, [`FAMILY_WISE`] over eight
/// octaves.
pub(super) const MISSING_ERRORS: f64 = 3.2;
/// On repeats of one path whatever errs alike in all of them is fitted by whoever has more parameters; joints
/// are taken apart only where that lowers the held-out squared error by more than this share, 5 % of the rms.
pub(super) const CLEARLY_BETTER: f64 = 0.1;
/// Effects added at most.
pub(super) const MOST_STEPS: usize = 12;

/// Why a candidate is refused, `None` where it passes. `tests` counts what was tried over joints and
/// candidates.
pub(super) fn refusal(evidence: &Evidence, tests: f64, local: bool) -> Option<String> {
    if evidence.score < LEAST_SCORE {
        return Some(format!("explains too little (score {:.1} of {LEAST_SCORE})", evidence.score));
    }
    let p = evidence.p_value * tests;
    if p > FAMILY_WISE {
        return Some(format!(
            "not significant between independent blocks (p = {p:.2} over all that was tried)"
        ));
    }
    let folds = &evidence.fold_gains;
    let good = folds.iter().filter(|g| **g > 0.0).count();
    let mean = folds.iter().sum::<f64>() / folds.len().max(1) as f64;
    if (good as f64) < FOLDS_THAT_MUST_GAIN * folds.len() as f64 {
        return Some(format!("the held-out error falls in {good} of {} folds only", folds.len()));
    }
    if mean < LEAST_GAIN {
        return Some(format!("the held-out squared error falls by {:.1} % only", 100.0 * mean));
    }
    if let Some(worst) = folds.iter().copied().reduce(f64::min).filter(|w| *w < WORST_FOLD) {
        return Some(format!("one held-out fold is {:.0} % worse", -100.0 * worst));
    }
    // What happens in some logs only need not happen in the logs of the other path.
    if evidence.path_gain <= 0.0 && !local {
        return Some(format!(
            "does not lower the error on the other path ({:+.1} %)",
            -100.0 * evidence.path_gain
        ));
    }
    None
}
