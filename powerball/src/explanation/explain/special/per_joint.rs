//! On a repeated path: one multibody model for all joints (the joint fit), or inertial parameters for each
//! joint by itself (the per-joint fit, see [`Data::set_per_joint`]).
//!
//! [`Data::set_per_joint`]: crate::logs::regression::Data::set_per_joint

use super::super::model::Model;
use super::super::study::Study;

/// Whether the first model's squared errors on the validation set are clearly below the second's: the
/// geometric mean over all rows, which no joint's unit rules.
pub(crate) fn predicts_better(model: (&Study<'_>, &Model), rival: (&Study<'_>, &Model)) -> bool {
    let square = |(study, model): (&Study<'_>, &Model)| -> Vec<(f64, f64)> {
        let left = model.residual_on_validation(study);
        left.iter().map(|r| (r.len() as f64, r.iter().map(|e| e * e).sum::<f64>())).collect()
    };
    let (mut log_ratio, mut rows) = (0.0, 0.0);
    for ((n, own), (_, theirs)) in square(model).into_iter().zip(square(rival)) {
        if own > 0.0 && theirs > 0.0 {
            log_ratio += n * (own / theirs).ln();
            rows += n;
        }
    }
    log_ratio < rows * (1.0 - model.0.rule().clearly_better).ln()
}
