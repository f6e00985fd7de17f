//! Which name a residual gets, and why the others do not.

use super::family::Family;
use super::result::Rival;
use super::rule;

/// How a chosen family compares with the others on its joints.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    /// Its score over that of the next best name.
    pub(super) margin: f64,
    /// The next best names.
    pub(super) rivals: Vec<Rival>,
    /// A name that fits as well.
    pub(super) twin: Option<String>,
    /// The joints on which they were compared.
    pub(super) joints: Vec<usize>,
}

/// Rivals listed at most.
const LISTED: usize = 3;

/// Compares the family at `chosen` with the others, each on the chosen joints only.
#[must_use]
pub(super) fn compare(families: &[Family], chosen: usize, joints: &[usize]) -> Comparison {
    let own = families[chosen].score_on(joints);
    let mut others: Vec<(usize, f64)> = (0..families.len())
        .filter(|f| *f != chosen)
        .map(|f| (f, families[f].score_on(joints)))
        .filter(|(_, score)| *score > 0.0)
        .collect();
    others.sort_by(|a, b| b.1.total_cmp(&a.1));
    let next = others.first().map_or(0.0, |(_, score)| *score);
    let margin = if next > rule::LEAST_SCORE / 2.0 { own / next } else { surprise(own) };
    let rivals = others
        .iter()
        .take(LISTED)
        .map(|(f, score)| {
            let family = &families[*f];
            let why_not = if own / score < rule::LEAST_MARGIN {
                format!(
                    "fits as well within {:.0} %: these logs do not tell the two apart",
                    100.0 * (rule::LEAST_MARGIN - 1.0)
                )
            } else {
                let share = 100.0 * score / own;
                match family.refusal_on(joints) {
                    Some(reason) => format!("explains {share:.0} % as much, and {reason}"),
                    None => format!("explains {share:.0} % as much"),
                }
            };
            Rival { effect: family.name.to_string(), why_not }
        })
        .collect();
    let twin = others
        .first()
        .filter(|(_, score)| own / score < rule::LEAST_MARGIN)
        .map(|(f, _)| families[*f].name.to_string());
    Comparison { margin, rivals, twin, joints: joints.to_vec() }
}

/// The margin of a name without a rival: its score over the least that could have counted.
#[must_use]
pub(super) fn surprise(score: f64) -> f64 {
    score / (rule::LEAST_SCORE / 2.0)
}
