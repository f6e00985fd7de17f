//! From rows to parameters: fits, their errors, and the paths that excite them.
//!
//! [`identify`] is the whole way from logs to a model; [`estimate`] holds its fits.

pub mod comparison;
pub mod conventions;
pub mod estimate;
pub mod evidence;
pub mod excite;
mod identify;
mod known;
pub mod mounting;
mod nearest;
mod numeric_arm;
pub mod servo;
mod source;
pub mod transmission;
pub mod usable;
mod verify;

pub use powerball_logs::{chain, motion};

pub use identify::{
    Along, Estimator, Identified, IdentifyError, IdentifyOptions, JointAlong, LogFacts, MountedFit, Recorded,
    identify,
};
pub use known::KnownModel;
pub use nearest::{NearestArm, NearestError, ValueChange, nearest_arm};
pub use numeric_arm::NumericArm;
pub use source::{Input, Source, Summarized, summarize};
pub use transmission::{JointTransmission, transmission};
pub use verify::{Verified, VerifyOptions, verify};
