//! The files of an identification and of an explanation of position servos.

use crate::report::{Figure, Files, Ink, Page, Panel, Table, Tone, number};
use powerball_controller::JointNumber;
use powerball_explanation::servo::{ExplainedServos, ServoEffect};
use powerball_identification::servo::constants::Found;
use powerball_identification::servo::{Along, IdentifiedServos};

/// identified.json and report.html.
///
/// # Errors
/// A result that is no JSON.
pub fn files(found: &IdentifiedServos) -> Result<Files, String> {
    Ok(Files::default().json("identified.json", found)?.with("report.html", page(found).to_html()))
}

/// A number where there is one.
fn cell(of: Option<f64>) -> String {
    of.map_or("–".to_string(), number)
}

/// A constant with its standard error and unit.
#[must_use]
pub fn in_words(found: &Found) -> String {
    let unit = if found.unit == "1" { String::new() } else { format!(" {}", found.unit) };
    match found.std {
        Some(std) => format!("{} {} ± {}{unit}", found.name, number(found.value), number(std)),
        None => format!("{} {}{unit}", found.name, number(found.value)),
    }
}

/// The page.
#[must_use]
pub fn page(found: &IdentifiedServos) -> Page {
    let mut page = Page::new(format!("Position servos of {}", found.arm));
    page.lead(
        "Each joint's closed loop, simulated from its set-points alone: gain, delay, limits, motor and \
         friction for which the simulated positions lie nearest to the measured ones. Standard errors hold \
         for errors that depend on each other within a second.",
    );
    for reason in &found.unusable {
        page.note(Tone::Bad, &format!("Do not use this result: {reason}."));
    }
    page.heading("Position errors");
    let mut table = Table::new(["joint", "fit [rad]", "held out [rad]", "goal with a delay, held out [rad]"]);
    for (j, servo) in found.servo.iter().enumerate() {
        let held_out = found.validate.as_ref();
        table.push([
            servo.joint.to_string(),
            number(found.fit.position_error[j]),
            cell(held_out.map(|v| v.position_error[j])),
            cell(held_out.and_then(|v| v.goal_error[j])),
        ]);
    }
    page.table(&table);
    page.heading("Servos");
    let mut table = Table::new(["joint", "constant", "value", "standard error", "unit"]);
    let rows =
        found.servo.iter().flat_map(|servo| servo.parameters.iter().map(|p| (servo.joint.to_string(), p)));
    for (joint, p) in rows.chain(found.parameters.iter().map(|p| (String::new(), p))) {
        let std = match (p.known, p.std) {
            (true, _) => "as the arm file has it".to_string(),
            (false, Some(std)) => number(std),
            (false, None) => "not shown by these logs alone".to_string(),
        };
        table.push([joint, p.name.clone(), number(p.value), std, p.unit.clone()]);
    }
    page.table(&table);
    for (j, along) in found.along.iter().enumerate().filter(|(_, along)| !along.t.is_empty()) {
        page.figure(&figure(j, along), "");
    }
    if !found.warnings.is_empty() {
        page.heading("Notes");
        found.warnings.iter().for_each(|warning| page.paragraph(warning));
    }
    page
}

fn figure(joint: usize, along: &Along) -> Figure {
    let line = |x: &[f64]| along.t.iter().copied().zip(x.iter().copied()).collect::<Vec<_>>();
    let left: Vec<f64> = along.measured.iter().zip(&along.simulated).map(|(q, s)| q - s).collect();
    let positions = Panel::new("position [rad]")
        .line("goal", Ink::Grey, line(&along.goal))
        .line("measured", Ink::Blue, line(&along.measured))
        .line("simulated", Ink::Orange, line(&along.simulated));
    let error = Panel::new("error [rad]").height(0.75).line("measured − simulated", Ink::Grey, line(&left));
    Figure::new(format!("Joint {}", JointNumber::from_index(joint)), "time along the logs [s]")
        .panel(positions)
        .panel(error)
}

/// explained.json and report.html.
///
/// # Errors
/// A result that is no JSON.
pub fn explained(found: &ExplainedServos) -> Result<Files, String> {
    Ok(Files::default().json("explained.json", found)?.with("report.html", explained_page(found).to_html()))
}

/// An effect with its size and where it is, in one line.
#[must_use]
pub fn effect_in_words(effect: &ServoEffect) -> String {
    let joints: Vec<String> = effect.joints.iter().map(ToString::to_string).collect();
    let of = |key: &str| effect.parameters.get(key).and_then(serde_json::Value::as_f64);
    let with_error = |key: &str, unit: &str| {
        let (value, std) = (of(key)?, of(&format!("{key}_std"))?);
        Some(format!("{} ± {}{unit}", number(value), number(std)))
    };
    let mass =
        with_error("mass", " kg").or_else(|| with_error("mass_for_torque", " kg for each N·m at full duty"));
    let gain = with_error("gain", " times the arm file's").map(|gain| match of("kp") {
        Some(kp) => format!("the gain of the position loop is {gain} (kp {})", number(kp)),
        None => gain,
    });
    let size = mass.or(gain).unwrap_or_else(|| {
        let each =
            effect.parameters.iter().filter_map(|(key, v)| Some(format!("{key} {}", number(v.as_f64()?))));
        each.collect::<Vec<_>>().join(", ")
    });
    let logs = match effect.logs.as_slice() {
        [] => String::new(),
        some => format!("; in {}", some.join(", ")),
    };
    format!(
        "{} on joint {}: {size}; position error {} rad, {} without it{logs}",
        effect.effect,
        joints.join(", "),
        number(effect.rms_after[0]),
        number(effect.rms_before[0])
    )
}

/// The page of an explanation.
#[must_use]
pub fn explained_page(found: &ExplainedServos) -> Page {
    let mut page = Page::new(format!("What the servos of {} lack", found.arm));
    page.lead(
        "Candidates are judged by the position error of the simulated closed loop on the validation logs.",
    );
    for reason in &found.unusable {
        page.note(Tone::Bad, &format!("Do not use this result: {reason}."));
    }
    for effect in &found.effects {
        page.paragraph(&format!("{}.", effect_in_words(effect)));
        effect
            .rivals
            .iter()
            .for_each(|rival| page.paragraph(&format!("Not {}: {}.", rival.effect, rival.why_not)));
    }
    let mut table =
        Table::new(["joint", "held out before [rad]", "after [rad]", "goal with a delay [rad]", "verdict"]);
    for (j, verdict) in found.verdict.iter().enumerate() {
        table.push([
            verdict.joint.to_string(),
            number(found.before.validate.position_error[j]),
            number(found.after.validate.position_error[j]),
            cell(found.goal_error[j]),
            verdict.state.to_string(),
        ]);
    }
    page.table(&table);
    let mut table = Table::new(["log", "like the others", "what it has alone"]);
    for log in &found.logs {
        let differs: Vec<&str> = log.differs.iter().map(|differs| differs.effect).collect();
        let like = if log.like_the_others { "yes" } else { "no" };
        table.push([log.log.clone(), like.to_string(), differs.join(", ")]);
    }
    page.table(&table);
    if !found.warnings.is_empty() {
        page.heading("Notes");
        found.warnings.iter().for_each(|warning| page.paragraph(warning));
    }
    page
}
