//! The joint torques of the effects that are torques.

use super::{Instant, PlantEffect, SLIDERS, State};

/// Below this velocity the teeth of a gear do not yet rub at full strength, rad/s.
const RUB_SPEED: f64 = 0.004;
/// A hose stiffens by its own stiffness over this angle, rad.
const HOSE_STIFFENS_OVER: f64 = 6.0;
/// Share and place of the second harmonic of a ripple.
const SECOND_HARMONIC: (f64, f64) = (0.25, 0.7);

impl PlantEffect {
    /// Adds the effect's torque, N·m, to the torques that the drives must give.
    pub(in crate::virtual_arm) fn add_torque(&self, now: &Instant<'_>, state: &mut State, tau: &mut [f64]) {
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
