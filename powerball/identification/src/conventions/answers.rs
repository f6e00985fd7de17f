//! The answers in words.

use super::arm_file::{Better, Change};
use super::properties::{Common, Scale, Size, Unit};
use super::result::{Answer, GravityIs, Kind, Side};
use super::search::{Found, Step};
use powerball_controller::JointNumber;

/// `joint 2`, `joints 2 and 5`.
fn joints(list: &[usize]) -> String {
    let names: Vec<String> = list.iter().map(|j| JointNumber::from_index(*j).to_string()).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!("joint {one}"),
        [all @ .., last] => format!("joints {} and {last}", all.join(", ")),
    }
}

fn percent(shares: &[f64]) -> Vec<Option<f64>> {
    let of = |x: &f64| x.is_finite().then(|| (1000.0 * x).round() / 10.0);
    shares.iter().map(of).collect()
}

/// The joint whose error falls most: `held-out error of joint 2 falls from 57 to 1.2 % of its torque`.
fn falls(before: &[f64], after: &[f64]) -> String {
    let ratio = |j: &usize| after[*j] / before[*j];
    let moving = (0..before.len()).filter(|j| ratio(j).is_finite());
    let mut by_fall: Vec<usize> = moving.collect();
    by_fall.sort_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let one = |j: &usize| {
        format!(
            "{:.1} to {:.1} % on joint {}",
            100.0 * before[*j],
            100.0 * after[*j],
            JointNumber::from_index(*j)
        )
    };
    let text: Vec<String> = by_fall.iter().take(3).map(one).collect();
    format!("the held-out error falls from {} of the torque", text.join(", "))
}

/// The answer that a change of the reading is.
fn of_step(step: &Step, unit: &Unit) -> Answer {
    let why = falls(&step.before, &step.after);
    let (question, sentence) = in_words(&step.change, step.rival.is_some(), unit, &why);
    Answer {
        question,
        as_said: Some(false),
        as_it_is: percent(&step.before),
        as_it_would_be: percent(&step.after),
        sentence,
    }
}

/// The question that a change answers, and the answer; `rival` is whether another change fits as well.
fn in_words(change: &Change, rival: bool, unit: &Unit, why: &str) -> (&'static str, String) {
    let or =
        |what: &str| if rival { format!(", or {what}: these logs do not show which") } else { String::new() };
    let exchanged = |what: &str, [a, b]: [usize; 2]| {
        format!("{what} of {} are exchanged: the other way round {why}.", joints(&[a, b]))
    };
    match change {
        Change::TorqueReversed(list) => (
            "torque sign",
            format!(
                "The torque of {} has the wrong sign{}: friction would drive it otherwise, and {why}.",
                joints(list),
                or("the sign of its position")
            ),
        ),
        Change::PositionReversed(j) => (
            "position sign",
            format!(
                "The position of {} has the wrong sign{}: with the other one {why}.",
                joints(&[*j]),
                or("the sign of its torque")
            ),
        ),
        Change::AxisReversed(j) => (
            "position sign",
            format!(
                "Position and torque of {} count against the axis of the arm file: with the other sign of \
                 both {why}.",
                joints(&[*j])
            ),
        ),
        Change::TorquesExchanged(a, b) => ("joint order", exchanged("The torque columns", [*a, *b])),
        Change::PositionsExchanged(a, b) => ("joint order", exchanged("The position columns", [*a, *b])),
        Change::JointsExchanged(a, b) => ("joint order", exchanged("Positions and torques", [*a, *b])),
        Change::Late(by) => {
            let (by, word) = (1000.0 * by.abs(), if *by > 0.0 { "late" } else { "early" });
            let text = format!(
                "The torque columns are about {by:.0} ms {word} relative to the positions: without that \
                    {why}."
            );
            ("delay", text)
        }
        Change::GravityOut(list) => (
            "gravity",
            format!(
                "Gravity was taken out of the torques of {}: without it in the model {why}; set gravity = \
                 [0, 0, 0] in the arm file.",
                joints(list)
            ),
        ),
        Change::FromTip => (
            "joint order",
            format!("The columns count the joints from the tip, the arm file from the base: taken so {why}."),
        ),
        Change::Degrees => ("position unit", format!("Positions are in degrees: taken so {why}.")),
        Change::Factors(factors) => {
            let list: Vec<String> = factors.iter().map(|f| format!("{f:.2}")).collect();
            ("torque unit", format!("{} ({}), and {why}.", factors_in_words(unit), list.join(", ")))
        }
    }
}

