//! One joint at constant velocities, there and back: the motion of a friction experiment, and the mean
//! torques of its log.

use super::laws::Point;
use powerball_logs::motion::Motion;

/// Velocities of the paper's experiment, rad/s: eleven up to 0.2, where a Stribeck effect would show, and
/// seven more up to 0.55; less where the joint is not as fast.
#[must_use]
pub fn velocities(fastest: f64) -> Vec<f64> {
    let scale = (0.95 * fastest / 0.55).min(1.0);
    let slow = (0..11).map(|k| 0.01 + 0.019 * f64::from(k));
    let fast = (1..=7).map(|k| 0.2 + 0.05 * f64::from(k));
    slow.chain(fast).map(|v| v * scale).collect()
}

/// A stretch of constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plateau {
    /// rad/s
    pub velocity: f64,
    /// Time from the start of the motion, s.
    pub from: f64,
    /// s
    pub to: f64,
}

/// A motion of one joint with its plateaus.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The joint that moves, from 0.
    pub joint: usize,
    /// All joints; from rest at the start of the joint's way to rest at the same place.
    pub motion: Motion,
    /// The stretches of constant velocity, in order.
    pub plateaus: Vec<Plateau>,
}

/// The limits of the motion.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Range of the joint's position, rad.
    pub position: [f64; 2],
    /// rad/s²
    pub acceleration: f64,
}

/// Time at one velocity that is aimed at, s, and the least way, rad: several turns of the motor's ripple.
const TIME: f64 = 2.0;
const WAY: f64 = 0.1;
/// Settling at the beginning of a plateau that is left out, s.
const SETTLE: f64 = 0.25;
/// Rest between two ways, s.
const REST: f64 = 0.3;

/// Plans the experiment of a joint: at each velocity once in either direction over the same path, so that the
/// remaining gravity acts on both alike. `pose` holds the other joints.
#[must_use]
pub fn plan(joint: usize, pose: &[f64], bounds: Bounds, velocities: &[f64], period: f64) -> Plan {
    let [low, high] = bounds.position;
    let middle = 0.5 * (low + high);
    let room = 0.9 * (high - low);
    let mut motion = Motion::new(pose.len(), period);
    let mut plateaus = Vec::new();
    // The place at rest between velocities; each way is symmetric about the middle.
    let way_of = |v: f64| {
        let ramps = 1.5 * v * v / bounds.acceleration;
        ((TIME + SETTLE) * v).max(WAY).min((room - ramps).max(0.1 * room)) + ramps
    };
    let first = velocities.first().map_or(0.0, |v| way_of(*v));
    let mut place = middle - 0.5 * first;
    let mut sample = |motion: &mut Motion, q: f64, dq: f64, ddq: f64| {
        motion.push(pose.iter().enumerate().map(
            |(i, held)| {
                if i == joint { [q, dq, ddq] } else { [*held, 0.0, 0.0] }
            },
        ));
    };
    let hold = |motion: &mut Motion, q: f64, sample: &mut dyn FnMut(&mut Motion, f64, f64, f64)| {
        (0..(REST / period).ceil() as usize).for_each(|_| sample(motion, q, 0.0, 0.0));
    };
    sample(&mut motion, place, 0.0, 0.0);
    for v in velocities {
        let way = way_of(*v);
        for direction in [1.0, -1.0] {
            let goal = middle + 0.5 * direction * way;
            let velocity = direction * v;
            // Velocity rises and falls as 3x² − 2x³, whose steepest slope is 3/2.
            let ramp = ((1.5 * v / bounds.acceleration) / period).ceil().max(1.0);
            let ramp_time = ramp * period;
            let plateau_time = (((goal - place).abs() / v - ramp_time) / period).floor().max(0.0) * period;
            let start = motion.len() as f64 * period;
            let samples = (2.0 * ramp_time + plateau_time) / period;
            let from = place;
            for k in 1..=samples.round() as usize {
                let t = k as f64 * period;
                let (shape, slope, way) = if t < ramp_time {
                    smooth(t / ramp_time, ramp_time)
                } else if t <= ramp_time + plateau_time {
                    (1.0, 0.0, 0.5 * ramp_time + (t - ramp_time))
                } else {
                    let left = (2.0 * ramp_time + plateau_time - t).max(0.0);
                    let (shape, slope, way) = smooth(left / ramp_time, ramp_time);
                    (shape, -slope, ramp_time + plateau_time - way)
                };
                place = from + velocity * way;
                sample(&mut motion, place, velocity * shape, velocity * slope);
            }
            plateaus.push(Plateau {
                velocity,
                from: start + ramp_time + SETTLE.min(0.2 * plateau_time),
                to: start + ramp_time + plateau_time,
            });
            hold(&mut motion, place, &mut sample);
        }
    }
    Plan { joint, motion, plateaus }
}

