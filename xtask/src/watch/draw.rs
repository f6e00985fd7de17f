//! Logs of the virtual arm in the middle of which something changes by a drawn amount.

use chacha20::ChaCha8Rng;
use powerball::controller::friction::TanhFriction;
use powerball::identification::motion::Motion;
use powerball::logs::log::Log;
use powerball::virtual_arm::{Plant, PlantEffect};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// Changes that are drawn.
pub(super) const KINDS: [&str; 5] =
    ["contact_wrench", "payload", "temperature", "encoder_offset", "time_delay"];
/// Joints move when they are faster than this, rad/s: a watch sees nothing at rest.
const MOVES: f64 = 0.03;
/// No zero moves by more, rad.
const FARTHEST: f64 = 0.3;

/// A log with a change.
pub(super) struct Changed {
    pub(super) log: Log,
    /// The log without the change.
    pub(super) clean: Log,
    /// When it begins, or the arm begins to move with it, s.
    pub(super) at: f64,
    /// The joint of whose torque it is a share, from 1.
    pub(super) joint: usize,
}

/// What a change of a kind is but for its size.
struct Kind<'a> {
    name: &'a str,
    plant: &'a Plant,
    motion: &'a Motion,
    seed: u64,
    joint: usize,
    direction: [f64; 3],
    centre: [f64; 3],
    sign: f64,
}

impl Kind<'_> {
    fn draw<'a>(plant: &'a Plant, motion: &'a Motion, name: &'a str, rng: &mut ChaCha8Rng) -> Kind<'a> {
        let seed = rng.random();
        // The zero of an upright first joint shows in no torque.
        let joint = rng.random_range(usize::from(name == "encoder_offset")..motion.dof());
        let direction: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(rng));
        let length = direction.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
        let centre = std::array::from_fn(|k| if k == 2 { 0.1 } else { rng.random_range(-0.05..0.05) });
        let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
        Kind { name, plant, motion, seed, joint, direction: direction.map(|x| x / length), centre, sign }
    }

    /// The whole log with the change of a size; without one where that is zero.
    fn log(&self, by: f64) -> Log {
        let mut friction = self.plant.friction().to_vec();
        let mut effect = None;
        match self.name {
            _ if by == 0.0 => {}
            "contact_wrench" => {
                let force = self.direction.map(|x| by * x);
                effect = Some(PlantEffect::ContactWrench { force, start: 0.0, length: 1e6, every: 1e6 });
            }
            "payload" => effect = Some(PlantEffect::Payload { mass: by, centre: self.centre, start: 0.0 }),
            "temperature" => {
                let TanhFriction { gamma1, gamma2, gamma3, gamma4, gamma5 } = friction[self.joint];
                let by = 1.0 + self.sign * by;
                let scaled = [gamma1 * by, gamma2, gamma3 * by, gamma4, gamma5 * by];
                friction[self.joint] = TanhFriction::new(scaled);
            }
            "encoder_offset" => {
                effect = Some(PlantEffect::EncoderOffset { joint: self.joint, offset: self.sign * by });
            }
            _ => effect = Some(PlantEffect::TimeDelay { delay: by }),
        }
        let plant = Plant::new(self.plant.dynamics().clone(), friction, self.plant.sensors().clone());
        let plant = if let Some(effect) = effect { plant.with(effect) } else { plant };
        plant.record(self.motion, 0.0, self.seed).log("run")
    }
}

/// A log in which something changes at a time by a share of a joint's torque.
pub(super) fn changed(
    plant: &Plant,
    motion: &Motion,
    name: &str,
    size: f64,
    rng: &mut ChaCha8Rng,
) -> Changed {
    // Some zeros show in no torque: that of an arm's last joint, about which its hand is even.
    let mut kind = Kind::draw(plant, motion, name, rng);
    while name == "encoder_offset" && offset_of_size(plant, motion, kind.joint, size) > FARTHEST {
        kind = Kind::draw(plant, motion, name, rng);
    }
    let clean = kind.log(0.0);
    // A zero is another one after a start, and does not jump on the way.
    let place = rng.random_range(0.3..0.6);
    let from = if name == "encoder_offset" { 0 } else { (clean.t.len() as f64 * place) as usize };
    let by = if name == "encoder_offset" {
        // The log shows the true torque at another place: the same size of torque as that place's would
        // differ by.
        offset_of_size(plant, motion, kind.joint, size)
    } else {
        let mut by = if name == "contact_wrench" { 5.0 } else { 0.05 };
        for _ in 0..3 {
            by *= size / share(&kind.log(by), &clean, from).1.max(1e-9);
        }
        by
    };
    let whole = kind.log(by);
    let most = if name == "encoder_offset" { kind.joint } else { share(&whole, &clean, from).0 };
    let splice = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<Vec<f64>> {
        a.iter().zip(b).map(|(a, b)| [&a[..from], &b[from..]].concat()).collect()
    };
    let log =
        Log { q: splice(&clean.q, &whole.q), torque: splice(&clean.torque, &whole.torque), ..clean.clone() };
    let moves = |[_, v, _]: [&[f64]; 3]| v.iter().any(|v| v.abs() > MOVES);
    let first = motion.samples().skip(from).position(moves).unwrap_or(0);
    Changed { at: clean.t[from + first], log, clean, joint: most + 1 }
}

/// The rms of a change over that of the torque, on the joint on which it is largest, and that joint.
fn share(log: &Log, clean: &Log, from: usize) -> (usize, f64) {
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let of = |j: usize| {
        let change: Vec<f64> = (from..log.t.len()).map(|k| log.torque[j][k] - clean.torque[j][k]).collect();
        rms(&change) / rms(&clean.torque[j])
    };
    (0..log.torque.len()).map(|j| (j, of(j))).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a })
}

/// The offset of a joint's zero by which the torque at the place that is logged differs by a share of a
/// joint's.
fn offset_of_size(plant: &Plant, motion: &Motion, joint: usize, size: f64) -> f64 {
    let n = motion.dof();
    let torques = |by: f64| -> Vec<Vec<f64>> {
        let moved = motion.samples().map(|[q, dq, ddq]| {
            let mut q = q.to_vec();
            q[joint] += by;
            plant.dynamics().inverse(&q, dq, ddq)
        });
        moved.collect()
    };
    let (at, next) = (torques(0.0), torques(0.01));
    let of = |j: usize| {
        let change: f64 = at.iter().zip(&next).map(|(a, b)| (a[j] - b[j]).powi(2)).sum();
        let whole: f64 = motion
            .samples()
            .zip(&at)
            .map(|([_, dq, _], a)| (a[j] + plant.friction()[j].torque(dq[j])).powi(2))
            .sum();
        (change / whole).sqrt()
    };
    let most = (0..n).map(of).fold(0.0, f64::max);
    0.01 * size / most.max(1e-6)
}
