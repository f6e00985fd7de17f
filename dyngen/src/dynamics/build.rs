//! A function of an arm as a graph, in the form that costs least.

use super::chain::{self, Origins};
use super::followers::Followers;
use super::function::{Argument, Function, Kind};
use super::motion;
use super::regroup::Regrouping;
use super::stage::{Chain, Form};
use super::{composite, coriolis, energy, forward, inverse, momentum, pose, regressor};
use crate::arm::{Arm, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::exact::elimination::Dependence;
use crate::exact::rational::{Rational, to_f64};
use crate::exact::symbols::AngleSymbols;
use crate::graph::differentiate::{self, Direction};
use crate::graph::{Builder, Expr, Graph, Input, JointSum, Operations, Preparation};
use crate::lagrangian::elements::{ArmElements, PlacementElements, Source};
use crate::optimize::{self, COMPARED, Pass};
use crate::parameters::ParameterSet;

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
    /// Number of coordinates.
    pub joints: usize,
    /// Number of parameters of the set.
    pub parameters: usize,
    /// Whether the parameters' values are constants of the graph.
    pub baked: bool,
}

impl FunctionGraph {
    /// What it costs, without what is prepared of the parameters alone.
    pub fn operations(&self) -> Operations {
        self.graph.operations_when_prepared(&self.outputs)
    }

    /// The function without what depends on the parameters alone, which `preparation` takes.
    #[must_use]
    pub fn without_preparation(&self, preparation: &mut Preparation) -> FunctionGraph {
        let (graph, outputs) = preparation.take_out(&self.graph, &self.outputs);
        FunctionGraph { graph, outputs, ..self.clone() }
    }

    /// What it takes: the function's arguments, without the parameters where their values are baked in.
    pub fn arguments(&self) -> impl Iterator<Item = Argument> + '_ {
        let baked = self.baked;
        self.function.arguments().iter().copied().filter(move |a| !(baked && *a == Argument::Parameters))
    }
}

/// What functions are built from: an arm with what is known exactly of it.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Its angles that are kept as symbols.
    pub symbols: &'a AngleSymbols,
    /// The field of its constants.
    pub field: &'a ConstantField,
    /// How all its parameters depend on those of the minimal set.
    pub minimal: &'a Dependence,
}

/// Builds a function of an arm for a parameter set, with its parameters as inputs or their values baked in,
/// in the form that costs least, and runs passes over its graph.
pub fn build(
    function: Function,
    subject: &Subject<'_>,
    set: &ParameterSet,
    regroupings: &[Regrouping],
    baked: Option<&[Rational]>,
    passes: &[(&str, Pass)],
) -> FunctionGraph {
    // The forms are compared after the first passes; the others go over the cheapest.
    let (passes, rest) = passes.split_at(passes.len().min(COMPARED));
    let mut best: Option<((usize, usize), FunctionGraph)> = None;
    let mut keep_cheapest = |built: FunctionGraph| {
        let operations = built.operations();
        let cost = (operations.mul + operations.add, operations.add);
        if best.as_ref().is_none_or(|(lowest, _)| cost < *lowest) {
            best = Some((cost, built));
        }
    };
    let both = [Origins::Inner, Origins::Outer];
    match function.kind() {
        Kind::Dynamics => {
            for regrouping in regroupings {
                for form in Form::all(regrouping.order.origins).take(4) {
                    keep_cheapest(build_in(form, Some(regrouping), function, subject, set, baked, passes));
                }
            }
        }
        Kind::Regressor => {
            for form in both.into_iter().flat_map(Form::all) {
                keep_cheapest(build_in(form, None, function, subject, set, baked, passes));
            }
        }
        Kind::Other => {}
    }
    let cheapest = match best {
        Some((_, built)) => built,
        None => build_in(Form::FIRST, None, function, subject, set, baked, passes),
    };
    let (graph, outputs) = optimize::optimize(cheapest.graph, cheapest.outputs, subject.field, rest);
    FunctionGraph { graph, outputs, ..cheapest }
}

