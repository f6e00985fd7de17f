//! Effects of a real arm that its model may lack, as physical laws of the plant.
//!
//! These laws are written for the plant alone. If an estimator has a term for the same phenomenon, its
//! formula is different: the gear's load friction is smooth here, presliding is a set of elastic sliders, and
//! so on. A name is then found for its physics and not for its formula.

mod draw;

use super::dynamics::{Body, Dynamics};
pub use draw::Places;
use nalgebra::{Matrix3, Vector3};
use powerball_controller::friction::TanhFriction;
use serde::{Deserialize, Serialize};

/// Elastic sliders that make up presliding.
const SLIDERS: usize = 4;

/// Stiffness of a gear's teeth once they touch, N·m/rad: so high that winding up is not a second effect in
/// addition to the play.
const TEETH: f64 = 2.0e5;

/// An elastic gear: a spring between motor and link, with play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    /// Stiffness once the teeth touch, N·m/rad.
    pub stiffness: f64,
    /// The whole play, rad.
    pub gap: f64,
}

impl Gear {
    /// The torque onto the link, N·m, where the motor is `ahead` of it, rad at the joint, and whether teeth
    /// touch.
    pub fn torque(&self, ahead: f64) -> (f64, bool) {
        let free = 0.5 * self.gap;
        (self.stiffness * (ahead - ahead.clamp(-free, free)), ahead.abs() >= free)
    }

    /// How far ahead the motor must be for a torque, rad; within the play the teeth lean to the loaded side.
    pub fn windup(&self, torque: f64) -> f64 {
        // Half a newton metre is enough to press the teeth onto one flank.
        torque / self.stiffness + 0.5 * self.gap * torque / torque.hypot(0.5)
    }
}

/// One undeclared effect. Joints count from 0 here and from 1 in [`joints`](PlantEffect::joints).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlantEffect {
    /// The gear's teeth rub in proportion to the torque that they carry, N·m of friction for each N·m.
    LoadFriction {
        /// The joint.
        joint: usize,
        /// Share of the carried torque.
        coefficient: f64,
    },
    /// Friction that is higher while the lubricant's film is not yet built up.
    Stribeck {
        /// The joint.
        joint: usize,
        /// Additional friction at the smallest velocities, N·m.
        level: f64,
        /// Velocity at which the film is built up, rad/s.
        velocity: f64,
    },
    /// Losses that grow faster than the velocity: churned grease.
    VelocityNonlinearity {
        /// The joint.
        joint: usize,
        /// Torque at 1 rad/s, N·m.
        torque: f64,
        /// Exponent of the velocity.
        exponent: f64,
    },
    /// Friction that is higher in one direction, and a torque that pulls to one side.
    Asymmetry {
        /// The joint.
        joint: usize,
        /// Share by which Coulomb friction is higher in the positive direction.
        share: f64,
        /// Constant torque, N·m.
        constant: f64,
    },
    /// Part of the friction builds up over a small way and not at once.
    Hysteresis {
        /// The joint.
        joint: usize,
        /// Friction of all sliders together, N·m.
        level: f64,
        /// The way after which the last slider slips, rad.
        way: f64,
    },
    /// Coulomb friction that is higher on one side of the joint's turn: a seal that is pressed on there.
    FrictionByPosition {
        /// The joint.
        joint: usize,
        /// Largest share by which it is higher and lower.
        share: f64,
        /// Position at which the friction is highest, rad.
        place: f64,
    },
    /// A payload is bolted to the flange.
    Payload {
        /// Mass, kg.
        mass: f64,
        /// Centre of the body in the last frame, m.
        centre: [f64; 3],
        /// Time from which on it acts, s.
        start: f64,
    },
    /// A hose or cable pulls the joint back.
    Spring {
        /// The joint.
        joint: usize,
        /// Stiffness around rest, N·m/rad.
        stiffness: f64,
        /// Position at which the hose is slack, rad.
        rest: f64,
    },
    /// Torque that is periodic in the joint's position: teeth, wave generator, cogging.
    PositionRipple {
        /// The joint.
        joint: usize,
        /// Cycles for each turn of the joint.
        order: f64,
        /// Amplitude, N·m.
        amplitude: f64,
        /// Phase of the ripple at the joint's zero, rad.
        phase: f64,
    },
    /// Lubricant that thins as the joints warm.
    Temperature {
        /// Relative change of viscous friction once warm, negative.
        change: f64,
        /// Time constant of warming, s.
        time_constant: f64,
    },
    /// The drive's current-to-torque factor differs from that of its file.
    TorqueConstant {
        /// The joint.
        joint: usize,
        /// Logged torque over true torque.
        gain: f64,
    },
    /// Torques are logged late.
    TimeDelay {
        /// Delay, s.
        delay: f64,
    },
    /// A joint's encoder has a wrong zero.
    EncoderOffset {
        /// The joint.
        joint: usize,
        /// Logged minus true position, rad.
        offset: f64,
    },
    /// The base is not level.
    BaseTilt {
        /// Rotation of the base about its x and y axes, rad.
        tilt: [f64; 2],
    },
    /// An obstacle or a person pushes the last link repeatedly.
    ContactWrench {
        /// Force at the last frame's origin in the base frame, N.
        force: [f64; 3],
        /// Time of the first push, s.
        start: f64,
        /// Duration of each push, s.
        length: f64,
        /// Time between two pushes, s.
        every: f64,
    },
    /// A link's centre of mass lies off the plane in which it was declared to lie.
    BrokenSymmetry {
        /// The link.
        link: usize,
        /// Shift along the link's x axis, m.
        aside: f64,
    },
    /// A gear that winds up under its load; the encoder sits on the motor.
    JointElasticity {
        /// The joint.
        joint: usize,
        /// Stiffness, N·m/rad.
        stiffness: f64,
    },
    /// Play in a gear.
    Backlash {
        /// The joint.
        joint: usize,
        /// The whole gap, rad at the joint.
        gap: f64,
    },
    /// One joint's friction loads the other joint of its module.
    JointCoupling {
        /// The joint that moves.
        from: usize,
        /// The joint that feels it.
        onto: usize,
        /// Share of the friction that is felt.
        share: f64,
    },
}

