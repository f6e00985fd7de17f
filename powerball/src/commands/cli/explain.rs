//! `powerball explain`: the residual loop, from logs to explained.json and report.html.

use super::Failure;
use super::bus::{Where, virtual_bus};
use super::inputs::{Inputs, recorded};
use super::output::{self, Accept, Progress, Verbosity};
use super::summary::{everything, summary};
use crate::bus::driver::lwa4p::LWA4P;
use crate::bus::transport::{Bus, BusUrl};
use crate::explanation::experiment::{self, TRAJECTORY};
use crate::explanation::explain::Explained;
use crate::explanation::torque_model::TorqueModel;
use crate::explanation::{ExplainError, ExplainOptions, Prepared};
use crate::identification::motion::Motion;
use crate::identification::mounting::Mounting;
use crate::logs;
use crate::logs::log::{Log, read_logs};
use crate::procedure::{Envelope, RecordError, record};
use crate::report;
use crate::virtual_arm::Undeclared;
use clap::Args;
use dyngen::Arm;
use std::path::{Path, PathBuf};

/// Said where an experiment has nothing to tell apart.
const NOTHING_OPEN: &str = "--experiment: nothing was recorded: these logs leave no names open that a path \
    within the arm file's limits could tell apart";

/// Find, name and add what the model lacks on logs; every addition is judged on another path.
///
/// Writes explained.json, report.html, and model.json: the model with what was named, for `powerball
/// generate`, `verify` and the next `identify` or `explain`. Where two names fit equally well, also
/// next_experiment.csv: the trajectory on which they differ most. With --experiment THE ARM MOVES along it.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball explain --arm arm.toml --log a.csv b.csv c.csv --validate d.csv \
        --out result\n\n\
    On the virtual arm, from logs to a decision between two names that fit alike:\n  \
    powerball demo --effect asymmetry --seed 3 --out demo\n  \
    powerball explain --arm demo/arm.toml --log demo/fit_*.csv --validate demo/held_out_*.csv --out again \
    --experiment"
)]
pub(crate) struct Explain {
    #[command(flatten)]
    inputs: Inputs,
    /// Logs of another path, on which additions must hold.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    validate: Vec<PathBuf>,
    /// What is known already: model.json of an earlier `powerball explain` for the same arm file. It is taken
    /// out of the logs as it stands; what is found comes to it.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
    /// Where two names fit equally well, record the experiment that tells them apart, and explain again with
    /// its log.
    #[arg(long)]
    experiment: bool,
    /// Print how long each phase took, on standard error.
    #[arg(long)]
    timings: bool,
    #[command(flatten)]
    verbosity: Verbosity,
    #[command(flatten)]
    accept: Accept,
    /// Where something stays without a name, fit a bounded curve of the one or two signals that it depends on
    /// most; kept where errors fall that it was not fitted to.
    #[arg(long)]
    correct_unattributed: bool,
    /// The bus that the arm of the experiment is on.
    #[arg(long, value_name = "URL", default_value = "virtual", requires = "experiment")]
    bus: BusUrl,
    /// What is undeclared in the virtual arm, where it is on --bus virtual: as `powerball demo` writes it;
    /// without, the file virtual_arm.json beside the arm file.
    #[arg(long, value_name = "FILE", requires = "experiment")]
    plant: Option<PathBuf>,
}

impl Explain {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::timed(self.timings);
        let experiment = if self.experiment { Some(self.arm()?) } else { None };
        let arm = Arm::read(&self.inputs.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let known = self.model.as_deref().map(TorqueModel::read).transpose();
        let known = known.map_err(|e| Failure::Unusable(e.to_string()))?;
        let mut recorded = recorded(&self.inputs, &self.validate, &arm, &progress)?;
        let say = |what: &str| progress.say(what);
        let options = ExplainOptions {
            known,
            correct_unattributed: self.correct_unattributed,
            progress: logs::Progress::to(&say),
            ..ExplainOptions::default()
        };
        let refused = |e| self.failure(&e);
        let prepared = Prepared::new(&arm, &recorded.fit, &recorded.validate, &options).map_err(refused)?;
        let (mut explained, motion) = prepared.explained(&options).map_err(refused)?;
        self.write_trajectory(motion.as_ref())?;
        match (experiment, motion) {
            (Some((bus, note)), Some(motion)) => {
                progress.say("recording the experiment");
                let (new, notes) = self.recorded(&motion, bus, &arm)?;
                recorded.warnings.extend(notes.into_iter().chain(note));
                let old = (prepared.logs.as_slice(), prepared.validate.as_slice());
                for new in prepared.without_known(new) {
                    explained =
                        experiment::learn(&prepared.body, old, new, &explained, &options).map_err(refused)?;
                }
                // What is still open may ask for another experiment.
                let next = experiment::propose(&prepared.body, &mut explained, &options);
                self.write_trajectory(next.as_ref())?;
            }
            (Some(_), None) => recorded.warnings.push(NOTHING_OPEN.to_string()),
            (None, _) => {}
        }
        explained.warnings.splice(0..0, recorded.warnings);
        progress.say("writing");
        self.write(&prepared.with_known(explained))
    }

