//! Friction laws fitted to the mean torques of constant velocities, and the choice between them.

use faer::Mat;
use powerball_identification::estimate::bounded;

/// The mean torque of one joint at one constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Velocity, rad/s, negative in the negative direction.
    pub velocity: f64,
    /// Mean torque, N·m, positive in the direction of positive velocity.
    pub torque: f64,
    /// Standard error of the torque, N·m.
    pub error: f64,
}

/// A friction law: levels that are not negative times functions of the velocity with shapes, and a constant
/// torque in addition to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrictionLaw {
    /// Eq. 16: γ1·tanh(γ2·v) + γ3·tanh(γ4·v) + γ5·v.
    Tanh,
    /// Eq. 15: F_c·sign v + F_v·v.
    CoulombViscous,
    /// F_c·sign v + ΔF·exp(−(v/v_s)²)·sign v + F_v·v.
    Stribeck,
    /// `Stribeck` with exp(−|v/v_s|^δ): five parameters.
    StribeckPower,
}

/// Grid points of a shape over its whole range, and around the best point in a later round.
const GRID: usize = 13;
const FINER: usize = 5;
/// Later rounds, each half as wide as the one before: shapes to about 1e-3, where curves no longer differ.
const ROUNDS: usize = 9;
/// Two held-out errors closer than this share of their spread are not distinguished; the law that comes first
/// is taken.
const ALIKE: f64 = 1.0;

impl FrictionLaw {
    /// All of them; of those that fit equally well the first is taken: Eq. 16, because it is smooth and what
    /// everything else here works with.
    pub const ALL: [FrictionLaw; 4] =
        [FrictionLaw::Tanh, FrictionLaw::CoulombViscous, FrictionLaw::Stribeck, FrictionLaw::StribeckPower];

    /// The law's name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            FrictionLaw::Tanh => "tanh",
            FrictionLaw::CoulombViscous => "coulomb_viscous",
            FrictionLaw::Stribeck => "stribeck",
            FrictionLaw::StribeckPower => "stribeck_power",
        }
    }

    /// Least and greatest value of each shape: s/rad for γ2 and γ4, rad/s for v_s, 1 for δ.
    fn ranges(self) -> &'static [(f64, f64)] {
        match self {
            FrictionLaw::Tanh => &[(20.0, 2000.0), (0.5, 2000.0)],
            FrictionLaw::CoulombViscous => &[],
            FrictionLaw::Stribeck => &[(1e-3, 0.5)],
            FrictionLaw::StribeckPower => &[(1e-3, 0.5), (0.3, 3.0)],
        }
    }

    /// The functions whose levels are fitted, at a velocity.
    fn columns(self, shapes: &[f64], v: f64) -> [f64; 3] {
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        match self {
            FrictionLaw::Tanh => [(shapes[0] * v).tanh(), (shapes[1] * v).tanh(), v],
            FrictionLaw::CoulombViscous => [sign, 0.0, v],
            FrictionLaw::Stribeck => [sign, sign * (-(v / shapes[0]).powi(2)).exp(), v],
            FrictionLaw::StribeckPower => [sign, sign * (-(v / shapes[0]).abs().powf(shapes[1])).exp(), v],
        }
    }

    /// Fits the law: the levels by weighted least squares with bounds at every shape, the shapes by a grid
    /// over their whole range that is refined around the best of several starts.
    #[must_use]
    pub fn fit(self, points: &[Point]) -> Fitted {
        let at = |shapes: &[f64]| self.levels(points, shapes);
        let ranges = self.ranges();
        // Every point of the first grid is a start; the best few are followed.
        let mut starts: Vec<Fitted> = grid(ranges, GRID).iter().map(|shapes| at(shapes)).collect();
        starts.sort_by(|a, b| a.error.total_cmp(&b.error));
        starts.truncate(3);
        for start in &mut starts {
            let mut width: Vec<f64> =
                ranges.iter().map(|(low, high)| (high / low).powf(1.0 / (GRID - 1) as f64)).collect();
            for _ in 0..ROUNDS {
                let around: Vec<(f64, f64)> = start
                    .shapes
                    .iter()
                    .zip(&width)
                    .zip(ranges)
                    .map(|((s, w), (low, high))| ((s / w).max(*low), (s * w).min(*high)))
                    .collect();
                for shapes in grid(&around, FINER) {
                    let trial = at(&shapes);
                    if trial.error < start.error {
                        *start = trial;
                    }
                }
                width.iter_mut().for_each(|w| *w = w.sqrt());
            }
        }
        starts.into_iter().min_by(|a, b| a.error.total_cmp(&b.error)).unwrap_or_else(|| at(&[]))
    }

    fn levels(self, points: &[Point], shapes: &[f64]) -> Fitted {
        let mut gram = Mat::<f64>::zeros(4, 4);
        let mut right = vec![0.0; 4];
        let mut square = 0.0;
        for point in points {
            let w = point.error.max(f64::MIN_POSITIVE).powi(-2);
            let [a, b, c] = self.columns(shapes, point.velocity);
            let row = [a, b, c, 1.0];
            for i in 0..4 {
                for k in 0..4 {
                    gram[(i, k)] += w * row[i] * row[k];
                }
                right[i] += w * row[i] * point.torque;
            }
            square += w * point.torque * point.torque;
        }
        let (x, _) = bounded(&gram, &right, |_| true, &[0, 1, 2]);
        let fitted: f64 =
            (0..4).map(|i| x[i] * (2.0 * right[i] - (0..4).map(|k| gram[(i, k)] * x[k]).sum::<f64>())).sum();
        Fitted {
            law: self,
            shapes: shapes.to_vec(),
            levels: [x[0], x[1], x[2]],
            offset: x[3],
            error: square - fitted,
        }
    }
}

