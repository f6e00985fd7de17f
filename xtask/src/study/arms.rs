//! Arms drawn by lot, with bodies, friction and sensors to go with them, and effects drawn for any arm.

use dyngen::Arm;
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::virtual_arm::{Body, Dynamics, Plant, PlantEffect as Effect, Sensors};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::ops::Range;

/// Draws until a truth can be seen at the size that is wanted.
pub(super) const DRAWS: usize = 12;
/// How far a truth may be scaled away from what it was drawn as: an encoder is not off by a radian.
pub(super) const LARGEST_FACTOR: f64 = 4.0;

/// An arm and a plant like it.
pub(super) struct Drawn {
    pub(super) arm: Arm,
    /// Its arm file.
    pub(super) text: String,
    pub(super) plant: Plant,
    /// Links whose plane x = 0 is declared a plane of symmetry, from 0.
    symmetric: Vec<usize>,
}

impl Drawn {
    /// Four to seven joints, mostly turning, with rotors, of either convention.
    pub(super) fn new(rng: &mut impl Rng) -> Result<Drawn, String> {
        let n: usize = rng.random_range(4..=7);
        let standard = rng.random_bool(0.5);
        let convention = if standard { "standard" } else { "modified" };
        let mut text = format!("name = \"drawn\"\nconvention = \"{convention}\"\ngravity = [0, 0, -9.81]\n");
        let (mut bodies, mut symmetric) = (Vec::new(), Vec::new());
        let mut slides = 0;
        for i in 0..n {
            let prismatic = slides == 0 && rng.random_bool(0.1);
            slides += usize::from(prismatic);
            let pick = |from: &[f64], rng: &mut dyn Rng| *from.choose(rng).unwrap_or(&0.0);
            let a = pick(&[0.0, 0.0, 0.1, 0.25, 0.4], rng);
            let d = pick(&[0.0, 0.0, 0.12, 0.3], rng);
            let alpha = ["0", "pi/2", "-pi/2", "pi/2", "-pi/2", "pi"].choose(rng).unwrap_or(&"0");
            let theta = ["0", "0", "pi/2", "-pi/2"].choose(rng).unwrap_or(&"0");
            let plane = i > 0 && rng.random_bool(0.4);
            let ratio = rng.random_range(50..=160) * if prismatic { 5 } else { 1 };
            let (kind, position, velocity, acceleration) = match prismatic {
                true => ("prismatic", [0.1, 0.6], 0.4, 1.5),
                false => ("revolute", [-2.6, 2.6], rng.random_range(1.0..2.0), rng.random_range(3.0..6.0)),
            };
            let zero = if plane { "zero = [\"mx\", \"Ixy\", \"Ixz\"]\n" } else { "" };
            let _ = write!(
                text,
                "\n[[joint]]\nkind = \"{kind}\"\na = {a}\nalpha = \"{alpha}\"\nd = {d}\ntheta = \
                    \"{theta}\"\n{zero}\
                 rotor_ratio = {ratio}\nposition = {position:?}\nvelocity = {velocity}\nacceleration = \
                 {acceleration}\n"
            );
            if plane {
                symmetric.push(i);
            }
            let mut within = |reach: f64| rng.random_range(-reach..reach);
            let centre = [if plane { 0.0 } else { within(0.12) }, within(0.12), within(0.12)];
            let share = 0.72f64.powi(i as i32);
            let mass = 6.0 * share * rng.random_range(0.7..1.3);
            let edges = [0; 3].map(|_| rng.random_range(0.06..0.25));
            let felt = share * rng.random_range(0.2..0.9) * if prismatic { 6.0 } else { 1.0 };
            bodies.push(Body::even_box(mass, centre, edges, felt / f64::from(ratio * ratio)));
        }
        let arm = Arm::parse(&text, "drawn.toml").map_err(|e| e.to_string())?;
        let dynamics = Dynamics::new(Chain::new(&arm), bodies).ok_or("the arm is no chain of bodies")?;
        let usual = usual_torques(&dynamics, rng);
        let friction = |(i, usual): (usize, &f64)| {
            // As in Table 2, where Coulomb friction is a quarter of the torque of a loaded joint.
            let [g1, g2, g3, g4, g5] = TABLE_2[i % TABLE_2.len()];
            let slow = if dynamics.chain().rows()[i].is_revolute() { 1.0 } else { 4.0 };
            let level = usual * rng.random_range(0.1..0.4) / (g1 + g3);
            TanhFriction::new([level * g1, slow * g2, level * g3, slow * g4, level * slow * g5])
        };
        let friction = usual.iter().enumerate().map(friction).collect();
        let white: Vec<f64> = usual.iter().map(|usual| 0.01 * usual).collect();
        let sensors = Sensors {
            rate: 200.0,
            encoder_step: 0.001f64.to_radians(),
            coloured: vec![0.0; white.len()],
            white,
            colour_time: 0.15,
        };
        Ok(Drawn { arm, text, plant: Plant::new(dynamics, friction, sensors), symmetric })
    }

