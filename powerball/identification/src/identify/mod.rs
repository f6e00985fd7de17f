//! From logs to a model: one function, and what it takes and gives.
//!
//! `gather` makes sufficient statistics of logs, by mounting; `fit` fits them and makes what a page shows of
//! the fit; `judge` says what it leaves of each mounting and of other logs, and whether another friction law
//! would help; `result` holds all of it.

mod fit;
mod gather;
mod judge;
mod result;

use super::conventions::conventions;
use super::estimate::{BaseModel, Uncertainty, consistent_fit, estimates, stats_of};
use super::source::Source;
use super::transmission::transmission;
use crate::estimate::FrictionKind;
use crate::known::KnownModel;
use dyngen::{Arm, SetKind};
pub use fit::{Along, JointAlong, LogFacts};
use fit::{Fitted, fit};
pub use gather::Recorded;
use gather::{Gathered, Mounted};
pub(crate) use gather::{Gathering, InMemory, no_log_in_both, one_mounting};
pub use judge::MountedFit;
pub(crate) use judge::by_band;
use powerball_logs::Progress;
use powerball_logs::log::notes_of;
use powerball_logs::regression::DataOptions;
use powerball_logs::summary::BANDS;
pub use result::{Identified, IdentifyError};

/// Fits the minimal inertial set and the friction of every joint (Eq. 16) to logs, and judges them on the
/// logs of another path, `validate`, where there are any.
///
/// `logs` are [`Log`](powerball_logs::log::Log)s, or [`Source`]s where some are files, summaries, or of a
/// base that was mounted otherwise.
///
/// ```
/// use powerball_identification::{IdentifyOptions, identify};
/// use powerball_logs::log::{Arrays, Log};
/// # let arm = "name = \"pendulum\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\n\
/// #     kind = \"revolute\"\na = 0.5\nalpha = 0\nd = 0\ntheta = 0\n";
/// let arm = dyngen::Arm::parse(arm, "pendulum.toml")?;
/// // A swing of 1 kg at 0.5 m with 0.3 N·m of friction.
/// let swing = |t: &f64| {
///     let (sin, cos) = (3.0 * t).sin_cos();
///     (sin, 0.25 * -9.0 * sin + 0.5 * 9.81 * sin.cos() + 0.3 * (90.0 * cos).tanh())
/// };
/// let t: Vec<f64> = (0..4000).map(|k| 0.005 * f64::from(k)).collect();
/// let (q, torque) = t.iter().map(swing).unzip();
/// let arrays = Arrays { t: &t, q: &[q], torque: &[torque], ..Arrays::default() };
/// let (log, _findings) = Log::from_arrays("swing", &arm, &arrays)?;
/// let model = identify(&arm, [&log], [], &IdentifyOptions::default())?;
/// assert!((model.friction[0].gamma1 + model.friction[0].gamma3 - 0.3).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IdentifyError`]: what is wrong with the logs, or why they have no answer.
pub fn identify<'a, S: Into<Source<'a>>>(
    arm: &Arm,
    logs: impl IntoIterator<Item = S>,
    validate: impl IntoIterator<Item = S>,
    options: &IdentifyOptions<'_>,
) -> Result<Identified, IdentifyError> {
    let logs: Vec<Source<'a>> = logs.into_iter().map(Into::into).collect();
    let validate: Vec<Source<'a>> = validate.into_iter().map(Into::into).collect();
    let mut gathered = gather_logs(arm, &logs, &validate, options)?;
    let mut warnings = std::mem::take(&mut gathered.warnings);
    let conventions = gathered.conventions.take().or_else(|| gathered.conventions(options.progress));
    let transmission = gathered.transmission.take().or_else(|| gathered.transmission(options.progress));
    options.progress.say("fitting");
    let fitted = fit(&gathered, options, &mut warnings)?;
    let mountings = judge::fits(&gathered, &fitted, options, &mut warnings)?;
    let identified = conclude(&gathered, &fitted, mountings, options, warnings)?;
    let advice = judge::advice(&gathered, &identified, options)?;
    let unusable = judge::unusable(&gathered, conventions.as_ref(), &identified);
    Ok(Identified { conventions, transmission, advice, unusable, ..identified })
}

