//! Why an arm is not recorded.

use crate::bus::driver::Rejection;
use crate::bus::transport::ArmError;
use std::fmt;
use std::io;

/// Why a recording ended early, or did not begin.
#[derive(Debug)]
pub enum RecordError {
    /// The arm.
    Arm(ArmError),
    /// A set-point was rejected.
    Rejected(Rejection),
    /// The motion does not fit the arm or its rate.
    Motion(String),
    /// The arm must not go where it would have to: why.
    Barred(String),
    /// The log could not be written.
    Write(io::Error),
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RecordError::Arm(e) => e.fmt(f),
            RecordError::Rejected(rejection) => write!(f, "the motion cannot be followed: {rejection}"),
            RecordError::Motion(what) | RecordError::Barred(what) => f.write_str(what),
            RecordError::Write(e) => write!(f, "the log cannot be written: {e}"),
        }
    }
}

impl std::error::Error for RecordError {}

impl<E: Into<ArmError>> From<E> for RecordError {
    fn from(e: E) -> Self {
        RecordError::Arm(e.into())
    }
}
