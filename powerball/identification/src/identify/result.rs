//! What an identification gives, and the words for it.
//!
//! The file also has why logs come to no model.

use super::fit::Along;
use super::judge::MountedFit;
use crate::conventions::Conventions;
use crate::estimate::{
    BaseModel, ConsistentReport, JointFriction, ParameterEstimate, ResidualStats, Uncertainty,
};
use crate::transmission::JointTransmission;
use dyngen::Arm;
use powerball_controller::JointNumber;
use powerball_logs::regression::DataError;
use powerball_logs::summary::BANDS;
use serde::Serialize;

/// A model with its errors; as JSON it is `identified.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Identified {
    /// Why this result should not be used; empty where it can be.
    pub unusable: Vec<String>,
    /// The arm's name.
    pub arm: String,
    /// The names of its bars of closed loops.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bars: Vec<String>,
    /// The arm file, as its path was given to the command; `None` for an arm in memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_file: Option<String>,
    /// What the columns of the logs are; `None` where only summaries were given, which hold no samples.
    pub conventions: Option<Conventions>,
    /// What is between the motors' torques and the links', by joint, where logs hold both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Vec<JointTransmission>>,
    /// The parameter set: "minimal".
    pub set: String,
    /// The set's values with their standard errors.
    pub parameters: Vec<ParameterEstimate>,
    /// Eq. 16 by joint.
    pub friction: Vec<JointFriction>,
    /// What the fit leaves of its own logs.
    pub fit: ResidualStats,
    /// What the model leaves of the validation set, where there is one.
    pub validate: Option<ResidualStats>,
    /// Whether a real arm can have these values.
    pub physically_consistent: bool,
    /// The share of poses at which the mass matrix of these values is not positive definite; not part of the
    /// JSON.
    #[serde(skip)]
    pub indefinite: f64,
    /// The nearest values that a real arm can have, with what that costs.
    pub consistent: ConsistentReport,
    /// How the base stood for the fitted logs, where it was not as the arm file says or not always the same.
    /// The parameters are those that these mountings determine together.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mountings: Vec<MountedFit>,
    /// The widest band of a joint, Hz.
    pub band: [f64; 2],
    /// The end of each joint's band, Hz: of its fit, and of its errors.
    pub joint_bands: Vec<f64>,
    /// Why these, in words.
    pub band_reason: String,
    /// What is to be reported about the logs, the arm file and the fit.
    pub warnings: Vec<String>,
    /// What would lower errors that are large now, where something is known to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
    /// The model along the validation set, or along the fitted logs where there is none.
    #[serde(skip)]
    pub along: Along,
    /// How well all of it is known together: `covariance.json`.
    #[serde(skip)]
    pub uncertainty: Uncertainty,
    /// The arm as it was identified: that of the file, with what a known model changes of it.
    #[serde(skip)]
    pub described: Arm,
}

impl Identified {
    /// The model alone.
    #[must_use]
    pub fn model(&self) -> BaseModel {
        BaseModel {
            arm: self.arm.clone(),
            parameters: self.parameters.clone(),
            friction: self.friction.clone(),
        }
    }
}

/// What to report about parameters that the logs do not determine.
pub(super) fn undetermined(parameters: &[ParameterEstimate]) -> Option<String> {
    let names: Vec<&str> = parameters.iter().filter(|p| p.std.is_none()).map(|p| p.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "these logs do not determine {}: they were set to 0; record a motion that excites them",
            names.join("; ")
        )
    })
}

/// Why the joints' bands end where they do, and what of the motion lies in them: the arm moves below `motion`
/// Hz.
pub(super) fn band_reason(bands: &[usize], motion: Option<f64>) -> String {
    let mut why = vec![format!("0 to {} Hz, above which arms are not rigid", BANDS[0])];
    for (k, high) in BANDS.iter().enumerate().skip(1) {
        let joints: Vec<String> = (0..bands.len())
            .filter(|j| bands[*j] == k)
            .map(|j| JointNumber::from_index(j).to_string())
            .collect();
        if !joints.is_empty() {
            why.push(format!(
                "0 to {high} Hz for joint {}, whose model torque is below what it leaves in the octave above",
                joints.join(", ")
            ));
        }
    }
    let lowest = bands.iter().map(|k| BANDS[*k]).fold(BANDS[0], f64::min);
    let motion = motion.map_or(String::new(), |motion| {
        let verdict = if motion > 0.5 * lowest {
            "that is too near to the end of a band: move slower, or much of the torque is left out"
        } else {
            "gravity and inertia are within, and so is what friction does at reversals, several times faster"
        };
        format!("; 99 % of the power of the velocities lies below {motion:.1} Hz: {verdict}")
    });
    format!("band {}{motion}", why.join("; "))
}

// Why logs come to no model.

/// Why an identification, a verification or a summary was not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// A file is among the logs to fit and among those to judge by.
    #[error("{0} is given to --log and --validate: a log cannot judge its own fit")]
    JudgesItself(String),
    /// Logs that cannot be used as they are: unreadable, damaged, of another arm, given twice, stated with a
    /// wrong mounting. Every reason.
    #[error("{}", .0.join("\n"))]
    Unusable(Vec<String>),
    /// Logs that can be read, of which nothing can be used. Every reason.
    #[error("{}", .0.join("\n"))]
    NothingUsable(Vec<String>),
    /// Gravity that is no number: which.
    #[error("{0}")]
    Mounting(String),
    /// Logs of several mountings of the base, where one is asked for: by what.
    #[error("{0} logs of one mounting of the base")]
    SeveralMountings(&'static str),
    /// The known model is none of this arm, or says nothing of this mounting: why.
    #[error("{0}")]
    Known(String),
    /// A setting that is out of its range: which.
    #[error("{0}")]
    Setting(String),
    /// The arm's dynamics cannot be derived.
    #[error("{0}")]
    Arm(#[from] dyngen::Error),
    /// Of the logs to judge by nothing can be used.
    #[error("{0}")]
    Data(#[from] DataError),
    /// The logs of several mountings come to no common parameters: why.
    #[error("{0}")]
    Together(String),
    /// The instruments do not determine what the columns do, or there are none: why.
    #[error("{0}")]
    Instruments(String),
    /// No joint is in any band.
    #[error("no joint has a band")]
    NoBand,
}

impl IdentifyError {
    /// Whether the input was wrong or unreadable. Otherwise it was right, and the data or the arm have no
    /// answer.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            IdentifyError::JudgesItself(_)
            | IdentifyError::Unusable(_)
            | IdentifyError::Mounting(_)
            | IdentifyError::SeveralMountings(_)
            | IdentifyError::Known(_)
            | IdentifyError::Setting(_) => true,
            IdentifyError::NothingUsable(_)
            | IdentifyError::Arm(_)
            | IdentifyError::Data(_)
            | IdentifyError::Together(_)
            | IdentifyError::Instruments(_)
            | IdentifyError::NoBand => false,
        }
    }
}
