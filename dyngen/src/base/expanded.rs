//! The coefficients by expanding the Lagrangian: an independent reference for small arms.

use super::coefficients::{self, Sizes};
use crate::arm::{Arm, JointKind, Linkage};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::exact::elimination::SparseRow;
use crate::exact::polynomial::{Monomial, Numerator, Polynomial, PolynomialRing, Square};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, Source, joint_symbols};
use crate::lagrangian::linkage::BarTurns;
use crate::lagrangian::twice_lagrangian;
use std::collections::BTreeMap;

/// A variable of the Lagrangian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variable {
    Sin,
    Cos,
    Position,
    Velocity,
    A(usize),
    B(usize),
    D(usize),
    Ratio(usize),
    Coupling(usize),
    Gravity(usize),
    Symbol(usize, bool),
}

/// The Lagrangian as integer polynomials: L = ½ Σ column·π.
#[derive(Clone, Debug)]
pub(super) struct LagrangianPolynomials {
    variables: Vec<Variable>,
    /// The entries of transmissions' matrices, by the index in [`Variable::Coupling`].
    couplings: Vec<Rational>,
    columns: Vec<(usize, Polynomial<i64>)>,
}

/// Gives every quantity of the arm a variable of the ring.
struct Variables<'r> {
    ring: &'r PolynomialRing<i64>,
    variables: &'r [Variable],
    couplings: &'r [Rational],
    /// First variable of each joint's q.
    joints: &'r [usize],
}

impl Variables<'_> {
    fn of(&self, wanted: Variable) -> Polynomial<i64> {
        let index = self.variables.iter().position(|v| *v == wanted).unwrap_or_default();
        self.ring.variable(index)
    }
}

impl Source<Polynomial<i64>> for Variables<'_> {
    fn joint_trig(&mut self, joint: usize) -> (Polynomial<i64>, Polynomial<i64>) {
        let first = self.joints[joint];
        (self.ring.variable(first), self.ring.variable(first + 1))
    }
    fn position(&mut self, joint: usize) -> Polynomial<i64> {
        self.ring.variable(self.joints[joint])
    }
    fn velocity(&mut self, joint: usize) -> Polynomial<i64> {
        let first = self.joints[joint];
        let width = if self.variables[first] == Variable::Position { 1 } else { 2 };
        self.ring.variable(first + width)
    }
    fn a(&mut self, joint: usize) -> Polynomial<i64> {
        self.of(Variable::A(joint))
    }
    fn b(&mut self, joint: usize) -> Polynomial<i64> {
        self.of(Variable::B(joint))
    }
    fn d(&mut self, joint: usize) -> Polynomial<i64> {
        self.of(Variable::D(joint))
    }
    fn ratio(&mut self, joint: usize) -> Polynomial<i64> {
        self.of(Variable::Ratio(joint))
    }
    fn exact(&mut self, value: &Rational) -> Polynomial<i64> {
        let place = self.couplings.iter().position(|c| c == value);
        self.of(Variable::Coupling(place.unwrap_or_default()))
    }
    fn linkage(&mut self, _: &Linkage) -> Option<BarTurns<Polynomial<i64>>> {
        None
    }
    fn gravity(&mut self, axis: usize) -> Polynomial<i64> {
        self.of(Variable::Gravity(axis))
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Polynomial<i64> {
        self.of(Variable::Symbol(index, sine))
    }
}

impl LagrangianPolynomials {
    /// Derives the Lagrangian of an arm, for all its parameters whether declared zero or not.
    ///
    /// The angle of a revolute joint is q + theta: a constant shift of q changes no relation.
    pub(super) fn derive(arm: &Arm, symbols: &AngleSymbols) -> Self {
        let mut variables = Vec::new();
        let mut squares = Vec::new();
        let mut joints = Vec::new();
        for joint in &arm.joints {
            joints.push(variables.len());
            match joint.kind {
                JointKind::Revolute => {
                    squares.push(Square::OneMinusSquare(variables.len() + 1));
                    variables.extend([Variable::Sin, Variable::Cos]);
                }
                JointKind::Prismatic => variables.push(Variable::Position),
            }
            variables.push(Variable::Velocity);
            squares.resize(variables.len(), Square::Free);
        }
        for i in 0..arm.dof() {
            variables.extend([Variable::A(i), Variable::B(i), Variable::D(i), Variable::Ratio(i)]);
        }
        let rows = (0..arm.dof()).filter_map(|motor| arm.coupled_motor(motor));
        let couplings: Vec<Rational> = rows.flatten().map(|(_, factor)| factor).collect();
        variables.extend((0..couplings.len()).map(Variable::Coupling));
        variables.extend([0, 1, 2].map(Variable::Gravity));
        squares.resize(variables.len(), Square::Free);
        for index in 0..joint_symbols(arm) {
            squares.push(Square::OneMinusSquare(squares.len() + 1));
            squares.push(Square::Free);
            variables.extend([Variable::Symbol(index, true), Variable::Symbol(index, false)]);
        }
        let ring = PolynomialRing::new(squares);
        let mut source =
            Variables { ring: &ring, variables: &variables, couplings: &couplings, joints: &joints };
        let elements = ArmElements::build(&ring, arm, symbols, &mut source);
        let all = arm.all_parameters();
        let columns = (all.into_iter().zip(twice_lagrangian(&ring, &elements)))
            .filter(|(_, column)| !ring.is_zero(column))
            .map(|(p, column)| (p.index(), column))
            .collect();
        LagrangianPolynomials { variables, couplings, columns }
    }

