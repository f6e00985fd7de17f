//! A random point: a state of the arm and values of its parameters, modulo the prime.

use crate::arm::{Arm, Convention, JointKind, Parameter};
use crate::base::sets::{Combination, ParameterSet, Sets};
use crate::dynamics::FunctionGraph;
use crate::dynamics::elements::{ArmElements, Source};
use crate::dynamics::lagrangian::twice_lagrangian;
use crate::exact::jet::{Jet, Jets};
use crate::exact::prime::{Draws, Fp};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::graph::{Input, evaluate};

/// A state and parameter values.
pub(super) struct Point<'a> {
    arm: &'a Arm,
    symbols: &'a AngleSymbols,
    sets: &'a Sets,
    /// For a revolute joint sine and cosine of its trigonometric input, for a prismatic one q twice.
    positions: Vec<(Fp, Fp)>,
    pub(super) speeds: Vec<Fp>,
    pub(super) accelerations: Vec<Fp>,
    /// Values of the arm's kept parameters.
    values: Vec<(Parameter, Fp)>,
}

impl<'a> Point<'a> {
    pub(super) fn draw(arm: &'a Arm, symbols: &'a AngleSymbols, sets: &'a Sets, draws: &mut Draws) -> Self {
        let positions = arm
            .joints
            .iter()
            .map(|joint| match joint.kind {
                JointKind::Revolute => draws.element().circle_point(),
                JointKind::Prismatic => {
                    let q = draws.element();
                    (q, q)
                }
            })
            .collect();
        let mut vector = || (0..arm.dof()).map(|_| draws.element()).collect::<Vec<_>>();
        let (speeds, accelerations) = (vector(), vector());
        let values = arm.kept_parameters().into_iter().map(|p| (p, draws.element())).collect();
        Point { arm, symbols, sets, positions, speeds, accelerations, values }
    }

    pub(super) fn dof(&self) -> usize {
        self.arm.dof()
    }

    /// The regressor of all parameters, by the Euler–Lagrange equations: for each parameter its torques.
    fn columns(&self, speeds: &[Fp], accelerations: &[Fp], with_gravity: bool) -> Vec<Vec<Fp>> {
        let mut source = JetSource { point: self, speeds, accelerations, with_gravity };
        let elements = ArmElements::build(&Jets, self.arm, self.symbols, &mut source);
        let half = Fp::from_integer(2).inverse().unwrap_or(Fp::ONE);
        twice_lagrangian(&Jets, &elements)
            .iter()
            .map(|jet| (0..self.dof()).map(|i| half * jet.euler_lagrange(i)).collect())
            .collect()
    }

    /// The torques of a motion at this pose with the point's parameter values.
    pub(super) fn torques(&self, speeds: &[Fp], accelerations: &[Fp], with_gravity: bool) -> Vec<Fp> {
        let columns = self.columns(speeds, accelerations, with_gravity);
        let mut torques = vec![Fp::ZERO; self.dof()];
        for (parameter, value) in &self.values {
            for (torque, entry) in torques.iter_mut().zip(&columns[parameter.index()]) {
                *torque = *torque + *value * *entry;
            }
        }
        torques
    }

    /// Y of a set from the Lagrangian: its columns are those of the carriers.
    pub(super) fn regressor_of_set(&self, set: &ParameterSet) -> Vec<Fp> {
        let columns = self.columns(&self.speeds, &self.accelerations, true);
        let n = self.dof();
        let mut rows = vec![Fp::ZERO; n * set.parameters.len()];
        for (c, parameter) in set.parameters.iter().enumerate() {
            for (carrier, factor) in &parameter.carriers {
                let factor = self.sets.field.modular(factor).unwrap_or(Fp::ZERO);
                for i in 0..n {
                    let entry = &mut rows[i * set.parameters.len() + c];
                    *entry = *entry + factor * columns[carrier.index()][i];
                }
            }
        }
        rows
    }

    /// The homogeneous transform of the last frame as a product of elementary ones, row-major.
    pub(super) fn pose(&self) -> Vec<Fp> {
        let mut source = JetSource {
            point: self,
            speeds: &self.speeds,
            accelerations: &self.accelerations,
            with_gravity: true,
        };
        let elements = ArmElements::build(&Jets, self.arm, self.symbols, &mut source);
        let (zero, one) = (Fp::ZERO, Fp::ONE);
        let mut pose = [
            [one, zero, zero, zero],
            [zero, one, zero, zero],
            [zero, zero, one, zero],
            [zero, zero, zero, one],
        ];
        for joint in &elements.joints {
            let v = |jet: &Jet| jet.value();
            let (s, c, sa, ca) = (v(&joint.sin), v(&joint.cos), v(&joint.sin_alpha), v(&joint.cos_alpha));
            let about_z = [
                [c, -s, zero, zero],
                [s, c, zero, zero],
                [zero, zero, one, v(&joint.shift)],
                [zero, zero, zero, one],
            ];
            let about_x = [
                [one, zero, zero, v(&joint.a)],
                [zero, ca, -sa, zero],
                [zero, sa, ca, zero],
                [zero, zero, zero, one],
            ];
            pose = match self.arm.convention {
                Convention::Standard => product(&product(&pose, &about_z), &about_x),
                Convention::Modified => product(&product(&pose, &about_x), &about_z),
            };
        }
        pose.concat()
    }

