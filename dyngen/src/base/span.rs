//! Sums of parameters as combinations of other sums: what one base set says of another one of the same arm.

use crate::arm::Parameter;

/// A linear combination of an arm's parameters, in numbers.
pub type Sum = Vec<(Parameter, f64)>;

/// Coefficients that differ by less than this share of the largest are the same.
const SAME: f64 = 1e-9;

/// Each of the `wanted` sums as a combination of the `given` ones, coefficient by coefficient in their order;
/// `None` where one of them is none. Every given sum must have a parameter that no other one has, as those of
/// a base set have: the column it was chosen for.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::base::SetKind;
    use crate::exact::rational::integer;
    use crate::model::Model;
    use crate::values::Values;

    /// What gravity in a general direction determines says what any gravity determines, for all values of all
    /// parameters; not the other way round.
    #[test]
    fn a_general_gravity_says_what_others_do() {
        let text = include_str!("../../../powerball/lwa4p.toml");
        let of = |gravity: [i64; 3]| {
            let mut arm = Arm::parse(text, "lwa4p.toml").unwrap();
            arm.gravity = gravity.map(integer);
            Model::derive(arm).unwrap()
        };
        let (general, upright) = (of([0, -5, -9]), of([0, 0, -9]));
        let sets = [&general, &upright].map(|m| m.set(SetKind::Minimal).unwrap());
        let sums = [general.sums(sets[0]), upright.sums(sets[1])];
        assert!(sums[0].len() > sums[1].len());
        let combined = combinations(&sums[1], &sums[0]).unwrap();
        let all: Vec<f64> = (0..66).map(|k| f64::from((37 * k + 11) % 101) / 50.0 - 1.0).collect();
        let [values, expected] = [general.set_values(sets[0], &all), upright.set_values(sets[1], &all)];
        for (row, expected) in combined.iter().zip(&expected) {
            let value: f64 = row.iter().zip(&values).map(|(c, v)| c * v).sum();
            assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0), "{value} {expected}");
        }
        assert_eq!(combinations(&sums[0], &sums[1]), None);

        // By their names alone, as from a file.
        let names = sets[0].names();
        let named = |skip: &str| {
            let pairs = names.iter().map(String::as_str).zip(values.iter().copied());
            Values::named(pairs.filter(|(name, _)| *name != skip), "identified.json")
        };
        let read = named("").of_set(&upright, sets[1]).unwrap();
        for (value, expected) in read.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0), "{value} {expected}");
        }
        let missing = named("mz2 + my3").of_set(&upright, sets[1]).unwrap_err().to_string();
        assert!(missing.contains("no value for Ixz2 + 7/20*mz2 + 7/20*my3"), "{missing}");
    }
}
