//! A log reduced to the sufficient statistics of its fit: R factors of the QR decomposition of its rows,
//! whose size does not depend on the length of the log.
//!
//! The reduction fixes the arm, the parameter set and the bands. It does not fix which band is used (see
//! [`Bands`]), the steepnesses of friction (see [`Steepness`]), the joints' weights, and the colour of the
//! noise (see [`Octaves`]).

mod file;
mod octaves;
mod r_factor;
mod reduce;

use crate::parallel;
use crate::regression::{DataOptions, RigidArm};
pub use file::SummaryError;
pub use octaves::{OCTAVES, Octaves, SLOW, halved};
pub use r_factor::RFactor;
pub use reduce::parts;
pub use reduce::{BANDS, Bands, Columns, NODES, Powers, Steepness};

/// The arm and the options of a summary: they must agree before summaries are added.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// The arm's name.
    pub arm: String,
    /// A hash of all else that its file says.
    pub hash: u64,
    /// Gravity in the base frame as the base was mounted, m/s².
    pub gravity: [f64; 3],
    /// The minimal set, in the order of the columns.
    pub parameters: Vec<String>,
    /// Band, Hz.
    pub cutoff: f64,
    /// Smoothing of positions, Hz.
    pub smoothing: f64,
    /// The steepnesses of each joint.
    pub steepness: Vec<Steepness>,
}

/// Logs of one arm, reduced.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The arm and the options of the summary.
    pub identity: Identity,
    /// The logs that went in, and the seconds of each.
    pub logs: Vec<(String, f64)>,
    /// Samples in the band, resting joints among them.
    pub samples: u64,
    /// By joint: the reason why a log has no information about it.
    pub inactive: Vec<Option<String>>,
    /// The rows of each joint.
    pub joints: Vec<Octaves>,
    /// The end of each joint's band, Hz.
    pub joint_bands: Vec<f64>,
    /// Spectrum of the widest of several bands: see [`Bands::spectrum`].
    pub spectrum: Vec<Powers>,
}

/// A joint without a velocity limit is taken to move about this fast, rad/s or m/s.
const ORDINARY_SPEED: f64 = 1.0;

impl Summary {
    /// An empty summary.
    #[must_use]
    pub fn new(body: &RigidArm, options: &DataOptions) -> Summary {
        let arm = body.filed();
        let mut described = format!("{:?} {:?} {:?} {:?}", arm.convention, arm.gravity, arm.joints, arm.tool);
        // Without transmissions the hash is that of summaries that were written before there were any.
        if !arm.transmissions.is_empty() {
            described += &format!(" rows of motors {:?}", arm.transmissions);
        }
        let identity = Identity {
            arm: arm.name.clone(),
            hash: fnv(described.as_bytes()),
            gravity: body.gravity(),
            parameters: body.names().to_vec(),
            cutoff: options.cutoff,
            smoothing: options.smoothing,
            steepness: (0..body.dof())
                .map(|j| {
                    Steepness::new(body.velocity_limit(j).filter(|v| *v > 0.0).unwrap_or(ORDINARY_SPEED))
                })
                .collect(),
        };
        Summary::without_logs(identity)
    }

    fn without_logs(identity: Identity) -> Summary {
        let (columns, dof) = (Columns { inertial: identity.parameters.len() }, identity.steepness.len());
        Summary {
            joint_bands: vec![identity.cutoff; dof],
            identity,
            logs: Vec::new(),
            samples: 0,
            inactive: vec![None; dof],
            joints: vec![Octaves::new(columns.width()); dof],
            spectrum: vec![Powers::default(); dof],
        }
    }

    /// The columns of its factors.
    #[must_use]
    pub fn columns(&self) -> Columns {
        Columns { inertial: self.identity.parameters.len() }
    }

    /// Rows in the columns of the minimal set of `general`, which is the same arm under a gravity
    /// whose parameters determine those of `own`, in whose columns the rows are; `None` if they do not.
    #[must_use]
    pub fn in_set(&self, own: &RigidArm, general: &RigidArm) -> Option<Summary> {
        let rows = own.parameters_from(general)?;
        let parameters = general.names().to_vec();
        let inertial = |c: usize| -> Vec<(usize, f64)> {
            rows.iter().enumerate().map(|(k, row)| (k, row[c])).filter(|(_, factor)| *factor != 0.0).collect()
        };
        let others = self.columns().inertial..self.columns().width();
        let columns: Vec<Vec<(usize, f64)>> =
            (0..parameters.len()).map(inertial).chain(others.map(|c| vec![(c, 1.0)])).collect();
        let joints = parallel::map(&self.joints, |octaves| octaves.combined(&columns));
        let identity = Identity { parameters, gravity: general.gravity(), ..self.identity.clone() };
        Some(Summary { identity, joints, ..self.clone() })
    }

    /// Takes in what other logs of the same arm gave.
    ///
    /// # Errors
    /// [`SummaryError::Differs`] where they are of another arm, mounting, set or band.
    pub fn merge(&mut self, other: &Summary) -> Result<(), SummaryError> {
        self.identity.same_as(&other.identity)?;
        self.join(other);
        Ok(())
    }

    /// [`Summary::merge`] of what is known to be of the same arm.
    fn join(&mut self, other: &Summary) {
        for (octaves, other) in self.joints.iter_mut().zip(&other.joints) {
            octaves.merge(other);
        }
        for (inactive, other) in self.inactive.iter_mut().zip(&other.inactive) {
            *inactive = other.clone().or(inactive.take());
        }
        for (sum, other) in self.spectrum.iter_mut().flatten().zip(other.spectrum.iter().flatten()) {
            (sum[0], sum[1]) = (sum[0] + other[0], sum[1] + other[1]);
        }
        self.samples += other.samples;
        self.logs.extend(other.logs.iter().cloned());
    }
}

/// The hash of Fowler, Noll and Vo (FNV-1a, 64 bits): the same on every machine.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, b| (hash ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
}