    /// The function's graph at this point, with the set's sums of the parameter values.
    pub(super) fn evaluate(&self, set: &ParameterSet, function: &FunctionGraph) -> Option<Vec<Fp>> {
        let sums: Vec<Fp> = set.parameters.iter().map(|p| self.sum(&p.terms)).collect();
        // Forward dynamics gets the torques of the point's motion and must give its accelerations back.
        let torques = match function.function.takes_torques() {
            true => self.torques(&self.speeds, &self.accelerations, true),
            false => Vec::new(),
        };
        let input = |input: Input| match input {
            Input::Sin(i) | Input::Position(i) => self.positions[i].0,
            Input::Cos(i) => self.positions[i].1,
            Input::Speed(i) => self.speeds[i],
            Input::Acceleration(i) => self.accelerations[i],
            Input::Torque(i) => torques[i],
            Input::Parameter(i) => sums[i],
        };
        let symbol = |index, sine| self.sets.field.modular_symbol(index, sine);
        evaluate::evaluate(&function.graph, &function.outputs, input, symbol)
    }

    fn sum(&self, terms: &Combination) -> Fp {
        terms.iter().fold(Fp::ZERO, |sum, (parameter, factor)| {
            let value = self.values.iter().find(|(p, _)| p == parameter).map_or(Fp::ZERO, |(_, v)| *v);
            sum + self.sets.field.modular(factor).unwrap_or(Fp::ZERO) * value
        })
    }
}

fn product(a: &[[Fp; 4]; 4], b: &[[Fp; 4]; 4]) -> [[Fp; 4]; 4] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).fold(Fp::ZERO, |sum, k| sum + a[i][k] * b[k][j])))
}

/// The arm's quantities as jets along the point's motion.
struct JetSource<'p, 'a> {
    point: &'p Point<'a>,
    speeds: &'p [Fp],
    accelerations: &'p [Fp],
    with_gravity: bool,
}

impl JetSource<'_, '_> {
    fn number(&self, value: &Rational) -> Jet {
        // Numbers with the prime in a denominator were refused when the sets were derived.
        Jet::constant(Fp::from_rational(value).unwrap_or(Fp::ZERO))
    }
}

impl Source<Jet> for JetSource<'_, '_> {
    fn joint_trig(&mut self, joint: usize) -> (Jet, Jet) {
        let (sin, cos) = self.point.positions[joint];
        // sin(q + theta) by the addition theorem where theta is a multiple of pi/2; the input holds any other theta.
        let (st, ct) = match self.point.arm.joints[joint].theta.quarter_turns() {
            None => (Fp::ZERO, Fp::ONE),
            Some(turns) => {
                let cycle = [0, 1, 0, -1].map(Fp::from_integer);
                (cycle[usize::from(turns % 4)], cycle[usize::from((turns + 1) % 4)])
            }
        };
        let (s, c) = (sin * ct + cos * st, cos * ct - sin * st);
        let (n, dq) = (self.point.dof(), self.speeds[joint]);
        (Jet::of_position(n, joint, s, c, dq), Jet::of_position(n, joint, c, -s, dq))
    }
    fn position(&mut self, joint: usize) -> Jet {
        Jet::of_position(self.point.dof(), joint, self.point.positions[joint].0, Fp::ONE, self.speeds[joint])
    }
    fn speed(&mut self, joint: usize) -> Jet {
        Jet::speed(self.point.dof(), joint, self.speeds[joint], self.accelerations[joint])
    }
    fn a(&mut self, joint: usize) -> Jet {
        self.number(&self.point.arm.joints[joint].a)
    }
    fn d(&mut self, joint: usize) -> Jet {
        self.number(&self.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Jet {
        let ratio = self.point.arm.joints[joint].rotor_ratio.clone();
        ratio.map_or(Jet::constant(Fp::ZERO), |k| self.number(&k))
    }
    fn gravity(&mut self, axis: usize) -> Jet {
        if self.with_gravity { self.number(&self.point.arm.gravity[axis]) } else { Jet::constant(Fp::ZERO) }
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Jet {
        Jet::constant(self.point.sets.field.modular_symbol(index, sine))
    }
}
