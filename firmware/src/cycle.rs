//! One cycle of a controller with everything on, in single precision: the torque of an explained model, joint
//! impedance, limits, the momentum observer, and the test whether the model still holds.

use crate::arm::{self, Prepared, Trig};
use crate::f32::{friction, tau, trig};
use crate::watch::Watch;
use nalgebra::{SMatrix, SVector};
use powerball::controller::correction::{Corrector, Instant, Law, Term};
use powerball::controller::dynamics::{ArmModel, Reference, State};
use powerball::controller::laws::{JointImpedance, Limiter, MomentumObserver};

/// One number a joint.
pub type Joints = SVector<f32, 6>;

/// Time between two cycles, s.
const PERIOD: f32 = 0.005;

/// Three effects: presliding, friction under load, and a ripple with its two waves.
const EFFECTS: [Term<f32>; 4] = [
    Term { joint: 0, coefficient: 3.9, law: Law::Presliding { distance: 0.018 } },
    Term { joint: 1, coefficient: 0.12, law: Law::Load { steepness: 200.0 } },
    Term { joint: 2, coefficient: 0.5, law: Law::Cosine { order: 16.0 } },
    Term { joint: 2, coefficient: -0.3, law: Law::Sine { order: 16.0 } },
];

/// The arm at one pose, whose sines and cosines all functions share.
struct AtPose<'a> {
    trig: Trig<f32>,
    values: &'a Prepared<f32>,
}

impl ArmModel<f32, 6> for AtPose<'_> {
    fn mass_matrix(&self, _: &Joints) -> SMatrix<f32, 6, 6> {
        arm::mass_matrix_with(&self.trig, self.values)
    }
    fn coriolis_times_velocity(&self, _: &Joints, dq: &Joints) -> Joints {
        arm::coriolis_times_velocity_with(&self.trig, dq, self.values)
    }
    fn coriolis_transpose_times_velocity(&self, _: &Joints, dq: &Joints) -> Joints {
        arm::coriolis_transpose_times_velocity_with(&self.trig, dq, self.values)
    }
    fn gravity(&self, _: &Joints) -> Joints {
        arm::gravity_with(&self.trig, self.values)
    }
    fn momentum(&self, _: &Joints, dq: &Joints) -> Joints {
        arm::momentum_with(&self.trig, dq, self.values)
    }
}

/// What a controller remembers from cycle to cycle.
pub struct Controller {
    effects: Corrector<f32, 4>,
    law: JointImpedance<f32, 6>,
    limiter: Limiter<f32, 6>,
    observer: MomentumObserver<f32, 6>,
    /// What of the last torque went into friction and effects, N·m.
    added: Joints,
    /// Whether the model still holds.
    pub watch: Watch,
}

/// What a cycle gives.
pub struct Output {
    /// For the drives, N·m.
    pub torque: Joints,
    /// External torque by joint, N·m.
    pub external: Joints,
    /// The model's torque: rigid arm, friction and effects, N·m.
    pub model: Joints,
    /// The model's friction, N·m.
    pub friction: Joints,
}

impl Default for Controller {
    fn default() -> Self {
        let law = JointImpedance { stiffness: Joints::repeat(200.0), damping: Joints::repeat(20.0) };
        Controller {
            effects: Corrector::new(EFFECTS),
            law,
            limiter: Limiter::new(Joints::repeat(64.0), Joints::repeat(2000.0), Joints::zeros()),
            observer: MomentumObserver::new(50.0),
            added: Joints::zeros(),
            watch: Watch::default(),
        }
    }
}

/// Trigonometry, torque with three effects, impedance, limits, observer.
#[inline(never)]
pub fn control(
    controller: &mut Controller,
    state: &State<f32, 6>,
    reference: &Reference<f32, 6>,
    values: &Prepared<f32>,
) -> Output {
    let pose = AtPose { trig: trig(&state.q), values };
    // The torque that acted since the last cycle, before it is replaced.
    let acted = *controller.limiter.last() - controller.added;
    let external = controller.observer.advance(&pose, state, &acted, PERIOD);

    let rigid = tau(&pose.trig, &reference.dq, &reference.ddq, values);
    let friction = friction(&reference.dq);
    let now = Instant {
        q: state.q.as_slice(),
        dq: reference.dq.as_slice(),
        ddq: reference.ddq.as_slice(),
        rigid: rigid.as_slice(),
        friction: friction.as_slice(),
        temperature: &[],
        running: 0.0,
    };
    let mut added = friction;
    controller.effects.add_torques(&now, added.as_mut_slice());
    let asked = controller.law.torque(&pose, state, reference) + added;
    controller.added = added;
    Output { torque: controller.limiter.limit(&asked, PERIOD), external, model: rigid + added, friction }
}

/// A turn of the test whether the model still holds; whether its alarm rises.
#[inline(never)]
pub fn watch(watch: &mut Watch, output: &Output, measured: &Joints) -> bool {
    watch.turn(&(measured - output.model), &output.friction)
}

/// Both.
#[inline(never)]
pub fn step(
    controller: &mut Controller,
    state: &State<f32, 6>,
    reference: &Reference<f32, 6>,
    measured: &Joints,
    values: &Prepared<f32>,
) -> (Output, bool) {
    let output = control(controller, state, reference, values);
    let alarm = watch(&mut controller.watch, &output, measured);
    (output, alarm)
}
