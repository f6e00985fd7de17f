//! The functions of an arm: their names, shapes and arguments, in one table.

use std::fmt;

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
    /// Its transpose times e, p × 1
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
}

/// A length of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// One for each joint.
    Joints,
    /// One for each parameter.
    Parameters,
    /// The same for every arm.
    Fixed(usize),
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
            Argument::Parameters => "parameters",
        }
    }

    /// What it is, with its unit.
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
            Argument::Parameters => "the values of [`PARAMETER_NAMES`]",
        }
    }

    /// How many numbers it has for n joints and p parameters.
    pub fn length(self, n: usize, p: usize) -> usize {
        match self {
            Argument::Wrench => 6,
            Argument::Parameters => p,
            _ => n,
        }
    }
}

/// What the cost of a function depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// On the form of the recursion and on how it sums the parameters up.
    Dynamics,
    /// On the form of the recursion.
    Regressor,
    /// On neither.
    Other,
}

/// What is known of a function beside its equations.
struct Row {
    function: Function,
    /// On the command line and in the emitted code.
    name: &'static str,
    /// Before the numbers of its entries, as a column of a table.
    letter: &'static str,
    size: (Size, Size),
    arguments: &'static [Argument],
    kind: Kind,
    /// What it computes.
    what: &'static str,
    /// What it returns, with the unit.
    returns: &'static str,
}

use Argument::*;
use Function::*;
use Size::{Fixed, Joints, Parameters as ByParameter};

