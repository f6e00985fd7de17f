//! Values with the derivatives that the Euler–Lagrange equations need, modulo the prime.
//!
//! For L(q, q̇) the torque is τᵢ = d/dt ∂L/∂q̇ᵢ − ∂L/∂qᵢ. A jet carries L, dL/dt along the motion, ∂L/∂q̇ᵢ
//! with its time derivative, and ∂L/∂qᵢ, so one evaluation of L over jets gives every torque exactly.

use super::algebra::Algebra;
use super::prime::Fp;

/// A value with its derivatives at one state of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Jet {
    value: Fp,
    rate: Fp,
    /// ∂/∂q̇ᵢ, its time derivative, and ∂/∂qᵢ for each joint; empty where all are zero.
    joints: Vec<[Fp; 3]>,
}

impl Jet {
    /// A constant.
    pub fn constant(value: Fp) -> Jet {
        Jet { value, rate: Fp::ZERO, joints: Vec::new() }
    }

    /// A function of qᵢ with the given value and derivative, where q̇ᵢ = `dq`.
    pub fn of_position(dof: usize, joint: usize, value: Fp, derivative: Fp, dq: Fp) -> Jet {
        let mut joints = vec![[Fp::ZERO; 3]; dof];
        joints[joint][2] = derivative;
        Jet { value, rate: derivative * dq, joints }
    }

    /// The joint velocity q̇ᵢ itself, where q̈ᵢ = `ddq`.
    pub fn velocity(dof: usize, joint: usize, dq: Fp, ddq: Fp) -> Jet {
        let mut joints = vec![[Fp::ZERO; 3]; dof];
        joints[joint][0] = Fp::ONE;
        Jet { value: dq, rate: ddq, joints }
    }

    /// The value.
    pub fn value(&self) -> Fp {
        self.value
    }

    /// A function that is zero at this state but has this rate along the motion.
    pub fn of_rate(rate: Fp) -> Jet {
        Jet { value: Fp::ZERO, rate, joints: Vec::new() }
    }

    /// ∂/∂q̇ᵢ of this function.
    pub fn by_velocity(&self, joint: usize) -> Fp {
        self.joints.get(joint).map_or(Fp::ZERO, |j| j[0])
    }

    /// d/dt ∂/∂q̇ᵢ − ∂/∂qᵢ of this function.
    pub fn euler_lagrange(&self, joint: usize) -> Fp {
        self.joints.get(joint).map_or(Fp::ZERO, |j| j[1] - j[2])
    }
}

/// Jets as an [`Algebra`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Jets;

impl Algebra for Jets {
    type Value = Jet;

    fn integer(&self, value: i64) -> Jet {
        Jet::constant(Fp::from_integer(value))
    }

    fn is_zero(&self, a: &Jet) -> bool {
        a.value == Fp::ZERO && a.rate == Fp::ZERO && a.joints.is_empty()
    }

    fn add(&self, a: &Jet, b: &Jet) -> Jet {
        let joints = match (a.joints.is_empty(), b.joints.is_empty()) {
            (true, _) => b.joints.clone(),
            (_, true) => a.joints.clone(),
            _ => (a.joints.iter().zip(&b.joints))
                .map(|(x, y)| [x[0] + y[0], x[1] + y[1], x[2] + y[2]])
                .collect(),
        };
        Jet { value: a.value + b.value, rate: a.rate + b.rate, joints }
    }

    fn neg(&self, a: &Jet) -> Jet {
        Jet { value: -a.value, rate: -a.rate, joints: a.joints.iter().map(|j| j.map(|x| -x)).collect() }
    }

    fn mul(&self, a: &Jet, b: &Jet) -> Jet {
        let none = [Fp::ZERO; 3];
        let joints = (0..a.joints.len().max(b.joints.len()))
            .map(|i| {
                let (x, y) = (a.joints.get(i).unwrap_or(&none), b.joints.get(i).unwrap_or(&none));
                [
                    x[0] * b.value + a.value * y[0],
                    x[1] * b.value + x[0] * b.rate + a.rate * y[0] + a.value * y[1],
                    x[2] * b.value + a.value * y[2],
                ]
            })
            .collect();
        Jet { value: a.value * b.value, rate: a.rate * b.value + a.value * b.rate, joints }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pendulum_obeys_its_equation() {
        // L = ½ q̇² + 7 c(q): τ = q̈ + 7 s(q), with 2L = q̇² + 14 c.
        let (s, c) = Fp::from_integer(5).circle_point();
        let (dq, ddq) = (Fp::from_integer(3), Fp::from_integer(-11));
        let cos = Jet::of_position(1, 0, c, -s, dq);
        let velocity = Jet::velocity(1, 0, dq, ddq);
        let twice = Jets.add(&Jets.mul(&velocity, &velocity), &Jets.mul(&Jets.integer(14), &cos));
        assert_eq!(twice.euler_lagrange(0), Fp::from_integer(2) * ddq + Fp::from_integer(14) * s);
    }
}
