//! Effects drawn by lot, of sizes that matter and that happen.

use super::PlantEffect;
use crate::virtual_arm::plant::Plant;
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use std::f64::consts::PI;
use std::ops::Range;

impl PlantEffect {
    /// The names that [`draw_named`](Self::draw_named) knows.
    pub const NAMES: [&'static str; 18] = [
        "load_friction",
        "stribeck",
        "velocity_nonlinearity",
        "asymmetry",
        "hysteresis",
        "payload",
        "spring",
        "position_ripple",
        "temperature",
        "torque_constant",
        "time_delay",
        "encoder_offset",
        "base_tilt",
        "contact_wrench",
        "broken_symmetry",
        "joint_coupling",
        "joint_elasticity",
        "backlash",
    ];

    /// Draws an effect of that name for the virtual LWA 4P: its joint and its figures. `session` is the time
    /// in s within which the logs are recorded, and what starts at some time starts within `begins`.
    ///
    /// Sizes are chosen against the joint's friction and noise, such that the effect can be seen in a log but
    /// does not outgrow what it disturbs. `None` for a name that is not known.
    pub fn draw_named(
        name: &str,
        plant: &Plant,
        session: f64,
        begins: Range<f64>,
        rng: &mut impl Rng,
    ) -> Option<PlantEffect> {
        let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let any = rng.random_range(0..plant.friction().len());
        let large = rng.random_range(0..4);
        let friction = plant.friction()[any];
        let coulomb = friction.gamma1 + friction.gamma3;
        let noise = plant.sensors().white[any];
        let moment = rng.random_range(begins);
        Some(match name {
            // The joints that gravity loads.
            "load_friction" => PlantEffect::LoadFriction {
                joint: rng.random_range(1..3),
                coefficient: rng.random_range(0.05..0.11),
            },
            "stribeck" => PlantEffect::Stribeck {
                joint: large,
                level: plant.friction()[large].gamma1 * rng.random_range(0.3..0.6),
                velocity: rng.random_range(0.03..0.07),
            },
            "velocity_nonlinearity" => PlantEffect::VelocityNonlinearity {
                joint: large,
                torque: plant.friction()[large].gamma5 * rng.random_range(0.35..0.7),
                exponent: rng.random_range(2.2..3.0),
            },
            "asymmetry" => PlantEffect::Asymmetry {
                joint: any,
                share: rng.random_range(0.1..0.3),
                constant: coulomb * rng.random_range(0.0..0.15),
            },
            "hysteresis" => PlantEffect::Hysteresis {
                joint: any,
                level: coulomb * rng.random_range(0.3..0.6),
                way: rng.random_range(0.010..0.030),
            },
            // What joint 2 can still carry on an exciting path.
            "payload" => {
                let aside = [0, 1].map(|_| rng.random_range(-0.04..0.04));
                PlantEffect::payload(rng.random_range(0.6..1.2), aside, rng.random_range(0.03..0.10), moment)
            }
            "spring" => PlantEffect::Spring {
                joint: any,
                stiffness: 6.0 * noise * rng.random_range(0.5..1.2),
                rest: rng.random_range(-0.5..0.5),
            },
            "position_ripple" => PlantEffect::PositionRipple {
                joint: any,
                // Teeth and wave generator turn with the motor, bearings and cables with the joint.
                order: *[5.0, 9.0, 14.0, 100.0, 160.0].choose(rng)?,
                amplitude: noise * rng.random_range(1.2..2.5),
                phase: rng.random_range(-PI..PI),
            },
            "temperature" => PlantEffect::Temperature {
                change: -rng.random_range(0.15..0.30),
                time_constant: session * rng.random_range(0.3..0.6),
            },
            "torque_constant" => PlantEffect::TorqueConstant {
                joint: rng.random_range(1..3),
                gain: 1.0 + sign * rng.random_range(0.04..0.1),
            },
            "time_delay" => PlantEffect::TimeDelay { delay: rng.random_range(0.006..0.018) },
            "encoder_offset" => PlantEffect::EncoderOffset {
                joint: rng.random_range(1..3),
                offset: sign * rng.random_range(0.03..0.08),
            },
            "base_tilt" => {
                PlantEffect::BaseTilt { tilt: [0, 1].map(|_| sign * rng.random_range(0.02..0.06)) }
            }
            "contact_wrench" => PlantEffect::ContactWrench {
                force: [0, 1, 2].map(|_| sign * rng.random_range(5.0..15.0)),
                start: session * rng.random_range(0.0..0.1),
                length: rng.random_range(2.0..5.0),
                every: rng.random_range(17.0..29.0),
            },
            // The elbow and the forearm, whose centres of mass are declared to lie in a plane.
            "broken_symmetry" => {
                let link = rng.random_range(2..4);
                PlantEffect::BrokenSymmetry {
                    link,
                    aside: sign * [0.02, 0.06][link - 2] * rng.random_range(0.8..1.5),
                }
            }
            "joint_elasticity" => PlantEffect::JointElasticity {
                joint: rng.random_range(1..3),
                stiffness: rng.random_range(1500.0..3500.0),
            },
            "backlash" => {
                PlantEffect::Backlash { joint: rng.random_range(1..3), gap: rng.random_range(0.01..0.03) }
            }
            // Both axes of a module share a housing.
            "joint_coupling" => {
                let [from, onto] = [[0, 1], [1, 0], [2, 3], [3, 2], [4, 5], [5, 4]][rng.random_range(0..6)];
                PlantEffect::JointCoupling { from, onto, share: rng.random_range(0.06..0.15) }
            }
            _ => return None,
        })
    }

