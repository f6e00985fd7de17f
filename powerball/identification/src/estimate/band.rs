//! The bands in which logs determine a model, joint by joint.
//!
//! Logs are reduced in bands an octave apart ([`Bands`]). In the spectrum of a joint's torque the model's
//! part falls below the residual at some frequency; above it, rows show noise, or motion that no rigid arm
//! has. Each log gives this frequency by its own fit; the powers are added over logs, so that summaries give
//! it too. A joint with a large residual, whose model is below its residual in an octave, is fitted and
//! judged in the band below that octave: in a wider one it would be judged on the noise of positions that
//! were differentiated twice, and any attenuation of the model would lower the error. Rows of a joint are
//! filtered by themselves, so the other joints keep theirs. Identification and explanation take the same
//! bands.

use super::design::Design;
use super::estimates::stats_of;
use super::fit::friction_columns;
use super::reduced::{FrictionKind, Solution, solve_reduced};
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataError, DataOptions, RigidArm};
use powerball_logs::signal::motion::between;
use powerball_logs::summary::{BANDS, Bands, Powers, Summary, parts};

/// A model fitted in the bands in which the logs speak of it.
#[derive(Debug)]
pub struct InBand {
    /// The fit.
    pub solution: Solution,
    /// Which of [`BANDS`], by joint.
    pub bands: Vec<usize>,
}

/// Fits the base model to reduced logs, every joint in the band that they ask for.
#[must_use]
pub fn solve_in_band(reduced: &Bands, law: FrictionKind) -> InBand {
    // A log that is too short for a band must not fall out of the fit.
    let whole = |narrower: &&Summary| narrower.logs.len() == reduced.widest().logs.len();
    let narrower = reduced.all()[1..].iter().take_while(whole).count();
    let widest = solve_reduced(reduced.widest(), law);
    let left = stats_of(&widest, &widest.theta).relative;
    let mut bands = joint_bands(&left, reduced.spectrum());
    bands.iter_mut().for_each(|band| *band = (*band).min(narrower));
    match bands.iter().all(|band| *band == 0) {
        true => InBand { solution: widest, bands },
        false => InBand { solution: solve_reduced(&reduced.of_joints(&bands), law), bands },
    }
}

/// A joint may have a narrower band if the residual of a fit of the widest band is more than this share of
/// its torque.
const MUCH: f64 = 0.1;

/// Which of [`BANDS`] each joint has: `left` is the residual of a fit of the widest band as a share of its
/// torque.
fn joint_bands(left: &[f64], spectrum: &[Powers]) -> Vec<usize> {
    // Number of octaves below the widest band in which the model is smaller than its residual.
    let quiet = |octaves: &Powers| octaves.iter().take_while(|[model, left]| model < left).count();
    left.iter().zip(spectrum).map(|(left, octaves)| if *left > MUCH { quiet(octaves) } else { 0 }).collect()
}

/// Which of [`BANDS`] each joint has if single samples are available, as in [`solve_in_band`]. `left` is the
/// residual of a fit of the widest band as a share of each joint's torque.
#[must_use]
pub fn bands_of_logs(body: &RigidArm, logs: &[Log], options: &DataOptions, left: &[f64]) -> Vec<usize> {
    if left.iter().all(|left| *left <= MUCH) {
        return vec![0; left.len()];
    }
    let options = DataOptions { cutoff: BANDS[0], ..options.clone() };
    let own = |log: &Log| {
        let mut reduced = Summary::new(body, &options);
        reduced.push(body, log, &options).ok()?;
        let own = solve_reduced(&reduced, FrictionKind::Symmetric);
        reduced.spectrum = spectrum_of(body, log, &options, &own);
        Some(reduced)
    };
    let mut all = Summary::new(body, &options);
    for own in logs.iter().filter_map(own) {
        // All are of one arm.
        let _ = all.merge(&own);
    }
    joint_bands(left, &all.spectrum)
}

/// Reduces one log in all bands, and takes the spectrum of its first part. Also gives notes on the samples
/// that were left out.
///
/// # Errors
/// [`DataError`] where nothing of the log can be used.
pub fn reduce_in_bands(
    body: &RigidArm,
    log: &Log,
    options: &DataOptions,
) -> Result<(Bands, Vec<String>), DataError> {
    let mut bands = Bands::new(body, options);
    let notes = bands.push(body, log, options)?;
    let own = solve_reduced(bands.widest(), FrictionKind::Symmetric);
    let widest = DataOptions { cutoff: BANDS[0], ..options.clone() };
    bands.set_spectrum(&spectrum_of(body, log, &widest, &own));
    Ok((bands, notes))
}

/// The spectrum of a log of which `own` is the fit; `widest` are options with the widest band.
fn spectrum_of(body: &RigidArm, log: &Log, widest: &DataOptions, own: &Solution) -> Vec<Powers> {
    // Some minutes say where a spectrum sinks.
    let first = parts(log).into_iter().find_map(|part| Data::new(body, &[part], widest).ok());
    first.map_or_else(|| vec![Powers::default(); body.dof()], |data| spectrum(&data, &own.shapes, &own.theta))
}

/// By joint and octave between neighbouring bands: the power of the model's torque, and of its residual.
fn spectrum(data: &Data<'_>, shapes: &[[f64; 2]], theta: &[f64]) -> Vec<Powers> {
    let design = Design::new(data, &friction_columns(data, shapes), &[]);
    let rate = data.rate() / data.band.decimation as f64;
    let of_joint = |j: usize| {
        let rows = &data.joints[j];
        let predicted = design.predict(j, theta);
        let left: Vec<f64> = rows.torque.iter().zip(&predicted).map(|(y, p)| y - p).collect();
        let mut sums = Powers::default();
        for run in rows.runs() {
            for (which, signal) in [&predicted, &left].into_iter().enumerate() {
                for (sum, ends) in sums.iter_mut().zip(BANDS.windows(2)) {
                    sum[which] += between(&signal[run.clone()], rate, [ends[1], ends[0]]);
                }
            }
        }
        sums
    };
    (0..data.dof()).map(of_joint).collect()
}
