//! The files of a comparison of two fits.

use crate::report::{Figure, Files, Ink, Page, Panel, Series, Table, Tone, number};
use powerball_identification::comparison::{Comparison, FrictionDifference};

/// comparison.json and report.html.
///
/// # Errors
/// A result that is not JSON.
pub fn files(compared: &Comparison) -> Result<Files, String> {
    Ok(Files::default().json("comparison.json", compared)?.with("report.html", page(compared).to_html()))
}

/// The page.
#[must_use]
pub fn page(compared: &Comparison) -> Page {
    let mut page = Page::new(format!("Two fits of {}", compared.arm));
    page.lead(&format!(
        "A: {}. B: {}. Differences are B minus A. The intervals of all {} numbers hold simultaneously; \
            equal arms are reported as different in {} % of comparisons.",
        compared.a,
        compared.b,
        compared.comparisons,
        100.0 * compared.level
    ));
    for why in &compared.unusable {
        page.note(Tone::Bad, &format!("Do not use this result: {why}."));
    }
    page.note(if compared.differ { Tone::Bad } else { Tone::Good }, &compared.sentence);
    compared.warnings.iter().for_each(|warning| {
        page.note(Tone::Plain, warning);
    });
    page.heading("Torque");
    page.paragraph(
        "How far the torques of the two models differ along the logs of A, and how much of that the errors \
            of the fits alone explain.",
    );
    let mut table =
        Table::new(["joint", "difference, rms [N·m]", "of the torque", "explained by the errors [N·m]"]);
    for t in &compared.torque_difference {
        let share = format!("{:.2} %", 100.0 * t.relative);
        table.push([t.joint.to_string(), number(t.rms), share, number(t.expected)]);
    }
    page.table(&table);
    page.heading("Friction");
    for f in &compared.friction {
        page.figure(&friction_figure(f), "");
    }
    page.heading("Inertial parameters");
    let mut table = Table::new(["parameter", "A", "B", "difference", "interval", "differs"]);
    for p in &compared.parameters {
        table.push([
            p.name.clone(),
            number(p.a),
            number(p.b),
            number(p.difference),
            format!("{} to {}", number(p.interval[0]), number(p.interval[1])),
            if p.differs { "yes".to_string() } else { String::new() },
        ]);
    }
    page.table(&table);
    page
}

fn friction_figure(f: &FrictionDifference) -> Figure {
    let title = format!("Joint {}{}", f.joint, if f.differs { ": friction differs" } else { "" });
    let at = |values: &[f64]| f.velocities.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let end = |k: usize| f.interval.iter().map(|interval| interval[k]).collect::<Vec<f64>>();
    let curves = Panel::new("friction [N·m]").line("A", Ink::Blue, at(&f.a)).line("B", Ink::Orange, at(&f.b));
    let difference = Panel::new("B − A [N·m]")
        .height(0.6)
        .line("difference", Ink::Green, at(&f.difference))
        .series(Series::dashed("its interval", Ink::Grey, at(&end(0))))
        .series(Series::dashed("", Ink::Grey, at(&end(1))));
    Figure::new(title, "velocity [rad/s]").panel(curves).panel(difference)
}