/// One row for each function, in the order of [`Function::ALL`].
const TABLE: [Row; 33] = [
    Row {
        function: InverseDynamics,
        name: "inverse_dynamics",
        letter: "tau",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Accelerations, Parameters],
        kind: Kind::Dynamics,
        what: "Joint torques of a motion: τ = B(q)·q̈ + C(q, q̇)·q̇ + g(q), without friction.",
        returns: "Returns τ, N·m (N where prismatic).",
    },
    Row {
        function: InverseDynamicsWithoutGravity,
        name: "inverse_dynamics_without_gravity",
        letter: "tau",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Accelerations, Parameters],
        kind: Kind::Dynamics,
        what: "Joint torques of a motion without gravity: B(q)·q̈ + C(q, q̇)·q̇.",
        returns: "Returns the torques, N·m.",
    },
    Row {
        function: Regressor,
        name: "regressor",
        letter: "Y",
        size: (Joints, ByParameter),
        arguments: &[Positions, Velocities, Accelerations],
        kind: Kind::Regressor,
        what: "Regressor Y(q, q̇, q̈): τ = Y·π for the parameters of [`PARAMETER_NAMES`].",
        returns: "Returns Y, n × p.",
    },
    Row {
        function: RegressorTransposeTimes,
        name: "regressor_transpose_times",
        letter: "Yte",
        size: (ByParameter, Fixed(1)),
        arguments: &[Positions, Velocities, Accelerations, Errors],
        kind: Kind::Regressor,
        what: "Yᵀ(q, q̇, q̈)·e without Y itself.",
        returns: "Returns one number for each parameter.",
    },
    Row {
        function: SlotineLiRegressor,
        name: "slotine_li_regressor",
        letter: "Y",
        size: (Joints, ByParameter),
        arguments: &[Positions, Velocities, ReferenceVelocities, ReferenceAccelerations],
        kind: Kind::Regressor,
        what: "Regressor of Slotine and Li: Y(q, q̇, q̇ᵣ, q̈ᵣ)·π = B·q̈ᵣ + C·q̇ᵣ + g, \
            with C of Christoffel symbols.",
        returns: "Returns Y, n × p.",
    },
    Row {
        function: SlotineLiTransposeTimes,
        name: "slotine_li_transpose_times",
        letter: "Yte",
        size: (ByParameter, Fixed(1)),
        arguments: &[Positions, Velocities, ReferenceVelocities, ReferenceAccelerations, Errors],
        kind: Kind::Regressor,
        what: "Yᵀ(q, q̇, q̇ᵣ, q̈ᵣ)·e of Slotine and Li's regressor: the direction of their adaptation law.",
        returns: "Returns one number for each parameter.",
    },
    Row {
        function: MassMatrix,
        name: "mass_matrix",
        letter: "B",
        size: (Joints, Joints),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Mass matrix B(q), symmetric.",
        returns: "Returns B, n × n, kg·m².",
    },
    Row {
        function: MassMatrixInverse,
        name: "mass_matrix_inverse",
        letter: "Binv",
        size: (Joints, Joints),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Inverse of the mass matrix, B⁻¹(q).",
        returns: "Returns n × n, symmetric; not finite where the parameters make B singular.",
    },
    Row {
        function: CoriolisMatrix,
        name: "coriolis_matrix",
        letter: "C",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Coriolis matrix C(q, q̇) of Christoffel symbols: Ḃ − 2C is skew-symmetric.",
        returns: "Returns C, n × n.",
    },
    Row {
        function: CoriolisTimesVelocity,
        name: "coriolis_times_velocity",
        letter: "tau",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Coriolis and centrifugal torques C(q, q̇)·q̇.",
        returns: "Returns the torques, N·m.",
    },
    Row {
        function: CoriolisTransposeTimesVelocity,
        name: "coriolis_transpose_times_velocity",
        letter: "tau",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Cᵀ(q, q̇)·q̇ of the Christoffel matrix, which is ∂T/∂q: what a momentum observer integrates.",
        returns: "Returns the torques, N·m.",
    },
    Row {
        function: Gravity,
        name: "gravity",
        letter: "g",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Joint torques that hold the arm still: g(q).",
        returns: "Returns g, N·m.",
    },
    Row {
        function: ForwardDynamics,
        name: "forward_dynamics",
        letter: "ddq",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Torques, Parameters],
        kind: Kind::Dynamics,
        what: "Joint accelerations under joint torques: q̈ = B⁻¹·(τ − C·q̇ − g), without friction.",
        returns: "Returns q̈; not finite where the parameters make B singular.",
    },
    Row {
        function: ForwardKinematics,
        name: "forward_kinematics",
        letter: "T",
        size: (Fixed(4), Fixed(4)),
        arguments: &[Positions],
        kind: Kind::Other,
        what: "Pose of the tool's frame (the last link's where the arm declares no tool) in the base frame.",
        returns: "Returns the homogeneous transform, 4 × 4, lengths in m.",
    },
    Row {
        function: Jacobian,
        name: "jacobian",
        letter: "J",
        size: (Fixed(6), Joints),
        arguments: &[Positions],
        kind: Kind::Other,
        what: "Geometric Jacobian of the tool's frame (the last link's where the arm declares no tool), \
            in base axes.",
        returns: "Returns 6 × n: velocity of the origin, m/s, above the angular velocity, rad/s.",
    },
    Row {
        function: JacobianRateTimesVelocity,
        name: "jacobian_rate_times_velocity",
        letter: "a",
        size: (Fixed(6), Fixed(1)),
        arguments: &[Positions, Velocities],
        kind: Kind::Other,
        what: "J̇(q, q̇)·q̇ of the geometric Jacobian: acceleration of the tool's frame where q̈ = 0.",
        returns: "Returns six numbers: acceleration of the origin, m/s², \
            above the angular acceleration, rad/s².",
    },
    Row {
        function: KineticEnergy,
        name: "kinetic_energy",
        letter: "T",
        size: (Fixed(1), Fixed(1)),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Kinetic energy T = ½ q̇ᵀ·B·q̇.",
        returns: "Returns T, J.",
    },
    Row {
        function: PotentialEnergy,
        name: "potential_energy",
        letter: "U",
        size: (Fixed(1), Fixed(1)),
        arguments: &[Positions, Parameters],
        kind: Kind::Other,
        what: "Potential energy U(q) under gravity, up to a constant: ∂U/∂q = g(q).",
        returns: "Returns U, J.",
    },
    Row {
        function: KineticEnergyRegressor,
        name: "kinetic_energy_regressor",
        letter: "T",
        size: (Fixed(1), ByParameter),
        arguments: &[Positions, Velocities],
        kind: Kind::Other,
        what: "Row of the kinetic energy: T = row·π.",
        returns: "Returns 1 × p.",
    },
    Row {
        function: PotentialEnergyRegressor,
        name: "potential_energy_regressor",
        letter: "U",
        size: (Fixed(1), ByParameter),
        arguments: &[Positions],
        kind: Kind::Other,
        what: "Row of the potential energy, up to a constant: U = row·π.",
        returns: "Returns 1 × p.",
    },
    Row {
        function: Momentum,
        name: "momentum",
        letter: "p",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Generalised momentum B(q)·q̇.",
        returns: "Returns the momenta, N·m·s.",
    },
    Row {
        function: TorqueByPosition,
        name: "torque_by_position",
        letter: "dtau_dq",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Accelerations, Parameters],
        kind: Kind::Dynamics,
        what: "∂τ/∂q of the inverse dynamics.",
        returns: "Returns n × n; column j is the derivative by q of joint j.",
    },
    Row {
        function: TorqueByVelocity,
        name: "torque_by_velocity",
        letter: "dtau_ddq",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Accelerations, Parameters],
        kind: Kind::Dynamics,
        what: "∂τ/∂q̇ of the inverse dynamics.",
        returns: "Returns n × n; column j is the derivative by q̇ of joint j.",
    },
    Row {
        function: AccelerationByPosition,
        name: "acceleration_by_position",
        letter: "dddq_dq",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Torques, Parameters],
        kind: Kind::Dynamics,
        what: "∂q̈/∂q of the forward dynamics at given torques: −B⁻¹·∂τ/∂q. With ∂q̈/∂τ = B⁻¹ it is the linearisation \
            of the arm.",
        returns: "Returns n × n; column j is the derivative by q of joint j.",
    },
    Row {
        function: AccelerationByVelocity,
        name: "acceleration_by_velocity",
        letter: "dddq_ddq",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Torques, Parameters],
        kind: Kind::Dynamics,
        what: "∂q̈/∂q̇ of the forward dynamics at given torques: −B⁻¹·∂τ/∂q̇.",
        returns: "Returns n × n, 1/s; column j is the derivative by q̇ of joint j.",
    },
    Row {
        function: MassMatrixRate,
        name: "mass_matrix_rate",
        letter: "dB",
        size: (Joints, Joints),
        arguments: &[Positions, Velocities, Parameters],
        kind: Kind::Dynamics,
        what: "Rate of the mass matrix, Ḃ(q, q̇) = C + Cᵀ.",
        returns: "Returns Ḃ, n × n, kg·m²/s.",
    },
    Row {
        function: MassMatrixTimesByPosition,
        name: "mass_matrix_times_by_position",
        letter: "dBe_dq",
        size: (Joints, Joints),
        arguments: &[Positions, Errors, Parameters],
        kind: Kind::Dynamics,
        what: "∂(B(q)·e)/∂q for a vector e that does not depend on q.",
        returns: "Returns n × n; column j is the derivative by q of joint j.",
    },
    Row {
        function: JacobianRate,
        name: "jacobian_rate",
        letter: "dJ",
        size: (Fixed(6), Joints),
        arguments: &[Positions, Velocities],
        kind: Kind::Other,
        what: "Rate of the geometric Jacobian of the tool's frame, J̇(q, q̇), in base axes.",
        returns: "Returns J̇, 6 × n.",
    },
    Row {
        function: JacobianTransposeTimes,
        name: "jacobian_transpose_times",
        letter: "tau",
        size: (Joints, Fixed(1)),
        arguments: &[Positions, Wrench],
        kind: Kind::Other,
        what: "Jᵀ(q)·f: the joint torques that hold a wrench f on the tool's frame.",
        returns: "Returns the torques, N·m (N where prismatic).",
    },
    Row {
        function: JacobianTransposeTimesByPosition,
        name: "jacobian_transpose_times_by_position",
        letter: "dtau_dq",
        size: (Joints, Joints),
        arguments: &[Positions, Wrench],
        kind: Kind::Other,
        what: "∂(Jᵀ(q)·f)/∂q for a wrench f that does not depend on q, in base axes.",
        returns: "Returns n × n; column j is the derivative by q of joint j.",
    },
    Row {
        function: TaskInertiaInverse,
        name: "task_inertia_inverse",
        letter: "Linv",
        size: (Fixed(6), Fixed(6)),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Inverse of the inertia that a wrench on the tool's frame feels: Λ⁻¹ = J·B⁻¹·Jᵀ (Khatib 1987), in base \
            axes.",
        returns: "Returns Λ⁻¹, 6 × 6, symmetric; not finite where the parameters make B singular.",
    },
    Row {
        function: TaskInertia,
        name: "task_inertia",
        letter: "L",
        size: (Fixed(6), Fixed(6)),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Operational-space inertia Λ = (J·B⁻¹·Jᵀ)⁻¹ of the tool's frame (Khatib 1987), in base axes.",
        returns: "Returns Λ, 6 × 6, symmetric; not finite where the Jacobian loses rank.",
    },
    Row {
        function: ConsistentInverse,
        name: "dynamically_consistent_inverse",
        letter: "Jbar",
        size: (Joints, Fixed(6)),
        arguments: &[Positions, Parameters],
        kind: Kind::Dynamics,
        what: "Dynamically consistent inverse of the Jacobian, J̄ = B⁻¹·Jᵀ·Λ (Khatib 1987): torques of the null space \
            (I − JᵀJ̄ᵀ)·τ do not accelerate the tool's frame.",
        returns: "Returns J̄, n × 6; not finite where the Jacobian loses rank.",
    },
];

