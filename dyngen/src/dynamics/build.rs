//! A function of an arm as a graph, in the form that costs least.

use super::angles::Angles;
use super::chain::{self, LinkGeometry, Origins};
use super::followers::Followers;
use super::function::{Argument, Function, Kind};
use super::moments::{ENTRIES, Moments};
use super::motion;
use super::regroup::{LinkBody, Regrouping};
use super::stage::{Chain, Form};
use super::task::{Task, sum_of_products};
use super::total::Total;
use super::{bars, composite, coriolis, energy, forward, inverse, momentum, payload, pose, regressor};
use crate::arm::{Arm, Linkage, Parameter, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::exact::elimination::Dependence;
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::graph::differentiate::{self, Direction};
use crate::graph::{Builder, Contraction, Expr, Graph, Input, Operations, Preparation};
use crate::lagrangian::elements::{ArmElements, PlacementElements, Source};
use crate::lagrangian::linkage::{BarTurns, turns};
use crate::optimize::{self, COMPARED, Pass};
use crate::parameters::{ParameterSet, SetParameter};

/// A function as expressions.
#[derive(Clone, Debug)]
pub struct FunctionGraph {
    /// Which function.
    pub function: Function,
    /// The expressions.
    pub graph: Graph,
    /// The result, row-major.
    pub outputs: Vec<Expr>,
    /// The result's rows and columns.
    pub shape: (usize, usize),
    /// Number of coordinates.
    pub joints: usize,
    /// Number of parameters of the set.
    pub parameters: usize,
    /// Whether the parameters' values are constants of the graph.
    pub baked: bool,
    /// Whether its code forms products within sums.
    pub contracted: bool,
}

impl FunctionGraph {
    /// Operations of the function, without those that are prepared from the parameters alone.
    pub fn operations(&self) -> Operations {
        self.graph.operations_when_prepared(&self.outputs)
    }

    /// The function without what depends on the parameters alone, which `preparation` takes.
    #[must_use]
    pub fn without_preparation(&self, preparation: &mut Preparation) -> FunctionGraph {
        let (graph, outputs) = preparation.take_out(&self.graph, &self.outputs);
        FunctionGraph { graph, outputs, ..self.clone() }
    }

    /// The products that its code forms within sums.
    pub fn contraction(&self) -> Contraction {
        match self.contracted {
            true => Contraction::of(&self.graph, &self.outputs),
            false => Contraction::none(&self.graph),
        }
    }

    /// The function's arguments, without the parameters if their values are baked in.
    pub fn arguments(&self) -> impl Iterator<Item = Argument> + '_ {
        let baked = self.baked;
        self.function.arguments().iter().copied().filter(move |a| !(baked && *a == Argument::Parameters))
    }
}

/// The data from which functions are built: an arm with its exact properties.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// The angles whose sine and cosine functions use.
    pub angles: &'a Angles,
    /// The arm's constant angles that are kept as symbols.
    pub symbols: &'a AngleSymbols,
    /// The field of its constants.
    pub field: &'a ConstantField,
    /// Dependence of all parameters on those of the minimal set.
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
    let b = Builder::new();
    let followers = Followers::new(subject.arm, subject.angles);
    let mut parts = Parts::new(&b, &followers, form, regrouping, *subject, (set, baked));
    if function.takes(Argument::Payload) {
        let payload = payload::given(&b, parts.carrier(), &parts.ends().tool);
        parts.load(&payload);
    }
    parts.turn_last();
    let outputs = parts.outputs(function);
    let (graph, outputs) = followers.of_coordinates(b.finish(), outputs);
    let (graph, outputs) = optimize::optimize(graph, outputs, subject.field, passes);
    let (joints, parameters) = (subject.arm.dof(), set.parameters.len());
    let shape = function.shape(joints, parameters);
    let baked = baked.is_some();
    FunctionGraph { function, graph, outputs, shape, joints, parameters, baked, contracted: false }
}

