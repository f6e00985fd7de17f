//! `powerball compare`: two fits side by side.

use super::inputs::MapArgument;
use super::{Failure, output};
use crate::report;
use clap::Args;
use dyngen::Arm;
use powerball_identification::comparison::{CompareError, CompareOptions, Side, compare};
use powerball_identification::{IdentifyOptions, Source, identify};
use powerball_logs::Progress;
use powerball_logs::log::read_log_as;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Compare two fits: which parameters and friction curves differ significantly, the difference in torque, and
/// why.
///
/// Writes comparison.json and report.html. All intervals hold at once: --level is the share of comparisons in
/// which equal arms are called different. Differences are B − A.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball compare monday/ friday/ --out compared\n  powerball compare \
        unit_1.csv \
        unit_2.csv --arm arm.toml --out compared")]
pub(crate) struct Compare {
    /// The first: the folder of a result of `powerball identify` or its identified.json; or, with --arm, a
    /// log or a summary.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The second.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// The arm file (TOML), where A or B is a log or a summary.
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    #[command(flatten)]
    map: MapArgument,
    /// Share of comparisons in which equal arms may be called different.
    #[arg(long, default_value_t = 0.01)]
    level: f64,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    accept: output::Accept,
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
        output::make_folder(&self.out)?;
        let [a, b] = [self.side(&self.a, arm.as_ref())?, self.side(&self.b, arm.as_ref())?];
        let compared = compare(&a, &b, &CompareOptions { level: self.level })?;
        let files = report::compared::files(&compared).map_err(Failure::Refused)?;
        output::write_all(&files, &self.out)?;
        if self.json {
            output::data(&files.first());
            return self.accept.judge(&compared.unusable);
        }
        output::first_lines(&compared.unusable, None, false).iter().for_each(|line| output::print(line));
        compared.warnings.iter().for_each(|warning| output::print(&format!("note: {warning}")));
        output::print(&compared.sentence);
        for t in &compared.torque_difference {
            output::print(&t.in_words());
        }
        self.accept.judge(&compared.unusable)
    }

    /// A result that is read, or the fit of a log or a summary.
    fn side(&self, path: &Path, arm: Option<&Arm>) -> Result<Side, Failure> {
        if path.is_dir() || is_json(path) {
            return Ok(Side::read(path)?);
        }
        let shown = path.display().to_string();
        let Some(arm) = arm else {
            return Err(Failure::Unusable(format!(
                "{shown}: is not a result of `powerball identify`; for a log or a summary give its arm with \
                    --arm"
            )));
        };
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let map = self.map.read()?;
        let options = || IdentifyOptions { progress: Progress::to(&say), ..IdentifyOptions::default() };
        let fit = |source: Source<'_>| identify(arm, [source], [], &options());
        let side = Side::of(&shown, &fit(Source::file(path).mapped(Arc::new(map.clone())))?);
        // A summary has no parts.
        let Ok(log) = read_log_as(path, arm, &map, &mut Vec::new()) else { return Ok(side) };
        let side = side.along(&log);
        let halves: Vec<Side> = (log.halves().into_iter())
            .filter_map(|half| Some(Side::of(&half.file.clone(), &fit(Source::from(half)).ok()?)))
            .collect();
        match halves.as_slice() {
            [first, second] => Ok(side.repeated([first, second])),
            _ => Ok(side),
        }
    }
}

fn is_json(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = dyngen::file::open(path).and_then(|file| file.take(64).read_to_end(&mut head));
    read.is_ok() && head.trim_ascii_start().starts_with(b"{")
}
