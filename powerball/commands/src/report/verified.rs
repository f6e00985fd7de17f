//! The files of a verification.

use super::identified::torque_figure;
use crate::report::{Files, Page, Table, Tone, band_of, number};
use powerball_identification::Verified;

/// verified.json and report.html.
///
/// # Errors
/// A result that is not JSON.
pub fn files(verified: &Verified) -> Result<Files, String> {
    Ok(Files::default().json("verified.json", verified)?.with("report.html", page(verified).to_html()))
}

/// The page.
#[must_use]
pub fn page(verified: &Verified) -> Page {
    let mut page = Page::new(format!("Torque model of {}, verified", verified.arm));
    page.lead(
        "A model on logs that were not fitted: measured and predicted torque, 95 % intervals of the error \
            from blocks that count as independent.",
    );
    let percent = 100.0 * verified.tolerance;
    match verified.within_tolerance {
        true => {
            page.note(Tone::Good, &format!("Every joint that moves is within {percent} % of its torque."))
        }
        false => page.note(Tone::Bad, &format!("Not every joint is within {percent} % of its torque.")),
    };
    let mut table = Table::new([
        "joint",
        "error [N·m]",
        "interval [N·m]",
        "of the torque",
        "noise alone [N·m]",
        "band [Hz]",
    ]);
    for (j, band) in verified.joints.iter().zip(&verified.joint_bands) {
        table.push([
            j.joint.to_string(),
            number(j.rms),
            format!("{} to {}", number(j.interval[0]), number(j.interval[1])),
            format!("{:.1} %", 100.0 * j.relative),
            number(j.noise_floor),
            band_of(*band),
        ]);
    }
    page.table(&table);
    for (joint, curve) in verified.curves.iter().enumerate().filter(|(_, c)| !c.t.is_empty()) {
        page.figure(&torque_figure(joint, curve), "");
    }
    page
}
