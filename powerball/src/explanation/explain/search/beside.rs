//! What is in the model from the start: which of it is needed once everything else is known.

use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::both_ways::Swapped;
use super::evidence::{Extent, Validation, evidence};
use super::groups::{Judge, Member};
use super::screen::Screen;
use crate::explanation::effects::Context;
use crate::identification::estimate::{Design, friction_columns};
use std::sync::OnceLock;

/// Takes out of the model what was in it from the start and is not needed, the weakest first, each judged
/// with everything else in the model.
pub(crate) fn keep_needed(study: &Study<'_>, model: &mut Model) {
    loop {
        let beside: Vec<usize> =
            (0..model.accepted.len()).filter(|k| is_beside(&model.accepted[*k])).collect();
        let judged: Vec<(usize, Option<Member>)> =
            beside.iter().map(|k| (*k, judged(study, model, *k, beside.len() as f64))).collect();
        let score = |m: &Option<Member>| m.as_ref().map_or(f64::NEG_INFINITY, |m| m.trial.score);
        let least = study.rule().least_score;
        let refused = judged.iter().filter(|(_, m)| m.as_ref().is_none_or(|m| m.trial.score < least));
        if std::env::var("DBG").is_ok() {
            for (k, m) in &judged {
                if let Some(m) = m {
                    let e = m.evidence.as_ref().unwrap();
                    eprintln!(
                        "{k} {:?} score {:.1} folds {:.2?} val {:.3} p {:.2e} {:?}",
                        m.candidate.joints,
                        m.trial.score,
                        e.fold_gains,
                        e.validation_gain,
                        e.p_value,
                        m.refusal
                    );
                }
            }
            eprintln!();
        }
        let Some((weakest, _)) = refused.min_by(|a, b| score(&a.1).total_cmp(&score(&b.1))) else {
            for (k, member) in judged {
                let Some(found) = member.and_then(|m| m.evidence) else { continue };
                model.accepted[k].p_value = (found.p_value * beside.len() as f64).min(1.0);
                model.accepted[k].fold_gain = found.median_gain();
            }
            return;
        };
        model.accepted.remove(*weakest);
        model.refit(study);
    }
}

/// Whether something was in the model from the start.
pub(crate) fn is_beside(accepted: &Accepted) -> bool {
    accepted.step.is_none()
}

/// What speaks for a part of the model, everything else refitted; `None` where it cannot be told from the
/// rest.
fn judged(study: &Study<'_>, model: &Model, k: usize, tests: f64) -> Option<Member> {
    let (candidate, own) = (&model.accepted[k].candidate, model.places()[k].clone());
    let coefficients = &model.coefficients()[k];
    let effect = candidate.effect();
    let mut residual = model.fit.residual.clone();
    let columns = effect.columns(&model.context(study), candidate);
    columns.iter().zip(coefficients).for_each(|(column, c)| column.add_to(&mut residual, *c));
    let context = Context::new(&study.data, &model.fit, &residual, study.rule());
    let screen = Screen::without(&context, own);
    let trial = screen.try_candidate(candidate)?;
    let all = model.columns_on_validation(study);
    let mut there = model.fit.residual_on(&study.validation, &all);
    let context = Context::for_columns(&study.validation, &model.fit, study.rule());
    let columns = effect.columns(&context, candidate);
    columns.iter().zip(coefficients).for_each(|(column, c)| column.add_to(&mut there, *c));
    let design =
        Design::new(&study.validation, &friction_columns(&study.validation, &model.fit.shapes), &all);
    let validation = Validation { data: &study.validation, design, residual: there };
    let set = Some((&validation, columns.as_slice()));
    let mut found = evidence(&screen, &trial, &candidate.joints, &study.folds, Extent::Everywhere, set);
    let without = || Swapped::new(study, model, Some(k));
    let judge = Judge { study, screen: &screen, tests, swapped: &OnceLock::new(), swap: &without };
    let refusal = judge.judge(candidate, &trial, &mut found);
    Some(Member { candidate: candidate.clone(), trial, evidence: Some(found), refusal, judged: true })
}