/// The quantities on which an effect may depend at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant<'a> {
    /// Time, s.
    pub t: f64,
    /// True joint positions.
    pub q: &'a [f64],
    /// True joint velocities.
    pub dq: &'a [f64],
    /// Torques of the rigid bodies, rotors included.
    pub rigid: &'a [f64],
    /// Friction of each joint without effects.
    pub friction: &'a [TanhFriction<f64>],
    /// The arm without effects.
    pub dynamics: &'a Dynamics,
}

/// The memory of an effect along a motion.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// The joint's last position, and how far each slider is wound up.
    sliders: Option<(f64, [f64; SLIDERS])>,
}

impl PlantEffect {
    /// The name under which the effect is known to users.
    pub fn name(&self) -> &'static str {
        match self {
            PlantEffect::LoadFriction { .. } => "load_friction",
            PlantEffect::Stribeck { .. } => "stribeck",
            PlantEffect::VelocityNonlinearity { .. } => "velocity_nonlinearity",
            PlantEffect::Asymmetry { .. } => "asymmetry",
            PlantEffect::Hysteresis { .. } => "hysteresis",
            PlantEffect::FrictionByPosition { .. } => "friction_by_position",
            PlantEffect::Payload { .. } => "payload",
            PlantEffect::Spring { .. } => "spring",
            PlantEffect::PositionRipple { .. } => "position_ripple",
            PlantEffect::Temperature { .. } => "temperature",
            PlantEffect::TorqueConstant { .. } => "torque_constant",
            PlantEffect::TimeDelay { .. } => "time_delay",
            PlantEffect::EncoderOffset { .. } => "encoder_offset",
            PlantEffect::BaseTilt { .. } => "base_tilt",
            PlantEffect::ContactWrench { .. } => "contact_wrench",
            PlantEffect::BrokenSymmetry { .. } => "broken_symmetry",
            PlantEffect::JointElasticity { .. } => "joint_elasticity",
            PlantEffect::Backlash { .. } => "backlash",
            PlantEffect::JointCoupling { .. } => "joint_coupling",
        }
    }

    /// The joints that the effect sits at, from 1; empty where it is the whole arm's.
    pub fn joints(&self) -> Vec<usize> {
        self.joint().map(|joint| joint + 1).into_iter().collect()
    }

    fn joint(&self) -> Option<usize> {
        match self {
            PlantEffect::LoadFriction { joint, .. }
            | PlantEffect::Stribeck { joint, .. }
            | PlantEffect::VelocityNonlinearity { joint, .. }
            | PlantEffect::Asymmetry { joint, .. }
            | PlantEffect::Hysteresis { joint, .. }
            | PlantEffect::FrictionByPosition { joint, .. }
            | PlantEffect::Spring { joint, .. }
            | PlantEffect::PositionRipple { joint, .. }
            | PlantEffect::TorqueConstant { joint, .. }
            | PlantEffect::EncoderOffset { joint, .. }
            | PlantEffect::JointElasticity { joint, .. }
            | PlantEffect::Backlash { joint, .. }
            | PlantEffect::JointCoupling { onto: joint, .. } => Some(*joint),
            _ => None,
        }
    }

    /// The effect's figures in words.
    pub fn describe(&self) -> String {
        match self {
            PlantEffect::LoadFriction { coefficient, .. } => {
                format!("gear friction of {coefficient:.3} N·m for each N·m that the gear carries")
            }
            PlantEffect::Stribeck { level, velocity, .. } => {
                format!(
                    "{level:.2} N·m more friction at the smallest velocities, gone beyond about \
                    {velocity:.3} rad/s"
                )
            }
            PlantEffect::VelocityNonlinearity { torque, exponent, .. } => {
                format!("{torque:.2} N·m·|q̇|^{exponent:.1} of churning losses")
            }
            PlantEffect::Asymmetry { share, constant, .. } => {
                format!(
                    "Coulomb friction {:+.0} % in the positive direction, {constant:+.2} N·m always",
                    100.0 * share
                )
            }
            PlantEffect::Hysteresis { level, way, .. } => {
                format!("{level:.2} N·m of friction that builds up over {:.1} mrad", 1e3 * way)
            }
            PlantEffect::FrictionByPosition { share, place, .. } => {
                format!("Coulomb friction ±{:.0} % by position, highest at {place:+.2} rad", 100.0 * share)
            }
            PlantEffect::Payload { mass, centre, start } => format!(
                "{mass:.2} kg at ({:.3}, {:.3}, {:.3}) m of the last frame from t = {start:.1} s on",
                centre[0], centre[1], centre[2]
            ),
            PlantEffect::Spring { stiffness, rest, .. } => {
                format!("a hose of {stiffness:.2} N·m/rad that is slack at {rest:+.2} rad")
            }
            PlantEffect::PositionRipple { order, amplitude, .. } => {
                format!("{amplitude:.2} N·m of ripple, {order:.0} cycles a turn")
            }
            PlantEffect::Temperature { change, time_constant } => {
                format!(
                    "viscous friction changes by {:+.0} % with a time constant of {time_constant:.0} s",
                    100.0 * change
                )
            }
            PlantEffect::TorqueConstant { gain, .. } => format!("logged torque is {gain:.3} of the true one"),
            PlantEffect::TimeDelay { delay } => format!("torques are logged {:.1} ms late", 1e3 * delay),
            PlantEffect::EncoderOffset { offset, .. } => {
                format!("the encoder's zero is off by {:+.1} mrad", 1e3 * offset)
            }
            PlantEffect::BaseTilt { tilt } => {
                format!("the base is tilted by ({:+.1}, {:+.1}) mrad", 1e3 * tilt[0], 1e3 * tilt[1])
            }
            PlantEffect::ContactWrench { force, start, length, every } => format!(
                "a force of ({:.0}, {:.0}, {:.0}) N on the wrist for {length:.1} s at t = {start:.1} s and \
                    every {every:.0} s after",
                force[0], force[1], force[2]
            ),
            PlantEffect::BrokenSymmetry { link, aside } => {
                format!("the centre of mass of link {} lies {:+.1} mm off its plane", link + 1, 1e3 * aside)
            }
            PlantEffect::JointElasticity { stiffness, .. } => {
                format!("the gear winds up by a radian for {stiffness:.0} N·m")
            }
            PlantEffect::Backlash { gap, .. } => format!("the gear has {:.1} mrad of play", 1e3 * gap),
            PlantEffect::JointCoupling { from, share, .. } => {
                format!("{:.0} % of the friction of joint {} is felt here", 100.0 * share, from + 1)
            }
        }
    }

    /// The arm at time `t` where the effect changes its bodies or the direction of gravity.
    pub(super) fn changed_dynamics(&self, arm: &Dynamics, t: f64) -> Option<Dynamics> {
        match self {
            PlantEffect::Payload { mass, centre, start } if t >= *start => {
                let mut bodies = arm.bodies().to_vec();
                let last = bodies.last_mut()?;
                // An even ball of the density of aluminium.
                let radius = (3.0 * mass / (4.0 * std::f64::consts::PI * 2700.0)).cbrt();
                let tensor = Matrix3::identity() * (0.4 * mass * radius * radius);
                let load = Body::about_centre(*mass, Vector3::from(*centre), tensor, 0.0);
                last.mass += load.mass;
                last.moment += load.moment;
                last.inertia += load.inertia;
                Dynamics::new(arm.chain().clone(), bodies)
            }
            PlantEffect::BrokenSymmetry { link, aside } => {
                let mut bodies = arm.bodies().to_vec();
                let body = bodies.get_mut(*link)?;
                *body = body.moved(Vector3::new(*aside, 0.0, 0.0));
                Dynamics::new(arm.chain().clone(), bodies)
            }
            PlantEffect::BaseTilt { tilt } => {
                let mut chain = arm.chain().clone();
                let turn = nalgebra::Rotation3::from_euler_angles(tilt[0], tilt[1], 0.0);
                chain.gravity = turn.inverse() * chain.gravity;
                Dynamics::new(chain, arm.bodies().to_vec())
            }
            _ => None,
        }
    }

    /// The joint whose friction the effect changes, if its torque may reverse within a small change of
    /// velocity.
    pub(super) fn rubs_at(&self) -> Option<usize> {
        match self {
            PlantEffect::LoadFriction { joint, .. }
            | PlantEffect::Stribeck { joint, .. }
            | PlantEffect::VelocityNonlinearity { joint, .. }
            | PlantEffect::Asymmetry { joint, .. }
            | PlantEffect::FrictionByPosition { joint, .. } => Some(*joint),
            _ => None,
        }
    }

    /// The gear that the effect makes of a joint's stiff one.
    pub(super) fn gear(&self) -> Option<(usize, Gear)> {
        match self {
            PlantEffect::JointElasticity { joint, stiffness } => {
                Some((*joint, Gear { stiffness: *stiffness, gap: 0.0 }))
            }
            PlantEffect::Backlash { joint, gap } => Some((*joint, Gear { stiffness: TEETH, gap: *gap })),
            _ => None,
        }
    }

    /// How far the motor is ahead of the link in an arm that follows its motion exactly, added to the
    /// positions.
    pub(super) fn add_windup(&self, now: &Instant<'_>, q: &mut [f64]) {
        if let Some((joint, gear)) = self.gear() {
            q[joint] += gear.windup(now.rigid[joint]);
        }
    }

    /// Applies the effect to the logged positions and torques, n values per sample.
    pub(super) fn distort(&self, q: &mut [f64], tau: &mut [f64], n: usize, period: f64) {
        match self {
            PlantEffect::EncoderOffset { joint, offset } => {
                q.chunks_exact_mut(n).for_each(|q| q[*joint] += offset)
            }
            PlantEffect::TorqueConstant { joint, gain } => {
                tau.chunks_exact_mut(n).for_each(|tau| tau[*joint] *= gain)
            }
            PlantEffect::TimeDelay { delay } => {
                let shift = delay / period;
                let (whole, part) = (shift.floor() as usize, shift.fract());
                let at =
                    |k: usize, back: usize, i: usize, source: &[f64]| source[k.saturating_sub(back) * n + i];
                let source = tau.to_vec();
                for k in 0..tau.len() / n {
                    for i in 0..n {
                        let (near, far) = (at(k, whole, i, &source), at(k, whole + 1, i, &source));
                        tau[k * n + i] = (1.0 - part) * near + part * far;
                    }
                }
            }
            _ => {}
        }
    }
}

