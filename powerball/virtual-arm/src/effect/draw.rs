//! Random effects, of sizes that matter and that occur on real arms.

use super::PlantEffect;
use crate::plant::Plant;
use powerball_controller::friction::TanhFriction;
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use std::f64::consts::PI;
use std::ops::Range;

/// The places of effects on an arm; joints and links from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Places {
    /// Joints that have what any joint may have.
    pub any: Vec<usize>,
    /// Joints whose friction at low and at high velocity can be seen.
    pub large: Vec<usize>,
    /// Joints that carry a load.
    pub loaded: Vec<usize>,
    /// Links with a declared plane of symmetry, and how far aside a centre of mass may lie there, m.
    pub symmetric: Vec<(usize, f64)>,
    /// Joints of which the second feels friction of the first, and its share where both have the same
    /// friction.
    pub coupled: Vec<([usize; 2], f64)>,
    /// Stiffness of each joint's gear, N·m/rad or N/m.
    pub stiffness: Vec<Range<f64>>,
    /// Distance from the last frame to the flange, m.
    pub flange: f64,
}

/// One of the items; `None` if there are none.
fn one_of<T: Clone>(from: &[T], rng: &mut impl Rng) -> Option<T> {
    if from.is_empty() { None } else { from.get(rng.random_range(0..from.len())).cloned() }
}

/// Random values for any effect, and its possible places.
struct Lot<'a> {
    plant: &'a Plant,
    places: &'a Places,
    /// The time within which the logs are recorded, s.
    session: f64,
    sign: f64,
    /// A joint that has what any joint may have.
    any: usize,
    /// One whose friction at low and at high velocity can be seen.
    large: usize,
    /// When what starts at some time starts, s.
    moment: f64,
}

impl Lot<'_> {
    fn friction(&self, joint: usize) -> TanhFriction<f64> {
        self.plant.friction()[joint]
    }

    /// Coulomb friction of a joint, N·m.
    fn coulomb(&self, joint: usize) -> f64 {
        self.friction(joint).gamma1 + self.friction(joint).gamma3
    }

    fn noise(&self) -> f64 {
        self.plant.sensors().white[self.any]
    }

    /// A usual way of a joint, rad or m.
    fn unit(&self, joint: usize) -> f64 {
        self.plant.dynamics().usual_way(joint)
    }

    /// Effects that depend on velocity and its history.
    fn friction_effect(&self, name: &str, rng: &mut impl Rng) -> Option<PlantEffect> {
        Some(match name {
            "load_friction" => PlantEffect::LoadFriction {
                joint: one_of(&self.places.loaded, rng)?,
                coefficient: rng.random_range(0.05..0.11),
            },
            "stribeck" => PlantEffect::Stribeck {
                joint: self.large,
                level: self.friction(self.large).gamma1 * rng.random_range(0.3..0.6),
                velocity: self.unit(self.large) * rng.random_range(0.03..0.07),
            },
            "velocity_nonlinearity" => {
                let share = rng.random_range(0.35..0.7);
                let exponent: f64 = rng.random_range(2.2..3.0);
                let torque =
                    self.friction(self.large).gamma5 * share * self.unit(self.large).powf(1.0 - exponent);
                PlantEffect::VelocityNonlinearity { joint: self.large, torque, exponent }
            }
            "asymmetry" => PlantEffect::Asymmetry {
                joint: self.any,
                share: rng.random_range(0.1..0.3),
                constant: self.coulomb(self.any) * rng.random_range(0.0..0.15),
            },
            "hysteresis" => PlantEffect::Hysteresis {
                joint: self.any,
                level: self.coulomb(self.any) * rng.random_range(0.3..0.6),
                way: self.unit(self.any) * rng.random_range(0.010..0.030),
            },
            "friction_by_position" => PlantEffect::FrictionByPosition {
                joint: self.any,
                share: rng.random_range(0.2..0.4),
                place: rng.random_range(-PI..PI),
            },
            "temperature" => PlantEffect::Temperature {
                change: -rng.random_range(0.15..0.30),
                time_constant: self.session * rng.random_range(0.3..0.6),
            },
            "joint_coupling" => {
                let ([from, onto], scale) = one_of(&self.places.coupled, rng)?;
                PlantEffect::JointCoupling { from, onto, share: scale * rng.random_range(0.06..0.15) }
            }
            _ => return None,
        })
    }

    /// Effects that depend on position, and of the arm itself.
    fn body_effect(&self, name: &str, rng: &mut impl Rng) -> Option<PlantEffect> {
        Some(match name {
            "spring" => PlantEffect::Spring {
                joint: self.any,
                stiffness: 6.0 * self.noise() / self.unit(self.any) * rng.random_range(0.5..1.2),
                rest: if self.unit(self.any) < 1.0 {
                    rng.random_range(0.2..0.5)
                } else {
                    rng.random_range(-0.5..0.5)
                },
            },
            "position_ripple" => PlantEffect::PositionRipple {
                joint: self.any,
                // Teeth and wave generator turn with the motor, bearings and cables with the joint.
                order: *[5.0, 9.0, 14.0, 100.0, 160.0].choose(rng)? / self.unit(self.any),
                amplitude: self.noise() * rng.random_range(1.2..2.5),
                phase: rng.random_range(-PI..PI),
            },
            "encoder_offset" => {
                let joint = one_of(&self.places.loaded, rng)?;
                PlantEffect::EncoderOffset {
                    joint,
                    offset: self.sign * self.unit(joint) * rng.random_range(0.03..0.08),
                }
            }
            "base_tilt" => {
                PlantEffect::BaseTilt { tilt: [0, 1].map(|_| self.sign * rng.random_range(0.02..0.06)) }
            }
            "broken_symmetry" => {
                let (link, aside) = one_of(&self.places.symmetric, rng)?;
                PlantEffect::BrokenSymmetry { link, aside: self.sign * aside * rng.random_range(0.8..1.5) }
            }
            // What the arm can still carry on an exciting path.
            "payload" => {
                let aside = [0, 1].map(|_| rng.random_range(-0.04..0.04));
                let mass = rng.random_range(0.6..1.2);
                PlantEffect::Payload {
                    mass,
                    centre: [aside[0], aside[1], self.places.flange + rng.random_range(0.03..0.10)],
                    start: self.moment,
                }
            }
            _ => return None,
        })
    }

    /// Effects of the torque and its timing, and events.
    fn torque_effect(&self, name: &str, rng: &mut impl Rng) -> Option<PlantEffect> {
        Some(match name {
            "torque_constant" => PlantEffect::TorqueConstant {
                joint: one_of(&self.places.loaded, rng)?,
                gain: 1.0 + self.sign * rng.random_range(0.04..0.1),
            },
            "time_delay" => PlantEffect::TimeDelay { delay: rng.random_range(0.006..0.018) },
            "contact_wrench" => PlantEffect::ContactWrench {
                force: [0, 1, 2].map(|_| self.sign * rng.random_range(5.0..15.0)),
                start: self.session * rng.random_range(0.0..0.1),
                length: rng.random_range(2.0..5.0),
                every: rng.random_range(17.0..29.0),
            },
            "joint_elasticity" => {
                let joint = one_of(&self.places.loaded, rng)?;
                let stiffness = self.places.stiffness.get(joint).filter(|range| !range.is_empty())?.clone();
                PlantEffect::JointElasticity { joint, stiffness: rng.random_range(stiffness) }
            }
            "backlash" => {
                let joint = one_of(&self.places.loaded, rng)?;
                PlantEffect::Backlash { joint, gap: self.unit(joint) * rng.random_range(0.01..0.03) }
            }
            _ => return None,
        })
    }
}

