//! The functions of an arm: their arguments and results.

mod table;

use std::fmt;
use table::{COUNT, Row, TABLE};

/// A function of the arm's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Function {
    /// τ(q, q̇, q̈) = B·q̈ + C·q̇ + g
    InverseDynamics,
    /// B·q̈ + C·q̇
    InverseDynamicsWithoutGravity,
    /// Y(q, q̇, q̈), n × p
    Regressor,
    /// Yᵀ·e, p × 1
    RegressorTransposeTimes,
    /// Y(q, q̇, q̇ᵣ, q̈ᵣ) of Slotine and Li, n × p
    SlotineLiRegressor,
    /// Yᵀ·e, the regressor of Slotine and Li transposed times e, p × 1
    SlotineLiTransposeTimes,
    /// B(q), n × n
    MassMatrix,
    /// B⁻¹(q), n × n
    MassMatrixInverse,
    /// C(q, q̇), n × n, of Christoffel symbols
    CoriolisMatrix,
    /// C·q̇
    CoriolisTimesVelocity,
    /// Cᵀ·q̇
    CoriolisTransposeTimesVelocity,
    /// g(q)
    Gravity,
    /// q̈(q, q̇, τ)
    ForwardDynamics,
    /// Homogeneous transform of the tool's frame (the last frame where no tool is declared) to the base, 4 ×
    /// 4
    ForwardKinematics,
    /// Geometric Jacobian of the tool's frame, 6 × n
    Jacobian,
    /// J̇·q̇, 6 × 1
    JacobianRateTimesVelocity,
    /// T(q, q̇)
    KineticEnergy,
    /// U(q)
    PotentialEnergy,
    /// T = row·π, 1 × p
    KineticEnergyRegressor,
    /// U = row·π, 1 × p
    PotentialEnergyRegressor,
    /// B·q̇
    Momentum,
    /// ∂τ/∂q, n × n
    TorqueByPosition,
    /// ∂τ/∂q̇, n × n
    TorqueByVelocity,
    /// ∂q̈/∂q at given torques, n × n
    AccelerationByPosition,
    /// ∂q̈/∂q̇ at given torques, n × n
    AccelerationByVelocity,
    /// Ḃ(q, q̇), n × n
    MassMatrixRate,
    /// ∂(B·e)/∂q, n × n
    MassMatrixTimesByPosition,
    /// J̇(q, q̇), 6 × n
    JacobianRate,
    /// Jᵀ·f, n × 1
    JacobianTransposeTimes,
    /// ∂(Jᵀ·f)/∂q, n × n
    JacobianTransposeTimesByPosition,
    /// Λ⁻¹ = J·B⁻¹·Jᵀ, 6 × 6
    TaskInertiaInverse,
    /// Λ = (J·B⁻¹·Jᵀ)⁻¹, 6 × 6
    TaskInertia,
    /// J̄ = B⁻¹·Jᵀ·Λ, n × 6
    ConsistentInverse,
    /// Jacobian of the tool's frame in its own axes, 6 × n
    BodyJacobian,
    /// Jacobian of the tool's frame about the base's origin, 6 × n
    SpatialJacobian,
    /// J·q̇, 6 × 1
    Twist,
    /// J·q̈ + J̇·q̇, 6 × 1
    TwistRate,
    /// τ(q, q̇, q̈) with a payload
    InverseDynamicsWithPayload,
    /// The payload's part of τ by its ten parameters, n × 10
    PayloadRegressor,
    /// B(q) with a payload, n × n
    MassMatrixWithPayload,
    /// C(q, q̇) with a payload, n × n
    CoriolisMatrixWithPayload,
    /// g(q) with a payload
    GravityWithPayload,
    /// q̈(q, q̇, τ) with a payload
    ForwardDynamicsWithPayload,
    /// The Hessian of eᵀτ by (q, q̇) times a vector, n × 2
    TorqueHessianTimes,
    /// Centre of mass of the whole arm, 3 × 1
    CentreOfMass,
    /// Jacobian of the centre of mass, 3 × n
    CentreOfMassJacobian,
    /// Linear above angular momentum about the base's origin, 6 × 1
    TotalMomentum,
    /// Matrix of the total momentum: momentum = matrix·q̇, 6 × n
    TotalMomentumMatrix,
}

