"""Every generated function of an arm, over numpy arrays.

Each is proven equal to the Lagrangian before it runs. States have shape (n,) for one sample or (N, n) for N;
all states of a call have the same shape, and so has what comes back: (N, n, p) where one sample gives (n, p).
Arrays are C-contiguous float64; others are converted. A wrong shape, NaN or infinity is a ``ValueError`` that
names the argument.
"""

from __future__ import annotations

from typing import Dict, Optional

from numpy.typing import ArrayLike

from ._arrays import Array, Values


class Functions:
    """The functions of an :class:`~powerball.Arm`.

    ``values`` are the values of the parameters: a dict by name, a JSON file, a result of ``identify``, or an
    array of shape (p,) in the order of the set that ``parameters`` names ("minimal", "symbolic", "published"
    or "full"). An arm from a URDF or a MuJoCo model has the values of that file; there they may be left out.
    """

    def _evaluate(
        self, name: str, parameters: str, values: Optional[Values], states: Dict[str, ArrayLike]
    ) -> Array:
        raise NotImplementedError

    def inverse_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint torques of a motion: τ = B(q)·q̈ + C(q, q̇)·q̇ + g(q), without friction; N·m (N).

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("inverse_dynamics", parameters, values, {"q": q, "dq": dq, "ddq": ddq})

    def inverse_dynamics_without_gravity(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint torques of a motion without gravity: B(q)·q̈ + C(q, q̇)·q̇. N·m.

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate(
            "inverse_dynamics_without_gravity", parameters, values, {"q": q, "dq": dq, "ddq": ddq}
        )

    def regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, parameters: str = "minimal") -> Array:
        """Regressor Y(q, q̇, q̈): τ = Y·π for the p parameters of the set.

        Returns: (n, p) for one sample, (N, n, p) for N.
        """
        return self._evaluate("regressor", parameters, None, {"q": q, "dq": dq, "ddq": ddq})

    def regressor_transpose_times(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, e: ArrayLike, *, parameters: str = "minimal"
    ) -> Array:
        """Yᵀ(q, q̇, q̈)·e without Y itself.

        Returns: (p,) for one sample, (N, p) for N.
        """
        return self._evaluate(
            "regressor_transpose_times", parameters, None, {"q": q, "dq": dq, "ddq": ddq, "e": e}
        )

    def slotine_li_regressor(
        self, q: ArrayLike, dq: ArrayLike, dqr: ArrayLike, ddqr: ArrayLike, *, parameters: str = "minimal"
    ) -> Array:
        """Regressor of Slotine and Li: Y(q, q̇, q̇ᵣ, q̈ᵣ)·π = B·q̈ᵣ + C·q̇ᵣ + g, with C of Christoffel
        symbols.

        Returns: (n, p) for one sample, (N, n, p) for N.
        """
        return self._evaluate(
            "slotine_li_regressor", parameters, None, {"q": q, "dq": dq, "dqr": dqr, "ddqr": ddqr}
        )

    def slotine_li_transpose_times(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        dqr: ArrayLike,
        ddqr: ArrayLike,
        e: ArrayLike,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Yᵀ(q, q̇, q̇ᵣ, q̈ᵣ)·e of Slotine and Li's regressor: the direction of their adaptation law.

        Returns: (p,) for one sample, (N, p) for N.
        """
        return self._evaluate(
            "slotine_li_transpose_times",
            parameters,
            None,
            {"q": q, "dq": dq, "dqr": dqr, "ddqr": ddqr, "e": e},
        )

    def mass_matrix(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Mass matrix B(q), symmetric, kg·m².

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("mass_matrix", parameters, values, {"q": q})

    def mass_matrix_inverse(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Inverse of the mass matrix, symmetric.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("mass_matrix_inverse", parameters, values, {"q": q})

    def coriolis_matrix(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Coriolis matrix C(q, q̇) of Christoffel symbols: Ḃ − 2C is skew-symmetric.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("coriolis_matrix", parameters, values, {"q": q, "dq": dq})

    def coriolis_times_velocity(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Coriolis and centrifugal torques C(q, q̇)·q̇, N·m.

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("coriolis_times_velocity", parameters, values, {"q": q, "dq": dq})

    def coriolis_transpose_times_velocity(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Cᵀ(q, q̇)·q̇ of the Christoffel matrix, which is ∂T/∂q: what a momentum observer integrates. N·m.

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("coriolis_transpose_times_velocity", parameters, values, {"q": q, "dq": dq})

    def gravity(self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal") -> Array:
        """Joint torques that hold the arm still, g(q), N·m.

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("gravity", parameters, values, {"q": q})

    def forward_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint accelerations under joint torques, q̈ = B⁻¹·(τ − C·q̇ − g), without friction, rad/s².

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("forward_dynamics", parameters, values, {"q": q, "dq": dq, "tau": tau})

    def forward_kinematics(self, q: ArrayLike) -> Array:
        """Pose of the tool's frame (the last link's where the arm declares no tool) in the base frame: a
        homogeneous transform, lengths in m.

        Returns: (4, 4) for one sample, (N, 4, 4) for N.
        """
        return self._evaluate("forward_kinematics", "full", None, {"q": q})

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian of the tool's frame in base axes: velocity of the origin, m/s, above the angular
        velocity, rad/s.

        Returns: (6, n) for one sample, (N, 6, n) for N.
        """
        return self._evaluate("jacobian", "full", None, {"q": q})

    def jacobian_rate_times_velocity(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """J̇(q, q̇)·q̇ of the geometric Jacobian: acceleration of the tool's frame where q̈ = 0.

        Returns: (6,) for one sample, (N, 6) for N.
        """
        return self._evaluate("jacobian_rate_times_velocity", "full", None, {"q": q, "dq": dq})

    def kinetic_energy(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Kinetic energy T = ½ q̇ᵀ·B·q̇, J.

        Returns: () for one sample, (N,) for N.
        """
        return self._evaluate("kinetic_energy", parameters, values, {"q": q, "dq": dq})

    def potential_energy(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Potential energy U(q) under gravity, up to a constant, J: ∂U/∂q = g(q).

        Returns: () for one sample, (N,) for N.
        """
        return self._evaluate("potential_energy", parameters, values, {"q": q})

    def kinetic_energy_regressor(self, q: ArrayLike, dq: ArrayLike, *, parameters: str = "minimal") -> Array:
        """Row of the kinetic energy: T = row·π.

        Returns: (p,) for one sample, (N, p) for N.
        """
        return self._evaluate("kinetic_energy_regressor", parameters, None, {"q": q, "dq": dq})

    def potential_energy_regressor(self, q: ArrayLike, *, parameters: str = "minimal") -> Array:
        """Row of the potential energy, up to a constant: U = row·π.

        Returns: (p,) for one sample, (N, p) for N.
        """
        return self._evaluate("potential_energy_regressor", parameters, None, {"q": q})

    def momentum(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Generalised momentum B(q)·q̇, N·m·s.

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("momentum", parameters, values, {"q": q, "dq": dq})

    def torque_by_position(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """∂τ/∂q of the inverse dynamics; column j is the derivative by q of joint j.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("torque_by_position", parameters, values, {"q": q, "dq": dq, "ddq": ddq})

    def torque_by_velocity(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """∂τ/∂q̇ of the inverse dynamics; column j is the derivative by q̇ of joint j.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("torque_by_velocity", parameters, values, {"q": q, "dq": dq, "ddq": ddq})

    def acceleration_by_position(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """∂q̈/∂q of the forward dynamics at given torques; column j is the derivative by q of joint j.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("acceleration_by_position", parameters, values, {"q": q, "dq": dq, "tau": tau})

    def acceleration_by_velocity(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """∂q̈/∂q̇ of the forward dynamics at given torques; column j is the derivative by q̇ of joint j, 1/s.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("acceleration_by_velocity", parameters, values, {"q": q, "dq": dq, "tau": tau})

    def mass_matrix_rate(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Rate of the mass matrix, Ḃ(q, q̇) = C + Cᵀ, kg·m²/s.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("mass_matrix_rate", parameters, values, {"q": q, "dq": dq})

    def mass_matrix_times_by_position(
        self, q: ArrayLike, e: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """∂(B(q)·e)/∂q for a vector e that does not depend on q; column j is the derivative by q of joint j.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("mass_matrix_times_by_position", parameters, values, {"q": q, "e": e})

    def jacobian_rate(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Rate of the geometric Jacobian of the tool's frame, J̇(q, q̇), in base axes.

        Returns: (6, n) for one sample, (N, 6, n) for N.
        """
        return self._evaluate("jacobian_rate", "full", None, {"q": q, "dq": dq})

    def jacobian_transpose_times(self, q: ArrayLike, f: ArrayLike) -> Array:
        """Jᵀ(q)·f: the joint torques that hold a wrench f on the tool's frame; f is the force, N, above the
        moment about the frame's origin, N·m, in base axes, (6,) or (N, 6).

        Returns: (n,) for one sample, (N, n) for N, N·m (N).
        """
        return self._evaluate("jacobian_transpose_times", "full", None, {"q": q, "f": f})

    def jacobian_transpose_times_by_position(self, q: ArrayLike, f: ArrayLike) -> Array:
        """∂(Jᵀ(q)·f)/∂q for a wrench f that does not depend on q; column j is the derivative by q of joint j.

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("jacobian_transpose_times_by_position", "full", None, {"q": q, "f": f})

    def task_inertia_inverse(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Inverse of the inertia that a wrench on the tool's frame feels: Λ⁻¹ = J·B⁻¹·Jᵀ (Khatib 1987), in
        base axes.

        Returns: (6, 6) for one sample, (N, 6, 6) for N.
        """
        return self._evaluate("task_inertia_inverse", parameters, values, {"q": q})

    def task_inertia(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Operational-space inertia Λ = (J·B⁻¹·Jᵀ)⁻¹ of the tool's frame (Khatib 1987), in base axes; not
        finite where the Jacobian loses rank.

        Returns: (6, 6) for one sample, (N, 6, 6) for N.
        """
        return self._evaluate("task_inertia", parameters, values, {"q": q})

    def dynamically_consistent_inverse(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "minimal"
    ) -> Array:
        """Dynamically consistent inverse of the Jacobian, J̄ = B⁻¹·Jᵀ·Λ (Khatib 1987): torques
        (I − JᵀJ̄ᵀ)·τ do not accelerate the tool's frame.

        Returns: (n, 6) for one sample, (N, n, 6) for N.
        """
        return self._evaluate("dynamically_consistent_inverse", parameters, values, {"q": q})

    def body_jacobian(self, q: ArrayLike) -> Array:
        """Jacobian of the tool's frame in its own axes: velocity of the origin above the angular velocity.

        Returns: (6, n) for one sample, (N, 6, n) for N.
        """
        return self._evaluate("body_jacobian", "full", None, {"q": q})

    def spatial_jacobian(self, q: ArrayLike) -> Array:
        """Jacobian of the tool's link about the base's origin, in base axes (Murray, Li and Sastry 1994).

        Returns: (6, n) for one sample, (N, 6, n) for N.
        """
        return self._evaluate("spatial_jacobian", "full", None, {"q": q})

    def twist(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Velocity of the tool's frame, J(q)·q̇, in base axes: that of the origin, m/s, above the angular
        velocity, rad/s.

        Returns: (6,) for one sample, (N, 6) for N.
        """
        return self._evaluate("twist", "full", None, {"q": q, "dq": dq})

    def twist_rate(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Acceleration of the tool's frame, J(q)·q̈ + J̇(q, q̇)·q̇, in base axes.

        Returns: (6,) for one sample, (N, 6) for N.
        """
        return self._evaluate("twist_rate", "full", None, {"q": q, "dq": dq, "ddq": ddq})

    def inverse_dynamics_with_payload(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        payload: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint torques of a motion with a payload on the tool's frame, N·m (N). ``payload`` is m, mx,
        my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz in the frame's axes and about its origin, (10,) or (N, 10).

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate(
            "inverse_dynamics_with_payload",
            parameters,
            values,
            {"q": q, "dq": dq, "ddq": ddq, "payload": payload},
        )

    def payload_regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Regressor of a payload on the tool's frame: τ with it is τ without it + Y·payload, for its ten
        parameters.

        Returns: (n, 10) for one sample, (N, n, 10) for N.
        """
        return self._evaluate("payload_regressor", "full", None, {"q": q, "dq": dq, "ddq": ddq})

    def mass_matrix_with_payload(
        self,
        q: ArrayLike,
        payload: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Mass matrix B(q) with a payload on the tool's frame, symmetric. ``payload`` is m, mx, my, mz, Ixx,
        Ixy, Ixz, Iyy, Iyz, Izz in the frame's axes and about its origin, (10,) or (N, 10).

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate("mass_matrix_with_payload", parameters, values, {"q": q, "payload": payload})

    def coriolis_matrix_with_payload(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        payload: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Coriolis matrix C(q, q̇) of Christoffel symbols with a payload on the tool's frame. ``payload`` is
        m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz in the frame's axes and about its origin, (10,) or (N,
        10).

        Returns: (n, n) for one sample, (N, n, n) for N.
        """
        return self._evaluate(
            "coriolis_matrix_with_payload", parameters, values, {"q": q, "dq": dq, "payload": payload}
        )

    def gravity_with_payload(
        self,
        q: ArrayLike,
        payload: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint torques that hold the arm with a payload on the tool's frame still, N·m (N). ``payload`` is
        m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz in the frame's axes and about its origin, (10,) or (N,
        10).

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate("gravity_with_payload", parameters, values, {"q": q, "payload": payload})

    def forward_dynamics_with_payload(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        payload: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """Joint accelerations under joint torques with a payload on the tool's frame, without friction.
        ``payload`` is m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz in the frame's axes and about its origin,
        (10,) or (N, 10).

        Returns: (n,) for one sample, (N, n) for N.
        """
        return self._evaluate(
            "forward_dynamics_with_payload",
            parameters,
            values,
            {"q": q, "dq": dq, "tau": tau, "payload": payload},
        )

    def torque_hessian_times(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        e: ArrayLike,
        vq: ArrayLike,
        vdq: ArrayLike,
        values: Optional[Values] = None,
        *,
        parameters: str = "minimal",
    ) -> Array:
        """The Hessian of eᵀ·τ(q, q̇, q̈) by (q, q̇) times the direction (vq, vdq): the part of q, then that of
        q̇.

        Returns: (n, 2) for one sample, (N, n, 2) for N.
        """
        return self._evaluate(
            "torque_hessian_times",
            parameters,
            values,
            {"q": q, "dq": dq, "ddq": ddq, "e": e, "vq": vq, "vdq": vdq},
        )

    def centre_of_mass(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "full"
    ) -> Array:
        """Centre of mass of the whole arm in the base frame, m; asked with ``parameters="full"``, because no
        torque shows all masses.

        Returns: (3,) for one sample, (N, 3) for N.
        """
        return self._evaluate("centre_of_mass", parameters, values, {"q": q})

    def centre_of_mass_jacobian(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "full"
    ) -> Array:
        """Jacobian of the centre of mass of the whole arm, in base axes.

        Returns: (3, n) for one sample, (N, 3, n) for N.
        """
        return self._evaluate("centre_of_mass_jacobian", parameters, values, {"q": q})

    def total_momentum(
        self, q: ArrayLike, dq: ArrayLike, values: Optional[Values] = None, *, parameters: str = "full"
    ) -> Array:
        """Momentum of the whole arm with its rotors: linear, kg·m/s, above angular about the base's origin,
        kg·m²/s, in base axes.

        Returns: (6,) for one sample, (N, 6) for N.
        """
        return self._evaluate("total_momentum", parameters, values, {"q": q, "dq": dq})

    def total_momentum_matrix(
        self, q: ArrayLike, values: Optional[Values] = None, *, parameters: str = "full"
    ) -> Array:
        """Matrix of the momentum of the whole arm: momentum = A(q)·q̇.

        Returns: (6, n) for one sample, (N, 6, n) for N.
        """
        return self._evaluate("total_momentum_matrix", parameters, values, {"q": q})