/// Builds a function in one form, with its parameters summed up in one way.
pub fn build_in(
    form: Form,
    regrouping: Option<&Regrouping>,
    function: Function,
    subject: &Subject<'_>,
    set: &ParameterSet,
    baked: Option<&[Rational]>,
    passes: &[(&str, Pass)],
) -> FunctionGraph {
    let Subject { arm, symbols, field, .. } = *subject;
    let b = Builder::new();
    let value = |i: usize| match baked {
        Some(values) => b.constant(&values[i]),
        None => b.input(Input::Parameter(i)),
    };
    // Of the chain; joints that follow others are links of it. Its functions become those of the coordinates.
    let (n, dof) = (arm.links(), arm.dof());
    let followers = Followers::new(arm);
    let rows = |matrix: Vec<Expr>| followers.rows(&b, matrix);
    let square = |matrix: Vec<Expr>| rows(followers.columns(&b, matrix));
    let elements = ArmElements::build(&b, arm, symbols, &mut Inputs { b: &b, arm });
    let chain = Chain::build(&b, arm, &elements, form);
    let mut bodies = regrouping.map_or(Vec::new(), |r| r.bodies(&b, arm, symbols, field, set, value));
    if let Some(last) = bodies.last_mut() {
        last.moments = last.moments.turned_back_z(&b, &chain.last_turn.0, &chain.last_turn.1);
    }
    let velocities: Vec<Expr> = (0..n).map(|i| b.input(Input::Velocity(i))).collect();
    let input = |of: fn(usize) -> Input| -> Vec<Expr> { (0..n).map(|i| b.input(of(i))).collect() };
    let none = vec![Expr::ZERO; n];
    let torque = |accelerations: &[Expr], gravity: bool| {
        let drive = motion::Drive {
            velocities: velocities.clone(),
            reference: velocities.clone(),
            accelerations: accelerations.to_vec(),
            gravity,
        };
        rows(inverse::inverse_dynamics(&b, &chain, &bodies, &drive))
    };
    let geometry = chain::geometry(&b, arm, form.origins, &elements);
    let regressor = |drive: &motion::Drive| {
        let columns = regressor::Columns { set, field, links: &geometry, forces_home: form.forces_home };
        rows(regressor::regressor(&b, &chain, &columns, drive))
    };
    let motion = || motion::Drive {
        velocities: velocities.clone(),
        reference: velocities.clone(),
        accelerations: input(Input::Acceleration),
        gravity: true,
    };
    let reference = || motion::Drive {
        velocities: velocities.clone(),
        reference: input(Input::ReferenceVelocity),
        accelerations: input(Input::ReferenceAcceleration),
        gravity: true,
    };
    let transposed = |y: Vec<Expr>| -> Vec<Expr> {
        let p = set.parameters.len();
        let product = |c: usize| {
            let times = |i: usize| b.mul(&y[i * p + c], &b.input(Input::Error(i)));
            (0..dof).fold(Expr::ZERO, |sum, i| b.add(&sum, &times(i)))
        };
        (0..p).map(product).collect()
    };
    let derivatives = |direction: fn(usize) -> Direction| -> Vec<Expr> {
        let torques = torque(&input(Input::Acceleration), true);
        let columns: Vec<Vec<Expr>> =
            (0..n).map(|j| differentiate::derivative(&b, &torques, direction(j))).collect();
        followers.columns(&b, (0..dof * n).map(|k| columns[k % n][k / n]).collect())
    };
    let placed = |frame: &Option<Placement>| {
        let symbol = |index, sine| b.symbol(index, sine);
        PlacementElements::build(&b, frame.as_ref(), symbols, |x| b.constant(x), symbol)
    };
    let mass_matrix = || square(composite::mass_matrix(&b, &chain, &bodies));
    let ends = || pose::Ends { base: placed(&arm.base), tool: placed(&arm.tool) };
    let outputs = match function {
        Function::InverseDynamics => torque(&input(Input::Acceleration), true),
        Function::InverseDynamicsWithoutGravity => torque(&input(Input::Acceleration), false),
        Function::Regressor => regressor(&motion()),
        Function::RegressorTransposeTimes => transposed(regressor(&motion())),
        Function::SlotineLiRegressor => regressor(&reference()),
        Function::SlotineLiTransposeTimes => transposed(regressor(&reference())),
        Function::MassMatrix => mass_matrix(),
        Function::MassMatrixInverse => forward::inverse_symmetric(&b, &mass_matrix(), dof),
        Function::CoriolisMatrix => square(coriolis::coriolis_matrix(&b, &chain, &bodies, &velocities)),
        Function::CoriolisTimesVelocity => torque(&none, false),
        Function::CoriolisTransposeTimesVelocity => {
            rows(momentum::coriolis_transpose_times_velocity(&b, &chain, &bodies, &velocities))
        }
        Function::Gravity => rows(composite::gravity(&b, &chain, &bodies)),
        Function::ForwardDynamics => {
            let bias = torque(&none, true);
            let torques: Vec<Expr> = (0..dof).map(|i| b.input(Input::Torque(i))).collect();
            let right: Vec<Expr> = torques.iter().zip(&bias).map(|(t, c)| b.sub(t, c)).collect();
            forward::solve_symmetric(&b, &mass_matrix(), &right)
        }
        Function::ForwardKinematics => pose::forward_kinematics(&b, &elements, &ends()),
        Function::Jacobian => followers.columns(&b, pose::jacobian(&b, &elements, &ends())),
        Function::JacobianRateTimesVelocity => {
            let drive = motion::Drive {
                velocities: velocities.clone(),
                reference: velocities.clone(),
                accelerations: none,
                gravity: false,
            };
            let straight = Chain::build(&b, arm, &elements, Form { last_in_frame_before: false, ..form });
            pose::jacobian_rate_times_velocity(&b, &elements, &straight, &geometry[n - 1], &ends(), &drive)
        }
        Function::KineticEnergy => vec![momentum::kinetic_energy(&b, &chain, &bodies, &velocities)],
        Function::PotentialEnergy => {
            let row = energy::potential_regressor(&b, arm, &elements, set, field);
            let term = |(i, column): (usize, &Expr)| b.mul(column, &value(i));
            let terms: Vec<Expr> = row.iter().enumerate().map(term).collect();
            vec![terms.iter().fold(Expr::ZERO, |sum, t| b.add(&sum, t))]
        }
        Function::KineticEnergyRegressor => energy::kinetic_regressor(&b, arm, &elements, set, field),
        Function::PotentialEnergyRegressor => energy::potential_regressor(&b, arm, &elements, set, field),
        Function::Momentum => rows(momentum::momentum(&b, &chain, &bodies, &velocities)),
        Function::TorqueByPosition => derivatives(Direction::Position),
        Function::TorqueByVelocity => derivatives(Direction::Velocity),
    };
    let parameters = set.parameters.len();
    let (graph, outputs) = followers.of_coordinates(b.finish(), outputs);
    let (graph, outputs) = optimize::optimize(graph, outputs, field, passes);
    let shape = function.shape(dof, parameters);
    FunctionGraph { function, graph, outputs, shape, joints: dof, parameters, baked: baked.is_some() }
}

