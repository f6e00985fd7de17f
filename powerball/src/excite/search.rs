//! The search for a good path: many starts, then small changes to the best ones. The same seed finds the same path.

use super::Error;
use super::fourier::{Fourier, Harmonics};
use super::limits::Limits;
use super::objective::{Figures, Objective};
use dyngen::{Model, SetKind};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What path to look for, and how long.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Number of harmonics N of each joint.
    pub harmonics: usize,
    /// Fundamental frequency ω_f, rad/s.
    pub fundamental: f64,
    /// How often the path is run through.
    pub periods: usize,
    /// Duration of the start and of the stop, s.
    pub ramp: f64,
    /// Share of range, speed and acceleration that stays unused.
    pub margin: f64,
    /// λ₂ of Eq. 17 against λ₁ = 1.
    pub lambda2: f64,
    /// How many paths are judged in all.
    pub evaluations: usize,
    /// Seed of the search.
    pub seed: u64,
}

impl Default for Settings {
    /// The paper's N = 4 and ω_f = 2π/10.
    fn default() -> Self {
        Settings {
            harmonics: 4,
            fundamental: std::f64::consts::TAU / 10.0,
            periods: 2,
            ramp: 1.0,
            margin: 0.05,
            lambda2: 1.0,
            evaluations: 2000,
            seed: 0,
        }
    }
}

/// A path that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The path.
    pub path: Fourier,
    /// Its figures.
    pub figures: Figures,
    /// The figures of the middle one of the random starts, for comparison.
    pub usual: Figures,
}

/// A path in the coordinates of the search, where every point keeps the limits.
#[derive(Clone)]
struct Candidate {
    /// Directions of the coefficients, any size.
    shape: Vec<Harmonics>,
    /// Share of what the limits allow, −1 to 1 before folding.
    range: Vec<f64>,
    place: Vec<f64>,
}

/// Finds a path for a parameter set of an arm within the limits of its file.
///
/// # Errors
/// Limits that the file misses, a set that has no regressor, settings that make no sense.
pub fn optimise(model: &Model, kind: SetKind, settings: &Settings) -> Result<Excitation, Error> {
    check(settings)?;
    let limits = Limits::of(model.arm(), settings.margin)?;
    // Eight instants for each period of the highest harmonic resolve its regressor.
    let mut objective = Objective::new(model, kind, (8 * settings.harmonics).max(48))?;
    let dof = model.arm().dof();
    // Columns are scaled by paths of a seed of their own: figures of different searches can then be compared.
    let mut fixed = ChaCha8Rng::seed_from_u64(0);
    let typical: Vec<Fourier> =
        (0..16).map(|_| Candidate::random(dof, settings, &mut fixed).path(settings, &limits)).collect();
    objective.scale_columns(&typical);

    let (path, figures, usual) = search(dof, settings, &limits, |path| {
        let figures = objective.judge(path);
        (figures.objective(settings.lambda2), figures)
    })?;
    Ok(Excitation { path, figures, usual })
}