/// Value, slope and integral of 3x² − 2x³ over a ramp of some time.
fn smooth(x: f64, time: f64) -> (f64, f64, f64) {
    (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / time, time * x * x * x * (1.0 - 0.5 * x))
}

/// Means within a plateau whose spread gives its error, at least.
const PARTS: usize = 5;

impl Plan {
    /// The mean torque of every plateau, with its standard error, from the joint's log: times from the start
    /// of the motion, s, and torques, N·m. A plateau without enough samples is left out.
    ///
    /// The error is that of the means of parts of the plateau, because samples next to each other are not
    /// independent.
    #[must_use]
    pub fn points(&self, t: &[f64], torque: &[f64]) -> Vec<Point> {
        let of = |plateau: &Plateau| {
            let first = t.partition_point(|t| *t < plateau.from);
            let last = t.partition_point(|t| *t <= plateau.to);
            let samples = torque.get(first..last)?;
            let length = samples.len() / PARTS;
            if length < 4 {
                return None;
            }
            let means: Vec<f64> = samples
                .chunks_exact(length)
                .take(PARTS)
                .map(|c| c.iter().sum::<f64>() / length as f64)
                .collect();
            let mean = means.iter().sum::<f64>() / PARTS as f64;
            let deviation = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (PARTS - 1) as f64;
            Some(Point { velocity: plateau.velocity, torque: mean, error: (deviation / PARTS as f64).sqrt() })
        };
        let mut points: Vec<Point> = self.plateaus.iter().filter_map(of).collect();
        // Five means know their own spread badly: none is taken for much better than the others.
        let mut errors: Vec<f64> = points.iter().map(|p| p.error).collect();
        errors.sort_by(f64::total_cmp);
        let typical = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        points.iter_mut().for_each(|p| p.error = p.error.hypot(typical));
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Plan {
        let bounds = Bounds { position: [-1.0, 1.2], acceleration: 2.0 };
        plan(1, &[0.3, 0.0, -0.4], bounds, &velocities(1.257), 0.005)
    }

    #[test]
    fn the_motion_is_smooth_keeps_its_bounds_and_has_the_velocities_it_says() {
        let plan = example();
        assert_eq!(plan.plateaus.len(), 36);
        let samples: Vec<[f64; 3]> =
            plan.motion.samples().map(|[q, dq, ddq]| [q[1], dq[1], ddq[1]]).collect();
        assert!(plan.motion.samples().all(|[q, ..]| q[0] == 0.3 && q[2] == -0.4));
        for pair in samples.windows(2) {
            let [[q0, v0, a0], [q1, v1, _]] = [pair[0], pair[1]];
            assert!((-1.0..=1.2).contains(&q1) && a0.abs() <= 2.0 * 1.01);
            // The trapezoid's own error in ramps of few samples.
            approx::assert_abs_diff_eq!(q1 - q0, 0.5 * 0.005 * (v0 + v1), epsilon = 5e-6);
        }
        for p in &plan.plateaus {
            let (first, last) = ((p.from / 0.005).ceil() as usize, (p.to / 0.005) as usize);
            assert!(last - first > 200, "{p:?}");
            assert!(samples[first..last].iter().all(|[_, v, _]| (v - p.velocity).abs() < 1e-9), "{p:?}");
        }
        let (first, last) = (samples[0], samples[samples.len() - 1]);
        assert_eq!((first[1], last[1]), (0.0, 0.0));
    }

    /// Means over the same way both ways: what depends on the position is in the constant torque, not in the
    /// friction.
    #[test]
    fn means_are_the_friction_and_a_constant() {
        let plan = example();
        let friction = |v: f64| 2.0 * (300.0 * v).tanh() + 4.0 * v;
        let t: Vec<f64> = (0..plan.motion.len()).map(|k| k as f64 * 0.005).collect();
        let torque: Vec<f64> =
            plan.motion.samples().map(|[q, dq, _]| friction(dq[1]) + 1.5 * (q[1] - 0.1)).collect();
        let points = plan.points(&t, &torque);
        assert_eq!(points.len(), 36);
        for pair in points.chunks_exact(2) {
            assert_eq!(pair[0].velocity, -pair[1].velocity);
            let half = 0.5 * (pair[0].torque - pair[1].torque);
            // The settling that is left out stands at the beginning of each way, so the ways differ a little.
            approx::assert_abs_diff_eq!(half, friction(pair[0].velocity), epsilon = 1.5 * 0.55 * SETTLE);
        }
    }
}
