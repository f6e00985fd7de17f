//! Arms drawn by lot, with bodies, friction and sensors to go with them.

use dyngen::Arm;
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::virtual_arm::{Body, Dynamics, Places, Plant, Sensors};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use std::fmt::Write as _;

/// Draws until a truth can be seen at the size that is wanted.
pub(super) const DRAWS: usize = 12;
/// Noise of a torque against what is usual there.
const NOISE: f64 = 0.01;
/// How far a truth may be scaled away from what it was drawn as: an encoder is not off by a radian.
pub(super) const LARGEST_FACTOR: f64 = 4.0;

/// An arm and a plant like it.
pub(super) struct Drawn {
    pub(super) arm: Arm,
    /// The arm file.
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
        let white: Vec<f64> = usual.iter().map(|usual| NOISE * usual).collect();
        let sensors = Sensors {
            rate: 200.0,
            encoder_step: 0.001f64.to_radians(),
            coloured: vec![0.0; white.len()],
            white,
            colour_time: 0.15,
        };
        Ok(Drawn { arm, text, plant: Plant::new(dynamics, friction, sensors), symmetric })
    }

    /// Where effects sit on it: on joint `on`, from 0, or anywhere.
    pub(super) fn places(&self, on: Option<usize>) -> Places {
        let usual: Vec<f64> = self.plant.sensors().white.iter().map(|noise| noise / NOISE).collect();
        let symmetric = self.symmetric.iter().map(|link| (*link, 0.015)).collect();
        Places { symmetric, ..places(&self.plant, &usual, on) }
    }
}

/// Where effects sit on an arm without declared symmetries: on joint `on`, from 0, or anywhere; `usual`: the
/// rms of each joint's torque, N·m or N.
pub(super) fn places(plant: &Plant, usual: &[f64], on: Option<usize>) -> Places {
    let joints = 0..plant.friction().len();
    let coulomb = |j: usize| plant.friction()[j].gamma1 + plant.friction()[j].gamma3;
    let any: Vec<usize> = joints.clone().filter(|j| on.is_none_or(|on| on == *j)).collect();
    let coupled = |&onto: &usize| {
        let from = if onto == 0 { 1 } else { onto - 1 };
        ([from, onto], coulomb(onto) / coulomb(from))
    };
    let stiffness = |j: usize| {
        let usual = usual[j] / plant.dynamics().usual_way(j);
        usual / 0.015..usual / 0.003
    };
    Places {
        large: any.clone(),
        loaded: any.clone(),
        symmetric: Vec::new(),
        coupled: any.iter().map(coupled).collect(),
        stiffness: joints.map(stiffness).collect(),
        flange: 0.035,
        any,
    }
}

/// The rms of each joint's torque over states that an exciting path may pass.
fn usual_torques(dynamics: &Dynamics, rng: &mut impl Rng) -> Vec<f64> {
    const STATES: usize = 200;
    let n = dynamics.dof();
    let mut squares = vec![0.0; n];
    for _ in 0..STATES {
        let mut state = |reach: f64| -> Vec<f64> {
            (0..n).map(|i| rng.random_range(-reach..reach) * dynamics.usual_way(i)).collect()
        };
        let tau = dynamics.inverse(&state(2.0), &state(1.0), &state(3.0));
        squares.iter_mut().zip(tau).for_each(|(s, t)| *s += t * t / STATES as f64);
    }
    squares.into_iter().map(f64::sqrt).collect()
}