/// A length of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// One for each joint.
    Joints,
    /// One for each parameter.
    Parameters,
    /// A number that is the same for every arm.
    Fixed(usize),
}

impl Size {
    /// The length for n joints and p parameters.
    pub fn length(self, n: usize, p: usize) -> usize {
        match self {
            Size::Joints => n,
            Size::Parameters => p,
            Size::Fixed(length) => length,
        }
    }
}

/// The arguments of a function, in the order in which it takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// q
    Positions,
    /// q̇
    Velocities,
    /// q̈
    Accelerations,
    /// q̇ᵣ
    ReferenceVelocities,
    /// q̈ᵣ
    ReferenceAccelerations,
    /// τ
    Torques,
    /// e
    Errors,
    /// f
    Wrench,
    /// A payload's ten inertial parameters
    Payload,
    /// A direction in which q changes
    PositionDirection,
    /// A direction in which q̇ changes
    VelocityDirection,
    /// π
    Parameters,
}

impl Argument {
    /// The name in the emitted code; with the joint's number the column in a table of states.
    pub fn name(self) -> &'static str {
        match self {
            Argument::Positions => "q",
            Argument::Velocities => "dq",
            Argument::Accelerations => "ddq",
            Argument::ReferenceVelocities => "dqr",
            Argument::ReferenceAccelerations => "ddqr",
            Argument::Torques => "tau",
            Argument::Errors => "e",
            Argument::Wrench => "f",
            Argument::Payload => "payload",
            Argument::PositionDirection => "vq",
            Argument::VelocityDirection => "vdq",
            Argument::Parameters => "parameters",
        }
    }

    /// The meaning of the argument, with its unit.
    pub fn meaning(self) -> &'static str {
        match self {
            Argument::Positions => "joint positions, rad (m where prismatic)",
            Argument::Velocities => "joint velocities, rad/s",
            Argument::Accelerations => "joint accelerations, rad/s²",
            Argument::ReferenceVelocities => "reference velocities q̇ᵣ, rad/s",
            Argument::ReferenceAccelerations => "reference accelerations q̈ᵣ, rad/s²",
            Argument::Torques => "joint torques, N·m (N where prismatic)",
            Argument::Errors => "one number for each joint",
            Argument::Wrench => {
                "force, N, above the moment about the origin, N·m, on the tool's frame, in base axes"
            }
            Argument::Payload => {
                "m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of a body on the tool's frame, in its axes and \
                 about its origin: kg, kg·m, kg·m²"
            }
            Argument::PositionDirection => "a direction in which q changes, one number for each joint",
            Argument::VelocityDirection => "a direction in which q̇ changes, one number for each joint",
            Argument::Parameters => "the values of [`PARAMETER_NAMES`]",
        }
    }

    /// How many numbers it has.
    pub fn size(self) -> Size {
        match self {
            Argument::Parameters => Size::Parameters,
            _ => self.parts().map_or(Size::Joints, |parts| Size::Fixed(parts.len())),
        }
    }

    /// How many numbers it has for n joints and p parameters.
    pub fn length(self, n: usize, p: usize) -> usize {
        self.size().length(n, p)
    }

    /// The names of its numbers where it has not one for each joint or parameter.
    pub fn parts(self) -> Option<&'static [&'static str]> {
        match self {
            Argument::Wrench => Some(&["fx", "fy", "fz", "mx", "my", "mz"]),
            Argument::Payload => Some(&["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]),
            _ => None,
        }
    }
}

/// The kind of a function, on which its cost depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// On the form of the recursion and on how it sums the parameters up.
    Dynamics,
    /// On the form of the recursion.
    Regressor,
    /// On neither.
    Other,
}

