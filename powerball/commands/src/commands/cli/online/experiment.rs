//! The experiment of `powerball explain --experiment`: recorded on a bus, read as a log.

use super::Failure;
use super::bus::{Consent, Where, virtual_bus};
use super::inputs::Inputs;
use super::motion::live;
use super::output::Progress;
use super::replace;
use crate::procedure::{Envelope, RecordError, record};
use clap::Args;
use dyngen::Arm;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{Bus, BusUrl};
use powerball_explanation::experiment::TRAJECTORY;
use powerball_identification::mounting::Mounting;
use powerball_logs::log::{Log, read_logs};
use powerball_logs::motion::Motion;
use powerball_virtual_arm::Undeclared;
use std::path::{Path, PathBuf};

/// The file of the experiment's log, in the folder of the results.
const LOG: &str = "experiment.csv";

/// Said where an experiment has nothing to tell apart.
const NOTHING_OPEN: &str = "--experiment: nothing was recorded: these logs leave no names open that a path \
    within the arm file's limits could tell apart";

/// Whether an experiment is recorded, and on which arm.
#[derive(Args, Debug)]
pub(in super::super) struct Experiment {
    /// Where two names fit equally well, record the experiment that tells them apart, and explain again with
    /// its log.
    #[arg(long)]
    experiment: bool,
    /// The bus that the arm of the experiment is on.
    #[arg(long, value_name = "URL", default_value = "virtual", requires = "experiment")]
    bus: BusUrl,
    /// What is undeclared in the virtual arm, where it is on --bus virtual: as `powerball demo` writes it;
    /// without, the file virtual_arm.json next to the arm file.
    #[arg(long, value_name = "FILE", requires = "experiment")]
    plant: Option<PathBuf>,
    #[command(flatten)]
    consent: Consent,
}

/// The bus of an experiment, open.
pub(in super::super) struct Opened {
    bus: Box<dyn Bus>,
    place: Where,
    consent: Consent,
    /// What there is to report about the bus.
    note: Option<String>,
}

impl Experiment {
    /// Whether an experiment is requested.
    pub(in super::super) fn is_requested(&self) -> bool {
        self.experiment
    }

    /// The bus, opened before any work is done, where an experiment is asked for.
    pub(in super::super) fn opened(&self, inputs: &Inputs) -> Result<Option<Opened>, Failure> {
        if !self.experiment {
            return Ok(None);
        }
        let read: Vec<&Path> = inputs.log.iter().map(PathBuf::as_path).collect();
        replace::check_inputs(&inputs.out.join(LOG), &read)?;
        replace::own_folder::check(&inputs.out, &[LOG])?;
        let place = Where { bus: self.bus.clone(), json: inputs.json };
        let (bus, note) = self.arm(&inputs.arm, &place)?;
        Ok(Some(Opened { bus, place, consent: self.consent, note }))
    }

    fn arm(&self, arm: &Path, place: &Where) -> Result<(Box<dyn Bus>, Option<String>), Failure> {
        if self.bus != BusUrl::Virtual {
            if self.plant.is_some() {
                return Err(Failure::Unusable("--plant is for --bus virtual".to_string()));
            }
            return Ok((place.open()?, None));
        }
        let Some(file) = self.plant.clone().or_else(|| Undeclared::next_to(arm)) else {
            let note = "the experiment was recorded on the built-in virtual arm, which has no undeclared \
                effect: it says \
                        nothing of another arm; name that one's bus by --bus, or the virtual arm's file by \
                        --plant";
            return Ok((place.open()?, Some(note.to_string())));
        };
        let arm = Undeclared::read(&file).map_err(Failure::Unusable)?.arm([0.0; 6], 1, false);
        let note = format!("the experiment was recorded on the virtual arm of {}", file.display());
        Ok((virtual_bus(arm.map_err(|e| Failure::Refused(e.to_string()))?)?, Some(note)))
    }
}

impl Opened {
    /// Records the experiment into the folder of the results and reads its log, with what is to be reported
    /// about that; no log where there is no path that could tell names apart.
    pub(in super::super) fn recorded(
        self,
        motion: Option<&Motion>,
        arm: &Arm,
        out: &Path,
        progress: &Progress,
    ) -> Result<(Vec<Log>, Vec<String>), Failure> {
        let Some(motion) = motion else { return Ok((Vec::new(), vec![NOTHING_OPEN.to_string()])) };
        progress.say("recording the experiment");
        let file = out.join(LOG);
        let note = self.note.clone();
        self.record(motion, arm, &file)?;
        let (new, findings) = read_logs(&[&file], arm).map_err(|e| Failure::Refused(e.to_string()))?;
        Ok((new, findings.iter().map(ToString::to_string).chain(note).collect()))
    }

    fn record(self, motion: &Motion, arm: &Arm, file: &Path) -> Result<(), Failure> {
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
        let envelope = match self.place.bus {
            BusUrl::Virtual => Envelope::new(|_| None),
            _ => Envelope::of(arm, &Mounting::Filed, None, None)
                .map_err(|e| Failure::Unusable(format!("--experiment: {e}")))?,
        };
        let master = self.place.driver(self.bus, self.consent)?;
        let mut log = std::fs::File::create(file)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", file.display())))?;
        record(master, motion, envelope, live(), &mut log).map(|_| ()).map_err(|e| match e {
            RecordError::Write(_) => Failure::Unusable(e.to_string()),
            other => Failure::Refused(format!("the experiment was not recorded: {other}")),
        })
    }
}
