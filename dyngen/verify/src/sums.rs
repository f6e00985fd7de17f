//! The names of parameters as the sums that they say: what a file calls a parameter is what is proven of it.

use crate::angles::{Circle, residue};
use crate::matrix::reduce;
use dyngen_arm::arm::{Arm, Parameter};
use dyngen_arm::exact::prime::Fp;
use dyngen_arm::exact::rational::parse_rational;

/// A number, then what each parameter of the arm is multiplied by.
type Linear = Vec<Fp>;

/// The factors of all the arm's parameters in the sum that a name stands for; nothing where it is no sum of
/// them.
pub(crate) fn of_name(name: &str, arm: &Arm, circle: &Circle) -> Option<Vec<Fp>> {
    let width = 1 + 11 * arm.bodies();
    if let Some(grouping) = arm.groupings.iter().find(|grouping| grouping.name == name) {
        let mut sum = vec![Fp::ZERO; width - 1];
        grouping.terms.iter().for_each(|(parameter, factor)| sum[parameter.index()] = residue(factor));
        return Some(sum);
    }
    let mut reader = Reader { rest: name, width, circle };
    let mut sum = reader.sum()?;
    let number = sum.remove(0);
    (reader.rest.is_empty() && number == Fp::ZERO).then_some(sum)
}

struct Reader<'a> {
    rest: &'a str,
    width: usize,
    circle: &'a Circle,
}

impl Reader<'_> {
    fn takes(&mut self, text: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(text);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// What stands before any of some characters.
    fn until(&mut self, ends: &[char]) -> &str {
        let text = self.rest.trim_start();
        let (word, rest) = text.split_at(text.find(ends).unwrap_or(text.len()));
        self.rest = rest;
        word
    }

    fn sum(&mut self) -> Option<Linear> {
        let mut sum = self.signed(false)?;
        loop {
            let minus = if self.takes("+") {
                false
            } else if self.takes("-") {
                true
            } else {
                return Some(sum);
            };
            sum = sum.into_iter().zip(self.signed(minus)?).map(|(x, y)| x + y).collect();
        }
    }

    fn signed(&mut self, minus: bool) -> Option<Linear> {
        let minus = self.takes("-") != minus;
        let product = self.product()?;
        Some(if minus { product.into_iter().map(|x| -x).collect() } else { product })
    }

    fn product(&mut self) -> Option<Linear> {
        let is_number = |x: &Linear| x[1..].iter().all(|x| *x == Fp::ZERO);
        let mut product = self.power()?;
        loop {
            if self.takes("*") {
                let other = self.power()?;
                let (number, linear) = match (is_number(&product), is_number(&other)) {
                    (true, _) => (product[0], other),
                    (_, true) => (other[0], product),
                    _ => return None,
                };
                product = linear.into_iter().map(|x| x * number).collect();
            } else if self.takes("/") {
                let inverse = self.power().filter(is_number)?[0].inverse()?;
                product = product.into_iter().map(|x| x * inverse).collect();
            } else {
                return Some(product);
            }
        }
    }

    fn power(&mut self) -> Option<Linear> {
        let mut base = self.atom()?;
        if self.takes("^") {
            let exponent = self.until(&['*', '/', '+', '-', ')', ' ']).parse().ok()?;
            if base[1..].iter().any(|x| *x != Fp::ZERO) {
                return None;
            }
            base[0] = base[0].power(exponent);
        }
        Some(base)
    }

    fn atom(&mut self) -> Option<Linear> {
        let mut linear = vec![Fp::ZERO; self.width];
        for (function, sine) in [("sin(", true), ("cos(", false)] {
            if self.takes(function) {
                let angle = self.until(&[')']).to_string();
                linear[0] = self.circle.constant(self.circle.constant_named(&angle)?, sine)?;
                return self.takes(")").then_some(linear);
            }
        }
        if self.takes("(") {
            let inner = self.sum()?;
            return self.takes(")").then_some(inner);
        }
        let bodies = self.width / 11;
        let word = self.until(&['*', '/', '+', '-', ')', '^', ' ']);
        match Parameter::parse(word) {
            Some(parameter) if parameter.link >= bodies => return None,
            Some(parameter) => *linear.get_mut(1 + parameter.index())? = Fp::ONE,
            None => linear[0] = residue(&parse_rational(word).ok()?),
        }
        Some(linear)
    }
}

/// Values of all parameters for which some sums have given values; the other parameters keep theirs.
pub(crate) fn with_sums(sums: &[Vec<Fp>], wanted: &[Fp], values: &[Fp]) -> Option<Vec<Fp>> {
    let columns = values.len();
    let mut rows: Vec<Vec<Fp>> =
        sums.iter().zip(wanted).map(|(sum, x)| sum.iter().chain([x]).copied().collect()).collect();
    let pivots = reduce(&mut rows, columns);
    // Two sums of which one is a multiple of the other have no values of their own.
    if pivots.len() < rows.len() {
        return None;
    }
    let mut found = values.to_vec();
    for (row, pivot) in rows.iter().zip(&pivots) {
        let others = (0..columns).filter(|k| !pivots.contains(k));
        found[*pivot] = others.fold(row[columns], |rest, k| rest - row[k] * values[k]);
    }
    Some(found)
}
