//! Sums of parameters as combinations of other sums: the parameters of one base set from those of another one
//! of the same arm.

use crate::arm::Parameter;

/// A linear combination of an arm's parameters, in numbers.
pub type Sum = Vec<(Parameter, f64)>;

/// Coefficients that differ by less than this share of the largest are the same.
const SAME: f64 = 1e-9;

/// Each of the `wanted` sums as a combination of the `given` ones, coefficient by coefficient in their order;
/// `None` if one of them is not such a combination. Every given sum must have a parameter that no other one
/// has, as those of a base set have: the column it was chosen for.
#[must_use]
pub fn combinations(wanted: &[Sum], given: &[Sum]) -> Option<Vec<Vec<f64>>> {
    let own: Vec<(Parameter, f64)> = given
        .iter()
        .enumerate()
        .map(|(k, sum)| {
            let elsewhere = |p: &Parameter| {
                let others = given.iter().enumerate().filter(|(other, _)| *other != k);
                others.flat_map(|(_, sum)| sum).any(|(q, _)| q == p)
            };
            sum.iter().find(|(p, c)| *c != 0.0 && !elsewhere(p)).copied()
        })
        .collect::<Option<_>>()?;
    let of = |sum: &Sum| -> Option<Vec<f64>> {
        let at = |sum: &Sum, p: Parameter| sum.iter().filter(|(q, _)| *q == p).map(|(_, c)| c).sum::<f64>();
        let factors: Vec<f64> = own.iter().map(|(p, c)| at(sum, *p) / c).collect();
        let used = || given.iter().zip(&factors).filter(|(_, f)| **f != 0.0);
        let parameters = used().flat_map(|(sum, _)| sum).chain(sum).map(|(p, _)| *p);
        let largest = sum.iter().fold(0.0f64, |m, (_, c)| m.max(c.abs()));
        let holds = |p: Parameter| {
            let made: f64 = used().map(|(sum, f)| f * at(sum, p)).sum();
            (made - at(sum, p)).abs() <= SAME * largest
        };
        let all = parameters.into_iter().all(holds);
        all.then_some(factors)
    };
    wanted.iter().map(of).collect()
}
