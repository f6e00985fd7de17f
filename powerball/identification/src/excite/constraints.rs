//! Constraints of a path in addition to its joints' limits: torque, floor, and its own links.
//!
//! The module also has the joint limits of the arm file, the space around an arm, and capsules.

use super::Mounting;
use super::fourier::Fourier;
use super::load::Load;
use super::shape::{Floor, Nearness, Shape};
use dyngen::Arm;
use nalgebra::Vector3;
use powerball_logs::motion::Motion;

/// Instants a second at which the search looks at a path: between two of them a wrist at 40 m/s² comes at
/// most two millimetres nearer than at either.
const RATE: f64 = 50.0;
/// Additional clearance of the search for that, m.
const BETWEEN: f64 = 2e-3;
/// Like [`BETWEEN`], for torques, as a share of the limit.
const TORQUE_BETWEEN: f64 = 0.01;

/// The capsules of an arm, and how far they are to stay apart.
#[derive(Clone, Debug)]
pub struct Space {
    /// The capsules.
    pub shape: Shape,
    /// The floor, where there is one.
    pub floor: Option<Floor>,
    /// Smallest distance of surfaces, m.
    pub clearance: f64,
}

/// The constraints of the paths of one mounting.
#[derive(Clone, Debug)]
pub struct Constraints {
    /// Positions, velocities and accelerations.
    pub limits: Limits,
    /// Floor and links, if they are checked.
    pub space: Option<Space>,
    /// Torques, if they are checked.
    pub load: Option<Load>,
    /// Position of the arm before it moves to the path's beginning, each joint straight there, rad.
    pub from: Option<Vec<f64>>,
}

/// The tightest places of a motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tightest {
    /// The nearest approach, and when, s.
    pub nearest: Option<(Nearness, f64)>,
    /// The largest torque of each joint, N·m, if torques are checked.
    pub torque: Option<Vec<f64>>,
}

impl Constraints {
    /// The joints' limits alone.
    #[must_use]
    pub fn of(limits: Limits) -> Constraints {
        Constraints { limits, space: None, load: None, from: None }
    }

    /// Whether there is more than the joints' limits.
    #[must_use]
    pub fn any(&self) -> bool {
        self.space.is_some() || self.load.is_some()
    }

    /// How far a path is from keeping them: 0 where it does. Means over its instants of what surfaces lack in
    /// distance, in radii, and of the torque that is too much, as a share of its limit.
    #[must_use]
    pub fn violation(&self, path: &Fourier) -> f64 {
        if !self.any() {
            return 0.0;
        }
        let motion = whole(path, self.load.is_some());
        self.lack_of_space(&motion) + self.excess_of_torque(&motion)
    }

    /// The missing distance of a pose, in radii; 0 if it is free.
    #[must_use]
    pub fn lacks(&self, q: &[f64]) -> f64 {
        let Some(space) = &self.space else { return 0.0 };
        let nearest = space.shape.nearest(q, space.floor.as_ref());
        let lack = nearest.map_or(0.0, |near| space.clearance + BETWEEN - near.distance);
        lack.max(0.0) / space.shape.radius().max(1e-3)
    }

    fn lack_of_space(&self, motion: &Motion) -> f64 {
        let sum: f64 = motion.samples().map(|[q, ..]| self.lacks(q)).sum();
        let Some(from) = self.from.as_ref().filter(|_| self.space.is_some()) else {
            return sum / motion.len().max(1) as f64;
        };
        let steps = motion.len().clamp(1, 64);
        let to = &motion.q[..from.len()];
        let way = |k: usize| -> Vec<f64> {
            let share = k as f64 / steps as f64;
            from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect()
        };
        let way: f64 = (0..steps).map(|k| self.lacks(&way(k))).sum();
        sum / motion.len().max(1) as f64 + way / steps as f64
    }

    fn excess_of_torque(&self, motion: &Motion) -> f64 {
        let Some(load) = &self.load else { return 0.0 };
        let shares = load.shares(&motion.q, &motion.dq, &motion.ddq);
        let excess: f64 = shares.iter().map(|share| (share - 1.0 + TORQUE_BETWEEN).max(0.0)).sum();
        excess / motion.len().max(1) as f64
    }

    /// The tightest places of a motion, sample by sample.
    #[must_use]
    pub fn tightest(&self, motion: &Motion) -> Tightest {
        let mut tightest = Tightest::default();
        if let Some(space) = &self.space {
            for (k, [q, ..]) in motion.samples().enumerate() {
                let Some(near) = space.shape.nearest(q, space.floor.as_ref()) else { continue };
                if tightest.nearest.is_none_or(|(nearest, _)| near.distance < nearest.distance) {
                    tightest.nearest = Some((near, k as f64 * motion.period));
                }
            }
        }
        tightest.torque = self.load.as_ref().map(|load| {
            let n = motion.dof();
            let mut peak = vec![0.0f64; n];
            let torques = load.torques(&motion.q, &motion.dq, &motion.ddq);
            torques.iter().enumerate().for_each(|(k, tau)| peak[k % n] = peak[k % n].max(tau.abs()));
            peak
        });
        tightest
    }

