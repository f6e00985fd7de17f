//! The choice of a name for a residual, and the reasons against the others.

use super::super::named::Rival;
use super::super::search::{Extent, Group, Member, Screen};
use crate::effects::{Window, mask};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::evidence::correlation;
use powerball_logs::regression::Signals;

/// How a chosen group compares with the others on its joints.
#[derive(Clone, Debug)]
pub(crate) struct Comparison {
    /// The name's score over that of the next best name.
    pub(crate) margin: f64,
    /// The next best names.
    pub(crate) rivals: Vec<Rival>,
    /// A name that fits as well.
    pub(crate) twin: Option<String>,
    /// The name's score over that of the next best one that explains another part of the same residual. A
    /// name that explains the same part is only another word for it; one that explains another part equally
    /// well is a sign that neither is true.
    pub(crate) distinct_margin: f64,
    /// The joints on which they were compared.
    pub(crate) joints: Vec<JointNumber>,
}

/// Rivals listed at most.
const LISTED: usize = 3;

/// Compares the group at `chosen` with the others, each on the chosen joints only.
#[must_use]
pub(crate) fn compare(
    screen: &Screen<'_>,
    groups: &[Group],
    chosen: usize,
    joints: &[JointNumber],
) -> Comparison {
    let rule = screen.context.rule;
    let own = groups[chosen].score_on(joints);
    let score = |f: usize| groups[f].score_on(joints) * share_at_stake(screen, [&groups[chosen], &groups[f]]);
    let mut others: Vec<(usize, f64)> = (0..groups.len())
        .filter(|f| *f != chosen)
        .map(|f| (f, score(f)))
        .filter(|(_, score)| *score > 0.0)
        .collect();
    others.sort_by(|a, b| b.1.total_cmp(&a.1));
    let next = others.first().map_or(0.0, |(_, score)| *score);
    let margin = if next > rule.least_score / 2.0 { own / next } else { relative_score(rule, own) };
    let rivals = others
        .iter()
        .take(LISTED)
        .map(|(f, score)| {
            let group = &groups[*f];
            let alike = own / score < rule.least_margin;
            let why_not = if alike {
                format!(
                    "fits as well within {:.0} %: these logs cannot distinguish the two",
                    100.0 * (rule.least_margin - 1.0)
                )
            } else {
                let share = 100.0 * score / own;
                match group.refusal_on(joints) {
                    Some(reason) => format!("explains {share:.0} % as much, and {reason}"),
                    None => format!("explains {share:.0} % as much"),
                }
            };
            Rival { effect: group.name().to_string(), joints: joints.to_vec(), alike, why_not }
        })
        .collect();
    let explained = explained(screen, &groups[chosen], joints);
    // An effect that a repeated path cannot judge fits any error there: that it fits this one is not
    // evidence.
    let close = (others.iter().take_while(|(_, score)| own / score < rule.least_margin))
        .filter(|(f, _)| groups[*f].judged_on(joints));
    let other = close
        .map(|(f, score)| (score, self::explained(screen, &groups[*f], joints)))
        .find(|(_, theirs)| correlation(screen.base.weights, &explained, theirs).powi(2) < 1.0 - rule.little);
    let distinct_margin = other.map_or(relative_score(rule, own), |(score, _)| own / score);
    let twin = others
        .first()
        .filter(|(_, score)| own / score < rule.least_margin)
        .map(|(f, _)| groups[*f].name().to_string());
    Comparison { margin, rivals, twin, distinct_margin, joints: joints.to_vec() }
}

/// The share of a rival's score that counts against a choice.
///
/// An event is compared with a lasting effect over its own time only, whichever of the two was chosen: a
/// lasting effect explains all logs, and this does not show whether an event happened in one of them.
fn share_at_stake(screen: &Screen<'_>, [own, rival]: [&Group; 2]) -> f64 {
    match [event(own), event(rival)] {
        [Some(windows), None] => share_within(screen, rival, &windows),
        [None, Some(windows)] => share_within(screen, own, &windows),
        _ => 1.0,
    }
}

/// The windows of a group of events that are short.
fn event(group: &Group) -> Option<Vec<Window>> {
    let short = |m: &&Member| matches!(Extent::of(&m.candidate), Extent::Short(_));
    let windows: Vec<Window> =
        group.members.iter().filter(short).flat_map(|m| m.candidate.windows.clone()).collect();
    (!windows.is_empty()).then_some(windows)
}

/// The share of what a group explains that it explains in some windows.
fn share_within(screen: &Screen<'_>, group: &Group, windows: &[Window]) -> f64 {
    let context = screen.context;
    let joints: Vec<JointNumber> = group.members.iter().flat_map(|m| m.candidate.joints.clone()).collect();
    let (mut inside, mut all) = (0.0, 0.0);
    for (j, explained) in explained(screen, group, &joints).iter().enumerate() {
        let weight = context.fit.weights[j];
        let within = mask(context, j, windows);
        for ((e, r), m) in explained.iter().zip(&context.residual[j]).zip(&within) {
            let less = weight * e * (2.0 * r - e);
            inside += less * m;
            all += less;
        }
    }
    if all > 0.0 { (inside / all).clamp(0.0, 1.0) } else { 0.0 }
}

/// What a group's members on the given joints add to the prediction, by joint and row, N·m.
fn explained(screen: &Screen<'_>, group: &Group, joints: &[JointNumber]) -> Signals {
    let mut sum = Signals::zeros(screen.context.data);
    group.on(joints).for_each(|member| sum.add_signal(&screen.base.added(&member.trial), 1.0));
    sum
}

/// The margin of a name without a rival: its score over the least that could have counted.
#[must_use]
pub(crate) fn relative_score(rule: &Rule, score: f64) -> f64 {
    score / (rule.least_score / 2.0)
}
