//! Finite Fourier series, Eq. 18 to 20, that start from rest and stop at rest.

use super::constraints::JointLimits;
use powerball_logs::motion::Motion;

/// Share of a peak that is left free because samples may miss it.
const MISSED: f64 = 2e-3;

/// The harmonics of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    /// q₀, rad.
    pub middle: f64,
    /// a_l, rad/s, from l = 1.
    pub a: Vec<f64>,
    /// b_l, rad/s, from l = 1.
    pub b: Vec<f64>,
}

/// A periodic path of all joints, and how it is run through.
///
/// The series themselves (Eq. 18) are at full velocity at every time. To start and stop at rest, the path is
/// unchanged and time is warped: the series is run through at the velocity σ̇(t), which rises smoothly from 0
/// to 1 within `ramp` seconds and falls again at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Fourier {
    /// Fundamental frequency ω_f, rad/s.
    pub fundamental: f64,
    /// How often the path is run through.
    pub periods: usize,
    /// Duration of the start and of the stop, s.
    pub ramp: f64,
    /// The series of each joint.
    pub joints: Vec<Harmonics>,
}

/// Sine and cosine of all harmonics at one instant, by which all joints are the same.
fn waves(fundamental: f64, s: f64, count: usize) -> Vec<(f64, f64)> {
    let (sin, cos) = (fundamental * s).sin_cos();
    let next = |&(a, b): &(f64, f64)| Some((a * cos + b * sin, b * cos - a * sin));
    std::iter::successors(Some((sin, cos)), next).take(count).collect()
}

impl Harmonics {
    /// Position, first and second derivative of the series, Eq. 18, 19 and 20.
    fn at(&self, fundamental: f64, waves: &[(f64, f64)]) -> [f64; 3] {
        let mut out = [self.middle, 0.0, 0.0];
        for (l, ((a, b), (sin, cos))) in self.a.iter().zip(&self.b).zip(waves).enumerate() {
            let w = fundamental * (l + 1) as f64;
            out[0] += (a * sin - b * cos) / w;
            out[1] += a * cos + b * sin;
            out[2] += w * (b * cos - a * sin);
        }
        out
    }
}

impl Fourier {
    /// Time from the first to the last instant, s.
    pub fn duration(&self) -> f64 {
        self.periods as f64 * self.period() + self.ramp
    }