// The joint torques of the effects that are torques.

/// Below this velocity the teeth of a gear do not yet rub at full strength, rad/s.
const RUB_SPEED: f64 = 0.004;
/// A hose stiffens by its own stiffness over this angle, rad.
const HOSE_STIFFENS_OVER: f64 = 6.0;
/// Share and place of the second harmonic of a ripple.
const SECOND_HARMONIC: (f64, f64) = (0.25, 0.7);

impl PlantEffect {
    /// Adds the effect's torque, N·m, to the torques that the drives must give.
    pub(crate) fn add_torque(&self, now: &Instant<'_>, state: &mut State, tau: &mut [f64]) {
        match self {
            PlantEffect::LoadFriction { joint, coefficient } => {
                let carried = now.rigid[*joint];
                tau[*joint] += coefficient * carried.hypot(0.02) * direction(now.dq[*joint], RUB_SPEED);
            }
            PlantEffect::Stribeck { joint, level, velocity } => {
                let dq = now.dq[*joint];
                let film = 1.0 / (1.0 + (dq / velocity).powi(2));
                tau[*joint] += level * film * direction(dq, RUB_SPEED);
            }
            PlantEffect::VelocityNonlinearity { joint, torque, exponent } => {
                let dq = now.dq[*joint];
                tau[*joint] += torque * dq.abs().powf(*exponent) * dq.signum();
            }
            PlantEffect::Asymmetry { joint, share, constant } => {
                let gamma = now.friction[*joint];
                let forwards = 0.5 * (1.0 + direction(now.dq[*joint], RUB_SPEED));
                tau[*joint] += constant + share * (gamma.gamma1 + gamma.gamma3) * forwards;
            }
            PlantEffect::FrictionByPosition { joint, share, place } => {
                let gamma = now.friction[*joint];
                let around = (now.q[*joint] - place).cos();
                // Flatter than a cosine where it is highest.
                let shape = 1.25 * around / (1.0 + 0.25 * around * around);
                let level = share * (gamma.gamma1 + gamma.gamma3);
                tau[*joint] += level * shape * direction(now.dq[*joint], RUB_SPEED);
            }
            PlantEffect::Hysteresis { joint, level, way } => {
                tau[*joint] += level * wind(&mut state.sliders, now.q[*joint], *way);
            }
            PlantEffect::Spring { joint, stiffness, rest } => {
                let x = now.q[*joint] - rest;
                tau[*joint] += stiffness * x * (1.0 + (x / HOSE_STIFFENS_OVER).powi(2));
            }
            PlantEffect::PositionRipple { joint, order, amplitude, phase } => {
                let x = order * now.q[*joint] + phase;
                let (share, place) = SECOND_HARMONIC;
                tau[*joint] += amplitude * (x.sin() + share * (2.0 * x + place).sin());
            }
            PlantEffect::Temperature { change, time_constant } => {
                let warm = 1.0 - (-now.t / time_constant).exp();
                for i in 0..tau.len() {
                    tau[i] += change * warm * now.friction[i].gamma5 * now.dq[i];
                }
            }
            PlantEffect::ContactWrench { force, start, length, every }
                if now.t >= *start && (now.t - start).rem_euclid(*every) < *length =>
            {
                // The force's share alone: the arm at rest with it and without it.
                let zero = vec![0.0; tau.len()];
                let with = now.dynamics.inverse_in_contact(now.q, &zero, &zero, *force, [0.0; 3]);
                for (i, (with, without)) in with.iter().zip(now.dynamics.gravity(now.q)).enumerate() {
                    tau[i] += with - without;
                }
            }
            PlantEffect::JointCoupling { from, onto, share } => {
                let (felt, dq) = (now.friction[*from], now.dq[*from]);
                let level = |level: f64, steepness: f64| level * direction(dq, 1.0 / steepness);
                let levels = level(felt.gamma1, felt.gamma2) + level(felt.gamma3, felt.gamma4);
                tau[*onto] += share * (levels + felt.gamma5 * dq);
            }
            _ => {}
        }
    }
}