    /// Why a motion does not keep the constraints; `None` where it does.
    #[must_use]
    pub fn broken(&self, motion: &Motion) -> Option<String> {
        let tightest = self.tightest(motion);
        let mut reasons = Vec::new();
        if let (Some(space), Some((near, time))) = (&self.space, tightest.nearest)
            && near.distance < space.clearance
        {
            let how = match near.distance < 0.0 {
                true => format!("collide ({:.3} m into each other)", -near.distance),
                false => format!("come within {:.3} m of each other", near.distance),
            };
            reasons.push(format!("{} {how} at {time:.2} s", near.contact));
        }
        if let (Some(load), Some(torque)) = (&self.load, &tightest.torque) {
            for (i, (tau, limit)) in torque.iter().zip(load.limits()).enumerate() {
                if tau > limit {
                    reasons.push(format!("joint {} needs {tau:.1} N·m of {limit:.1}", i + 1));
                }
            }
        }
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }
}

/// All that a path passes through: its series once at full velocity, and with `ends` its start and stop too.
/// Such trajectories go along the same curve, but accelerate otherwise.
fn whole(path: &Fourier, ends: bool) -> Motion {
    let mut motion = Motion::new(path.joints.len(), 1.0 / RATE);
    let count = |time: f64| (time * RATE).ceil() as usize;
    let at = |k: usize, time: f64| time * k as f64 / count(time) as f64;
    // The first sample is the beginning of the path either way.
    (0..count(path.period())).for_each(|k| motion.push(path.series(at(k, path.period()))));
    if ends {
        for k in 0..=count(path.ramp) {
            let t = at(k, path.ramp);
            motion.push(path.at(t));
            motion.push(path.at(path.duration() - t));
        }
    }
    motion
}

// The limits of the joints, from the arm file.

/// The limits of one joint, rad (m for prismatic joints) and s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest and highest position.
    pub position: [f64; 2],
    /// Highest velocity.
    pub velocity: f64,
    /// Highest acceleration.
    pub acceleration: f64,
    /// Highest torque, N·m (N), where the file gives one.
    pub torque: Option<f64>,
}

/// The limits of every joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits(pub Vec<JointLimits>);

/// The arm file misses limits: one text for each joint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an exciting trajectory needs limits that the arm file does not give: {}", .0.join("; "))]
pub struct MissingLimits(pub Vec<String>);

impl Limits {
    /// The limits of an arm, drawn in by `margin`: 0.05 leaves 5 % of the range, the velocity, the
    /// acceleration and the torque unused.
    ///
    /// # Errors
    /// Every limit that the arm file misses, joint by joint.
    pub fn of(arm: &Arm, margin: f64) -> Result<Limits, MissingLimits> {
        let mut missing = Vec::new();
        let share = 1.0 - margin;
        let mut limits = Vec::new();
        for (i, joint) in arm.joints.iter().enumerate() {
            let keys = [
                ("`position`", joint.position.is_some()),
                ("`velocity`", joint.velocity.is_some()),
                ("`acceleration`", joint.acceleration.is_some()),
            ];
            let absent: Vec<&str> = keys.iter().filter(|(_, there)| !there).map(|(key, _)| *key).collect();
            if !absent.is_empty() {
                missing.push(format!("joint {}: {}", i + 1, absent.join(", ")));
            }
            let [low, high] = joint.position.unwrap_or_default();
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            limits.push(JointLimits {
                position: [middle - share * half, middle + share * half],
                velocity: share * joint.velocity.unwrap_or_default(),
                acceleration: share * joint.acceleration.unwrap_or_default(),
                torque: joint.torque.map(|torque| share * torque),
            });
        }
        if missing.is_empty() { Ok(Limits(limits)) } else { Err(MissingLimits(missing)) }
    }
}

// The space around an arm: the floor, and the arm's own links as capsules.

/// Radius of the links' capsules, m, where none is given.
pub const RADIUS: f64 = 0.06;
/// The distance that capsules keep from each other and from the floor, m, where none is given.
pub const CLEARANCE: f64 = 0.02;

/// An arm does not stand on a floor at its base that blocks more than this share of its poses.
const HANGS: f64 = 0.95;

/// A floor's height above the base frame's origin, m; `None` without a floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorAt(pub Option<f64>);

