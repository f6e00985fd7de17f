//! Verification of an existing model on logs that were not used to fit it (Fig. 8).

use super::estimate::{JointVerdict, TorqueCurve, curves, verdicts};
use super::identify::{IdentifyError, InMemory, by_band, one_mounting};
use super::known::KnownModel;
use super::source::Source;
use super::usable::{Findings, doubts};
use dyngen::Arm;
use powerball_logs::Progress;
use powerball_logs::regression::{Data, DataOptions};
use powerball_logs::summary::BANDS;
use serde::Serialize;

/// All settings of [`verify`].
#[derive(Clone, Debug)]
pub struct VerifyOptions<'a> {
    /// Largest error of a joint, as a share of the rms of its torque.
    pub tolerance: f64,
    /// The end of each joint's band, Hz, in which its error is taken: [`Identified::joint_bands`] of the
    /// model. The widest band is used if it is empty, or not one of [`BANDS`].
    ///
    /// [`Identified::joint_bands`]: super::Identified::joint_bands
    pub joint_bands: Vec<f64>,
    /// How logs are filtered and cut into blocks.
    pub data: DataOptions,
    /// The receiver of progress reports.
    pub progress: Progress<'a>,
}

impl Default for VerifyOptions<'_> {
    fn default() -> Self {
        VerifyOptions {
            tolerance: 0.1,
            joint_bands: Vec::new(),
            data: DataOptions::default(),
            progress: Progress::default(),
        }
    }
}

/// How a model does on logs; as JSON it is `verified.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Verified {
    /// The arm's name.
    pub arm: String,
    /// The model's error with an interval, joint by joint.
    pub joints: Vec<JointVerdict>,
    /// The requested tolerance.
    pub tolerance: f64,
    /// Whether no joint's error may be beyond the tolerance.
    pub within_tolerance: bool,
    /// The widest band, Hz.
    pub band: [f64; 2],
    /// The end of each joint's band, Hz, in which its error is taken: the one in which it was identified.
    pub joint_bands: Vec<f64>,
    /// Why it should not be used, each a sentence without its full stop; empty where it may be.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unusable: Vec<String>,
    /// Warnings about the logs and the arm file.
    pub warnings: Vec<String>,
    /// Measured torque and error, by joint.
    #[serde(skip)]
    pub curves: Vec<TorqueCurve>,
}

/// Judges a model on logs of one mounting of the base.
///
/// # Errors
/// [`IdentifyError`]: a model of another arm, logs that cannot be used.
pub fn verify<'a, S: Into<Source<'a>>>(
    arm: &Arm,
    model: &dyn KnownModel,
    logs: impl IntoIterator<Item = S>,
    options: &VerifyOptions<'_>,
) -> Result<Verified, IdentifyError> {
    let tolerance = options.tolerance;
    if !(tolerance.is_finite() && tolerance > 0.0) {
        return Err(IdentifyError::Setting("--tolerance must be above 0".into()));
    }
    let logs: Vec<Source<'a>> = logs.into_iter().map(Into::into).collect();
    let mounting = one_mounting(&logs, "verify takes")?;
    let read = InMemory::read(arm, model, [&logs, &[]], mounting, options.progress)?;
    options.progress.say("preparing signals");
    let data = Data::new(&read.body, &read.fit, &options.data)?;
    let residual = read.known.residual(&read.body, &data);
    let mut joints = verdicts(&data, &residual, tolerance);
    let said = |j: usize| options.joint_bands.get(j).copied().filter(|band| BANDS.contains(band));
    let joint_bands: Vec<f64> = (0..joints.len()).map(|j| said(j).unwrap_or(BANDS[0])).collect();
    for band in by_band(&read.body, &read.fit, &joint_bands, &options.data) {
        let (members, data) = band?;
        let own = verdicts(&data, &read.known.residual(&read.body, &data), tolerance);
        members.into_iter().for_each(|j| joints[j] = own[j].clone());
    }
    Ok(Verified {
        arm: read.body.arm().name.clone(),
        within_tolerance: joints.iter().all(|j| j.within != Some(false)),
        tolerance,
        band: [0.0, data.band.cutoff],
        joint_bands,
        unusable: Findings {
            doubts: doubts(&read.body.filed(), &read.fit),
            not_finite: joints.iter().any(|j| !j.rms.is_finite()),
            ..Findings::default()
        }
        .reasons(),
        joints,
        curves: curves(&data, &residual, &residual),
        warnings: read.warnings.into_iter().chain(data.notes.iter().cloned()).collect(),
    })
}