    /// Writes the trajectory of the experiment that an explanation asks for.
    fn write_trajectory(&self, motion: Option<&Motion>) -> Result<(), Failure> {
        let Some(motion) = motion else { return Ok(()) };
        output::write(&self.inputs.out, TRAJECTORY, motion.to_csv().as_bytes())
    }

    /// Writes and prints the result.
    fn write(&self, explained: &Explained) -> Result<(), Failure> {
        let files = report::explained::files(explained).map_err(Failure::Refused)?;
        files.write(&self.inputs.out).map_err(Failure::Unusable)?;
        let (arm, out) = (&self.inputs.arm, &self.inputs.out);
        match (self.inputs.json, self.verbosity) {
            (true, _) => output::print(&files.first()),
            (_, Verbosity { quiet: true, .. }) => {}
            (_, Verbosity { verbose: true, .. }) => output::print(&everything(explained, arm, out)),
            _ => output::print(&summary(explained, arm, out)),
        }
        self.accept.judge(explained.conventions.as_ref(), &explained.useless_joints())
    }

    /// Why there is no explanation: a known model that cannot be used is a wrong input.
    fn failure(&self, e: &ExplainError) -> Failure {
        match (e, &self.model) {
            (ExplainError::Changes(_) | ExplainError::Known(_), Some(file)) => {
                Failure::Unusable(format!("{}: {e}", file.display()))
            }
            _ => Failure::Refused(e.to_string()),
        }
    }
}

impl Explain {
    /// The bus of the experiment, opened before any work is done, and what there is to say of it.
    fn arm(&self) -> Result<(Box<dyn Bus>, Option<String>), Failure> {
        if self.bus != BusUrl::Virtual {
            if self.plant.is_some() {
                return Err(Failure::Unusable("--plant is for --bus virtual".to_string()));
            }
            return Ok((self.place().open()?, None));
        }
        let beside = self.inputs.arm.with_file_name(Undeclared::FILE);
        let file = self.plant.clone().or_else(|| beside.is_file().then_some(beside));
        let Some(file) = file else {
            let note = "the experiment was recorded on the built-in virtual arm, which has no undeclared \
                effect: it says \
                        nothing of another arm; name that one's bus by --bus, or the virtual arm's file by \
                        --plant";
            return Ok((self.place().open()?, Some(note.to_string())));
        };
        let arm = Undeclared::read(&file).map_err(Failure::Unusable)?.arm([0.0; 6], 1, false);
        let note = format!("the experiment was recorded on the virtual arm of {}", file.display());
        Ok((virtual_bus(arm.map_err(|e| Failure::Refused(e.to_string()))?)?, Some(note)))
    }

    fn place(&self) -> Where {
        Where { bus: self.bus.clone(), json: self.inputs.json }
    }

    /// Records the experiment and reads its log, with what is to be said of that.
    fn recorded(
        &self,
        motion: &Motion,
        bus: Box<dyn Bus>,
        arm: &Arm,
    ) -> Result<(Vec<Log>, Vec<String>), Failure> {
        let file = self.inputs.out.join("experiment.csv");
        self.record(motion, bus, arm, &file)?;
        let (new, findings) = read_logs(&[&file], arm).map_err(|e| Failure::Refused(e.to_string()))?;
        Ok((new, findings.iter().map(ToString::to_string).collect()))
    }

    fn record(&self, motion: &Motion, bus: Box<dyn Bus>, arm: &Arm, file: &Path) -> Result<(), Failure> {
        if motion.dof() != LWA4P.joints.len() {
            return Err(Failure::Unusable(format!(
                "--experiment: the driver's arm has {} joints, the arm file has {}; {TRAJECTORY} is written, \
                    record it with the \
                 arm's own driver",
                LWA4P.joints.len(),
                motion.dof()
            )));
        }
        // Nothing stands around a simulated arm.
        let envelope = match self.bus {
            BusUrl::Virtual => Envelope::new(|_| None),
            _ => Envelope::of(arm, &Mounting::Filed, None, None)
                .map_err(|e| Failure::Unusable(format!("--experiment: {e}")))?,
        };
        let master = self.place().driver(bus)?;
        let mut log = std::fs::File::create(file)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", file.display())))?;
        record(master, motion, envelope, output::live(), &mut log).map(|_| ()).map_err(|e| match e {
            RecordError::Write(_) => Failure::Unusable(e.to_string()),
            other => Failure::Refused(format!("the experiment was not recorded: {other}")),
        })
    }
}