/// The conclusion from factors by joint about the torque columns.
fn factors_in_words(unit: &Unit) -> &'static str {
    match unit {
        Unit::BeforeGear(_) => {
            "The torque columns are before the gear: the factors that one rigid arm needs are those of \
                rotor_ratio"
        }
        Unit::Ampere(Some(_)) => {
            "The torque columns are currents: the factors that one rigid arm needs are those of \
                torque_constant"
        }
        Unit::Ampere(None) => {
            "Each torque column has a unit of its own (currents, counts or % of rated): one rigid arm needs \
                a different factor for each joint"
        }
        _ => {
            "Some torque columns are in another unit than most: one rigid arm needs a different factor for \
            each joint"
        }
    }
}

/// The answer that the arm file is another arm's.
pub(super) fn of_arm_file(better: &Better) -> Answer {
    let Better { change, alike, before, after } = better;
    let or = match alike.as_slice() {
        [] => String::new(),
        others => {
            let lines: Vec<&str> = others.iter().take(3).map(|other| other.line.as_str()).collect();
            format!(" These logs do not distinguish it from: {}.", lines.join("; "))
        }
    };
    Answer {
        question: "arm file",
        as_said: Some(false),
        as_it_is: percent(before),
        as_it_would_be: percent(after),
        sentence: format!(
            "With {} in the arm file (now {}) {}.{or}",
            change.line,
            change.now,
            falls(before, after)
        ),
    }
}

/// The answer about the arm file if no change of it fits better.
fn arm_file(facts: &Facts<'_>) -> Answer {
    let Facts { doubts, good, .. } = *facts;
    if !doubts.is_empty() {
        return plain("arm file", Some(false), format!("In the arm file {}.", doubts.join("; ")));
    }
    if facts.coupled {
        let why = "Whether the arm file belongs to this arm is not checked if a transmission couples joints.";
        return plain("arm file", None, why.into());
    }
    if good {
        let fits = "No other convention and no other sign of an a, d or alpha fits clearly better; where a \
            joint's error is more than 25 %, no quarter turn of theta and no other direction of gravity \
            does.";
        return plain("arm file", Some(true), fits.into());
    }
    plain(
        "arm file",
        None,
        "One rigid arm of this file with textbook friction does not fit, whatever single thing is changed \
            about the columns or the file: it may be the file of another arm, or the torques hold something \
            else."
            .into(),
    )
}

pub(super) fn plain(question: &'static str, as_said: Option<bool>, sentence: String) -> Answer {
    Answer { question, as_said, as_it_is: Vec::new(), as_it_would_be: Vec::new(), sentence }
}

/// Facts that are known in addition to the steps.
pub(super) struct Facts<'a> {
    pub(super) sign: Common,
    pub(super) unit: &'a Unit,
    pub(super) size: Size,
    pub(super) scale: Scale,
    pub(super) gravity: Option<GravityIs>,
    pub(super) side: Option<Side>,
    pub(super) friction_share: Option<f64>,
    pub(super) kind: Option<Kind>,
    pub(super) delay_would_show: bool,
    /// Whether the fit is good enough to judge by.
    pub(super) good: bool,
    /// Values of the arm file that are impossible for an arm.
    pub(super) doubts: &'a [String],
    /// Whether a transmission couples joints.
    pub(super) coupled: bool,
}

/// All answers, in the order in which they are read.
pub(super) fn answers(found: &Found<'_>, facts: &Facts<'_>) -> Vec<Answer> {
    let mut all: Vec<Answer> = found.steps.iter().map(|step| of_step(step, facts.unit)).collect();
    let asked = |all: &[Answer], question: &str| all.iter().any(|a| a.question == question);
    all.insert(0, common_sign(found, facts));
    if !asked(&all, "torque unit") {
        all.push(size(facts));
    }
    if !asked(&all, "gravity") {
        all.push(gravity(facts));
    }
    for (question, good, open) in [
        (
            "joint order",
            "No exchange of columns lowers the held-out error.",
            "No exchange of columns corrects the fit, which is poor.",
        ),
        (
            "position sign",
            "No other sign of a position lowers the held-out error.",
            "No other sign of a position corrects the fit, which is poor.",
        ),
        (
            "position unit",
            "Angles in radians fit.",
            "Whether angles are in radians cannot be determined: the fit is poor.",
        ),
    ] {
        if !asked(&all, question) {
            let (said, text) = if facts.good { (Some(true), good) } else { (None, open) };
            all.push(plain(question, said, text.into()));
        }
    }
    if !asked(&all, "delay") {
        all.push(match facts.delay_would_show {
            true => plain(
                "delay",
                Some(true),
                "Torques and positions are in step: 40 ms either way fit worse.".into(),
            ),
            false => plain("delay", None, "A delay of 40 ms would not show in these logs.".into()),
        });
    }
    all.push(side(facts));
    all.push(kind(facts));
    all.push(arm_file(facts));
    all
}

