//! The bands in which logs speak of a model, joint by joint.
//!
//! Logs are reduced in bands an octave apart ([`Bands`]). In the spectrum of a joint's torque the model's
//! part sinks under what it leaves at some frequency; from there on rows show noise, or what no rigid arm
//! does. Each log says by itself where that is, with a fit of its own; the powers are added over logs, so
//! that summaries say it too. A joint whose model is below what it leaves in an octave is fitted, and judged,
//! in the band below that octave. Rows of a joint are filtered by themselves, so the other joints keep
//! theirs.

use super::design::Design;
use super::fit::{Fit, friction_columns};
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
    let bands: Vec<usize> =
        reduced.spectrum().iter().map(|octaves| quiet_octaves(&octaves[..narrower])).collect();
    InBand { solution: solve_reduced(&reduced.of_joints(&bands), law), bands }
}

/// How many octaves below the widest band hold less of a model than of what it leaves.
fn quiet_octaves(octaves: &[[f64; 2]]) -> usize {
    octaves.iter().take_while(|[model, left]| model < left).count()
}

/// Which of [`BANDS`] a fit of the widest asks for, by joint.
#[must_use]
pub fn bands_of(data: &Data<'_>, fit: &Fit) -> Vec<usize> {
    spectrum(data, &fit.shapes, &fit.theta).iter().map(|octaves| quiet_octaves(octaves)).collect()
}

/// Reduces one log in all bands, and takes the spectrum of its first part. Also gives what was left out of
/// it, in words.
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
    // Some minutes say where a spectrum sinks.
    let first = parts(log).into_iter().find_map(|part| Data::new(body, &[part], &widest).ok());
    if let Some(data) = first {
        bands.set_spectrum(&spectrum(&data, &own.shapes, &own.theta));
    }
    Ok((bands, notes))
}

/// By joint and octave between neighbouring bands: the power of the model's torque, and of what it leaves.
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
