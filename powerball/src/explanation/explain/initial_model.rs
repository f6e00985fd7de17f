//! The model that the search begins with.

use super::model::Model;
use super::search::CrossValidation;
use super::study::Study;
use crate::identification::estimate::Fit;

/// The base model, with what every arm may have where this one shows it plainly (see
/// [`Effect::baseline`](crate::explanation::effects::Effect::beside)): every effect is then judged beside that.
pub(super) fn initial_model<'a>(base: Fit, study: &Study<'a>) -> Model {
    let plain = Model::new(base);
    // Per-joint fits have an offset already.
    if study.data.per_joint {
        return plain;
    }
    let with = plain.baseline(study);
    if is_plainly_better(&with, &plain, study) { with } else { plain }
}

/// Whether several joints are predicted much better than by another model, on logs that took no part in the
/// fit, both ways round.
fn is_plainly_better(model: &Model, other: &Model, study: &Study<'_>) -> bool {
    let square =
        |left: &[Vec<f64>]| -> Vec<f64> { left.iter().map(|r| r.iter().map(|e| e * e).sum()).collect() };
    let errors = |model: &Model| {
        let back = CrossValidation::new(study, model, None);
        [square(&model.residual_on_validation(study)), square(back.residual())]
    };
    let ([ours, back], [theirs, their_back]) = (errors(model), errors(other));
    let moving: Vec<usize> = (0..study.data.dof()).filter(|j| theirs[*j] > 0.0).collect();
    let least = 1.0 - study.rule().large_gain;
    let better = |j: &&usize| ours[**j] < least * theirs[**j] && back[**j] < least * their_back[**j];
    // One joint alone is looked at like any other effect.
    moving.iter().filter(better).count() >= study.rule().joints_with_zeros.min(moving.len()).max(1)
}
