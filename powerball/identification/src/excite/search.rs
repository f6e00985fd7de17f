//! The search for a good path: many starts, then small changes to the best ones. The same seed finds the same
//! path.

use super::Error;
use super::constraints::{Constraints, Limits};
use super::fourier::{Fourier, Harmonics};
use super::objective::{Conditioning, Criterion, Objective};
use super::shape::poses;
use chacha20::ChaCha8Rng;
use dyngen::{Model, SetKind};
use powerball_logs::parallel;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// Poses that are tried for the middle of a random path.
const PLACES: usize = 50;

/// Samples a second at which found paths are compared.
const JUDGED: f64 = 50.0;

/// Settings of an exciting path and of its search.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationSettings {
    /// Number of harmonics N of each joint.
    pub harmonics: usize,
    /// Fundamental frequency ω_f, rad/s.
    pub fundamental: f64,
    /// How often the path is run through.
    pub periods: usize,
    /// Duration of the start and of the stop, s.
    pub ramp: f64,
    /// Share of range, velocity and acceleration that stays unused.
    pub margin: f64,
    /// The criterion of a good path.
    pub criterion: Criterion,
    /// How many paths are judged in all.
    pub evaluations: usize,
    /// How many searches share them, each from random starts of its own: a search can end in a valley that is
    /// not the deepest.
    pub searches: usize,
    /// Seed of the search.
    pub seed: u64,
}

/// Evaluations of one search, after which it hardly gains: more of them make more searches, each from starts
/// of its own.
pub const SEARCH: usize = 12_000;

/// How many searches share this many evaluations.
#[must_use]
pub fn searches(evaluations: usize) -> usize {
    (evaluations / SEARCH).max(1)
}

impl Default for ExcitationSettings {
    /// The paper's N = 4 and ω_f = 2π/10.
    fn default() -> Self {
        ExcitationSettings {
            harmonics: 4,
            fundamental: std::f64::consts::TAU / 10.0,
            periods: 2,
            ramp: 1.0,
            margin: 0.05,
            criterion: Criterion::Condition { lambda2: 1.0 },
            evaluations: 2000,
            searches: 1,
            seed: 0,
        }
    }
}

/// The paths that were found, one for each mounting.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The paths.
    pub paths: Vec<Fourier>,
    /// The figures of all paths together.
    pub figures: Conditioning,
    /// The figures of the middle one of the random starts, for comparison.
    pub usual: Conditioning,
}

/// An arm as it is mounted for a path, and the constraints of the path.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The arm in this mounting.
    pub model: &'a Model,
    /// Limits and surroundings.
    pub constraints: Constraints,
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

/// Candidates for all mountings, with what they are worth.
struct Judged<J> {
    paths: Vec<Candidate>,
    violation: f64,
    value: f64,
    /// The result of `judge` for them; `None` if they break the constraints and were not judged.
    said: Option<J>,
}

impl<J> Judged<J> {
    /// A path that keeps the constraints is better than one that does not; then the smaller violation, then
    /// the value counts.
    fn rank(&self) -> (f64, f64) {
        (self.violation, self.value)
    }

    fn order(a: &Self, b: &Self) -> std::cmp::Ordering {
        a.violation.total_cmp(&b.violation).then(a.value.total_cmp(&b.value))
    }
}

/// Finds a path for a parameter set of an arm within the limits of its file, and no other constraint.
///
/// # Errors
/// Those of [`optimise_all`].
pub fn optimise(model: &Model, kind: SetKind, settings: &ExcitationSettings) -> Result<Excitation, Error> {
    check(settings)?;
    let constraints = Constraints::of(Limits::of(model.arm(), settings.margin)?);
    optimise_all(&[Task { model, constraints }], kind, settings)
}

