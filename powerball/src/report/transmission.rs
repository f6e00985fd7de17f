//! The transmissions between two torques, as a table of a page.

use crate::identification::transmission::{JointTransmission, Transmission, TransmissionEffect};
use crate::report::{Page, Table, number};

/// Adds what is told of the transmissions.
pub fn add_to_page(page: &mut Page, joints: &[JointTransmission]) {
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
                table.push(first.chain(nothing).chain([format!("not told: {}", unknown.why_not)]));
            }
        }
    }
    page.table(&table);
    page.paragraph(
        "motor = k·(torque at the link + rotor·acceleration + friction + offset), fitted without a rigid \
         model. Everything but k is at the link; where a joint is prismatic, N and m. Torque left: share of the \
         motor torque on logs that were not fitted.",
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
