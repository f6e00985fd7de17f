//! The error that no model can avoid.

use crate::logs::regression::Data;
use crate::logs::signal::Band;

/// What measurement noise alone would leave in the band, by joint, N·m.
///
/// Noise is seen where the motion is not: between neighbouring samples (second differences), and in the
/// octave above the band. Where the two disagree the noise is not white (a stiff servo's torque trembles
/// fast), and the smaller one is taken. Noise that is slower than the band is not seen this way, so the floor
/// is the lowest one that can be hoped for.
#[must_use]
pub fn noise_floor(data: &Data<'_>) -> Vec<f64> {
    let of_joint = |j: usize| {
        let torques: Vec<&[f64]> = data.recordings.iter().map(|r| r.torque[j].as_slice()).collect();
        noise_in_band(&torques, &data.joints[j].band, data.rate())
    };
    (0..data.dof()).map(of_joint).collect()
}

/// The same for one joint's torques along recordings of `rate` Hz.
pub(crate) fn noise_in_band(torques: &[&[f64]], band: &Band, rate: f64) -> f64 {
    let wider = Band::new(2.0 * band.cutoff, rate);
    let (share, between) = (band.white_share(rate), band.white_share_between(&wider, rate));
    let differences = torques.iter().flat_map(|tau| tau.windows(3)).map(|w| w[0] - 2.0 * w[1] + w[2]);
    // Second differences of white noise have six times its variance.
    let fast = deviation(differences.collect()) / 6f64.sqrt();
    if between < 1e-3 {
        return fast * share;
    }
    let above = torques.iter().flat_map(|tau| {
        let (wide, narrow) = (wider.filtered(tau), band.filtered(tau));
        let inner = band.trim..tau.len().saturating_sub(band.trim).max(band.trim);
        inner.map(|k| wide[k] - narrow[k]).collect::<Vec<f64>>()
    });
    fast.min(deviation(above.collect()) / between) * share
}

/// Standard deviation from the median of squares, which reversals and knocks do not move.
fn deviation(values: Vec<f64>) -> f64 {
    let mut squares: Vec<f64> = values.into_iter().map(|v| v * v).collect();
    if squares.is_empty() {
        return 0.0;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of χ² with one degree of freedom.
    (*median / 0.4549).sqrt()
}
