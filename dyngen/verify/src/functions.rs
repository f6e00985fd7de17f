//! Every function by the Lagrangian.

use crate::angles::residue;
use crate::dual::Dual;
use crate::lagrangian::{DIRECTIONS, FIRST, Frame, ORIGIN, SECOND, VIRTUAL, first_moments, inertial};
use crate::matrix::{inverse, times, transposed};
use crate::point::{Point, dot, motion};
use dyngen_arm::exact::prime::Fp;
use dyngen_arm::function::{Argument, Function};

/// For each parameter of the arm what it multiplies in a function's result. Behind those of the bodies are
/// the ten of a payload.
type Columns = Vec<Vec<Fp>>;

impl Point<'_> {
    /// The result of a function, row by row; where parameters have a column or a row each, for all those of
    /// the arm. Nothing where the function has no value for the arm, such as the inertia in the task's
    /// coordinates of one with fewer than six joints.
    pub(crate) fn expected(&self, function: Function) -> Option<Vec<Fp>> {
        use Function::*;
        let n = self.dof();
        let (v, a, e) = (self.rates(), self.vector(Argument::Accelerations), self.vector(Argument::Errors));
        let zeros = &vec![Fp::ZERO; n];
        let loaded = function.takes(Argument::Payload);
        let moving = || motion(v, v, a);
        let mass_matrix = || self.mass_matrix(loaded);
        let by_row = |columns: Columns| {
            let all = 11 * self.arm.bodies();
            self.bodies_alone(&columns, all)
        };
        Some(match function {
            InverseDynamics | InverseDynamicsWithPayload => self.torques(loaded),
            InverseDynamicsWithoutGravity => self.weighed(&self.forces(&moving(), false, 0), false),
            Regressor => by_row(self.forces(&moving(), true, 0)),
            RegressorTransposeTimes => self.transpose_times(&self.forces(&moving(), true, 0)),
            SlotineLiRegressor => by_row(self.slotine_li()),
            SlotineLiTransposeTimes => self.transpose_times(&self.slotine_li()),
            MassMatrix | MassMatrixWithPayload => mass_matrix(),
            MassMatrixInverse => inverse(mass_matrix(), n)?,
            CoriolisMatrix | CoriolisMatrixWithPayload => self.coriolis_matrix(loaded),
            CoriolisTimesVelocity => self.weighed(&self.forces(&motion(v, v, zeros), false, 0), false),
            CoriolisTransposeTimesVelocity => times(&transposed(&self.coriolis_matrix(false), n), v, n),
            Gravity | GravityWithPayload => {
                self.weighed(&self.forces(&motion(zeros, zeros, zeros), true, 0), loaded)
            }
            ForwardDynamics | ForwardDynamicsWithPayload => a.to_vec(),
            KineticEnergy => vec![dot(&self.values, &self.kinetic_energy())],
            PotentialEnergy => vec![dot(&self.values, &self.potential_energy())],
            KineticEnergyRegressor => self.kinetic_energy(),
            PotentialEnergyRegressor => self.potential_energy(),
            Momentum => times(&mass_matrix(), v, n),
            TorqueByPosition => self.torque_derivatives(Self::position_changed),
            TorqueByVelocity => self.torque_derivatives(Self::velocity_changed),
            AccelerationByPosition | AccelerationByVelocity => {
                let of = match function {
                    AccelerationByPosition => Self::position_changed,
                    _ => Self::velocity_changed,
                };
                let derivatives = self.torque_derivatives(of);
                times(&inverse(mass_matrix(), n)?, &derivatives, n).into_iter().map(|x| -x).collect()
            }
            MassMatrixRate => self.by_columns(|j| {
                let motion = Self::position_changed(motion(zeros, zeros, &unit(n, j)), DIRECTIONS[0], v);
                self.weighed(&self.forces(&motion, false, DIRECTIONS[0]), false)
            }),
            MassMatrixTimesByPosition => self.by_columns(|k| {
                let motion = Self::position_changed(motion(zeros, zeros, e), DIRECTIONS[0], &unit(n, k));
                self.weighed(&self.forces(&motion, false, DIRECTIONS[0]), false)
            }),
            TorqueHessianTimes => self.torque_hessian_times(),
            ForwardKinematics => self.pose(),
            Jacobian => self.jacobian(),
            JacobianTransposeTimes => {
                times(&transposed(&self.jacobian(), n), self.vector(Argument::Wrench), 6)
            }
            Twist => self.twist(motion(v, zeros, zeros), FIRST, 0),
            JacobianRateTimesVelocity => self.twist(motion(v, v, zeros), FIRST, SECOND),
            TwistRate => self.twist(moving(), FIRST, SECOND),
            JacobianRate => self.by_columns(|j| self.twist(motion(v, &unit(n, j), zeros), SECOND, FIRST)),
            JacobianTransposeTimesByPosition => {
                let entry = |i: usize, k: usize| {
                    let second = self.twist(motion(&unit(n, k), &unit(n, i), zeros), SECOND, FIRST);
                    dot(&second, self.vector(Argument::Wrench))
                };
                (0..n * n).map(|k| entry(k / n, k % n)).collect()
            }
            BodyJacobian => self.body_jacobian(),
            SpatialJacobian => self.spatial_jacobian(),
            TaskInertiaInverse => self.task_inertia_inverse()?,
            TaskInertia => inverse(self.task_inertia_inverse()?, 6)?,
            ConsistentInverse => {
                let driven = times(&inverse(mass_matrix(), n)?, &transposed(&self.jacobian(), n), n);
                times(&driven, &inverse(self.task_inertia_inverse()?, 6)?, 6)
            }
            PayloadRegressor => {
                let columns = self.forces(&moving(), true, 0);
                self.bodies_alone(&columns[columns.len() - 10..], 10)
            }
            CentreOfMass => self.centre_of_mass()?,
            CentreOfMassJacobian => {
                let inverse = self.mass().inverse()?;
                self.total_momentum_matrix()[..3 * n].iter().map(|x| *x * inverse).collect()
            }
            TotalMomentum => times(&self.total_momentum_matrix(), v, n),
            TotalMomentumMatrix => self.total_momentum_matrix(),
        })
    }

    fn rates(&self) -> &[Fp] {
        self.vector(Argument::Velocities)
    }

    /// The torques of the point's motion.
    pub(crate) fn torques(&self, loaded: bool) -> Vec<Fp> {
        let motion = motion(self.rates(), self.rates(), self.vector(Argument::Accelerations));
        self.weighed(&self.forces(&motion, true, 0), loaded)
    }

    /// For each parameter the generalised forces of a motion, derived in the directions of an index.
    fn forces(&self, motion: &[Dual], gravity: bool, index: usize) -> Columns {
        let n = self.dof();
        let mut columns: Columns = Vec::new();
        for j in 0..n {
            let mut change = motion.to_vec();
            change[j] = &change[j] + &Dual::along(VIRTUAL, Fp::ONE);
            let (bodies, tool) = self.chain(change).bodies(false);
            let work = |frame: &Frame, a: usize, b: usize| {
                let term = |row: usize| {
                    let moved = frame.0[a][row].by(VIRTUAL);
                    let mut acceleration = frame.0[b][row].by(FIRST).by(SECOND);
                    if gravity && b == ORIGIN {
                        acceleration = &acceleration - &Dual::number(residue(&self.arm.gravity[row]));
                    }
                    &moved * &acceleration
                };
                &(&term(0) + &term(1)) + &term(2)
            };
            let of_bodies = bodies.iter().flat_map(|body| body.columns(work));
            let all = of_bodies.chain(inertial(|a, b| work(&tool, a, b))).map(|x| x.at(index));
            for (k, x) in all.enumerate() {
                if j == 0 {
                    columns.push(Vec::with_capacity(n));
                }
                columns[k].push(x);
            }
        }
        columns
    }

    /// Columns with the values of the parameters, and of the payload where the arm is loaded.
    fn weighed(&self, columns: &[Vec<Fp>], loaded: bool) -> Vec<Fp> {
        let payload = self.vector(Argument::Payload).iter().filter(|_| loaded);
        let values: Vec<Fp> = self.values.iter().chain(payload).copied().collect();
        let row = |i: usize| columns.iter().zip(&values).fold(Fp::ZERO, |sum, (c, x)| sum + c[i] * *x);
        (0..columns.first().map_or(0, Vec::len)).map(row).collect()
    }

    /// The first of some columns as a matrix.
    fn bodies_alone(&self, columns: &[Vec<Fp>], count: usize) -> Vec<Fp> {
        (0..self.dof()).flat_map(|i| columns[..count].iter().map(move |c| c[i])).collect()
    }

    fn transpose_times(&self, columns: &[Vec<Fp>]) -> Vec<Fp> {
        let e = self.vector(Argument::Errors);
        columns[..11 * self.arm.bodies()].iter().map(|column| dot(column, e)).collect()
    }

    /// The matrix of columns that are each a function's.
    fn by_columns(&self, column: impl Fn(usize) -> Vec<Fp>) -> Vec<Fp> {
        let columns: Vec<Vec<Fp>> = (0..self.dof()).map(column).collect();
        transposed(&columns.concat(), columns.first().map_or(0, Vec::len))
    }

    fn mass_matrix(&self, loaded: bool) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let column = |j| self.forces(&motion(&zeros, &zeros, &unit(self.dof(), j)), false, 0);
        self.by_columns(|j| self.weighed(&column(j), loaded))
    }

    /// Σ tr(∂ᵢT·J·∂ⱼ∂ₖT)·q̇ₖ: Christoffel's symbols.
    fn coriolis_matrix(&self, loaded: bool) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let column = |j| self.forces(&motion(self.rates(), &unit(self.dof(), j), &zeros), false, 0);
        self.by_columns(|j| self.weighed(&column(j), loaded))
    }

    /// B·q̈ᵣ + C·q̇ᵣ + g
    fn slotine_li(&self) -> Columns {
        let [v, a] =
            [Argument::ReferenceVelocities, Argument::ReferenceAccelerations].map(|x| self.vector(x));
        self.forces(&motion(self.rates(), v, a), true, 0)
    }

    /// A motion whose positions change in a direction by an infinitesimal.
    fn position_changed(motion: Vec<Dual>, by: usize, direction: &[Fp]) -> Vec<Dual> {
        motion.iter().zip(direction).map(|(x, d)| x + &Dual::along(by, *d)).collect()
    }

    /// A motion whose velocities do.
    fn velocity_changed(motion: Vec<Dual>, by: usize, direction: &[Fp]) -> Vec<Dual> {
        let changed = |(x, d): (&Dual, &Fp)| {
            [FIRST, SECOND].iter().fold(x.clone(), |sum, time| &sum + &Dual::along(time | by, *d))
        };
        motion.iter().zip(direction).map(changed).collect()
    }

    fn torque_derivatives(&self, changed: impl Fn(Vec<Dual>, usize, &[Fp]) -> Vec<Dual>) -> Vec<Fp> {
        let moving = motion(self.rates(), self.rates(), self.vector(Argument::Accelerations));
        self.by_columns(|k| {
            let motion = changed(moving.clone(), DIRECTIONS[0], &unit(self.dof(), k));
            self.weighed(&self.forces(&motion, true, DIRECTIONS[0]), false)
        })
    }

    /// The derivative of eᵀ·τ in the direction of (vq, vdq), derived by q and by q̇.
    fn torque_hessian_times(&self) -> Vec<Fp> {
        let moving = motion(self.rates(), self.rates(), self.vector(Argument::Accelerations));
        let [along, by] = DIRECTIONS;
        let moving = Self::position_changed(moving, along, self.vector(Argument::PositionDirection));
        let moving = Self::velocity_changed(moving, along, self.vector(Argument::VelocityDirection));
        let of = |changed: fn(Vec<Dual>, usize, &[Fp]) -> Vec<Dual>, j: usize| {
            let motion = changed(moving.clone(), by, &unit(self.dof(), j));
            dot(&self.weighed(&self.forces(&motion, true, along | by), false), self.vector(Argument::Errors))
        };
        (0..self.dof()).flat_map(|j| [of(Self::position_changed, j), of(Self::velocity_changed, j)]).collect()
    }

    /// ½·tr(Ṫ·J·Ṫᵀ) by the parameters.
    fn kinetic_energy(&self) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let (bodies, _) = self.chain(motion(self.rates(), &zeros, &zeros)).bodies(false);
        let square = |frame: &Frame, a: usize, b: usize| {
            let term = |row: usize| &frame.0[a][row].by(FIRST) * &frame.0[b][row].by(FIRST);
            &(&term(0) + &term(1)) + &term(2)
        };
        let half = Fp::from_integer(2).inverse().unwrap_or(Fp::ZERO);
        bodies.iter().flat_map(|body| body.columns(square)).map(|x| half * x.at(0)).collect()
    }

    /// −gᵀ·T·(first moments) by the parameters.
    fn potential_energy(&self) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let (bodies, _) = self.chain(motion(&zeros, &zeros, &zeros)).bodies(false);
        let along = |frame: &Frame, a: usize| {
            let term = |row: usize| frame.0[a][row].times(-residue(&self.arm.gravity[row]));
            &(&term(0) + &term(1)) + &term(2)
        };
        let of = |frame: &Frame| [first_moments(|a| along(frame, a)), vec![Dual::number(Fp::ZERO)]].concat();
        bodies.iter().flat_map(|body| of(&body.frame)).map(|x| x.at(0)).collect()
    }

    fn tool(&self, change: Vec<Dual>) -> Frame {
        self.chain(change).bodies(true).1
    }

    /// The twist of the tool's frame by one infinitesimal, derived by those of an index.
    fn twist(&self, change: Vec<Dual>, by: usize, index: usize) -> Vec<Fp> {
        self.tool(change).twist(by).iter().map(|x| x.at(index)).collect()
    }

    /// 4 × 4
    fn pose(&self) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let Frame(columns) = self.tool(motion(&zeros, &zeros, &zeros));
        let above = (0..12).map(|k| columns[k % 4][k / 4].at(0));
        above.chain([Fp::ZERO, Fp::ZERO, Fp::ZERO, Fp::ONE]).collect()
    }

    /// J, 6 × n
    fn jacobian(&self) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        self.by_columns(|j| self.twist(motion(&unit(self.dof(), j), &zeros, &zeros), FIRST, 0))
    }

    /// Rᵀ·v above Rᵀ·ω.
    fn body_jacobian(&self) -> Vec<Fp> {
        let (pose, jacobian, n) = (self.pose(), self.jacobian(), self.dof());
        let entry = |i: usize, j: usize| {
            (0..3).fold(Fp::ZERO, |sum, k| sum + pose[k * 4 + i % 3] * jacobian[(i / 3 * 3 + k) * n + j])
        };
        (0..6 * n).map(|k| entry(k / n, k % n)).collect()
    }

    /// v + p×ω above ω.
    fn spatial_jacobian(&self) -> Vec<Fp> {
        let (pose, mut jacobian, n) = (self.pose(), self.jacobian(), self.dof());
        let p = |i: usize| pose[i % 3 * 4 + 3];
        for (i, j) in (0..3 * n).map(|k| (k / n, k % n)) {
            let omega = |i: usize| jacobian[(3 + i % 3) * n + j];
            let carried = p(i + 1) * omega(i + 2) - p(i + 2) * omega(i + 1);
            jacobian[i * n + j] = jacobian[i * n + j] + carried;
        }
        jacobian
    }

    /// J·B⁻¹·Jᵀ
    fn task_inertia_inverse(&self) -> Option<Vec<Fp>> {
        let (n, jacobian) = (self.dof(), self.jacobian());
        let driven = times(&jacobian, &inverse(self.mass_matrix(false), n)?, n);
        Some(times(&driven, &transposed(&jacobian, n), n))
    }

    /// The sum of the bodies' first moments in the root link with the mass behind them.
    fn total_first_moments(&self, change: Vec<Dual>, by: usize) -> Vec<Fp> {
        let (bodies, _) = self.chain(change).bodies(true);
        let part = |x: &Dual| if by == 0 { x.at(0) } else { x.at(by) };
        let mut sum = vec![Fp::ZERO; 3];
        for (body, values) in bodies.iter().zip(self.values.chunks(11)) {
            for (row, total) in sum.iter_mut().enumerate() {
                let columns = first_moments(|a| Dual::number(part(&body.frame.0[a][row])));
                *total = columns.iter().zip(values).fold(*total, |sum, (c, x)| sum + c.at(0) * *x);
            }
        }
        sum
    }

    fn mass(&self) -> Fp {
        self.values.iter().step_by(11).fold(Fp::ZERO, |sum, m| sum + *m)
    }

    fn centre_of_mass(&self) -> Option<Vec<Fp>> {
        let zeros = vec![Fp::ZERO; self.dof()];
        let inverse = self.mass().inverse()?;
        let moments = self.total_first_moments(motion(&zeros, &zeros, &zeros), 0);
        Some(moments.into_iter().map(|x| x * inverse).collect())
    }

    /// Linear momentum above the angular momentum Σ r×ṙ about the root link's origin, for a unit of each
    /// joint's velocity: 6 × n.
    fn total_momentum_matrix(&self) -> Vec<Fp> {
        let zeros = vec![Fp::ZERO; self.dof()];
        self.by_columns(|j| {
            let motion = motion(&unit(self.dof(), j), &zeros, &zeros);
            let (bodies, _) = self.chain(motion.clone()).bodies(true);
            let product = |i: usize, k: usize| {
                let of = |frame: &Frame, a: usize, b: usize| &frame.0[a][i] * &frame.0[b][k].by(FIRST);
                let columns: Vec<Fp> =
                    bodies.iter().flat_map(|body| body.columns(of)).map(|x| x.at(0)).collect();
                dot(&columns, &self.values)
            };
            let angular = [(1, 2), (2, 0), (0, 1)].map(|(i, k)| product(i, k) - product(k, i));
            [self.total_first_moments(motion, FIRST), angular.to_vec()].concat()
        })
    }
}

fn unit(n: usize, j: usize) -> Vec<Fp> {
    (0..n).map(|i| if i == j { Fp::ONE } else { Fp::ZERO }).collect()
}