    /// The rows: for each function of q and q̇ (and of the sizes, where they are variables) its coefficient
    /// in the columns of the parameters that the arm keeps. Constants, which change no torque, are left out;
    /// there are no total time derivatives, because every other term is of degree 0 or 2 in the velocities.
    pub(super) fn rows(&self, arm: &Arm, field: &ConstantField, sizes: Sizes) -> Vec<SparseRow> {
        let mut rows: BTreeMap<Monomial, BTreeMap<usize, Numerator>> = BTreeMap::new();
        // The same products of constants stand before many functions.
        let mut products: BTreeMap<Monomial, Numerator> = BTreeMap::new();
        let ring = field.ring();
        let all = arm.all_parameters();
        for (column, polynomial) in self.columns.iter().filter(|(c, _)| arm.keeps(all[*c])) {
            for (monomial, coefficient) in polynomial.terms() {
                let (function, constants) = self.split(sizes, monomial);
                if self.is_constant(&function) {
                    continue;
                }
                let product =
                    products.entry(constants).or_insert_with(|| self.product(arm, field, &constants));
                let term = ring.mul(&ring.integer(*coefficient), product);
                let entry = rows.entry(function).or_default().entry(*column);
                let sum = entry.or_insert_with(|| ring.integer(0));
                *sum = ring.add(sum, &term);
            }
        }
        let nonzero = |row: BTreeMap<usize, Numerator>| -> SparseRow {
            row.into_iter().filter(|(_, value)| !value.terms().is_empty()).collect()
        };
        let mut rows: Vec<SparseRow> = rows.into_values().map(nonzero).filter(|r| !r.is_empty()).collect();
        // Many functions come with the same coefficients; one row of each says all.
        rows.sort_by_cached_key(row_key);
        rows.dedup();
        rows
    }

    /// Whether a function holds neither q nor q̇.
    fn is_constant(&self, function: &Monomial) -> bool {
        !function.powers().any(|(v, _)| {
            matches!(
                self.variables[v],
                Variable::Sin | Variable::Cos | Variable::Position | Variable::Velocity
            )
        })
    }

    /// Splits a monomial into the function it is and the constants that it multiplies.
    fn split(&self, sizes: Sizes, monomial: &Monomial) -> (Monomial, Monomial) {
        let (mut function, mut constants) = (*monomial, Monomial::default());
        for (v, exponent) in monomial.powers() {
            let constant = match self.variables[v] {
                Variable::Coupling(_) | Variable::Gravity(_) | Variable::Symbol(..) => true,
                Variable::A(_) | Variable::B(_) | Variable::D(_) | Variable::Ratio(_) => {
                    sizes == Sizes::Numbers
                }
                _ => false,
            };
            if constant {
                function = function.with(v, 0);
                constants = constants.with(v, exponent);
            }
        }
        (function, constants)
    }

    /// The value of a product of constants. A column with a ratio exists only where its joint has a rotor.
    fn product(&self, arm: &Arm, field: &ConstantField, constants: &Monomial) -> Numerator {
        let ring = field.ring();
        let mut product = ring.integer(1);
        for (v, exponent) in constants.powers() {
            let number = |value: &Rational| ring.constant(value.clone());
            let value = match self.variables[v] {
                Variable::Coupling(i) => number(&self.couplings[i]),
                Variable::Gravity(axis) => number(&arm.gravity[axis]),
                Variable::Symbol(index, sine) => field.symbol(index, sine).clone(),
                Variable::A(i) => number(&arm.joints[i].a),
                Variable::B(i) => number(&arm.joints[i].b),
                Variable::D(i) => number(&arm.joints[i].d),
                Variable::Ratio(i) => arm.joints[i].rotor_ratio.as_ref().map_or(ring.integer(1), number),
                _ => continue,
            };
            for _ in 0..exponent {
                product = ring.mul(&product, &value);
            }
        }
        product
    }
}

