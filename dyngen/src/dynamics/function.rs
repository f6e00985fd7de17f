//! The functions of an arm, each built as a graph.

use super::body::links;
use super::elements::{ArmElements, Source};
use super::{composite, coriolis, forward, inverse, pose, regressor};
use crate::arm::Arm;
use crate::base::ParameterSet;
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::exact::symbols::AngleSymbols;
use crate::graph::{Builder, Expr, Graph, Input};
use std::fmt;

/// A function of the arm's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Function {
    /// τ(q, q̇, q̈) = B·q̈ + C·q̇ + g
    InverseDynamics,
    /// Y(q, q̇, q̈), n × p
    Regressor,
    /// B(q), n × n
    MassMatrix,
    /// C(q, q̇), n × n, of Christoffel symbols
    CoriolisMatrix,
    /// g(q)
    Gravity,
    /// q̈(q, q̇, τ)
    ForwardDynamics,
    /// Homogeneous transform of the last frame to the base, 4 × 4
    ForwardKinematics,
}

impl Function {
    /// All of them, in the order in which they are emitted.
    pub const ALL: [Function; 7] = {
        use Function::*;
        [InverseDynamics, Regressor, MassMatrix, CoriolisMatrix, Gravity, ForwardDynamics, ForwardKinematics]
    };

    /// The name on the command line and in the emitted code.
    pub fn name(self) -> &'static str {
        match self {
            Function::InverseDynamics => "inverse_dynamics",
            Function::Regressor => "regressor",
            Function::MassMatrix => "mass_matrix",
            Function::CoriolisMatrix => "coriolis_matrix",
            Function::Gravity => "gravity",
            Function::ForwardDynamics => "forward_dynamics",
            Function::ForwardKinematics => "forward_kinematics",
        }
    }

    /// The function of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// Rows and columns of the result for n joints and p parameters.
    pub fn shape(self, n: usize, p: usize) -> (usize, usize) {
        match self {
            Function::Regressor => (n, p),
            Function::MassMatrix | Function::CoriolisMatrix => (n, n),
            Function::ForwardKinematics => (4, 4),
            _ => (n, 1),
        }
    }

    /// Whether the result depends on parameter values.
    pub fn takes_parameters(self) -> bool {
        !matches!(self, Function::Regressor | Function::ForwardKinematics)
    }

    /// Whether it depends on q̇.
    pub fn takes_speeds(self) -> bool {
        !matches!(self, Function::MassMatrix | Function::Gravity | Function::ForwardKinematics)
    }

    /// Whether it depends on q̈.
    pub fn takes_accelerations(self) -> bool {
        matches!(self, Function::InverseDynamics | Function::Regressor)
    }

    /// Whether it depends on τ.
    pub fn takes_torques(self) -> bool {
        self == Function::ForwardDynamics
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A function as expressions.
#[derive(Clone, Debug)]
pub struct FunctionGraph {
    /// Which function.
    pub function: Function,
    /// The expressions.
    pub graph: Graph,
    /// The result, row-major.
    pub outputs: Vec<Expr>,
    /// Its rows and columns.
    pub shape: (usize, usize),
}

/// Builds a function of an arm for a parameter set.
pub fn build(
    function: Function,
    arm: &Arm,
    symbols: &AngleSymbols,
    set: &ParameterSet,
    field: &ConstantField,
) -> FunctionGraph {
    let b = Builder::new();
    let n = arm.dof();
    let elements = ArmElements::build(&b, arm, symbols, &mut Inputs { b: &b, arm });
    let links = links(&b, arm, set, field);
    let input = |of: fn(usize) -> Input| -> Vec<Expr> { (0..n).map(|i| b.input(of(i))).collect() };
    let none = vec![Expr::ZERO; n];
    let outputs = match function {
        Function::InverseDynamics => {
            inverse::inverse_dynamics(&b, &elements, &links, &input(Input::Acceleration), true)
        }
        Function::Regressor => {
            regressor::regressor(&b, arm, &elements, set, field, &input(Input::Acceleration))
        }
        Function::MassMatrix => composite::mass_matrix(&b, &elements, &links),
        Function::CoriolisMatrix => coriolis::coriolis_matrix(&b, &elements, &links),
        Function::Gravity => inverse::gravity(&b, &elements, &links),
        Function::ForwardDynamics => {
            let bias = inverse::inverse_dynamics(&b, &elements, &links, &none, true);
            let right: Vec<Expr> = input(Input::Torque).iter().zip(&bias).map(|(t, c)| b.sub(t, c)).collect();
            forward::solve_symmetric(&b, &composite::mass_matrix(&b, &elements, &links), &right)
        }
        Function::ForwardKinematics => pose::forward_kinematics(&b, &elements),
    };
    let shape = function.shape(n, set.parameters.len());
    FunctionGraph { function, graph: b.finish(), outputs, shape }
}

/// The arm's quantities as inputs and constants of a graph.
struct Inputs<'a> {
    b: &'a Builder,
    arm: &'a Arm,
}

impl Source<Expr> for Inputs<'_> {
    fn joint_trig(&mut self, joint: usize) -> (Expr, Expr) {
        let (s, c) = (self.b.input(Input::Sin(joint)), self.b.input(Input::Cos(joint)));
        // A constant of quarter turns only swaps and signs; any other is added to the angle itself.
        match self.arm.joints[joint].theta.quarter_turns() {
            Some(1) => (c, -s),
            Some(2) => (-s, -c),
            Some(3) => (-c, s),
            _ => (s, c),
        }
    }
    fn position(&mut self, joint: usize) -> Expr {
        self.b.input(Input::Position(joint))
    }
    fn speed(&mut self, joint: usize) -> Expr {
        self.b.input(Input::Speed(joint))
    }
    fn a(&mut self, joint: usize) -> Expr {
        self.b.constant(&self.arm.joints[joint].a)
    }
    fn d(&mut self, joint: usize) -> Expr {
        self.b.constant(&self.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Expr {
        self.arm.joints[joint].rotor_ratio.as_ref().map_or(Expr::ZERO, |k| self.b.constant(k))
    }
    fn gravity(&mut self, axis: usize) -> Expr {
        self.b.constant(&self.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Expr {
        self.b.symbol(index, sine)
    }
}

/// What is added to q before its sine and cosine are taken: theta where it is no multiple of pi/2.
pub fn trig_offset(arm: &Arm, joint: usize) -> f64 {
    let theta = &arm.joints[joint].theta;
    if theta.quarter_turns().is_some() { 0.0 } else { theta.radians() }
}