/// The links and the floor of an arm in a mounting, and the floor's height: at the base where none is given,
/// the base stands upright and the arm can be above it, as an arm that is below its base wherever it
/// is hangs over something.
#[must_use]
pub fn surroundings(
    arm: &Arm,
    mounting: &Mounting,
    shape: &Shape,
    floor: Option<FloorAt>,
    clearance: f64,
    limits: &Limits,
) -> (Space, Option<f64>) {
    let up = mounting.up(arm);
    let free =
        |height: &f64| shape.blocked(&shape.floor(up, *height, &limits.0), clearance, &limits.0) < HANGS;
    let height = match floor {
        Some(FloorAt(height)) => height,
        None => (up.z > 0.5).then_some(0.0).filter(free),
    };
    let floor = height.map(|height| shape.floor(up, height, &limits.0));
    (Space { shape: shape.clone(), floor, clearance }, height)
}

// Capsules: line segments with a radius, and how far two of them are apart.

/// The axis of a capsule, from one end to the other, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end.
    pub from: Vector3<f64>,
    /// The other.
    pub to: Vector3<f64>,
}

impl Segment {
    /// Length, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// The point at a share of the way.
    #[must_use]
    pub fn at(&self, share: f64) -> Vector3<f64> {
        self.from + (self.to - self.from) * share
    }

    /// The segment without lengths (m) at both ends; `None` if nothing remains.
    #[must_use]
    pub fn cut(&self, at_from: f64, at_to: f64) -> Option<Segment> {
        let length = self.length();
        (at_from + at_to < length || at_from + at_to == 0.0).then(|| {
            let share = |cut: f64| if length > 0.0 { cut / length } else { 0.0 };
            Segment { from: self.at(share(at_from)), to: self.at(1.0 - share(at_to)) }
        })
    }

    /// Shortest distance to another segment, m.
    ///
    /// The square of the distance is a convex quadratic of the two places along the segments, so its minimum
    /// over the unit square is that of the lines, or lies on an edge, where it is the nearest place to an
    /// end.
    #[must_use]
    pub fn distance(&self, other: &Segment) -> f64 {
        let (u, v, w) = (self.to - self.from, other.to - other.from, self.from - other.from);
        let (a, b, c, d, e) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&w), v.dot(&w));
        let determinant = a * c - b * b;
        let inside = (determinant > 1e-12 * a * c)
            .then(|| ((b * e - c * d) / determinant, (a * e - b * d) / determinant));
        if let Some((s, t)) = inside.filter(|(s, t)| (0.0..=1.0).contains(s) && (0.0..=1.0).contains(t)) {
            return (w + u * s - v * t).norm();
        }
        let ends = [
            other.distance_to(&self.from),
            other.distance_to(&self.to),
            self.distance_to(&other.from),
            self.distance_to(&other.to),
        ];
        ends.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Shortest distance to a point, m.
    #[must_use]
    pub fn distance_to(&self, point: &Vector3<f64>) -> f64 {
        let along = self.to - self.from;
        let square = along.norm_squared();
        let share =
            if square > 0.0 { ((point - self.from).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
        (point - self.at(share)).norm()
    }
}

#[cfg(test)]
mod capsule_tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Against the distance of many points on both, which is never below the truth and little above it.
    #[test]
    fn distances_are_those_of_the_nearest_of_many_points() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(4);
        const POINTS: usize = 200;
        for case in 0..300 {
            let mut point = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let mut a = Segment { from: point(), to: point() };
            let mut b = Segment { from: point(), to: point() };
            match case % 6 {
                // Points, parallels, one line, a common end.
                0 => a.to = a.from,
                1 => b.to = b.from + (a.to - a.from) * 0.7,
                2 => b = Segment { from: a.at(1.3), to: a.at(1.9) },
                3 => b.from = a.to,
                _ => {}
            }
            let places = || (0..=POINTS).map(|k| k as f64 / POINTS as f64);
            let sampled = places()
                .flat_map(|s| places().map(move |t| (s, t)))
                .map(|(s, t)| (a.at(s) - b.at(t)).norm())
                .fold(f64::INFINITY, f64::min);
            let exact = a.distance(&b);
            let grid = (a.length() + b.length()) / POINTS as f64;
            assert!(exact <= sampled + 1e-12 && sampled <= exact + grid, "{case}: {exact} {sampled}");
            approx::assert_abs_diff_eq!(exact, b.distance(&a), epsilon = 1e-9);
        }
    }

    #[test]
    fn a_segment_is_cut_from_both_ends() {
        let line = Segment { from: Vector3::zeros(), to: Vector3::new(0.0, 0.0, 2.0) };
        let rest = line.cut(0.5, 0.25).unwrap();
        assert_eq!((rest.from.z, rest.to.z), (0.5, 1.75));
        assert!(line.cut(1.5, 0.5).is_none());
        assert_eq!(line.cut(0.0, 0.0), Some(line));
    }
}