impl Function {
    /// All of them, in the order in which they are emitted.
    pub const ALL: [Function; 33] = {
        let mut all = [InverseDynamics; 33];
        let mut k = 0;
        while k < all.len() {
            all[k] = TABLE[k].function;
            k += 1;
        }
        all
    };

    /// Those that a file has unless others are asked for: what identification and most controllers need.
    pub fn common() -> impl Iterator<Item = Function> {
        Self::ALL.into_iter().take_while(|f| *f <= TorqueByVelocity)
    }

    /// Whether it is of the tool's frame, so that other frames have it too.
    pub fn is_of_tool(self) -> bool {
        self.is_kinematic() || matches!(self, TaskInertiaInverse | TaskInertia | ConsistentInverse)
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

    /// What stands before the number of an entry where results are columns of a table: `tau`, `Y`.
    pub fn letter(self) -> &'static str {
        self.row().letter
    }

    /// What it computes, and what it returns with the unit: one sentence each.
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
        let length = |size: Size| match size {
            Size::Joints => n,
            Size::Parameters => p,
            Size::Fixed(length) => length,
        };
        let (rows, columns) = self.size();
        (length(rows), length(columns))
    }

    /// What it takes.
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
        )
    }

    pub(crate) fn kind(self) -> Kind {
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
        ) {
            "the mass matrix B(q) is singular there with these parameter values; `dyngen check` says which \
             link cannot be real"
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