/// The path within the limits whose value, the first thing that `judge` says, is smallest; what else it said of that path,
/// and of the middle one of the random starts.
///
/// # Errors
/// Settings that make no sense.
pub fn search<J: Clone>(
    dof: usize,
    settings: &Settings,
    limits: &Limits,
    mut judge: impl FnMut(&Fourier) -> (f64, J),
) -> Result<(Fourier, J, J), Error> {
    check(settings)?;
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let starts = (settings.evaluations / 8).max(1);
    let mut found: Vec<(f64, J, Candidate)> = (0..starts)
        .map(|_| {
            let candidate = Candidate::random(dof, settings, &mut rng);
            let (value, said) = judge(&candidate.path(settings, limits));
            (value, said, candidate)
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let usual = found[found.len() / 2].1.clone();
    found.truncate(3);

    let each = settings.evaluations.saturating_sub(starts) / found.len();
    for best in &mut found {
        // Steps grow after a success and shrink after a failure such that one in five succeeds.
        let mut step: f64 = 0.3;
        for _ in 0..each {
            let next = best.2.changed(step, &mut rng);
            let (value, said) = judge(&next.path(settings, limits));
            if value < best.0 {
                *best = (value, said, next);
                step = (step * 1.5).min(1.0);
            } else {
                step = (step * 0.9).max(0.01);
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (_, said, candidate) = found.swap_remove(0);
    Ok((candidate.path(settings, limits), said, usual))
}

fn check(settings: &Settings) -> Result<(), Error> {
    let wrong = |what: &str| Err(Error::Setting(what.to_string()));
    if settings.harmonics == 0 || settings.periods == 0 || settings.evaluations == 0 {
        return wrong("the numbers of harmonics, periods and evaluations must be at least 1");
    }
    if !(settings.fundamental.is_finite() && settings.fundamental > 0.0) {
        return wrong("the fundamental frequency must be above 0");
    }
    let period = std::f64::consts::TAU / settings.fundamental;
    if !(settings.ramp > 0.0 && settings.ramp <= 0.5 * period * settings.periods as f64) {
        return wrong("the start and the stop must last longer than 0 s and less than half of the path");
    }
    if !(0.0..0.9).contains(&settings.margin) || settings.lambda2.is_nan() || settings.lambda2 < 0.0 {
        return wrong("the margin must lie between 0 and 0.9, and the second weight must not be negative");
    }
    Ok(())
}

impl Candidate {
    fn random(n: usize, settings: &Settings, rng: &mut ChaCha8Rng) -> Candidate {
        let mut coefficients =
            || -> Vec<f64> { (0..settings.harmonics).map(|_| StandardNormal.sample(rng)).collect() };
        let shape = (0..n).map(|_| Harmonics { middle: 0.0, a: coefficients(), b: coefficients() }).collect();
        let range = (0..n).map(|_| rng.random_range(0.6..1.0)).collect();
        Candidate { shape, range, place: (0..n).map(|_| rng.random_range(0.0..1.0)).collect() }
    }

    /// Changes one or two joints.
    fn changed(&self, step: f64, rng: &mut ChaCha8Rng) -> Candidate {
        let mut next = self.clone();
        let joints: Vec<usize> = (0..self.shape.len()).collect();
        for _ in 0..rng.random_range(1..=2) {
            let Some(&joint) = joints.choose(rng) else { break };
            let mut by = || -> f64 { step * Distribution::<f64>::sample(&StandardNormal, rng) };
            let shape = &mut next.shape[joint];
            shape.a.iter_mut().chain(&mut shape.b).for_each(|c| *c += by());
            next.range[joint] = (next.range[joint] + 0.5 * by()).clamp(0.2, 1.0);
            next.place[joint] = (next.place[joint] + by()).clamp(0.0, 1.0);
        }
        next
    }

    fn path(&self, settings: &Settings, limits: &Limits) -> Fourier {
        let mut path = Fourier {
            fundamental: settings.fundamental,
            periods: settings.periods,
            ramp: settings.ramp,
            joints: self.shape.clone(),
        };
        path.fit(&limits.0, &self.range, &self.place);
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_arm::lwa4p;

    #[test]
    fn the_search_improves_keeps_the_limits_and_repeats_itself() {
        let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
        let settings = Settings { evaluations: 400, seed: 3, ..Settings::default() };
        let found = optimise(&model, SetKind::Minimal, &settings).unwrap();
        assert_eq!(found, optimise(&model, SetKind::Minimal, &settings).unwrap());
        assert!(found.figures.objective(1.0) < 0.5 * found.usual.objective(1.0), "{found:?}");
        let limits = Limits::of(model.arm(), 0.0).unwrap();
        for [q, dq, ddq] in found.path.sample(200.0).samples() {
            for (i, limit) in limits.0.iter().enumerate() {
                assert!((limit.position[0]..limit.position[1]).contains(&q[i]));
                assert!(dq[i].abs() < limit.velocity && ddq[i].abs() < limit.acceleration);
            }
        }
    }

    #[test]
    fn an_arm_without_limits_is_refused_with_what_is_missing() {
        let mut arm = lwa4p::arm().unwrap();
        arm.joints[2].velocity = None;
        arm.joints[4].position = None;
        let model = Model::derive(arm).unwrap();
        let refusal = optimise(&model, SetKind::Minimal, &Settings::default()).unwrap_err().to_string();
        assert!(
            refusal.contains("joint 3: `velocity`") && refusal.contains("joint 5: `position`"),
            "{refusal}"
        );
    }
}