/// An order on rows that equal rows share.
fn row_key(row: &SparseRow) -> Vec<(usize, Vec<(Monomial, Rational)>)> {
    row.iter().map(|(c, n)| (*c, n.terms().to_vec())).collect()
}

/// Columns depend in the same way, whichever rows are used: for known arms, arms with every kind of
/// twist, with sliding joints, tilted gravity and rotors.
#[test]
fn the_rows_span_those_of_the_expanded_lagrangian() {
    use super::preference::Preference;
    use crate::exact::elimination;
    use crate::exact::prime::Draws;
    use crate::lagrangian::elements::angle_symbols;

    let mut texts: Vec<String> = [
        include_str!("../../../tests/arms/twist.toml"),
        include_str!("../../../tests/arms/planar2r.toml"),
        include_str!("../../../tests/arms/pendulum.toml"),
        include_str!("../../../tests/arms/scara.toml"),
        include_str!("../../../tests/arms/stanford.toml"),
        include_str!("../../../powerball/lwa4p.toml"),
    ]
    .map(str::to_string)
    .to_vec();
    let mut draws = Draws::new(19);
    let mut pick = |count: usize| (draws.element().residue() % count as u64) as usize;
    for _ in 0..60 {
        let mut text = format!(
            "name = \"random\"\nconvention = \"{}\"\ngravity = {}\n",
            ["standard", "modified"][pick(2)],
            ["[0, 0, -9.81]", "[0, 0, 0]", "[1.5, 0, -3]", "[0, 2, 0]"][pick(4)]
        );
        let joints = 1 + pick(3);
        for _ in 0..joints {
            text += &format!(
                "[[joint]]\nkind = \"{}\"\na = {}\nalpha = {}\nd = {}\ntheta = {}\n{}{}{}",
                ["revolute", "revolute", "prismatic"][pick(3)],
                ["0", "0", "0.3", "-0.45"][pick(4)],
                ["0", "\"pi\"", "\"pi/2\"", "\"-pi/2\"", "\"pi/4\"", "\"pi/6\"", "0.3", "1.1"][pick(8)],
                ["0", "0", "0.2", "0.7"][pick(4)],
                ["0", "\"pi/2\"", "0.4"][pick(3)],
                ["", "rotor_ratio = 50\n"][pick(2)],
                ["", "zero = [\"my\", \"Ixy\"]\n"][pick(2)],
                ["", "b = 0.15\n", ""][pick(3)],
            );
        }
        if joints == 3 {
            let (blocks, matrices) = match pick(2) {
                0 => (
                    ["[1, 2]", "[3, 1]", "[3, 2]"],
                    ["[[1, 0], [1, 1]]", "[[1, 1], [0, 1]]", "[[0, 1], [1, 0]]", "[[2, \"1/3\"], [-1, 1]]"],
                ),
                _ => (
                    ["[1, 2, 3]", "[3, 1, 2]", "[2, 1, 3]"],
                    [
                        "[[1, 0, 0], [1, 1, 0], [0, -1, 1]]",
                        "[[0, 1, 0], [0, 0, 1], [1, 0, 0]]",
                        "[[1, 1, 1], [0, 2, 1], [0, 0, 1]]",
                        "[[1, 0, 0], [0, 3, 0], [0, 0, -1]]",
                    ],
                ),
            };
            let (block, matrix) = (blocks[pick(3)], matrices[pick(4)]);
            text += &format!("[[transmission]]\njoints = {block}\nmatrix = {matrix}\n");
        }
        texts.push(text);
    }
    for text in &texts {
        let arm = Arm::parse(text, "arm.toml").unwrap();
        let symbols = angle_symbols(&arm);
        let field = ConstantField::new(&symbols, joint_symbols(&arm), &mut Draws::new(5));
        let expanded = LagrangianPolynomials::derive(&arm, &symbols);
        let order: Vec<usize> = Preference::ALL[0].order(&arm).iter().map(|p| p.index()).collect();
        for sizes in [Sizes::Numbers, Sizes::Variables] {
            let depend =
                |rows: &[SparseRow]| elimination::dependence(&field, rows, arm.dof() * 11, &order).unwrap();
            let long = depend(&expanded.rows(&arm, &field, sizes));
            let rows = coefficients::all_rows(&arm, &symbols, &field, sizes).unwrap();
            let short = depend(&coefficients::kept(&arm, &rows));
            assert_eq!(short.kept, long.kept, "{sizes:?}\n{text}");
            assert_eq!(short.coordinates, long.coordinates, "{sizes:?}\n{text}");
        }
    }
}
