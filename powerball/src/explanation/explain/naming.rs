//! Which name a residual gets, and why the others do not.

use super::family::Family;
use super::result::Rival;
use super::rule;
use super::screen::{Screen, dot};

/// How a chosen family compares with the others on its joints.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    /// Its score over that of the next best name.
    pub(super) margin: f64,
    /// The next best names.
    pub(super) rivals: Vec<Rival>,
    /// A name that fits as well.
    pub(super) twin: Option<String>,
    /// Its score over that of the next best name that explains something else of the same residual. A name
    /// that explains the same part is another word for it; one that explains another part as well as this one
    /// is a sign that neither is true.
    pub(super) apart: f64,
    /// The joints on which they were compared.
    pub(super) joints: Vec<usize>,
}

/// Rivals listed at most.
const LISTED: usize = 3;

/// Compares the family at `chosen` with the others, each on the chosen joints only.
#[must_use]
pub(super) fn compare(
    screen: &Screen<'_>,
    families: &[Family],
    chosen: usize,
    joints: &[usize],
) -> Comparison {
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
    let explained = explained(screen, &families[chosen], joints);
    // What a repeated path cannot judge fits any misfit there: that it fits this one says nothing.
    let close = (others.iter().take_while(|(_, score)| own / score < rule::LEAST_MARGIN))
        .filter(|(f, _)| families[*f].judged_on(joints));
    let other = close
        .map(|(f, score)| (score, self::explained(screen, &families[*f], joints)))
        .find(|(_, theirs)| shared(&explained, theirs) < rule::SAME_PART);
    let apart = other.map_or(surprise(own), |(score, _)| own / score);
    let twin = others
        .first()
        .filter(|(_, score)| own / score < rule::LEAST_MARGIN)
        .map(|(f, _)| families[*f].name.to_string());
    Comparison { margin, rivals, twin, apart, joints: joints.to_vec() }
}

/// What a family's members on the given joints explain of each joint's residual, in standard deviations.
fn explained(screen: &Screen<'_>, family: &Family, joints: &[usize]) -> Vec<Vec<f64>> {
    let mut sum: Vec<Vec<f64>> = screen.context.residual.iter().map(|r| vec![0.0; r.len()]).collect();
    for member in family.members.iter().filter(|m| m.candidate.joints.iter().any(|j| joints.contains(j))) {
        for (j, columns) in screen.residualised(&member.trial).iter().enumerate() {
            let weight = screen.context.fit.weights[j].sqrt();
            for (column, theta) in columns.iter().zip(&member.trial.theta) {
                sum[j].iter_mut().zip(column).for_each(|(s, c)| *s += weight * theta * c);
            }
        }
    }
    sum
}

/// The share of one signal's power that the other has as well.
fn shared(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let sum = |x: &[Vec<f64>], y: &[Vec<f64>]| x.iter().zip(y).map(|(x, y)| dot(x, y)).sum::<f64>();
    let power = sum(a, a) * sum(b, b);
    if power > 0.0 { sum(a, b).powi(2) / power } else { 0.0 }
}

/// The margin of a name without a rival: its score over the least that could have counted.
#[must_use]
pub(super) fn surprise(score: f64) -> f64 {
    score / (rule::LEAST_SCORE / 2.0)
}
