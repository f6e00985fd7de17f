//! `powerball compare`: two fits side by side.

use super::inputs::MapArgument;
use super::{Failure, output};
use crate::comparison::{CompareError, CompareOptions, Comparison, FrictionDifference, Side, compare};
use crate::identification::{IdentifyOptions, Source, identify};
use crate::logs::Progress;
use crate::report::{Figure, Ink, Page, Panel, Series, Table, Tone, number};
use clap::Args;
use dyngen::Arm;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Compare two fits: which parameters and friction curves truly differ, what that means in torque, and why.
///
/// Writes comparison.json and report.html. Intervals hold all at once: equal arms are called different in the
/// share of comparisons that --level says. Differences are B less A.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball compare monday/ friday/ --out compared\n  powerball compare \
        unit_1.csv \
        unit_2.csv --arm arm.toml --out compared")]
pub(crate) struct Compare {
    /// The one: the folder of a result of `powerball identify` or its identified.json; or, with --arm, a log
    /// or a summary.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The other.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// The arm file (TOML), where A or B is a log or a summary.
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    #[command(flatten)]
    map: MapArgument,
    /// In which share of comparisons equal arms may be called different.
    #[arg(long, default_value_t = 0.01)]
    level: f64,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

impl From<CompareError> for Failure {
    fn from(e: CompareError) -> Self {
        match e {
            CompareError::Different(_) | CompareError::NoErrors(_) => Failure::Refused(e.to_string()),
            CompareError::Unreadable(_) | CompareError::Setting(_) => Failure::Unusable(e.to_string()),
        }
    }
}

impl Compare {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm =
            self.arm.as_deref().map(Arm::read).transpose().map_err(|e| Failure::Unusable(e.to_string()))?;
        let [a, b] = [self.side(&self.a, arm.as_ref())?, self.side(&self.b, arm.as_ref())?];
        let compared = compare(&a, &b, &CompareOptions { level: self.level })?;
        output::make_folder(&self.out)?;
        let text = output::json(&compared)?;
        output::write(&self.out, "comparison.json", text.as_bytes())?;
        output::write(&self.out, "report.html", page(&compared).to_html().as_bytes())?;
        if self.json {
            output::print(&text);
            return Ok(());
        }
        compared.warnings.iter().for_each(|warning| output::print(&format!("note: {warning}")));
        output::print(&compared.sentence);
        for t in &compared.torque_difference {
            output::print(&format!(
                "joint {}: {:.4} N·m along the logs of A, {:.1} % of the torque; the errors of both alone \
                    make {:.4} N·m",
                t.joint,
                t.rms,
                100.0 * t.relative,
                t.expected
            ));
        }
        Ok(())
    }

    /// A result as it is, or the fit of a log or a summary.
    fn side(&self, path: &Path, arm: Option<&Arm>) -> Result<Side, Failure> {
        if path.is_dir() || is_json(path) {
            return Ok(Side::read(path)?);
        }
        let shown = path.display().to_string();
        let Some(arm) = arm else {
            return Err(Failure::Unusable(format!(
                "{shown}: is no result of `powerball identify`; for a log or a summary give its arm with \
                    --arm"
            )));
        };
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let source = Source::file(path).mapped(Arc::new(self.map.read()?));
        let options = IdentifyOptions { progress: Progress::to(&say), ..IdentifyOptions::default() };
        Ok(Side::of(&shown, &identify(arm, [source], [], &options)?))
    }
}

fn is_json(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(64).read_to_end(&mut head));
    read.is_ok() && head.trim_ascii_start().starts_with(b"{")
}

fn page(compared: &Comparison) -> Page {
    let mut page = Page::new(format!("Two fits of {}", compared.arm));
    page.lead(&format!(
        "A: {}. B: {}. Differences are B less A; the intervals of all {} numbers hold at once, and equal \
            arms are called \
            different in {} % of comparisons.",
        compared.a,
        compared.b,
        compared.comparisons,
        100.0 * compared.level
    ));
    page.note(if compared.differ { Tone::Bad } else { Tone::Good }, &compared.sentence);
    compared.warnings.iter().for_each(|warning| {
        page.note(Tone::Plain, warning);
    });
    page.heading("Torque");
    page.paragraph(
        "What the difference means along the logs of A, and what the errors of both fits alone would make.",
    );
    let mut table = Table::new(["joint", "difference, rms [N·m]", "of the torque", "errors alone [N·m]"]);
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