/// The parts of functions in one form, as expressions of one graph: the chain, its links' bodies and rates.
/// All of it is of the chain, whose joints that follow others are links of it; what is linear in rates or
/// torques becomes that of the coordinates at once, angles and positions when a function is done.
#[derive(Clone)]
struct Parts<'a> {
    b: &'a Builder,
    followers: &'a Followers<'a>,
    subject: Subject<'a>,
    set: &'a ParameterSet,
    /// The parameters' values where they are baked in.
    baked: Option<&'a [Rational]>,
    form: Form,
    elements: ArmElements<Expr>,
    chain: Chain,
    /// Poses of the file's frames in those of the chain.
    geometry: Vec<LinkGeometry<Expr>>,
    /// None where the function takes no body of a link.
    bodies: Vec<LinkBody>,
    velocities: Vec<Expr>,
}

impl<'a> Parts<'a> {
    fn new(
        b: &'a Builder,
        followers: &'a Followers<'a>,
        form: Form,
        regrouping: Option<&Regrouping>,
        subject: Subject<'a>,
        (set, baked): (&'a ParameterSet, Option<&'a [Rational]>),
    ) -> Self {
        let Subject { arm, angles, symbols, field, .. } = subject;
        let elements = ArmElements::build(b, arm, symbols, &mut Inputs { b, arm, angles });
        let mut chain = Chain::build(b, arm, angles, &elements, form);
        let value = |i: usize| parameter(b, baked, i);
        let of_bars = regrouping.map_or(Vec::new(), |r| r.bars(b, arm, field, set, value));
        for (bar, parameters) in chain.bars.iter_mut().zip(&of_bars) {
            *bar = bar.carrying(b, parameters);
        }
        let bodies = regrouping.map_or(Vec::new(), |r| r.bodies(b, arm, symbols, field, set, value));
        let velocities = (0..arm.links()).map(|i| b.input(Input::Velocity(i))).collect();
        let geometry = chain::geometry(b, arm, form.origins, &elements);
        Parts { b, followers, subject, set, baked, form, elements, chain, geometry, bodies, velocities }
    }

    /// The frame of the link that carries the tool.
    fn carrier(&self) -> &LinkGeometry<Expr> {
        &self.geometry[self.subject.arm.tool_carrier()]
    }

    /// Adds a body to the link that carries the tool.
    fn load(&mut self, body: &Moments<Expr>) {
        if let Some(carrier) = self.bodies.get_mut(self.subject.arm.tool_carrier()) {
            carrier.moments = carrier.moments.plus(self.b, body);
        }
    }

    /// The last link's body in the axes in which the form sees it.
    fn turn_last(&mut self) {
        let (sin, cos) = self.chain.last_turn;
        if let Some(last) = self.bodies.last_mut() {
            last.moments = last.moments.turned_back_z(self.b, &sin, &cos);
        }
    }