    /// One period of the series, s.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.fundamental
    }

    /// The bent time σ(t) with its two derivatives. The rise of σ̇ is 10x³ − 15x⁴ + 6x⁵, x = t / ramp.
    fn warp(&self, t: f64) -> [f64; 3] {
        let r = self.ramp;
        let rise = |t: f64| {
            let x = (t / r).clamp(0.0, 1.0);
            let sigma = r * x.powi(4) * (2.5 - 3.0 * x + x * x);
            [sigma, x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)).powi(2) / r]
        };
        let left = self.duration() - t;
        if r <= 0.0 {
            [t, 1.0, 0.0]
        } else if t < r {
            rise(t)
        } else if left < r {
            let [sigma, velocity, change] = rise(left);
            [self.periods as f64 * self.period() - sigma, velocity, -change]
        } else {
            [t - 0.5 * r, 1.0, 0.0]
        }
    }

    /// The series of every joint with its first and second derivative at their own time `s`, without start
    /// and stop.
    pub fn series(&self, s: f64) -> impl Iterator<Item = [f64; 3]> + '_ {
        let waves = waves(self.fundamental, s, self.harmonics());
        self.joints.iter().map(move |joint| joint.at(self.fundamental, &waves))
    }

    fn harmonics(&self) -> usize {
        self.joints.iter().map(|joint| joint.a.len()).max().unwrap_or(0)
    }

    /// Position, velocity and acceleration of every joint at time `t` from 0 to [`duration`](Self::duration).
    pub fn at(&self, t: f64) -> impl Iterator<Item = [f64; 3]> + '_ {
        let [s, ds, dds] = self.warp(t);
        self.series(s).map(move |[q, first, second]| [q, first * ds, second * ds * ds + first * dds])
    }

    /// The motion in samples, `rate` a second.
    pub fn sample(&self, rate: f64) -> Motion {
        let mut motion = Motion::new(self.joints.len(), 1.0 / rate);
        let count = (self.duration() * rate).round() as usize;
        for k in 0..=count {
            motion.push(self.at((k as f64 / rate).min(self.duration())));
        }
        motion
    }

    /// Shrinks and shifts every joint's series so that the whole motion keeps the limits; `use_of_range` of a
    /// joint, 0 to 1, says how much of what the limits allow is taken, and `place`, 0 to 1, where within the
    /// range of positions the joint swings.
    pub fn fit(&mut self, limits: &[JointLimits], use_of_range: &[f64], place: &[f64]) {
        // All three quantities but the middle are linear in the coefficients: one measurement of the series
        // as they stand gives the scale. Sampling misses a peak by up to the share (l·ω_f·Δt)²/8, which the
        // rate keeps below 1e-3; twice that is left free.
        let rate = (self.fundamental * self.harmonics() as f64 * 12.0).max(8.0 / self.ramp.max(1e-3));
        for joint in &mut self.joints {
            joint.middle = 0.0;
        }
        let motion = self.sample(rate);
        let n = self.joints.len();
        for (i, joint) in self.joints.iter_mut().enumerate() {
            let reach = |values: &[f64]| {
                let own = values.iter().skip(i).step_by(n);
                own.fold([0.0f64; 2], |[low, high], v| [low.min(*v), high.max(*v)])
            };
            let [low, high] = reach(&motion.q);
            let largest = |values: &[f64]| reach(values).into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let limit = &limits[i];
            let range = limit.position[1] - limit.position[0];
            let scale = [
                range / (high - low),
                limit.velocity / largest(&motion.dq),
                limit.acceleration / largest(&motion.ddq),
            ];
            let scale = scale.into_iter().fold(f64::INFINITY, f64::min);
            let scale = if scale.is_finite() { (1.0 - MISSED) * scale * use_of_range[i] } else { 0.0 };
            joint.a.iter_mut().chain(&mut joint.b).for_each(|c| *c *= scale);
            let swing = scale * (1.0 + MISSED);
            let (lowest, highest) = (limit.position[0] - swing * low, limit.position[1] - swing * high);
            joint.middle = lowest + place[i] * (highest - lowest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    fn random(seed: u64) -> (Fourier, Vec<JointLimits>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |n: usize| (0..n).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f64>>();
        let joints = (0..3).map(|_| Harmonics { middle: 0.0, a: draw(5), b: draw(5) }).collect();
        let mut fourier = Fourier { fundamental: 0.6, periods: 2, ramp: 1.2, joints };
        let limit =
            |position, velocity, acceleration| JointLimits { position, velocity, acceleration, torque: None };
        let limits =
            vec![limit([-2.9, 1.0], 1.2, 4.0), limit([0.2, 0.4], 1.2, 4.0), limit([-100.0, 100.0], 9.0, 1.0)];
        fourier.fit(&limits, &[1.0, 0.7, 1.0], &[0.3, 1.0, 0.0]);
        (fourier, limits)
    }

    #[test]
    fn velocities_and_accelerations_are_derivatives_and_the_ends_are_at_rest() {
        for seed in 0..5 {
            let (fourier, _) = random(seed);
            let h = 1e-5;
            for k in 1..400 {
                let t = fourier.duration() * k as f64 / 400.0;
                let (now, before, after) = (fourier.at(t), fourier.at(t - h), fourier.at(t + h));
                for ((now, before), after) in now.zip(before).zip(after) {
                    approx::assert_relative_eq!(now[1], (after[0] - before[0]) / (2.0 * h), epsilon = 1e-7);
                    approx::assert_relative_eq!(now[2], (after[1] - before[1]) / (2.0 * h), epsilon = 1e-6);
                }
            }
            for end in [0.0, fourier.duration()] {
                assert!(fourier.at(end).all(|[_, dq, ddq]| dq.abs() < 1e-12 && ddq.abs() < 1e-9));
            }
        }
    }

    #[test]
    fn fitted_paths_keep_every_limit_and_use_one_to_the_full() {
        for seed in 0..20 {
            let (fourier, limits) = random(seed);
            let motion = fourier.sample(2000.0);
            let mut used = [0.0f64; 3];
            for [q, dq, ddq] in motion.samples() {
                for i in 0..3 {
                    let [low, high] = limits[i].position;
                    assert!(q[i] >= low - 1e-12 && q[i] <= high + 1e-12, "joint {i} at {}", q[i]);
                    let share =
                        (dq[i] / limits[i].velocity).abs().max((ddq[i] / limits[i].acceleration).abs());
                    assert!(share <= 1.0, "joint {i}: {share}");
                    used[i] = used[i].max(share);
                }
            }
            assert!(used[2] > 0.98 || used[0] > 0.98, "{used:?}");
        }
    }
}