/// A smooth sign of the velocity that reaches 1 like an algebraic curve, not like tanh.
fn direction(dq: f64, half: f64) -> f64 {
    dq / dq.hypot(half)
}

/// Elastic sliders in parallel, each of which slips after its own way, evenly spread up to `way`: the
/// friction between −1 and 1 that a contact gives while it is dragged from position to position. It does not
/// depend on time.
fn wind(memory: &mut Option<(f64, [f64; SLIDERS])>, q: f64, way: f64) -> f64 {
    let (last, mut wound) = memory.unwrap_or((q, [0.0; SLIDERS]));
    let mut sum = 0.0;
    for (k, x) in wound.iter_mut().enumerate() {
        let slips_at = way * (k + 1) as f64 / SLIDERS as f64;
        *x = (*x + q - last).clamp(-slips_at, slips_at);
        sum += *x / slips_at / SLIDERS as f64;
    }
    *memory = Some((q, wound));
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presliding_dissipates_and_does_not_depend_on_the_sampling() {
        let path = |k: usize, n: usize| 0.01 * (std::f64::consts::TAU * k as f64 / n as f64).sin();
        let work = |n: usize| {
            let mut memory = None;
            let mut work = 0.0;
            for k in 0..=3 * n {
                let before = memory.map(|m: (f64, _)| m.0);
                let force = wind(&mut memory, path(k, n), 0.004);
                work += before.map_or(0.0, |b| force * (path(k, n) - b));
            }
            work
        };
        assert!(work(4000) > 0.05);
        approx::assert_relative_eq!(work(4000), work(16_000), max_relative = 1e-2);
    }
}