    /// A function's result, row-major.
    fn outputs(&self, function: Function) -> Vec<Expr> {
        let Parts { b, chain, bodies, velocities, elements, set, .. } = self;
        let Subject { arm, field, .. } = self.subject;
        match function {
            Function::InverseDynamics => self.torque(self.each(Input::Acceleration), true),
            Function::InverseDynamicsWithoutGravity => self.torque(self.each(Input::Acceleration), false),
            Function::Regressor => self.regressor(&self.motion()),
            Function::RegressorTransposeTimes => {
                self.transposed_times_errors(&self.regressor(&self.motion()))
            }
            Function::SlotineLiRegressor => self.regressor(&self.reference_motion()),
            Function::SlotineLiTransposeTimes => {
                self.transposed_times_errors(&self.regressor(&self.reference_motion()))
            }
            Function::MassMatrix => self.mass_matrix(),
            Function::MassMatrixInverse => forward::inverse_symmetric(b, &self.mass_matrix(), arm.dof()),
            Function::CoriolisMatrix => self.coriolis_matrix(),
            Function::CoriolisTimesVelocity => self.torque(self.at_rest(), false),
            Function::CoriolisTransposeTimesVelocity => {
                let bare = chain.without_bars();
                let of_links = momentum::coriolis_transpose_times_velocity(b, &bare, bodies, velocities);
                self.rows(bars::coriolis_transpose_times_velocity(b, chain, velocities, of_links))
            }
            Function::Gravity => self.gravity(),
            Function::ForwardDynamics => self.forward_dynamics(),
            Function::ForwardKinematics => pose::forward_kinematics(b, elements, &self.ends()),
            Function::Jacobian => self.jacobian(),
            Function::JacobianRateTimesVelocity => self.jacobian_rate_times_velocity(),
            Function::KineticEnergy => vec![momentum::kinetic_energy(b, chain, bodies, velocities)],
            Function::PotentialEnergy => vec![self.potential_energy()],
            Function::KineticEnergyRegressor => energy::kinetic_regressor(b, arm, elements, set, field),
            Function::PotentialEnergyRegressor => energy::potential_regressor(b, arm, elements, set, field),
            Function::Momentum => self.rows(momentum::momentum(b, chain, bodies, velocities)),
            Function::TorqueByPosition => self.torque_derivatives(Direction::Position),
            Function::TorqueByVelocity => self.torque_derivatives(Direction::Velocity),
            Function::AccelerationByPosition => self.acceleration_derivatives(Direction::Position),
            Function::AccelerationByVelocity => self.acceleration_derivatives(Direction::Velocity),
            Function::MassMatrixRate => self.rate(&self.mass_matrix()),
            Function::MassMatrixTimesByPosition => self.by_position(&self.mass_matrix_times_errors()),
            Function::JacobianRate => self.rate(&self.jacobian()),
            Function::JacobianTransposeTimes => self.jacobian_transpose_times_wrench(),
            Function::JacobianTransposeTimesByPosition => {
                self.by_position(&self.jacobian_transpose_times_wrench())
            }
            Function::TaskInertiaInverse => self.task().inertia_inverse,
            Function::TaskInertia => forward::inverse_symmetric(b, &self.task().inertia_inverse, 6),
            Function::ConsistentInverse => self.task().consistent_inverse(b),
            Function::BodyJacobian => {
                self.followers.columns(b, pose::body_jacobian(b, elements, &self.ends()))
            }
            Function::SpatialJacobian => {
                self.followers.columns(b, pose::spatial_jacobian(b, elements, &self.ends()))
            }
            Function::Twist => self.twist(velocities),
            Function::TwistRate => {
                let driven = self.twist(&self.each(Input::Acceleration));
                driven.iter().zip(&self.jacobian_rate_times_velocity()).map(|(x, y)| b.add(x, y)).collect()
            }
            // Only the bodies differ from the functions without a payload.
            Function::InverseDynamicsWithPayload => self.torque(self.each(Input::Acceleration), true),
            Function::MassMatrixWithPayload => self.mass_matrix(),
            Function::CoriolisMatrixWithPayload => self.coriolis_matrix(),
            Function::GravityWithPayload => self.gravity(),
            Function::ForwardDynamicsWithPayload => self.forward_dynamics(),
            Function::PayloadRegressor => self.payload_regressor(),
            Function::TorqueHessianTimes => self.torque_hessian_times(),
            Function::CentreOfMass => self.centre_of_mass(),
            Function::CentreOfMassJacobian => self.centre_of_mass_jacobian(),
            Function::TotalMomentum => {
                let matrix = self.total().matrix();
                matrix.chunks(velocities.len()).map(|row| sum_of_products(b, row, velocities)).collect()
            }
            Function::TotalMomentumMatrix => self.followers.columns(b, self.total().matrix()),
        }
    }

    /// An input of each joint of the chain.
    fn each(&self, input: fn(usize) -> Input) -> Vec<Expr> {
        (0..self.subject.arm.links()).map(|i| self.b.input(input(i))).collect()
    }

    /// Zero for each joint of the chain.
    fn at_rest(&self) -> Vec<Expr> {
        vec![Expr::ZERO; self.subject.arm.links()]
    }

    /// Gᵀ·A: a row for each coordinate in place of each joint of the chain.
    fn rows(&self, matrix: Vec<Expr>) -> Vec<Expr> {
        self.followers.rows(self.b, matrix)
    }

    /// GᵀAG
    fn square(&self, matrix: Vec<Expr>) -> Vec<Expr> {
        self.rows(self.followers.columns(self.b, matrix))
    }

    /// The joints' velocities with some accelerations.
    fn drive(&self, accelerations: Vec<Expr>, gravity: bool) -> motion::Drive {
        let velocities = self.velocities.clone();
        motion::Drive { reference: velocities.clone(), velocities, accelerations, gravity }
    }

