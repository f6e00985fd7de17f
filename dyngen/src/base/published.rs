//! The check of a published parameter set: exact or not, and the parameters that it loses.

use super::plain::{combination_text, unexamined};
use crate::arm::{Arm, Parameter};
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, Dependence, Unproven};
use crate::parameters::{ParameterSet, SetKind, SetParameter, minimal_coordinates};
use std::collections::BTreeMap;

/// The file's groupings as a set.
///
/// The sums are exact if and only if every combination of parameters that leaves all sums at zero also leaves
/// the torque at zero. Such combinations have a basis with one vector for each parameter that carries no sum
/// of its own; where that vector moves the torque, the parameter is lost.
pub(super) fn published_set(
    arm: &Arm,
    field: &ConstantField,
    minimal: &Dependence,
) -> Result<ParameterSet, Unproven> {
    let kept = arm.kept_parameters();
    // Parameters that occur in one sum only carry it best, so that most carriers are single parameters.
    let occurrences =
        |p: Parameter| arm.groupings.iter().filter(|g| g.terms.iter().any(|(q, _)| *q == p)).count();
    let mut order: Vec<Parameter> = kept.iter().copied().filter(|p| occurrences(*p) > 0).collect();
    order.sort_by_key(|p| (occurrences(*p), *p));
    let place: BTreeMap<Parameter, usize> = order.iter().enumerate().map(|(i, p)| (*p, i)).collect();

    // Columns of the grouping matrix, one for each parameter in the order of preference.
    let constant = |value: &crate::exact::rational::Rational| field.rational(value.clone());
    let mut columns: Vec<Vec<(usize, Constant)>> = vec![Vec::new(); order.len()];
    for (g, grouping) in arm.groupings.iter().enumerate() {
        for (parameter, coefficient) in &grouping.terms {
            if let Some(at) = place.get(parameter) {
                columns[*at].push((g, constant(coefficient)));
            }
        }
    }
    let grouping = elimination::dependence_of_columns(field, &columns, arm.groupings.len())?;
    let carriers = right_inverse(field, &columns, &grouping, arm.groupings.len()).ok_or(Unproven)?;

    let parameters = (arm.groupings.iter().zip(carriers))
        .map(|(g, carriers)| SetParameter {
            name: g.name.clone(),
            terms: g.terms.iter().map(|(p, c)| (*p, constant(c))).collect(),
            carriers: carriers.into_iter().map(|(at, c)| (order[at], c)).collect(),
        })
        .collect();
    let mut set = unexamined(SetKind::Published, parameters);
    set.lost = lost(arm, field, minimal, &order, &grouping);
    set.exact = set.lost.is_empty();
    Ok(set)
}

/// For each grouping, the carrier columns that reproduce it and no other: the inverse of the grouping matrix
/// on the kept columns. Groupings that depend on others (a repeated sum) have no carrier.
fn right_inverse(
    field: &ConstantField,
    columns: &[Vec<(usize, Constant)>],
    grouping: &Dependence,
    groupings: usize,
) -> Option<Vec<Vec<(usize, Constant)>>> {
    // Append a unit column for each grouping; its coordinates in the kept columns are the inverse's column.
    let mut extended: Vec<Vec<(usize, Constant)>> =
        grouping.kept.iter().map(|k| columns[*k].clone()).collect();
    let one = field.rational(crate::exact::rational::integer(1));
    extended.extend((0..groupings).map(|g| vec![(g, one.clone())]));
    let solved = elimination::dependence_of_columns(field, &extended, groupings).ok()?;
    let carried = grouping.kept.len();
    Some(
        (0..groupings)
            .map(|g| {
                let coordinates = &solved.coordinates[carried + g];
                let in_kept = coordinates.iter().filter(|(p, _)| solved.kept[*p] < carried);
                in_kept.map(|(p, c)| (grouping.kept[solved.kept[*p]], c.clone())).collect()
            })
            .collect(),
    )
}

fn lost(
    arm: &Arm,
    field: &ConstantField,
    minimal: &Dependence,
    order: &[Parameter],
    grouping: &Dependence,
) -> Vec<(Parameter, String)> {
    let one = field.rational(crate::exact::rational::integer(1));
    let mut lost = Vec::new();
    for parameter in arm.kept_parameters() {
        let at = order.iter().position(|p| *p == parameter);
        if at.is_some_and(|at| grouping.kept.contains(&at)) {
            continue;
        }
        // The replacement of the parameter in the sums; empty if no sum names it.
        let replacement: Vec<(Parameter, Constant)> = at
            .map(|at| {
                grouping.coordinates[at].iter().map(|(p, c)| (order[grouping.kept[*p]], c.clone())).collect()
            })
            .unwrap_or_default();
        let mut difference = vec![(parameter, one.clone())];
        difference.extend(replacement.iter().map(|(p, c)| (*p, field.neg(c))));
        if minimal_coordinates(field, minimal, &difference).is_empty() {
            continue;
        }
        let reason = if replacement.is_empty() {
            format!("{parameter} changes the torque, but is in no sum")
        } else {
            let instead = combination_text(field, &replacement);
            let ratio = arm.joints.get(parameter.link).and_then(|joint| joint.rotor_ratio.as_ref());
            let rotor = match (parameter.kind, ratio) {
                (crate::arm::ParameterKind::Im, Some(k)) => format!(
                    " (rotor {} has ratio k = {}; its coupling enters with k, its own inertia with k²)",
                    parameter.link + 1,
                    crate::exact::rational::to_text(k)
                ),
                _ => String::new(),
            };
            format!("the sums replace {parameter} by {instead}, which changes the torque differently{rotor}")
        };
        lost.push((parameter, reason));
    }
    lost
}
