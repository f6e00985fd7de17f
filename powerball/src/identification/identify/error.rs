//! Why logs come to no model.

use crate::logs::regression::DataError;
use std::fmt;

/// Why an identification, a verification or a summary was not made.
#[derive(Debug)]
#[non_exhaustive]
pub enum IdentifyError {
    /// A file is among the logs to fit and among those to judge by.
    JudgesItself(String),
    /// Logs that cannot be used as they are: unreadable, damaged, of another arm, given twice, told of a
    /// wrong mounting. Every reason.
    Unusable(Vec<String>),
    /// Logs that can be read, of which nothing can be used. Every reason.
    NothingUsable(Vec<String>),
    /// Gravity that is no number: which.
    Mounting(String),
    /// Logs of several mountings of the base, where one is asked for: by what.
    SeveralMountings(&'static str),
    /// The known model is none of this arm, or says nothing of this mounting: why.
    Known(String),
    /// A setting that is out of its range: which.
    Setting(String),
    /// The arm's dynamics cannot be derived.
    Arm(dyngen::Error),
    /// Of the logs to judge by nothing can be used.
    Data(DataError),
    /// The logs of several mountings come to no common parameters: why.
    Together(String),
    /// The instruments do not determine what the columns do, or there are none: why.
    Instruments(String),
    /// No joint is in any band.
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

impl fmt::Display for IdentifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            IdentifyError::JudgesItself(file) => {
                write!(f, "{file} is given to --log and --validate: a log cannot judge its own fit")
            }
            IdentifyError::Unusable(reasons) | IdentifyError::NothingUsable(reasons) => {
                f.write_str(&reasons.join("\n"))
            }
            IdentifyError::Mounting(why)
            | IdentifyError::Known(why)
            | IdentifyError::Setting(why)
            | IdentifyError::Together(why)
            | IdentifyError::Instruments(why) => f.write_str(why),
            IdentifyError::SeveralMountings(what) => write!(f, "{what} logs of one mounting of the base"),
            IdentifyError::Arm(e) => e.fmt(f),
            IdentifyError::Data(e) => e.fmt(f),
            IdentifyError::NoBand => f.write_str("no joint has a band"),
        }
    }
}

impl std::error::Error for IdentifyError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            IdentifyError::Arm(e) => Some(e),
            IdentifyError::Data(e) => Some(e),
            _ => None,
        }
    }
}

impl From<dyngen::Error> for IdentifyError {
    fn from(e: dyngen::Error) -> Self {
        IdentifyError::Arm(e)
    }
}

impl From<DataError> for IdentifyError {
    fn from(e: DataError) -> Self {
        IdentifyError::Data(e)
    }
}
