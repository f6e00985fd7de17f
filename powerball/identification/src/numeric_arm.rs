//! The dynamics that control laws need, for an arm that is known only at run time.

use dyngen::{Error, Evaluator, Function, Model, Samples, SetKind};
use nalgebra::{SMatrix, SVector};
use powerball_controller::dynamics::ArmModel;

/// The rigid dynamics of an arm of `N` joints with values of its minimal set, evaluated and not compiled:
/// some 10 µs a call.
#[derive(Clone, Debug)]
pub struct NumericArm<const N: usize> {
    inertia: Evaluator,
    coriolis: Evaluator,
    transposed: Evaluator,
    gravity: Evaluator,
    values: Vec<f64>,
    /// Offset of the encoders: shown minus true position, rad.
    offset: SVector<f64, N>,
    /// A body that it holds, as an arm of nothing else.
    held: Option<Box<NumericArm<N>>>,
}

impl<const N: usize> NumericArm<N> {
    /// Makes it from a derived arm, the values of its minimal set, and the offsets of its encoders (rad).
    /// `None` if it has another number of joints, or not a value for each parameter.
    ///
    /// # Errors
    /// The errors of [`Model::function`].
    pub fn new(model: &Model, values: &[f64], offset: [f64; N]) -> Result<Option<Self>, Error> {
        if model.arm().dof() != N || model.set(SetKind::Minimal)?.parameters.len() != values.len() {
            return Ok(None);
        }
        let of = |function| Evaluator::new(model, function, SetKind::Minimal);
        Ok(Some(NumericArm {
            inertia: of(Function::MassMatrix)?,
            coriolis: of(Function::CoriolisTimesVelocity)?,
            transposed: of(Function::CoriolisTransposeTimesVelocity)?,
            gravity: of(Function::Gravity)?,
            values: values.to_vec(),
            offset: offset.into(),
            held: None,
        }))
    }

    /// This arm with the bodies of another one, which has the same joints: dynamics are linear in the
    /// parameters.
    #[must_use]
    pub fn holding(self, held: NumericArm<N>) -> Self {
        NumericArm { held: Some(Box::new(held)), ..self }
    }

    /// Adds the part of the held body.
    fn with_held<M: std::ops::Add<Output = M>>(&self, own: M, of: impl Fn(&NumericArm<N>) -> M) -> M {
        match &self.held {
            Some(held) => own + of(held),
            None => own,
        }
    }

    fn vector(&self, function: &Evaluator, q: &SVector<f64, N>, dq: &[f64]) -> SVector<f64, N> {
        let (mut out, q) = (SVector::<f64, N>::zeros(), q - self.offset);
        let samples = Samples { q: q.as_slice(), dq, parameters: &self.values, ..Samples::default() };
        function.run(&samples, out.as_mut_slice());
        out
    }
}

impl<const N: usize> ArmModel<f64, N> for NumericArm<N> {
    fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        // Symmetric: rows are columns.
        let (mut out, whole, q) = (SMatrix::<f64, N, N>::zeros(), *q, q - self.offset);
        let samples = Samples { q: q.as_slice(), parameters: &self.values, ..Samples::default() };
        self.inertia.run(&samples, out.as_mut_slice());
        self.with_held(out, |held| held.mass_matrix(&whole))
    }
    fn coriolis_times_velocity(&self, q: &SVector<f64, N>, dq: &SVector<f64, N>) -> SVector<f64, N> {
        let own = self.vector(&self.coriolis, q, dq.as_slice());
        self.with_held(own, |held| held.coriolis_times_velocity(q, dq))
    }
    fn coriolis_transpose_times_velocity(
        &self,
        q: &SVector<f64, N>,
        dq: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let own = self.vector(&self.transposed, q, dq.as_slice());
        self.with_held(own, |held| held.coriolis_transpose_times_velocity(q, dq))
    }
    fn gravity(&self, q: &SVector<f64, N>) -> SVector<f64, N> {
        self.with_held(self.vector(&self.gravity, q, &[]), |held| held.gravity(q))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use powerball_virtual_arm::lwa4p;

    /// Against the virtual arm's Newton–Euler, which shares no formula with it.
    #[test]
    fn it_is_the_virtual_arm_at_the_links_true_places() {
        let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
        let all: Vec<f64> = lwa4p::links().iter().flat_map(|b| b.parameters()).collect();
        let values = model.set_values(model.set(SetKind::Minimal).unwrap(), &all);
        let offset = [0.01, -0.02, 0.03, 0.0, 0.01, 0.02];
        let arm = NumericArm::<6>::new(&model, &values, offset).unwrap().unwrap();
        let plant = lwa4p::plant().unwrap();
        let q = SVector::from([0.3, -0.7, 1.1, 0.4, -1.2, 2.0]);
        let dq = SVector::from([0.5, -0.4, 0.3, 0.9, -0.8, 1.0]);
        let (truth, dynamics) = (q - SVector::from(offset), plant.dynamics());
        let near = |found: &[f64], expected: &[f64]| {
            for (a, b) in found.iter().zip(expected) {
                approx::assert_relative_eq!(*a, *b, epsilon = 1e-9, max_relative = 1e-9);
            }
        };
        near(arm.mass_matrix(&q).as_slice(), &dynamics.mass_matrix(truth.as_slice()));
        near(arm.gravity(&q).as_slice(), &dynamics.gravity(truth.as_slice()));
        let c =
            SMatrix::<f64, 6, 6>::from_row_slice(&dynamics.coriolis_matrix(truth.as_slice(), dq.as_slice()));
        near(arm.coriolis_times_velocity(&q, &dq).as_slice(), (c * dq).as_slice());
        near(arm.coriolis_transpose_times_velocity(&q, &dq).as_slice(), (c.transpose() * dq).as_slice());
    }
}