    /// The motion q̇, q̈ under gravity.
    fn motion(&self) -> motion::Drive {
        self.drive(self.each(Input::Acceleration), true)
    }

    /// The reference motion q̇ᵣ, q̈ᵣ of Slotine and Li in addition to q̇, under gravity.
    fn reference_motion(&self) -> motion::Drive {
        motion::Drive {
            velocities: self.velocities.clone(),
            reference: self.each(Input::ReferenceVelocity),
            accelerations: self.each(Input::ReferenceAcceleration),
            gravity: true,
        }
    }

    /// The torques τ of a motion.
    fn torque(&self, accelerations: Vec<Expr>, gravity: bool) -> Vec<Expr> {
        let drive = self.drive(accelerations, gravity);
        self.rows(inverse::inverse_dynamics(self.b, &self.chain, &self.bodies, &drive))
    }

    /// Y of a motion, n × p.
    fn regressor(&self, drive: &motion::Drive) -> Vec<Expr> {
        let columns = regressor::Columns {
            set: self.set,
            field: self.subject.field,
            links: &self.geometry,
            forces_home: self.form.forces_home,
        };
        self.rows(regressor::regressor(self.b, &self.chain, &columns, drive))
    }

    /// Yᵀ·e for the errors e of the coordinates.
    fn transposed_times_errors(&self, y: &[Expr]) -> Vec<Expr> {
        let (b, p) = (self.b, self.set.parameters.len());
        let product = |c: usize| {
            let times = |i: usize| b.mul(&y[i * p + c], &b.input(Input::Error(i)));
            (0..self.subject.arm.dof()).fold(Expr::ZERO, |sum, i| b.add(&sum, &times(i)))
        };
        (0..p).map(product).collect()
    }

    fn mass_matrix(&self) -> Vec<Expr> {
        let of_links = composite::mass_matrix(self.b, &self.chain, &self.bodies);
        self.square(bars::mass_matrix(self.b, &self.chain, of_links))
    }

    fn coriolis_matrix(&self) -> Vec<Expr> {
        let Parts { b, chain, bodies, velocities, .. } = self;
        let of_links = coriolis::coriolis_matrix(b, chain, bodies, velocities);
        self.square(bars::coriolis_matrix(b, chain, velocities, of_links))
    }

    fn gravity(&self) -> Vec<Expr> {
        let of_links = composite::gravity(self.b, &self.chain, &self.bodies);
        self.rows(bars::gravity(self.b, &self.chain, of_links))
    }

    /// M⁻¹·(τ − C·q̇ − g)
    fn forward_dynamics(&self) -> Vec<Expr> {
        let b = self.b;
        let bias = self.torque(self.at_rest(), true);
        let torques: Vec<Expr> = (0..self.subject.arm.dof()).map(|i| b.input(Input::Torque(i))).collect();
        let right: Vec<Expr> = torques.iter().zip(&bias).map(|(t, c)| b.sub(t, c)).collect();
        forward::solve_symmetric(b, &self.mass_matrix(), &right)
    }

    /// The poses of frame 0 and the tool.
    fn ends(&self) -> pose::Ends {
        let b = self.b;
        let symbol = |index, sine| b.symbol(index, sine);
        let placed = |frame: &Option<Placement>| {
            PlacementElements::build(b, frame.as_ref(), self.subject.symbols, |x| b.constant(x), symbol)
        };
        let arm = self.subject.arm;
        pose::Ends { base: placed(&arm.base), tool: placed(&arm.tool), carrier: arm.tool_carrier() }
    }

    /// J̇·q̇: the tool's acceleration without q̈, from the recursion along a chain whose last link has axes
    /// of its own.
    fn jacobian_rate_times_velocity(&self) -> Vec<Expr> {
        let Subject { arm, angles, .. } = self.subject;
        let drive = self.drive(self.at_rest(), false);
        let form = Form { last_in_frame_before: false, ..self.form };
        let chain = Chain::build(self.b, arm, angles, &self.elements, form);
        let last = &self.geometry[arm.tool_carrier()];
        pose::jacobian_rate_times_velocity(self.b, &self.elements, &chain, last, &self.ends(), &drive)
    }