/// All combinations of geometrically spaced values; one empty one where there are no shapes.
fn grid(ranges: &[(f64, f64)], count: usize) -> Vec<Vec<f64>> {
    let mut all = vec![Vec::new()];
    for (low, high) in ranges {
        let values = (0..count).map(|k| low * (high / low).powf(k as f64 / (count - 1) as f64));
        all =
            values.flat_map(|v| all.iter().map(move |head: &Vec<f64>| [&head[..], &[v]].concat())).collect();
    }
    all
}

/// A law with its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Which law.
    pub law: FrictionLaw,
    /// The law's shapes, in the order of its formula.
    pub shapes: Vec<f64>,
    /// The law's levels: N·m, N·m, N·m·s/rad.
    pub levels: [f64; 3],
    /// A constant torque in addition to the friction, N·m: what gravity is left, or what differs between the
    /// directions.
    pub offset: f64,
    /// χ² of the fit.
    pub error: f64,
}

impl Fitted {
    /// Friction torque, N·m, at a velocity, rad/s; without the constant torque.
    #[must_use]
    pub fn torque(&self, v: f64) -> f64 {
        self.law.columns(&self.shapes, v).iter().zip(self.levels).map(|(c, l)| c * l).sum()
    }

    /// γ1 … γ5 of Eq. 16, where this is that law.
    #[must_use]
    pub fn gamma(&self) -> Option<[f64; 5]> {
        let [g1, g3, g5] = self.levels;
        match (self.law, self.shapes.as_slice()) {
            (FrictionLaw::Tanh, [g2, g4]) => Some([g1, *g2, g3, *g4, g5]),
            _ => None,
        }
    }
}

/// A law fitted to all points, with its error on points that were not fitted.
#[derive(Clone, Debug)]
pub struct Rated {
    /// The fit.
    pub fitted: Fitted,
    /// Root of the mean squared error of velocities that were left out, both directions of a velocity
    /// together, N·m.
    pub held_out: f64,
    /// The fits without each velocity: their spread is the band of the curve.
    folds: Vec<Fitted>,
}

impl Rated {
    /// Standard error of the curve at a velocity, N·m, by the jackknife over velocities.
    #[must_use]
    pub fn band(&self, v: f64) -> f64 {
        let n = self.folds.len() as f64;
        if n < 2.0 {
            return f64::INFINITY;
        }
        let values: Vec<f64> = self.folds.iter().map(|f| f.torque(v)).collect();
        let mean = values.iter().sum::<f64>() / n;
        ((n - 1.0) / n * values.iter().map(|x| (x - mean).powi(2)).sum::<f64>()).sqrt()
    }
}

