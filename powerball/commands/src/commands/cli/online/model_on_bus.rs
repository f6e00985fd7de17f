//! The arm with a torque model, and its bus, for `follow` and `float`.

use super::bus::{Consent, Where, virtual_bus};
use super::envelope::Surroundings;
use super::virtual_arm::{built, setup};
use super::{Failure, output};
use crate::commands::model_arm::{self, ModelArm};
use crate::procedure::{Envelope, RecordError};
use clap::Args;
use dyngen::Arm;
use powerball_bus::driver::Profile;
use powerball_bus::transport::{Bus, BusUrl, Master};
use powerball_identification::mounting::Mounting;
use powerball_virtual_arm::slave::Hand;
use powerball_virtual_arm::{Undeclared, VirtualArm, lwa4p};
use std::path::{Path, PathBuf};

/// Arm, model and bus.
#[derive(Args, Debug)]
pub(crate) struct ModelOnBus {
    /// The torque model: model.json of `powerball explain` or identified.json of `powerball identify`, for
    /// the same arm file.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) model: PathBuf,
    #[command(flatten)]
    pub(crate) surroundings: Surroundings,
    #[command(flatten)]
    pub(crate) place: Where,
    /// The virtual arm of --bus virtual with what no model knows about it: virtual_arm.json, as `powerball
    /// demo` writes it; without, the file of that name next to the arm file, else the built-in arm.
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,
    #[command(flatten)]
    consent: Consent,
}

impl ModelOnBus {
    /// The arm file and the model, and what motions must keep: with the model's masses where no values were
    /// given.
    pub(crate) fn read(&mut self) -> Result<(Arm, ModelArm, Envelope<6>), Failure> {
        if self.plant.is_some() && self.place.bus != BusUrl::Virtual {
            return Err(Failure::Unusable("--plant works only with --bus virtual".into()));
        }
        let arm = self.surroundings.arm()?;
        let model = model_arm::read(&arm, &self.model, true).map_err(Failure::Unusable)?;
        if model.model.additions.arm_changes.is_empty() {
            self.surroundings.values_or(&self.model);
        }
        let envelope = self.surroundings.envelope(&arm, &Mounting::Filed)?;
        Ok((arm, model, envelope))
    }

    /// Whether the current mode may be tried.
    pub(crate) fn accepts(&self) -> bool {
        self.consent.accept_unverified || self.place.bus == BusUrl::Virtual
    }

    /// A driver of the arm; where the bus is virtual the arm stands at `start`, with a hand on it if there is
    /// one.
    pub(crate) fn master(
        &self,
        profile: Profile<6>,
        start: [f64; 6],
        hand: Option<Hand>,
    ) -> Result<Master<Box<dyn Bus>, 6>, Failure> {
        let bus = match self.place.bus {
            BusUrl::Virtual => virtual_bus(self.virtual_arm(start, hand)?)?,
            _ => self.place.open()?,
        };
        self.place.driver_of(profile, bus, self.consent)
    }

    /// The plant of --bus virtual: the file that is given, else the one next to the arm file, as for
    /// `explain --experiment`.
    fn plant_file(&self) -> Option<PathBuf> {
        self.plant.clone().or_else(|| self.surroundings.arm.as_deref().and_then(Undeclared::next_to))
    }

    /// The name of the plant of --bus virtual; `None` on other buses.
    pub(crate) fn plant(&self) -> Option<String> {
        let file = || self.plant_file().map_or("built-in".to_string(), |file| file.display().to_string());
        (self.place.bus == BusUrl::Virtual).then(file)
    }

    fn virtual_arm(&self, start: [f64; 6], hand: Option<Hand>) -> Result<VirtualArm, Failure> {
        let file = self.plant_file();
        output::notice(&match &file {
            Some(file) => format!("powerball: the virtual arm is that of {}", file.display()),
            None => "powerball: the virtual arm is the built-in one, which has no undeclared effect: it \
                cannot test a model of another arm; give the file of that arm with --plant"
                .to_string(),
        });
        let setup = match &file {
            Some(file) => Undeclared::read(file)
                .map_err(Failure::Unusable)?
                .setup(start, 1)
                .map_err(|e| Failure::Refused(e.to_string()))?,
            None => setup(start, 1, None)?,
        };
        let arm = built(lwa4p::with_current_mode(setup), false)?;
        Ok(match hand {
            Some(hand) => arm.with_hand(hand),
            None => arm,
        })
    }
}

/// The failure for an error of a trajectory's file, or of the arm.
pub(crate) fn failed(e: RecordError, file: &Path) -> Failure {
    match e {
        RecordError::Motion(what) => Failure::Unusable(format!("{}: {what}", file.display())),
        other => Failure::Refused(other.to_string()),
    }
}
