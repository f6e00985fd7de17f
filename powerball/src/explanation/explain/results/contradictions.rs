//! Whether an explanation contradicts itself: tests ask it of measured logs, and the study of every case.

use super::explained::Explained;
use super::verdict::State;
use crate::controller::JointNumber;

/// In what an explanation contradicts itself, in words; empty where it does not.
///
/// * Probabilities lie between 0 and 1.
/// * No name is given and refused on one joint.
/// * A joint that is explained is not among those where something is left without a name; one that is named in part
///   has a name, one that is not explained has none.
/// * An experiment is of names that are open: of at most one that was given on these joints.
/// * No interval of a change lies on the wrong side of it.
#[must_use]
pub fn contradictions(explained: &Explained) -> Vec<String> {
    let mut all = Vec::new();
    for effect in &explained.effects {
        let name = &effect.effect;
        let numbers =
            [("p", effect.p_value), ("probability", effect.probability), ("own share", effect.own_share)];
        for (what, value) in numbers.into_iter().filter(|(_, value)| !(0.0..=1.0).contains(value)) {
            all.push(format!("{what} of {name} is {value}"));
        }
        let rivals = effect.rivals.iter().filter(|rival| is_named(explained, &rival.effect, &effect.joints));
        all.extend(rivals.map(|rival| format!("{} is named and a rival of {name}", rival.effect)));
    }
    let laws = explained.laws.iter().filter(|law| !(0.0..=1.0).contains(&law.probability));
    all.extend(laws.map(|law| format!("the probability of {} is {}", law.formula, law.probability)));
    let rest = explained.unattributed.as_ref();
    for verdict in &explained.verdict {
        let joint = verdict.joint;
        let left = rest.is_some_and(|rest| rest.joints.contains(&joint));
        let named = explained.effects.iter().any(|effect| effect.joints.contains(&joint));
        let wrong = match verdict.state {
            State::Explained => left,
            State::InPart => !named,
            State::Not => named && !verdict.left.is_nan(),
        };
        if wrong {
            all.push(format!(
                "joint {joint} is {}, and named: {named}, left without a name: {left}",
                verdict.state
            ));
        }
    }
    for rival in rest.iter().flat_map(|rest| &rest.considered) {
        if is_named(explained, &rival.effect, &rival.joints) {
            all.push(format!("{} is named and refused on joint {:?}", rival.effect, rival.joints));
        }
    }
    if let (Some(next), Some(open)) = (&explained.next_experiment, &explained.open) {
        let given = open.hypotheses.iter().filter(|h| is_named(explained, h.name, &h.joints)).count();
        if given > 1 {
            all.push(format!("an experiment of {:?}, which are given", next.to_tell_apart));
        }
    }
    for change in &explained.held_out_change {
        let [low, high] = change.interval;
        if !(low <= change.rms && change.rms <= high) {
            all.push(format!(
                "joint {} changes by {}, which {low} to {high} does not hold",
                change.joint, change.rms
            ));
        }
    }
    all
}

fn is_named(explained: &Explained, name: &str, joints: &[JointNumber]) -> bool {
    explained.effects.iter().any(|effect| effect.is(name, joints))
}