    /// The same effect about `factor` times as large, where and when it is.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> PlantEffect {
        let mut scaled = self.clone();
        match &mut scaled {
            PlantEffect::LoadFriction { coefficient: x, .. }
            | PlantEffect::Stribeck { level: x, .. }
            | PlantEffect::VelocityNonlinearity { torque: x, .. }
            | PlantEffect::Hysteresis { level: x, .. }
            | PlantEffect::Payload { mass: x, .. }
            | PlantEffect::Spring { stiffness: x, .. }
            | PlantEffect::PositionRipple { amplitude: x, .. }
            | PlantEffect::Temperature { change: x, .. }
            | PlantEffect::TimeDelay { delay: x }
            | PlantEffect::EncoderOffset { offset: x, .. }
            | PlantEffect::BrokenSymmetry { aside: x, .. }
            | PlantEffect::Backlash { gap: x, .. }
            | PlantEffect::JointCoupling { share: x, .. } => *x *= factor,
            PlantEffect::Asymmetry { share, constant, .. } => {
                *share *= factor;
                *constant *= factor;
            }
            PlantEffect::TorqueConstant { gain, .. } => *gain = 1.0 + factor * (*gain - 1.0),
            PlantEffect::BaseTilt { tilt } => tilt.iter_mut().for_each(|x| *x *= factor),
            PlantEffect::ContactWrench { force, .. } => force.iter_mut().for_each(|x| *x *= factor),
            PlantEffect::JointElasticity { stiffness, .. } => *stiffness /= factor,
        }
        scaled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_arm::lwa4p;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_name_is_drawn_as_itself_and_the_same_seed_draws_the_same() {
        let plant = lwa4p::plant().unwrap();
        for name in PlantEffect::NAMES {
            let draw = |seed| {
                PlantEffect::draw_named(name, &plant, 100.0, 30.0..60.0, &mut ChaCha8Rng::seed_from_u64(seed))
                    .unwrap()
            };
            assert_eq!(draw(5).name(), name);
            assert_eq!(draw(5), draw(5));
            assert!((0..20).any(|seed| draw(seed) != draw(5)), "{name}");
        }
        assert!(
            PlantEffect::draw_named("ghosts", &plant, 1.0, 0.0..1.0, &mut ChaCha8Rng::seed_from_u64(1))
                .is_none()
        );
    }
}
