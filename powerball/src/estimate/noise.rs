//! The error that no model can avoid.

use crate::regression::Data;

/// What white measurement noise would leave in the band, by joint, N·m.
///
/// From second differences of the torque as sampled: what varies from one sample to the next is noise. Coloured noise
/// is not seen this way, so the floor is the lowest one that can be hoped for.
#[must_use]
pub fn noise_floor(data: &Data<'_>) -> Vec<f64> {
    let share = data.band.white_share(data.rate());
    (0..data.dof())
        .map(|j| {
            let mut squares: Vec<f64> = data
                .recordings
                .iter()
                .flat_map(|r| r.torque[j].windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2)))
                .collect();
            if squares.is_empty() {
                return 0.0;
            }
            let middle = squares.len() / 2;
            let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
            // The median of χ² with one degree of freedom is 0.4549; second differences have 6 times the variance.
            (*median / 0.4549 / 6.0).sqrt() * share
        })
        .collect()
}
