//! Graph against Lagrangian: every function, exactly, at random points of a 61-bit prime field.
//!
//! The Lagrangian is evaluated over jets, which gives the Euler–Lagrange equations without any recursion. A
//! wrong formula is a polynomial that is not zero; with degrees below 100 it vanishes at one random point with
//! probability below 2⁻⁵⁴, and at both points with probability below 2⁻¹⁰⁸.

mod point;

use crate::arm::Arm;
use crate::base::sets::{ParameterSet, Sets};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::prime::{Draws, Fp};
use crate::exact::symbols::AngleSymbols;
use point::Point;
use std::fmt;

/// Random points for each function.
pub const POINTS: usize = 2;

/// A function that does not agree with the Lagrangian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// Which function.
    pub function: Function,
    /// Row and column of the first result that differs, from 0.
    pub entry: (usize, usize),
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (row, column) = self.entry;
        write!(
            f,
            "{} does not agree with the Lagrangian of the arm (row {}, column {}): nothing is written",
            self.function,
            row + 1,
            column + 1
        )
    }
}

impl std::error::Error for Disagreement {}

/// Proves a function of an arm for a parameter set against the Lagrangian with all the arm's parameters.
///
/// # Errors
/// The first result that differs.
pub fn prove(
    arm: &Arm,
    symbols: &AngleSymbols,
    sets: &Sets,
    set: &ParameterSet,
    function: &FunctionGraph,
) -> Result<(), Disagreement> {
    // The seed is fixed: a proof that passed passes again, on every machine.
    let mut draws = Draws::new(0x7072_6f6f_66);
    for _ in 0..POINTS {
        let point = Point::draw(arm, symbols, sets, &mut draws);
        let expected = expected(&point, set, function.function);
        let actual = point.evaluate(set, function);
        let same = |(i, value): (usize, &Fp)| actual.as_ref().is_some_and(|a| a[i] == *value);
        if let Some(wrong) = expected.iter().enumerate().position(|pair| !same(pair)) {
            let columns = function.shape.1;
            return Err(Disagreement {
                function: function.function,
                entry: (wrong / columns, wrong % columns),
            });
        }
    }
    Ok(())
}

/// What the Lagrangian says the function's result must be, row-major.
fn expected(point: &Point<'_>, set: &ParameterSet, function: Function) -> Vec<Fp> {
    let n = point.dof();
    let zeros = vec![Fp::ZERO; n];
    match function {
        Function::InverseDynamics => point.torques(&point.speeds, &point.accelerations, true),
        Function::Regressor => point.regressor_of_set(set),
        Function::MassMatrix => {
            let columns: Vec<Vec<Fp>> = (0..n).map(|j| point.torques(&zeros, &unit(n, j), false)).collect();
            transpose(&columns)
        }
        Function::CoriolisMatrix => {
            // The velocity terms are h(v) = Σ c_ijk vⱼ vₖ with Christoffel symbols that are symmetric in j and
            // k, so polarisation gives the matrix: C·eⱼ = ½(h(q̇ + eⱼ) − h(q̇) − h(eⱼ)).
            let half = Fp::from_integer(2).inverse().unwrap_or(Fp::ONE);
            let h = |v: &[Fp]| point.torques(v, &zeros, false);
            let own = h(&point.speeds);
            let columns: Vec<Vec<Fp>> = (0..n)
                .map(|j| {
                    let e = unit(n, j);
                    let sum: Vec<Fp> = point.speeds.iter().zip(&e).map(|(a, b)| *a + *b).collect();
                    let (both, alone) = (h(&sum), h(&e));
                    (0..n).map(|i| half * (both[i] - own[i] - alone[i])).collect()
                })
                .collect();
            transpose(&columns)
        }
        Function::Gravity => point.torques(&zeros, &zeros, true),
        Function::ForwardDynamics => point.accelerations.clone(),
        Function::ForwardKinematics => point.pose(),
    }
}

fn unit(n: usize, j: usize) -> Vec<Fp> {
    (0..n).map(|i| if i == j { Fp::ONE } else { Fp::ZERO }).collect()
}

fn transpose(columns: &[Vec<Fp>]) -> Vec<Fp> {
    let rows = columns.first().map_or(0, Vec::len);
    (0..rows).flat_map(|i| columns.iter().map(move |c| c[i])).collect()
}