use Argument::*;
use Function::*;

impl Function {
    /// All of them, in the order in which they are emitted.
    pub const ALL: [Function; COUNT] = {
        let mut all = [InverseDynamics; COUNT];
        let mut k = 0;
        while k < all.len() {
            all[k] = TABLE[k].function;
            k += 1;
        }
        all
    };

    /// The functions that a file has unless others are requested: what identification and most controllers
    /// need.
    pub fn common() -> impl Iterator<Item = Function> {
        Self::ALL.into_iter().take_while(|f| *f <= TorqueByVelocity)
    }

    /// Whether it is of the tool's frame, so that other frames have it too.
    pub fn is_of_tool(self) -> bool {
        self.is_kinematic()
            || matches!(self, TaskInertiaInverse | TaskInertia | ConsistentInverse | PayloadRegressor)
            || self.takes(Payload)
    }

    /// Whether it depends on parameters that no torque shows, so that only the set `full` has it.
    pub fn needs_every_parameter(self) -> bool {
        matches!(self, CentreOfMass | CentreOfMassJacobian | TotalMomentum | TotalMomentumMatrix)
    }

    /// Whether only an arm has it whose tool can accelerate in every direction.
    pub fn needs_full_rank(self) -> bool {
        matches!(self, TaskInertia | ConsistentInverse)
    }

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The name on the command line and in the emitted code.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The letters before the number of an entry if results are columns of a table: `tau`, `Y`.
    pub fn letter(self) -> &'static str {
        self.row().letter
    }

    /// The quantity that it computes, and its result with the unit: one sentence each.
    pub fn meaning(self) -> (&'static str, &'static str) {
        (self.row().what, self.row().returns)
    }

    /// The function of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// Rows and columns of the result.
    pub fn size(self) -> (Size, Size) {
        self.row().size
    }

    /// Rows and columns of the result for n joints and p parameters.
    pub fn shape(self, n: usize, p: usize) -> (usize, usize) {
        let (rows, columns) = self.size();
        (rows.length(n, p), columns.length(n, p))
    }

    /// The arguments of the function.
    pub fn arguments(self) -> &'static [Argument] {
        self.row().arguments
    }

    /// Whether it depends on kinematics alone, on no parameter.
    pub fn is_kinematic(self) -> bool {
        matches!(
            self,
            ForwardKinematics
                | Jacobian
                | JacobianRateTimesVelocity
                | JacobianRate
                | JacobianTransposeTimes
                | JacobianTransposeTimesByPosition
                | BodyJacobian
                | SpatialJacobian
                | Twist
                | TwistRate
        )
    }

    /// On what its cost depends.
    pub fn kind(self) -> Kind {
        self.row().kind
    }

    /// Why its result can be no number where states and parameter values are finite, in words.
    pub fn why_not_finite(self) -> &'static str {
        if matches!(self, TaskInertia | ConsistentInverse) {
            "the Jacobian loses rank there, or the mass matrix is singular with these parameter values"
        } else if matches!(
            self,
            ForwardDynamics
                | MassMatrixInverse
                | AccelerationByPosition
                | AccelerationByVelocity
                | TaskInertiaInverse
                | ForwardDynamicsWithPayload
        ) {
            "the mass matrix B(q) is singular there with these parameter values; `dyngen check` says which \
             link cannot be real"
        } else if self.needs_every_parameter() {
            "the masses sum up to zero with these parameter values"
        } else {
            "the state or a parameter value is too large"
        }
    }

    /// Whether it takes an argument.
    pub fn takes(self, argument: Argument) -> bool {
        self.arguments().contains(&argument)
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_finds_its_own_row() {
        for function in Function::ALL {
            assert_eq!(function.row().function, function);
            assert_eq!(Function::parse(function.name()), Some(function));
        }
    }
}