    /// The regressor's row of the potential energy times the parameters.
    fn potential_energy(&self) -> Expr {
        let b = self.b;
        let Subject { arm, field, .. } = self.subject;
        let row = energy::potential_regressor(b, arm, &self.elements, self.set, field);
        let term = |(i, column): (usize, &Expr)| b.mul(column, &parameter(b, self.baked, i));
        let terms: Vec<Expr> = row.iter().enumerate().map(term).collect();
        terms.iter().fold(Expr::ZERO, |sum, t| b.add(&sum, t))
    }

    /// ∂τ/∂q or ∂τ/∂q̇, n × n.
    fn torque_derivatives(&self, direction: fn(usize) -> Direction) -> Vec<Expr> {
        self.derivatives(&self.torque(self.each(Input::Acceleration), true), direction)
    }

    /// −B⁻¹·∂τ/∂q or −B⁻¹·∂τ/∂q̇ at the accelerations that the torques make (Carpentier and Mansard 2018), n
    /// × n.
    fn acceleration_derivatives(&self, direction: fn(usize) -> Direction) -> Vec<Expr> {
        let (b, n) = (self.b, self.subject.arm.dof());
        let accelerations = self.followers.of_chain(b, &self.forward_dynamics());
        let derivatives = self.torque_derivatives(direction);
        let derivatives = b.replaced(&derivatives, |input| match input {
            Input::Acceleration(joint) => Some(accelerations[joint]),
            _ => None,
        });
        let right: Vec<Vec<Expr>> =
            (0..n).map(|j| (0..n).map(|i| -derivatives[i * n + j]).collect()).collect();
        let right: Vec<&[Expr]> = right.iter().map(Vec::as_slice).collect();
        let columns = forward::solve_symmetric_each(b, &self.mass_matrix(), n, &right);
        (0..n * n).map(|k| columns[k % n][k / n]).collect()
    }

    /// A column for the derivative by each coordinate's q or q̇.
    fn derivatives(&self, outputs: &[Expr], direction: fn(usize) -> Direction) -> Vec<Expr> {
        let n = self.subject.arm.links();
        let columns: Vec<Vec<Expr>> =
            (0..n).map(|j| differentiate::derivative(self.b, outputs, direction(j))).collect();
        self.followers.columns(self.b, (0..outputs.len() * n).map(|k| columns[k % n][k / n]).collect())
    }

    /// A column for the derivative by each coordinate's q.
    fn by_position(&self, outputs: &[Expr]) -> Vec<Expr> {
        self.derivatives(outputs, Direction::Position)
    }

    /// The rates of functions of the positions.
    fn rate(&self, outputs: &[Expr]) -> Vec<Expr> {
        let velocity = |joint: usize| self.b.input(Input::Velocity(joint));
        differentiate::along(self.b, outputs, &velocity, &|_| Expr::ZERO)
    }

    /// B·e
    fn mass_matrix_times_errors(&self) -> Vec<Expr> {
        let (b, n, matrix) = (self.b, self.subject.arm.dof(), self.mass_matrix());
        let errors: Vec<Expr> = (0..n).map(|i| b.input(Input::Error(i))).collect();
        matrix.chunks(n).map(|row| sum_of_products(b, row, &errors)).collect()
    }

    /// J of the coordinates, 6 × n.
    fn jacobian(&self) -> Vec<Expr> {
        self.followers.columns(self.b, pose::jacobian(self.b, &self.elements, &self.ends()))
    }

    /// Jᵀ·f
    fn jacobian_transpose_times_wrench(&self) -> Vec<Expr> {
        let (b, n, jacobian) = (self.b, self.subject.arm.dof(), self.jacobian());
        let wrench: Vec<Expr> = (0..6).map(|i| b.input(Input::Wrench(i))).collect();
        let column = |j: usize| -> Vec<Expr> { jacobian.iter().skip(j).step_by(n).copied().collect() };
        (0..n).map(|j| sum_of_products(b, &column(j), &wrench)).collect()
    }

    /// J·v for rates of the chain's joints.
    fn twist(&self, rates: &[Expr]) -> Vec<Expr> {
        let jacobian = pose::jacobian(self.b, &self.elements, &self.ends());
        jacobian.chunks(rates.len()).map(|row| sum_of_products(self.b, row, rates)).collect()
    }