fn common_sign(found: &Found<'_>, facts: &Facts<'_>) -> Answer {
    let mean = |of: &dyn Fn(usize) -> f64| 0.5 * (of(0) + of(1));
    let power = mean(&|part| found.energies[part].all_friction(&found.judged.fits[part]).value);
    let energy = mean(&|part| found.energies[part].kinetic(&found.judged.fits[part]).value);
    let figures = format!("friction takes {power:.3} W on average and the energy of motion is {energy:.3} J");
    match facts.sign {
        Common::AsSaid => plain(
            "torque sign",
            Some(true),
            format!("Torques are positive in the direction of q: {figures}."),
        ),
        Common::Reversed => plain(
            "torque sign",
            Some(false),
            format!(
                "All torques have the wrong sign (a reaction torque?): as they stand {figures}, and neither \
                    can be negative."
            ),
        ),
        Common::Unknown => plain(
            "torque sign",
            None,
            format!(
                "The common sign of the torques is not shown by these logs: {figures}, which is not sure or \
                    not of one sign."
            ),
        ),
    }
}

fn size(facts: &Facts<'_>) -> Answer {
    let limit = facts.size.of_limit.map_or(String::new(), |share| {
        format!("; they reach {:.1} % of a joint's limit at most", 100.0 * share)
    });
    let figure = match (facts.size.weight, facts.size.inertia) {
        (Some(weight), _) => format!(
            "the weight that they carry is {weight:.2e} kg for a metre of reach cubed, where arms have 0.2 \
                to 20{limit}"
        ),
        (None, Some(inertia)) => format!(
            "their inertia is {inertia:.2e} kg for a metre of reach cubed, where arms have 0.04 to 20{limit}"
        ),
        (None, None) => "these logs show neither weight nor inertia".to_string(),
    };
    match (facts.unit, facts.scale) {
        _ if !facts.doubts.is_empty() => plain(
            "torque unit",
            None,
            "Which unit the torques have cannot be seen with such an arm file.".to_string(),
        ),
        (Unit::Milli, _) => plain(
            "torque unit",
            Some(false),
            format!("Torques are too large for an arm of this size: {figure}; mN·m look like this."),
        ),
        (Unit::GearOrAmpere, _) => plain(
            "torque unit",
            Some(false),
            format!(
                "Torques are too small for an arm of this size: {figure}; torques before the gear (then each \
                    is to be multiplied by its rotor_ratio), currents (by its torque constant) or counts \
                    look like this."
            ),
        ),
        (_, Scale::Unknown) => plain(
            "torque unit",
            None,
            format!("The unit of the torques is not shown by these logs: {figure}."),
        ),
        _ => {
            plain("torque unit", Some(true), format!("Torques in N·m give an arm of usual weight: {figure}."))
        }
    }
}

fn gravity(facts: &Facts<'_>) -> Answer {
    match facts.gravity {
        Some(GravityIs::Included) => plain(
            "gravity",
            Some(true),
            "Torques contain gravity: without it the model fits clearly worse.".into(),
        ),
        Some(GravityIs::TakenOut) if facts.size.is_weightless() => plain(
            "gravity",
            None,
            "Gravity was taken out of the torques, or something balances it: they hold the inertia of an arm \
                and hardly any weight. Where it was taken out, set gravity = [0, 0, 0] in the arm file."
                .into(),
        ),
        Some(GravityIs::TakenOut) => {
            plain("gravity", Some(true), "Torques do not contain gravity, as the arm file says.".into())
        }
        None => plain("gravity", None, "Whether torques contain gravity is not shown by these logs.".into()),
    }
}

fn side(facts: &Facts<'_>) -> Answer {
    let share = facts.friction_share.map_or(String::new(), |s| {
        format!(": friction takes {:.0} % of the power of the joint that has the least of it", 100.0 * s)
    });
    match facts.side {
        Some(Side::Link) => plain(
            "side",
            Some(true),
            format!("Torques are on the link side of the gears (or there are none){share}."),
        ),
        Some(Side::Motor) => plain(
            "side",
            Some(true),
            format!("Torques are on the motor side, with the friction of motor and gear in them{share}."),
        ),
        None => plain("side", None, format!("The side of the gears is not shown by these logs{share}.")),
    }
}

fn kind(facts: &Facts<'_>) -> Answer {
    match facts.kind {
        Some(Kind::Commanded) => plain(
            "kind",
            Some(false),
            "Torques are commands, not measurements: two logs repeat them bit by bit while the positions \
                differ. What the drives delivered is not known."
                .into(),
        ),
        Some(Kind::Measured) => plain(
            "kind",
            Some(true),
            "Torques were measured: they have noise that \
            positions do not share."
                .into(),
        ),
        None => plain(
            "kind",
            None,
            "Whether torques were measured or commanded is not shown by these \
            logs."
                .into(),
        ),
    }
}
