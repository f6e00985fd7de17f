//! Sets before their rank is known, and sums of parameters as text.

use crate::arm::sum::sum_text;
use crate::arm::{Arm, Parameter};
use crate::exact::constant::{Constant, ConstantField};
use crate::parameters::{ParameterSet, SetKind, SetParameter};

pub(super) fn full_set(arm: &Arm, field: &ConstantField) -> ParameterSet {
    let one = field.rational(crate::exact::rational::integer(1));
    let parameters = arm
        .kept_parameters()
        .into_iter()
        .map(|p| SetParameter {
            name: p.to_string(),
            terms: vec![(p, one.clone())],
            carriers: vec![(p, one.clone())],
        })
        .collect();
    unexamined(SetKind::Full, parameters)
}

pub(super) fn unexamined(kind: SetKind, parameters: Vec<SetParameter>) -> ParameterSet {
    ParameterSet { kind, parameters, rank: 0, relations: Vec::new(), exact: true, lost: Vec::new() }
}

/// The text of a combination: `Ixx2 - Iyy2 + 49/400*m3`; coefficients with symbols stand in parentheses.
pub fn combination_text(field: &ConstantField, terms: &[(Parameter, Constant)]) -> String {
    named_combination_text(field, terms.iter().map(|(p, c)| (p.to_string(), c)))
}

pub(super) fn named_combination_text<'a>(
    field: &ConstantField,
    terms: impl IntoIterator<Item = (String, &'a Constant)>,
) -> String {
    let one = crate::exact::rational::integer(1);
    let terms: Vec<(String, crate::exact::rational::Rational)> = terms
        .into_iter()
        .map(|(name, c)| match c.as_rational() {
            Some(value) => (name, value),
            None => (format!("({})*{name}", field.text(c)), one.clone()),
        })
        .collect();
    sum_text(terms.iter().map(|(name, value)| (name, value)))
}