/// Every law fitted and rated by leaving velocities out, and the index of the one that is chosen: the least
/// held-out error, or the first one whose error is not distinguished from it. `None` with fewer than five
/// different velocities.
#[must_use]
pub fn choose(points: &[Point]) -> Option<(Vec<Rated>, usize)> {
    let mut velocities: Vec<f64> = points.iter().map(|p| p.velocity.abs()).collect();
    velocities.sort_by(f64::total_cmp);
    velocities.dedup_by(|a, b| (*a - *b).abs() < 0.02 * b.abs());
    if velocities.len() < 5 {
        return None;
    }
    let near = |p: &Point, velocity: f64| (p.velocity.abs() - velocity).abs() < 0.02 * velocity;
    let mut rated = Vec::new();
    let mut squares: Vec<Vec<f64>> = Vec::new();
    for law in FrictionLaw::ALL {
        let folds: Vec<Fitted> = powerball_logs::parallel::map(&velocities, |velocity| {
            let rest: Vec<Point> = points.iter().filter(|p| !near(p, *velocity)).copied().collect();
            law.fit(&rest)
        });
        let of_fold = |(velocity, fold): (&f64, &Fitted)| -> f64 {
            let left_out = points.iter().filter(|p| near(p, *velocity));
            let errors: Vec<f64> =
                left_out.map(|p| (p.torque - fold.offset - fold.torque(p.velocity)).powi(2)).collect();
            errors.iter().sum::<f64>() / errors.len().max(1) as f64
        };
        let errors: Vec<f64> = velocities.iter().zip(&folds).map(of_fold).collect();
        let held_out = (errors.iter().sum::<f64>() / errors.len() as f64).sqrt();
        rated.push(Rated { fitted: law.fit(points), held_out, folds });
        squares.push(errors);
    }
    let best = (0..rated.len()).min_by(|a, b| rated[*a].held_out.total_cmp(&rated[*b].held_out))?;
    // Paired over velocities: the mean difference against its standard error.
    let alike = |k: &usize| {
        let n = velocities.len() as f64;
        let differences: Vec<f64> = squares[*k].iter().zip(&squares[best]).map(|(a, b)| a - b).collect();
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean <= ALIKE * (variance / n).sqrt()
    };
    let chosen = (0..rated.len()).find(alike).unwrap_or(best);
    Some((rated, chosen))
}

#[cfg(test)]
mod tests {
    use super::*;
    use powerball_controller::friction::{TABLE_2, TanhFriction};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn points(truth: impl Fn(f64) -> f64, noise: f64, seed: u64) -> Vec<Point> {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(seed);
        let slow = (0..11).map(|k| 0.01 + 0.19 * f64::from(k) / 10.0);
        let fast = (1..=7).map(|k| 0.2 + 0.35 * f64::from(k) / 7.0);
        slow.chain(fast)
            .flat_map(|v| [v, -v])
            .map(|velocity| {
                let e: f64 = StandardNormal.sample(&mut rng);
                Point { velocity, torque: truth(velocity) + noise * e, error: noise }
            })
            .collect()
    }

    /// Table 2's curves come back within 1 % of their range, at every velocity of the experiment.
    #[test]
    fn the_curves_of_table_2_are_recovered() {
        for (joint, gamma) in TABLE_2.iter().enumerate() {
            let truth = TanhFriction::new(*gamma);
            let range = truth.torque(0.55);
            let points = points(|v| truth.torque(v) + 0.02 * range, 0.003 * range, joint as u64);
            let (rated, _) = choose(&points).unwrap();
            let fitted = &rated[0].fitted;
            for k in 1..=55 {
                let v = f64::from(k) * 0.01;
                let error = (fitted.torque(v) - truth.torque(v)).abs();
                assert!(error < 0.01 * range, "joint {}: {error} at {v} of {range}", joint + 1);
            }
            assert!((fitted.offset - 0.02 * range).abs() < 0.005 * range);
        }
    }

    /// Each law is chosen where it holds, and Eq. 16 where it does as well as a law with a kink.
    #[test]
    fn the_law_that_holds_is_chosen() {
        let tanh = TanhFriction::new(TABLE_2[0]);
        let stribeck = |v: f64| v.signum() * (3.0 + 2.0 * (-(v / 0.05).powi(2)).exp()) + 4.0 * v;
        for seed in 0..3 {
            let (rated, chosen) = choose(&points(|v| tanh.torque(v), 0.02, seed)).unwrap();
            assert_eq!(rated[chosen].fitted.law, FrictionLaw::Tanh);
            let (rated, chosen) = choose(&points(stribeck, 0.02, seed)).unwrap();
            assert_eq!(rated[chosen].fitted.law, FrictionLaw::Stribeck);
            approx::assert_abs_diff_eq!(rated[chosen].fitted.shapes[0], 0.05, epsilon = 0.005);
        }
    }

    /// The band is a standard error: over many draws the curve lies within twice the band nearly always.
    #[test]
    fn the_band_covers_the_truth() {
        let truth = TanhFriction::new(TABLE_2[2]);
        let (mut within, mut total) = (0, 0);
        for seed in 100..120 {
            let points = points(|v| truth.torque(v), 0.05, seed);
            let (rated, _) = choose(&points).unwrap();
            for v in [0.03, 0.1, 0.3, 0.5] {
                let error = (rated[0].fitted.torque(v) - truth.torque(v)).abs();
                within += usize::from(error < 2.0 * rated[0].band(v));
                total += 1;
            }
        }
        assert!(within as f64 > 0.85 * f64::from(total), "{within} of {total}");
    }
}