/// Finds a path for each mounting such that they determine a parameter set together.
///
/// # Errors
/// A set that has no regressor, and those of [`search_all`].
pub fn optimise_all(
    tasks: &[Task<'_>],
    kind: SetKind,
    settings: &ExcitationSettings,
) -> Result<Excitation, Error> {
    check(settings)?;
    let models: Vec<&Model> = tasks.iter().map(|task| task.model).collect();
    // Eight instants for each period of the highest harmonic resolve its regressor.
    let mut objective = Objective::new(&models, kind, (8 * settings.harmonics).max(48))?;
    let constraints: Vec<&Constraints> = tasks.iter().map(|task| &task.constraints).collect();
    // Columns are scaled by paths of a seed of their own: figures of different searches can then be compared.
    let mut fixed = ChaCha8Rng::seed_from_u64(0);
    let typical: Vec<Vec<Fourier>> = (0..16)
        .map(|_| {
            let one = |c: &&Constraints| Candidate::random(c, settings, &mut fixed).path(settings, &c.limits);
            constraints.iter().map(one).collect()
        })
        .collect();
    objective.scale_columns(&typical);
    let share = ExcitationSettings {
        evaluations: settings.evaluations.div_ceil(settings.searches),
        ..settings.clone()
    };
    let streams: Vec<u64> = (0..settings.searches as u64).collect();
    let found = parallel::map(&streams, |stream| {
        search_from(*stream, &constraints, &share, |paths| {
            let figures = objective.judge(paths);
            (figures.objective(settings.criterion), figures)
        })
    });
    // Of what the searches found for Eq. 17 the best is taken by a condition number that no scale of rows or
    // columns changes.
    let value = |paths: &[Fourier], figures: &Conditioning| match settings.criterion {
        Criterion::Condition { .. } if settings.searches > 1 => {
            let motions: Vec<_> = paths.iter().map(|path| path.sample(JUDGED)).collect();
            objective.conditions(&motions).normalised
        }
        criterion => figures.objective(criterion),
    };
    let (mut best, mut refused): (Option<(f64, Excitation)>, _) = (None, None);
    for found in found {
        match found {
            Ok((paths, figures, usual)) => {
                let value = value(&paths, &figures);
                if best.as_ref().is_none_or(|(least, _)| value < *least) {
                    best = Some((value, Excitation { paths, figures, usual }));
                }
            }
            Err(error) => refused = Some(error),
        }
    }
    best.map(|(_, found)| found).ok_or_else(|| refused.unwrap_or(Error::NoPose))
}

/// The path within the limits whose value, the first result of `judge`, is smallest; the other results
/// for that path, and of the middle one of the random starts.
///
/// # Errors
/// Those of [`search_all`].
pub fn search<J: Clone>(
    settings: &ExcitationSettings,
    limits: &Limits,
    mut judge: impl FnMut(&Fourier) -> (f64, J),
) -> Result<(Fourier, J, J), Error> {
    let constraints = Constraints::of(limits.clone());
    let (mut paths, said, usual) = search_all(&[&constraints], settings, |paths| judge(&paths[0]))?;
    Ok((paths.swap_remove(0), said, usual))
}

/// The paths, one for each mounting within its constraints, whose value together is smallest, with what else
/// `judge` returned for them, and of the middle ones of the random starts.
///
/// # Errors
/// Invalid settings, [`Error::NoPose`] if no pose keeps the constraints, and [`Error::NoPath`] if no path
/// that keeps the constraints was found.
pub fn search_all<J: Clone>(
    constraints: &[&Constraints],
    settings: &ExcitationSettings,
    judge: impl FnMut(&[Fourier]) -> (f64, J),
) -> Result<(Vec<Fourier>, J, J), Error> {
    check(settings)?;
    search_from(0, constraints, settings, judge)
}

/// One of the searches that the seed's streams of random numbers make.
fn search_from<J: Clone>(
    stream: u64,
    constraints: &[&Constraints],
    settings: &ExcitationSettings,
    mut judge: impl FnMut(&[Fourier]) -> (f64, J),
) -> Result<(Vec<Fourier>, J, J), Error> {
    if constraints.iter().any(|c| poses(&c.limits.0).all(|q| c.lacks(&q) > 0.0)) {
        return Err(Error::NoPose);
    }
    let place = |candidates: &[Candidate]| -> Vec<Fourier> {
        candidates.iter().zip(constraints).map(|(candidate, c)| candidate.path(settings, &c.limits)).collect()
    };
    let violation =
        |paths: &[Fourier]| -> f64 { constraints.iter().zip(paths).map(|(c, path)| c.violation(path)).sum() };
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    rng.set_stream(stream);
    let starts = (settings.evaluations / 8).max(1);
    let mut found: Vec<Judged<J>> = (0..starts)
        .map(|_| {
            let candidates: Vec<Candidate> =
                constraints.iter().map(|c| Candidate::random(c, settings, &mut rng)).collect();
            let paths = place(&candidates);
            let (value, said) = judge(&paths);
            Judged { paths: candidates, violation: violation(&paths), value, said: Some(said) }
        })
        .collect();
    found.sort_by(|a, b| a.value.total_cmp(&b.value));
    let usual = found[found.len() / 2].said.clone();
    found.sort_by(Judged::order);
    found.truncate(3);

    let each = settings.evaluations.saturating_sub(starts) / found.len();
    let constrained = constraints.iter().any(|c| c.any());
    for best in &mut found {
        // Steps grow after a success and shrink after a failure such that one in five succeeds.
        let mut step: f64 = 0.3;
        for _ in 0..each {
            let mut next = best.paths.clone();
            let changed = if next.len() > 1 { rng.random_range(0..next.len()) } else { 0 };
            next[changed] = next[changed].changed(step, constrained, &mut rng);
            match improved(best, next, &place, &violation, &mut judge) {
                Some(better) => {
                    *best = better;
                    step = (step * 1.5).min(1.0);
                }
                None => step = (step * 0.9).max(0.01),
            }
        }
    }
    found.sort_by(Judged::order);
    let best = found.swap_remove(0);
    let paths = place(&best.paths);
    match (best.said, usual) {
        (Some(said), Some(usual)) if best.violation == 0.0 => Ok((paths, said, usual)),
        _ => {
            let reasons =
                constraints.iter().zip(&paths).filter_map(|(c, path)| c.broken(&path.sample(200.0)));
            Err(Error::NoPath(reasons.collect::<Vec<_>>().join("; ")))
        }
    }
}

/// The candidates judged, if they are better than the best so far; expensive checks come last.
fn improved<J>(
    best: &Judged<J>,
    candidates: Vec<Candidate>,
    place: &impl Fn(&[Candidate]) -> Vec<Fourier>,
    violation: &impl Fn(&[Fourier]) -> f64,
    judge: &mut impl FnMut(&[Fourier]) -> (f64, J),
) -> Option<Judged<J>> {
    let paths = place(&candidates);
    let judged = if best.violation > 0.0 {
        let violation = violation(&paths);
        let (value, said) = match violation == 0.0 {
            true => {
                let (value, said) = judge(&paths);
                (value, Some(said))
            }
            false => (f64::INFINITY, None),
        };
        Judged { paths: candidates, violation, value, said }
    } else {
        let (value, said) = judge(&paths);
        if value >= best.value {
            return None;
        }
        Judged { paths: candidates, violation: violation(&paths), value, said: Some(said) }
    };
    (judged.rank() < best.rank()).then_some(judged)
}

fn check(settings: &ExcitationSettings) -> Result<(), Error> {
    let wrong = |what: &str| Err(Error::Setting(what.to_string()));
    if [settings.harmonics, settings.periods, settings.evaluations, settings.searches].contains(&0) {
        return wrong("the numbers of harmonics, periods, evaluations and searches must be at least 1");
    }
    if !(settings.fundamental.is_finite() && settings.fundamental > 0.0) {
        return wrong("the fundamental frequency must be above 0");
    }
    let period = std::f64::consts::TAU / settings.fundamental;
    if !(settings.ramp > 0.0 && settings.ramp <= 0.5 * period * settings.periods as f64) {
        return wrong("the start and the stop must last longer than 0 s and less than half of the path");
    }
    if !(0.0..0.9).contains(&settings.margin) {
        return wrong("the margin must lie between 0 and 0.9");
    }
    if matches!(settings.criterion, Criterion::Condition { lambda2 } if !(lambda2.is_finite() && lambda2 >= 0.0))
    {
        return wrong("the second weight must be a number and not negative");
    }
    Ok(())
}

impl Candidate {
    /// A random path; where there are surroundings, about a pose that is free if one of many is.
    fn random(constraints: &Constraints, settings: &ExcitationSettings, rng: &mut ChaCha8Rng) -> Candidate {
        let n = constraints.limits.0.len();
        let mut coefficients =
            || -> Vec<f64> { (0..settings.harmonics).map(|_| StandardNormal.sample(rng)).collect() };
        let shape = (0..n).map(|_| Harmonics { middle: 0.0, a: coefficients(), b: coefficients() }).collect();
        let range = (0..n).map(|_| rng.random_range(0.6..1.0)).collect();
        let mut candidate = Candidate { shape, range, place: Vec::new() };
        for _ in 0..PLACES {
            candidate.place = (0..n).map(|_| rng.random_range(0.0..1.0)).collect();
            let path = candidate.path(settings, &constraints.limits);
            let middle: Vec<f64> = path.joints.iter().map(|joint| joint.middle).collect();
            if constraints.lacks(&middle) == 0.0 {
                break;
            }
        }
        candidate
    }

    /// Changes one or two joints.
    fn changed(&self, step: f64, constrained: bool, rng: &mut ChaCha8Rng) -> Candidate {
        // A narrow range can be too narrow for a joint's usual range.
        let least = if constrained { 0.02 } else { 0.2 };
        let mut next = self.clone();
        let joints: Vec<usize> = (0..self.shape.len()).collect();
        for _ in 0..rng.random_range(1..=2) {
            let Some(&joint) = joints.choose(rng) else { break };
            let mut by = || -> f64 { step * Distribution::<f64>::sample(&StandardNormal, rng) };
            let shape = &mut next.shape[joint];
            shape.a.iter_mut().chain(&mut shape.b).for_each(|c| *c += by());
            next.range[joint] = (next.range[joint] + 0.5 * by()).clamp(least, 1.0);
            next.place[joint] = (next.place[joint] + by()).clamp(0.0, 1.0);
        }
        next
    }

    fn path(&self, settings: &ExcitationSettings, limits: &Limits) -> Fourier {
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
    use dyngen::Arm;

    fn lwa4p() -> Arm {
        Arm::parse(include_str!("../../../lwa4p.toml"), "lwa4p.toml").unwrap()
    }

    #[test]
    fn the_search_improves_keeps_the_limits_and_repeats_itself() {
        let model = Model::derive(lwa4p()).unwrap();
        let settings = ExcitationSettings { evaluations: 400, seed: 3, ..ExcitationSettings::default() };
        let found = optimise(&model, SetKind::Minimal, &settings).unwrap();
        assert_eq!(found, optimise(&model, SetKind::Minimal, &settings).unwrap());
        assert!(
            found.figures.objective(settings.criterion) < 0.5 * found.usual.objective(settings.criterion),
            "{found:?}"
        );
        let limits = Limits::of(model.arm(), 0.0).unwrap();
        for [q, dq, ddq] in found.paths[0].sample(200.0).samples() {
            for (i, limit) in limits.0.iter().enumerate() {
                assert!((limit.position[0]..limit.position[1]).contains(&q[i]));
                assert!(dq[i].abs() < limit.velocity && ddq[i].abs() < limit.acceleration);
            }
        }
    }

    #[test]
    fn an_arm_without_limits_is_refused_with_what_is_missing() {
        let mut arm = lwa4p();
        arm.joints[2].velocity = None;
        arm.joints[4].position = None;
        let model = Model::derive(arm).unwrap();
        let refusal =
            optimise(&model, SetKind::Minimal, &ExcitationSettings::default()).unwrap_err().to_string();
        assert!(
            refusal.contains("joint 3: `velocity`") && refusal.contains("joint 5: `position`"),
            "{refusal}"
        );
    }
}