impl PlantEffect {
    /// The names that [`draw`](Self::draw) knows.
    pub const NAMES: [&'static str; 19] = [
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
        "friction_by_position",
    ];

    /// The names among which a seed chooses: a name that was added later is not among them, so that a seed
    /// keeps its choice.
    pub fn chosen_by_seed() -> &'static [&'static str] {
        &Self::NAMES[..18]
    }

    /// Draws an effect of that name: its joint and its figures. `session` is the time in s within which the
    /// logs are recorded, and an effect that starts at some time starts within `begins`.
    ///
    /// Sizes are chosen against the joint's friction and noise, such that the effect can be seen in a log but
    /// is not larger than the torque that it disturbs. `None` for a name that is not known, or has no place
    /// on the arm.
    pub fn draw(
        name: &str,
        plant: &Plant,
        places: &Places,
        session: f64,
        begins: Range<f64>,
        rng: &mut impl Rng,
    ) -> Option<PlantEffect> {
        let lot = Lot {
            plant,
            places,
            session,
            sign: if rng.random_bool(0.5) { 1.0 } else { -1.0 },
            any: one_of(&places.any, rng)?,
            large: one_of(&places.large, rng)?,
            moment: rng.random_range(begins),
        };
        match name {
            "load_friction"
            | "stribeck"
            | "velocity_nonlinearity"
            | "asymmetry"
            | "hysteresis"
            | "temperature"
            | "friction_by_position"
            | "joint_coupling" => lot.friction_effect(name, rng),
            "spring" | "position_ripple" | "encoder_offset" | "base_tilt" | "broken_symmetry" | "payload" => {
                lot.body_effect(name, rng)
            }
            _ => lot.torque_effect(name, rng),
        }
    }

    /// This effect about `factor` times as large, at the same place and time.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> PlantEffect {
        let mut scaled = self.clone();
        match &mut scaled {
            PlantEffect::LoadFriction { coefficient: x, .. }
            | PlantEffect::Stribeck { level: x, .. }
            | PlantEffect::VelocityNonlinearity { torque: x, .. }
            | PlantEffect::Hysteresis { level: x, .. }
            | PlantEffect::FrictionByPosition { share: x, .. }
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
    use crate::lwa4p;
    use chacha20::ChaCha8Rng;
    use rand::SeedableRng;

    #[test]
    fn every_name_is_drawn_as_itself_and_the_same_seed_draws_the_same() {
        let plant = lwa4p::plant().unwrap();
        for name in PlantEffect::NAMES {
            let draw = |seed| {
                let rng = &mut ChaCha8Rng::seed_from_u64(seed);
                PlantEffect::draw(name, &plant, &lwa4p::places(), 100.0, 30.0..60.0, rng).unwrap()
            };
            assert_eq!(draw(5).name(), name);
            assert_eq!(draw(5), draw(5));
            assert!((0..20).any(|seed| draw(seed) != draw(5)), "{name}");
        }
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        assert!(PlantEffect::draw("ghosts", &plant, &lwa4p::places(), 1.0, 0.0..1.0, rng).is_none());
        let nowhere = Places { loaded: Vec::new(), ..lwa4p::places() };
        assert!(PlantEffect::draw("backlash", &plant, &nowhere, 1.0, 0.0..1.0, rng).is_none());
    }
}
