//! report.html of an identification.

use super::identify::Identification;
use crate::explain::TorqueCurve;
use crate::report::{Figure, Ink, Page, Panel, Series, Table, Tone, number};

/// The page; `curves` are of the held-out logs where there are any, else of the fitted ones.
pub(super) fn page(result: &Identification, curves: &[TorqueCurve], held_out: bool) -> Page {
    let mut page = Page::new(format!("Torque model of {}", result.arm));
    let [low, high] = result.band;
    page.lead(&format!(
        "Minimal inertial set and friction of Eq. 16, weighted least squares, {low} to {high} Hz. Standard errors hold for residuals that depend on each other within blocks of two seconds."
    ));
    if !result.physically_consistent {
        page.note(Tone::Bad, "No real arm can have these values: see the notes below. They predict torques near these logs; do not simulate forward with them.");
    }
    page.heading("Errors");
    let mut table = Table::new(["joint", "fit [N·m]", "of the torque", "held out [N·m]", "of the torque"]);
    for j in 0..result.fit.rms.len() {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let held = result.validate.as_ref();
        table.push([
            (j + 1).to_string(),
            number(result.fit.rms[j]),
            percent(result.fit.relative[j]),
            held.map_or(String::new(), |s| number(s.rms[j])),
            held.map_or(String::new(), |s| percent(s.relative[j])),
        ]);
    }
    page.table(&table);
    page.heading(if held_out { "Torques on the held-out logs" } else { "Torques on the fitted logs" });
    for (joint, curve) in curves.iter().enumerate().filter(|(_, c)| !c.t.is_empty()) {
        page.figure(&torque_figure(joint, curve), "");
    }
    page.heading("Inertial parameters");
    let mut table = Table::new(["parameter", "value (SI units)", "standard error", "relative"]);
    for p in &result.parameters {
        table.push([
            p.name.clone(),
            number(p.value),
            p.std.map_or("not determined".into(), number),
            p.relative_std.map_or(String::new(), |r| format!("{:.1} %", 100.0 * r)),
        ]);
    }
    page.table(&table);
    page.heading("Friction: γ1 tanh(γ2 q̇) + γ3 tanh(γ4 q̇) + γ5 q̇");
    let mut table =
        Table::new(["joint", "γ1 [N·m]", "γ2 [s/rad]", "γ3 [N·m]", "γ4 [s/rad]", "γ5 [N·m·s/rad]"]);
    for f in &result.friction {
        let gamma = [f.gamma1, f.gamma2, f.gamma3, f.gamma4, f.gamma5];
        let cell = |k: usize| match f.std[k] {
            Some(std) => format!("{} ± {}", number(gamma[k]), number(std)),
            None => number(gamma[k]),
        };
        table.push([f.joint.to_string(), cell(0), cell(1), cell(2), cell(3), cell(4)]);
    }
    page.table(&table);
    if !result.warnings.is_empty() {
        page.heading("Notes");
        let mut table = Table::new(["found in the logs, the arm file and the fit"]);
        result.warnings.iter().for_each(|w| table.push([w.clone()]));
        page.table(&table);
    }
    page
}

/// Measured against predicted torque of a joint, and the error below.
pub(super) fn torque_figure(joint: usize, curve: &TorqueCurve) -> Figure {
    let torque = Panel::new("torque [N·m]")
        .line("measured", Ink::Blue, curve.points(|k| curve.measured[k]))
        .series(Series::line("predicted", Ink::Orange, curve.points(|k| curve.measured[k] - curve.after[k])));
    let error = Panel::new("error [N·m]").height(0.75).line(
        "measured − predicted",
        Ink::Grey,
        curve.points(|k| curve.after[k]),
    );
    Figure::new(format!("Joint {}", joint + 1), "time along the logs [s]").panel(torque).panel(error)
}