    /// For each of a payload's parameters the torques of a motion of an arm that has no other mass, n × 10.
    fn payload_regressor(&self) -> Vec<Expr> {
        let (b, links) = (self.b, self.subject.arm.links());
        let column = |parameter: usize| {
            let (bodies, chain) = (vec![LinkBody::none(b); links], self.chain.without_bars());
            let mut only = Parts { bodies, chain, ..self.clone() };
            only.load(&payload::unit(b, self.carrier(), &self.ends().tool, parameter));
            only.turn_last();
            only.torque(self.each(Input::Acceleration), true)
        };
        let columns: Vec<Vec<Expr>> = (0..ENTRIES).map(column).collect();
        (0..self.subject.arm.dof()).flat_map(|i| columns.iter().map(move |c| c[i])).collect()
    }

    /// The gradient of eᵀτ backwards, then its change in the direction forwards (Griewank and Walther 2008,
    /// §5), n × 2.
    fn torque_hessian_times(&self) -> Vec<Expr> {
        let (b, n) = (self.b, self.subject.arm.dof());
        let of_each = |input: fn(usize) -> Input| (0..n).map(|i| b.input(input(i))).collect::<Vec<Expr>>();
        let torques = self.torque(self.each(Input::Acceleration), true);
        let product = sum_of_products(b, &torques, &of_each(Input::Error));
        let gradient = differentiate::gradient(b, product, self.subject.arm.links());
        let position = self.followers.of_chain(b, &of_each(Input::PositionDirection));
        let velocity = self.followers.of_chain(b, &of_each(Input::VelocityDirection));
        let parts = gradient.map(|part| {
            let change = differentiate::along(b, &part, &|j| position[j], &|j| velocity[j]);
            self.followers.rows(b, change)
        });
        (0..n).flat_map(|i| parts.each_ref().map(|part| part[i])).collect()
    }

    /// The whole arm, of the set with every parameter.
    fn total(&self) -> Total {
        let Subject { arm, .. } = self.subject;
        let value = |parameter: Parameter| {
            let is = |p: &SetParameter| matches!(p.terms[..], [(of, _)] if of == parameter);
            let found = self.set.parameters.iter().position(is);
            found.map_or(Expr::ZERO, |i| self::parameter(self.b, self.baked, i))
        };
        let coupled = |motor: usize| {
            let factors = arm.coupled_motor(motor)?;
            Some(factors.into_iter().map(|(joint, factor)| (joint, self.b.constant(&factor))).collect())
        };
        Total::build(self.b, &self.elements, &self.ends().base, value, coupled)
    }

    fn centre_of_mass(&self) -> Vec<Expr> {
        let body = self.total().body;
        body.first.iter().map(|x| self.b.div(*x, body.mass)).collect()
    }

    fn centre_of_mass_jacobian(&self) -> Vec<Expr> {
        let total = self.total();
        let linear = &total.matrix()[..3 * self.subject.arm.links()];
        let columns = self.followers.columns(self.b, linear.to_vec());
        columns.iter().map(|x| self.b.div(*x, total.body.mass)).collect()
    }

    /// How the tool's frame moves under forces.
    fn task(&self) -> Task {
        Task::new(self.b, &self.mass_matrix(), &self.jacobian(), self.subject.arm.dof())
    }
}

/// A parameter of the set as an input, or its value.
fn parameter(b: &Builder, baked: Option<&[Rational]>, i: usize) -> Expr {
    baked.map_or_else(|| b.input(Input::Parameter(i)), |values| b.constant(&values[i]))
}

/// The arm's quantities as inputs and constants of a graph.
struct Inputs<'a> {
    b: &'a Builder,
    arm: &'a Arm,
    angles: &'a Angles,
}

impl Source<Expr> for Inputs<'_> {
    fn joint_trig(&mut self, joint: usize) -> (Expr, Expr) {
        self.angles.of_chain(self.b, &[(joint, false)])
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
    fn exact(&mut self, value: &Rational) -> Expr {
        self.b.constant(value)
    }
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<Expr>> {
        let turn = self.joint_trig(linkage.joint);
        turns(self.b, linkage, &|x| self.b.constant(x), &turn)
    }
    fn gravity(&mut self, axis: usize) -> Expr {
        self.b.constant(&self.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Expr {
        self.b.symbol(index, sine)
    }
}
