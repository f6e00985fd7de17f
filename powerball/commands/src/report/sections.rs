//! Sections that several pages have: the meaning of the columns of logs, and the transmissions between two
//! torques.

use crate::report::{Page, Table, Tone, number};
use powerball_identification::conventions::Conventions;
use powerball_identification::transmission::{JointTransmission, Transmission, TransmissionEffect};

/// Writes the errors of the columns or the arm file, or that there are none.
pub fn columns_verdict(page: &mut Page, conventions: &Conventions) {
    let tone = if conventions.differ() { Tone::Bad } else { Tone::Plain };
    page.note(tone, &conventions.verdict());
}

/// Adds the verdict, and every question.
pub fn add_conventions(page: &mut Page, conventions: &Conventions) {
    columns_verdict(page, conventions);
    let mut table =
        Table::new(["question", "as said", "held-out error now [%]", "after the change [%]", "evidence"]);
    for answer in &conventions.answers {
        let said = match answer.as_said {
            Some(true) => "yes",
            Some(false) => "no",
            None => "these logs do not show it",
        };
        table.push([
            answer.question.to_string(),
            said.to_string(),
            errors(&answer.as_it_is),
            errors(&answer.as_it_would_be),
            answer.sentence.clone(),
        ]);
    }
    page.folded("What the columns of the logs are, question by question", &table);
}

fn errors(list: &[Option<f64>]) -> String {
    let one = |x: &Option<f64>| x.map_or("–".to_string(), |x| format!("{x:.1}"));
    list.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Adds what is known of the transmissions.
pub fn add_transmissions(page: &mut Page, joints: &[JointTransmission]) {
    page.heading("Between the motors' torques and the links'");
    let mut table = Table::new([
        "joint",
        "motor per N·m at the link",
        "Coulomb [N·m]",
        "viscous [N·m·s]",
        "rotor [kg·m²]",
        "torque left",
        "with effects",
        "effects",
    ]);
    for joint in joints {
        match joint {
            JointTransmission::Known(result) => table.push(row(result)),
            JointTransmission::Unknown(unknown) => {
                let nothing = std::iter::repeat_n(String::new(), 6);
                let first = std::iter::once(unknown.joint.to_string());
                table.push(first.chain(nothing).chain([format!("not known: {}", unknown.why_not)]));
            }
        }
    }
    page.table(&table);
    page.paragraph(
        "motor = k·(torque at the link + rotor·acceleration + friction + offset), fitted without a rigid \
         model. Everything but k is at the link; where a joint is prismatic, N and m. Torque left: share of \
         the motor torque on logs that were not fitted.",
    );
}

fn row(result: &Transmission) -> [String; 8] {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let effects: Vec<String> = result.effects.iter().map(TransmissionEffect::in_words).collect();
    [
        result.joint.to_string(),
        format!("{:.4e} ± {}", result.ratio, percent(result.relative_std())),
        number(result.coulomb),
        number(result.viscous),
        number(result.rotor_inertia),
        percent(result.left),
        percent(result.left_with),
        effects.join(", "),
    ]
}