    /// An effect of that name at joint `on`, from 0, or at any joint; `None` where the arm has no place for it.
    pub(super) fn effect(
        &self,
        name: &str,
        on: Option<usize>,
        session: f64,
        begins: Range<f64>,
        rng: &mut impl Rng,
    ) -> Option<Effect> {
        let rows = self.plant.dynamics().chain().rows();
        let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let any = rng.random_range(0..rows.len());
        let joint = on.unwrap_or(any);
        let friction = self.plant.friction()[joint];
        let coulomb = friction.gamma1 + friction.gamma3;
        let noise = self.plant.sensors().white[joint];
        let usual = 100.0 * noise;
        // Ways and velocities of a sliding joint in m against those of a turning one in rad.
        let unit = if rows[joint].is_revolute() { 1.0 } else { 0.2 };
        Some(match name {
            "load_friction" => Effect::LoadFriction { joint, coefficient: rng.random_range(0.05..0.11) },
            "stribeck" => Effect::Stribeck {
                joint,
                level: friction.gamma1 * rng.random_range(0.3..0.6),
                velocity: unit * rng.random_range(0.03..0.07),
            },
            "velocity_nonlinearity" => {
                let exponent = rng.random_range(2.2..3.0);
                let torque =
                    friction.gamma5 * unit * rng.random_range(0.35..0.7) * f64::powf(unit, -exponent);
                Effect::VelocityNonlinearity { joint, torque, exponent }
            }
            "asymmetry" => Effect::Asymmetry {
                joint,
                share: rng.random_range(0.1..0.3),
                constant: coulomb * rng.random_range(0.0..0.15),
            },
            "hysteresis" => Effect::Hysteresis {
                joint,
                level: coulomb * rng.random_range(0.3..0.6),
                way: unit * rng.random_range(0.010..0.030),
            },
            "payload" => {
                let mut aside = || rng.random_range(-0.05..0.05);
                let centre = [aside(), aside(), 0.1 + aside()];
                Effect::Payload { mass: rng.random_range(0.4..1.2), centre, start: rng.random_range(begins) }
            }
            "spring" => Effect::Spring {
                joint,
                stiffness: 4.0 * noise / unit,
                rest: if unit < 1.0 { rng.random_range(0.2..0.5) } else { rng.random_range(-0.5..0.5) },
            },
            "position_ripple" => Effect::PositionRipple {
                joint,
                order: *[5.0, 9.0, 14.0, 100.0, 160.0].choose(rng)? / unit,
                amplitude: 2.0 * noise,
                phase: rng.random_range(-PI..PI),
            },
            "temperature" => Effect::Temperature {
                change: -rng.random_range(0.15..0.30),
                time_constant: session * rng.random_range(0.3..0.6),
            },
            "torque_constant" => {
                Effect::TorqueConstant { joint, gain: 1.0 + sign * rng.random_range(0.04..0.1) }
            }
            "time_delay" => Effect::TimeDelay { delay: rng.random_range(0.006..0.018) },
            "encoder_offset" => {
                Effect::EncoderOffset { joint, offset: sign * unit * rng.random_range(0.03..0.08) }
            }
            "base_tilt" => Effect::BaseTilt { tilt: [0, 1].map(|_| sign * rng.random_range(0.02..0.06)) },
            "contact_wrench" => Effect::ContactWrench {
                force: [0, 1, 2].map(|_| sign * rng.random_range(5.0..15.0)),
                start: session * rng.random_range(0.0..0.1),
                length: rng.random_range(2.0..5.0),
                every: rng.random_range(17.0..29.0),
            },
            "broken_symmetry" => Effect::BrokenSymmetry {
                link: *self.symmetric.choose(rng)?,
                aside: sign * rng.random_range(0.01..0.03),
            },
            "joint_elasticity" => {
                Effect::JointElasticity { joint, stiffness: usual / (unit * rng.random_range(0.003..0.015)) }
            }
            "backlash" => Effect::Backlash { joint, gap: unit * rng.random_range(0.01..0.03) },
            "joint_coupling" => {
                let from = if joint == 0 { 1 } else { joint - 1 };
                let felt = self.plant.friction()[from];
                let share = coulomb / (felt.gamma1 + felt.gamma3) * rng.random_range(0.06..0.15);
                Effect::JointCoupling { from, onto: joint, share }
            }
            _ => return None,
        })
    }
}

/// The rms of each joint's torque over states that an exciting path may pass.
fn usual_torques(dynamics: &Dynamics, rng: &mut impl Rng) -> Vec<f64> {
    const STATES: usize = 200;
    let n = dynamics.dof();
    let mut squares = vec![0.0; n];
    for _ in 0..STATES {
        let mut state = |reach: f64| -> Vec<f64> {
            (dynamics.chain().rows().iter())
                .map(|row| rng.random_range(-reach..reach) * if row.is_revolute() { 1.0 } else { 0.2 })
                .collect()
        };
        let tau = dynamics.inverse(&state(2.0), &state(1.0), &state(3.0));
        squares.iter_mut().zip(tau).for_each(|(s, t)| *s += t * t / STATES as f64);
    }
    squares.into_iter().map(f64::sqrt).collect()
}
