//! Logs reduced in several bands: in which of them they speak of a model is decided when there is one.

use super::reduce::push_in_bands;
use super::{Summary, SummaryError};
use crate::logs::log::Log;
use crate::logs::regression::{DataError, DataOptions, RigidArm};

pub use crate::logs::signal::BANDS;

/// A model's power and that of what it leaves, (N·m)², between neighbouring bands.
pub type Powers = [[f64; 2]; BANDS.len() - 1];

/// Logs of one arm, reduced in each of [`BANDS`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    bands: Vec<Summary>,
}

impl Bands {
    /// Of no log yet; the band of `options` does not count.
    #[must_use]
    pub fn new(body: &RigidArm, options: &DataOptions) -> Bands {
        Bands { bands: BANDS.iter().map(|band| Summary::new(body, &with(options, *band))).collect() }
    }

    /// The logs in each band, widest first.
    #[must_use]
    pub fn all(&self) -> &[Summary] {
        &self.bands
    }

    /// The logs with all joints in the widest band.
    #[must_use]
    pub fn widest(&self) -> &Summary {
        &self.bands[0]
    }

    /// The logs with each joint in a band of its own.
    #[must_use]
    pub fn of_joints(&self, bands: &[usize]) -> Summary {
        let joint = |(j, band): (usize, &usize)| self.bands[*band].joints[j].clone();
        Summary { joints: bands.iter().enumerate().map(joint).collect(), ..self.bands[0].clone() }
    }

    /// By joint and octave between neighbouring bands, from fast to slow: the power of a model's torque
    /// there, and of what it leaves. Summed over logs, each with a model of its own.
    #[must_use]
    pub fn spectrum(&self) -> &[Powers] {
        &self.bands[0].spectrum
    }

    /// Says it of the one log that is in.
    pub(crate) fn set_spectrum(&mut self, spectrum: &[Powers]) {
        self.bands[0].spectrum = spectrum.to_vec();
    }

    /// Takes a log in. Returns what was left out of it, in words.
    ///
    /// # Errors
    /// [`DataError`] where nothing of the log can be used; nothing has been taken in then. A log that is too
    /// short for a narrow band is missing from that band alone.
    pub fn push(
        &mut self,
        body: &RigidArm,
        log: &Log,
        options: &DataOptions,
    ) -> Result<Vec<String>, DataError> {
        push_in_bands(&mut self.bands, body, log, &with(options, BANDS[0]), |_| {})
    }

    /// The logs in the columns of another set of the same arm, as [`Summary::in_set`].
    #[must_use]
    pub fn in_set(&self, own: &RigidArm, general: &RigidArm) -> Option<Bands> {
        let bands = self.bands.iter().map(|summary| summary.in_set(own, general));
        Some(Bands { bands: bands.collect::<Option<_>>()? })
    }

    /// Takes in what other logs of the same arm gave.
    ///
    /// # Errors
    /// As [`Summary::merge`].
    pub fn merge(&mut self, other: &Bands) -> Result<(), SummaryError> {
        self.bands.iter_mut().zip(&other.bands).try_for_each(|(summary, other)| summary.merge(other))
    }

    /// The bytes of a file: one band after the other.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.bands.iter().flat_map(Summary::to_bytes).collect()
    }

    /// From the bytes of a file.
    ///
    /// # Errors
    /// [`SummaryError::Unreadable`] where they are no summary, of another version, or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Bands, SummaryError> {
        let (mut bands, mut rest) = (Vec::new(), bytes);
        while bands.len() < BANDS.len() {
            let (summary, after) = Summary::from_bytes(rest)?;
            bands.push(summary);
            rest = after;
        }
        let cutoffs = bands.iter().map(|summary| summary.identity.cutoff);
        if !rest.is_empty() || !cutoffs.eq(BANDS) {
            return Err(SummaryError::Unreadable("it is torn or damaged: summarize the log anew".into()));
        }
        Ok(Bands { bands })
    }
}

fn with(options: &DataOptions, cutoff: f64) -> DataOptions {
    DataOptions { cutoff, ..options.clone() }
}