/// The arm's quantities as inputs and constants of a graph.
struct Inputs<'a> {
    b: &'a Builder,
    arm: &'a Arm,
}

impl Source<Expr> for Inputs<'_> {
    fn joint_trig(&mut self, joint: usize) -> (Expr, Expr) {
        let sum = JointSum::joint(joint);
        let (s, c) = (self.b.input(Input::Sin(sum)), self.b.input(Input::Cos(sum)));
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
    fn velocity(&mut self, joint: usize) -> Expr {
        self.b.input(Input::Velocity(joint))
    }
    fn a(&mut self, joint: usize) -> Expr {
        self.b.constant(&self.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Expr {
        self.b.constant(&self.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Expr {
        self.b.constant(&self.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Expr {
        self.arm.joints[joint].rotor_ratio.as_ref().map_or(Expr::ZERO, |k| self.b.constant(k))
    }
    fn coupling(&mut self, factor: &Rational) -> Expr {
        self.b.constant(factor)
    }
    fn gravity(&mut self, axis: usize) -> Expr {
        self.b.constant(&self.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Expr {
        self.b.symbol(index, sine)
    }
}

/// What is added to q before its sine and cosine are taken: theta where it is no multiple of pi/2; of a joint
/// that follows another, to its ratio times the other's q, its offset too.
pub fn trig_offset(arm: &Arm, joint: usize) -> f64 {
    let joint = &arm.joints[joint];
    let offset = joint.mimic.as_ref().map_or(0.0, |mimic| to_f64(&mimic.offset));
    if joint.theta.quarter_turns().is_some() { offset } else { joint.theta.radians() + offset }
}