/// The sufficient statistics of the logs to fit, and the logs to judge by; without what is known already.
fn gather_logs(
    arm: &Arm,
    logs: &[Source<'_>],
    validate: &[Source<'_>],
    options: &IdentifyOptions<'_>,
) -> Result<Gathered, IdentifyError> {
    gather::no_log_in_both(logs, validate)?;
    let needs_samples = options.estimator.needs_samples();
    let mut gathered = match options.known {
        Some(known) => {
            let mounting = one_mounting(logs.iter().chain(validate), "--model takes")?;
            let mut read = InMemory::read(arm, known, [logs, validate], mounting, options.progress)?;
            options.progress.say("asking what the columns are");
            let result = conventions(&read.body, &read.fit, &read.validate);
            let between = transmission(read.body.arm(), &read.fit, &read.validate);
            read.known.take_out(&read.body, &mut read.fit);
            read.known.take_out(&read.body, &mut read.validate);
            let fit: Vec<Source<'_>> =
                read.fit.into_iter().map(|log| Source::from(log).mounted(mounting)).collect();
            let start = Mounted::of(read.body, mounting, &options.data);
            let mut gathered = Gathering::new(&read.arm, &options.data, true, options.progress)
                .with(start)
                .said(read.warnings)
                .all(&fit)?;
            for log in read.validate {
                gathered.hold_out(log, mounting, &options.data)?;
            }
            // What is known of the arm is still in the torques that were asked.
            gathered.conventions = Some(result);
            gathered.transmission = between;
            gathered
        }
        None => {
            let mut gathered = Gathering::new(arm, &options.data, needs_samples, options.progress)
                .said(notes_of(arm))
                .all(logs)?;
            for (log, mounting) in gather::held_out(validate, arm, &mut gathered.warnings)? {
                gathered.hold_out(log, mounting, &options.data)?;
            }
            gathered
        }
    };
    if needs_samples && gathered.together.take().is_some() {
        return Err(IdentifyError::SeveralMountings("--estimator robust and instrumental take"));
    }
    Ok(gathered)
}

/// What is reported about a fit.
fn conclude(
    gathered: &Gathered,
    fitted: &Fitted,
    mountings: Vec<MountedFit>,
    options: &IdentifyOptions<'_>,
    mut warnings: Vec<String>,
) -> Result<Identified, IdentifyError> {
    let (body, solution) = (gathered.body(), &fitted.solution);
    let found = estimates(body.names(), solution, &fitted.errors);
    let model = BaseModel {
        arm: body.arm().name.clone(),
        parameters: found.parameters.clone(),
        friction: found.friction.clone(),
    };
    let joint_bands: Vec<f64> = fitted.bands.iter().map(|band| BANDS[*band]).collect();
    let validate = judge::validate(gathered, &model, &joint_bands, options)?;
    if validate.is_none() {
        warnings.push("no log was given to --validate: the errors below are those of the fit itself".into());
    }
    let along = judge::along(gathered, &model, &joint_bands, options)?;
    warnings.extend(result::undetermined(&found.parameters));
    let values: Vec<f64> = found.parameters.iter().map(|p| p.value).collect();
    let possibility = body.possibility(&values)?;
    let reasons = &possibility.reasons;
    warnings.extend(reasons.iter().map(|r| format!("no real arm can have these values: {r}")));
    options.progress.say("looking for the nearest real arm");
    Ok(Identified {
        arm: model.arm,
        bars: body.arm().bars.iter().map(|bar| bar.name.clone()).collect(),
        arm_file: None,
        conventions: None,
        transmission: None,
        advice: None,
        unusable: Vec::new(),
        indefinite: possibility.indefinite,
        set: SetKind::Minimal.to_string(),
        parameters: found.parameters,
        friction: found.friction,
        fit: stats_of(solution, &solution.theta),
        validate,
        physically_consistent: reasons.is_empty(),
        consistent: consistent_fit(body, solution)?.report(body, solution),
        mountings,
        band: [0.0, BANDS[0]],
        joint_bands,
        band_reason: result::band_reason(&fitted.bands, along.motion),
        warnings,
        along,
        uncertainty: Uncertainty::of(body.names(), solution, &fitted.errors),
        described: body.filed(),
    })
}

// How logs are identified.

/// All settings of [`identify`].
#[derive(Clone, Debug, Default)]
pub struct IdentifyOptions<'a> {
    /// The friction of every joint.
    pub friction: FrictionKind,
    /// How samples are counted.
    pub estimator: Estimator,
    /// How logs are filtered and cut into blocks. Its band counts where the estimator looks at single
    /// samples; else every joint has its own.
    pub data: DataOptions,
    /// What is known already: taken out of the logs as it stands. Logs of one mounting alone, no summaries.
    pub known: Option<&'a dyn KnownModel>,
    /// Where progress is reported.
    pub progress: Progress<'a>,
}

/// How samples are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Least squares, every joint weighted by its noise.
    #[default]
    Weighted,
    /// Weighted least squares in which torque samples that the model cannot believe (knocks, spikes, brief
    /// collisions) count less or nothing.
    Robust,
    /// Instrumental variables: unbiased where positions are noisy. The regressor from every second sample of
    /// the positions, its instruments from those between.
    Instrumental,
}

impl Estimator {
    /// Whether it looks at single samples, which a summary does not hold.
    #[must_use]
    pub fn needs_samples(self) -> bool {
        self != Estimator::Weighted
    }
}
