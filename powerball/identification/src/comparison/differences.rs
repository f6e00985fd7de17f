//! Differences of two fits, number by number, with their certainty.
//!
//! The module also compares one number of two fits, estimates the variation from run to run, and compares the
//! friction curves of one joint.

use super::result::{
    CompareError, CompareOptions, ConstantDifference, FrictionDifference, ParameterDifference,
    TorqueDifference,
};
use super::side::Side;
use super::strokes::{changes, wanders};
use crate::estimate::distribution::{f_tail, t_critical};
use crate::estimate::{Solver, Uncertainty, friction_row};
use faer::Mat;
use faer::linalg::solvers::SolveLstsq;

/// All differences, `b` less `a`.
pub(super) struct Differences {
    pub level: f64,
    pub comparisons: usize,
    pub parameters: Vec<ParameterDifference>,
    pub inertia: Inertia,
    pub friction: Vec<FrictionDifference>,
    pub constants: Vec<ConstantDifference>,
    pub torque: Vec<TorqueDifference>,
    pub warnings: Vec<String>,
}

/// The differences of the minimal set together.
pub(super) struct Inertia {
    /// b − a, in the order of the compared parameters.
    pub difference: Vec<f64>,
    /// The factor of their covariance.
    pub weights: Solver,
    /// Degrees of freedom of the least known.
    pub freedom: f64,
    /// How often equal arms would differ so in all of them.
    pub p_value: f64,
}

impl Inertia {
    fn new(a: &Side, b: &Side, compared: &[(usize, usize, Difference)]) -> Inertia {
        let covariance = Mat::from_fn(compared.len(), compared.len(), |i, k| {
            a.covariance(compared[i].0, compared[k].0) + b.covariance(compared[i].1, compared[k].1)
        });
        let difference: Vec<f64> = compared.iter().map(|(_, _, d)| d.value).collect();
        let weights = Solver::new(&covariance, |_| true);
        let mut freedom: Vec<f64> = compared.iter().map(|(_, _, d)| d.freedom).collect();
        freedom.sort_by(f64::total_cmp);
        let typical = freedom.get(freedom.len() / 2).copied().unwrap_or(0.0);
        let p_value = hotelling(&difference, &weights, typical);
        Inertia { difference, p_value, weights, freedom: freedom.first().copied().unwrap_or(f64::INFINITY) }
    }
}

/// How often differences like these come by chance (Hotelling's T²), their covariance known with `freedom`
/// degrees of freedom; 0 if they are too many to decide. The covariance is a sum over joints and octaves,
/// each known with degrees of freedom of its own: those of a typical parameter are used for all.
fn hotelling(difference: &[f64], weights: &Solver, freedom: f64) -> f64 {
    let count = weights.kept().len() as f64;
    let left = freedom - count + 1.0;
    if count == 0.0 || left <= 0.0 {
        return 0.0;
    }
    let square: f64 = difference.iter().zip(weights.solve(difference)).map(|(d, w)| d * w).sum();
    f_tail(square * left / (count * freedom), count, left)
}

impl Differences {
    pub(super) fn new(a: &Side, b: &Side, options: &CompareOptions) -> Result<Differences, CompareError> {
        let level = options.level;
        if !(level > 0.0 && level < 1.0) {
            return Err(CompareError::Setting("--level must lie between 0 and 1".into()));
        }
        let place = same_set(a, b)?;
        let mut warnings = Vec::new();
        for side in [a, b].into_iter().filter(|side| side.uncertainty.is_none()) {
            warnings.push(format!(
                "{}: there is no covariance.json next to it: standard errors are used one by one, so fewer \
                    differences are found; identify again to write it",
                side.name
            ));
        }
        let parameters = parameters(a, b, &place);
        let friction = Curves::of(a, b);
        let constant = |j: usize| Some((j, a.constant(j)?, b.constant(j)?));
        let constants: Vec<(usize, _, _)> = (0..a.friction.len()).filter_map(constant).collect();
        let comparisons =
            parameters.len() + friction.iter().map(Curves::points).sum::<usize>() + constants.len();
        if comparisons == 0 {
            let message =
                format!("{} and {} have no standard errors in common: identify again", a.name, b.name);
            return Err(CompareError::NoErrors(message));
        }
        // Bonferroni: each interval misses with an equal share of the level.
        let p = level / comparisons as f64;
        // Questions are fewer: each joint's friction, each constant torque, and inertia, which counts twice,
        // as a payload is what changes most often.
        let inertial = if parameters.is_empty() { 0 } else { 2 };
        let share = level / (inertial + friction.len() + constants.len()) as f64;
        let each = 2.0 * share / parameters.len().max(1) as f64;
        let inertia = Inertia::new(a, b, &parameters);
        let parameters = parameters.into_iter().map(|(k, other, d)| ParameterDifference {
            name: a.parameters[k].name.clone(),
            a: a.parameters[k].value,
            b: b.parameters[other].value,
            difference: d.value,
            interval: d.interval(p),
            p_value: d.p_value(),
            // One of twenty that is far off by itself is noise where all together are not.
            differs: d.p_value() < each && inertia.p_value < 2.0 * share,
        });
        let parameters = parameters.collect();
        let constants = constants.into_iter().map(|(j, own, other)| {
            let d = Difference::of(own, other);
            let p_value = d.p_value();
            let (joint, interval) = (j + 1, d.interval(p));
            let [a, b] = [own.0, other.0];
            ConstantDifference {
                joint,
                a,
                b,
                difference: d.value,
                interval,
                p_value,
                differs: p_value < share,
            }
        });
        let constants = constants.collect();
        let torque = torque(a, b, &place);
        let friction = friction_differences(&friction, [a, b], &torque, p, share);
        Ok(Differences { level, comparisons, parameters, inertia, friction, constants, torque, warnings })
    }
}

/// The difference of each joint's friction: by the curves, and along one path by the strokes too, which take
/// half of the joint's share of the level. Strokes see a change of all friction first; what changes at low
/// velocity alone shows in the curves only, as strokes are compared where they are fast.
fn friction_differences(
    curves: &[Curves],
    [a, b]: [&Side; 2],
    torque: &[TorqueDifference],
    p: f64,
    share: f64,
) -> Vec<FrictionDifference> {
    // A curve that is another one, where all torques together are the same, is what another parameter of
    // the fit made up for; one of less than no friction is no friction.
    let shows = |f: &FrictionDifference| {
        f.change[1] > -1.0 && torque.iter().find(|t| t.joint == f.joint).is_none_or(|t| t.rms > t.expected)
    };
    let on_one_path = changes(&a.strokes, &b.strokes);
    let difference = |curves: &Curves| {
        let Some(strokes) = on_one_path.get(curves.joint).copied().flatten() else {
            let f = curves.difference(p, share);
            return FrictionDifference { differs: f.differs && shows(&f), ..f };
        };
        let half = 0.5 * share;
        let f = curves.difference(p, half);
        let by_strokes = strokes.p_value() < half;
        let (own, change, differs) = match f.differs && shows(&f) && !wanders(f.change) && !by_strokes {
            true => (f.p_value, f.change, true),
            false => (strokes.p_value(), strokes.interval(half), by_strokes),
        };
        FrictionDifference { p_value: (2.0 * own).min(1.0), change, differs, ..f }
    };
    curves.iter().map(difference).collect()
}

/// The place in `b` of every parameter of `a`.
fn same_set(a: &Side, b: &Side) -> Result<Vec<usize>, CompareError> {
    let find =
        |p: &crate::estimate::ParameterEstimate| b.parameters.iter().position(|other| other.name == p.name);
    let place: Option<Vec<usize>> = a.parameters.iter().map(find).collect();
    let joints = a.friction.len() == b.friction.len();
    match place.filter(|place| joints && place.len() == b.parameters.len()) {
        Some(place) => Ok(place),
        None => {
            let names =
                |side: &Side| side.parameters.iter().map(|p| p.name.clone()).collect::<Vec<_>>().join("; ");
            Err(CompareError::Different(format!(
                "{} is of {} with {} joints and the parameters {}; {} is of {} with {} joints and {}: only \
                    fits of one arm \
                    file and one mounting can be compared",
                a.name,
                a.arm,
                a.friction.len(),
                names(a),
                b.name,
                b.arm,
                b.friction.len(),
                names(b)
            )))
        }
    }
}

fn parameters(a: &Side, b: &Side, place: &[usize]) -> Vec<(usize, usize, Difference)> {
    let one = |(k, other): (usize, &usize)| {
        let own = (a.parameters[k].value, a.covariance(k, k), a.freedom(k)?);
        let theirs = (b.parameters[*other].value, b.covariance(*other, *other), b.freedom(*other)?);
        Some((k, *other, Difference::of(own, theirs)))
    };
    place.iter().enumerate().filter_map(one).collect()
}

/// The difference in torque along the logs of `a`; empty if these are not known.
fn torque(a: &Side, b: &Side, place: &[usize]) -> Vec<TorqueDifference> {
    let Some(all) = &a.uncertainty else { return Vec::new() };
    let mut change = vec![0.0; all.freedom.len()];
    for (k, other) in place.iter().enumerate() {
        change[k] = b.parameters[*other].value - a.parameters[k].value;
    }
    for j in 0..a.friction.len() {
        for (k, part) in curve_in_columns(a, b, j).into_iter().enumerate() {
            change[all.friction(j, k)] = part;
        }
        let constant = |side: &Side| side.friction[j].offset.unwrap_or(0.0);
        if let Some(at) = all.constant(j) {
            change[at] = constant(b) - constant(a);
        }
    }
    (0..a.friction.len())
        .map(|j| {
            let path = &all.path[j];
            let products = |value: &dyn Fn(usize, usize) -> f64| -> f64 {
                let entries = path.products.iter().enumerate();
                let row = |(i, row): (usize, &Vec<f64>)| -> f64 {
                    let term = |(k, product): (usize, &f64)| {
                        let twice = if i == k { 1.0 } else { 2.0 };
                        twice * product * value(path.columns[i], path.columns[k])
                    };
                    row.iter().enumerate().map(term).sum()
                };
                entries.map(row).sum::<f64>().max(0.0)
            };
            let rms = products(&|i, k| change[i] * change[k]).sqrt();
            let expected =
                products(&|i, k| covariance(all, i, k) + other_covariance(a, b, place, i, k)).sqrt();
            let relative = if path.torque > 0.0 { rms / path.torque.sqrt() } else { 0.0 };
            TorqueDifference { joint: j + 1, rms, expected, relative }
        })
        .collect()
}

fn covariance(all: &Uncertainty, i: usize, k: usize) -> f64 {
    if all.freedom[i] > 0.0 && all.freedom[k] > 0.0 { all.covariance(i, k) } else { 0.0 }
}

/// The covariance of `b` in the order of `a`. Where its law has no constant torque, or nothing is known, that
/// of `a`.
fn other_covariance(a: &Side, b: &Side, place: &[usize], i: usize, k: usize) -> f64 {
    let Some(own) = &a.uncertainty else { return 0.0 };
    match &b.uncertainty {
        Some(other) if other.freedom.len() == own.freedom.len() => {
            let at = |c: usize| place.get(c).copied().unwrap_or(c);
            covariance(other, at(i), at(k))
        }
        _ => covariance(own, i, k),
    }
}

/// The difference of two friction curves in the columns of `a`'s: by least squares over the velocities of its
/// logs.
fn curve_in_columns(a: &Side, b: &Side, joint: usize) -> Vec<f64> {
    const POINTS: usize = 100;
    let Some(rms) = a.velocity(joint) else { return vec![0.0; 5] };
    let f = &a.friction[joint];
    // Velocities are about normal. Points are even in ln q̇, as steep levels bend where it is slowest: each
    // represents a range of velocities that grows with its own.
    let velocity = |k: usize| 3.0 * rms * (1e-4f64).powf(k as f64 / (POINTS - 1) as f64);
    let weight = |v: f64| (v / rms).sqrt() * (-0.25 * (v / rms).powi(2)).exp();
    let rows = Mat::from_fn(POINTS, 5, |k, c| {
        weight(velocity(k)) * friction_row([f.gamma2, f.gamma4], velocity(k))[c]
    });
    let right = Mat::from_fn(POINTS, 1, |k, _| {
        let v = velocity(k);
        weight(v) * (b.friction_at(joint, v).0 - a.friction_at(joint, v).0)
    });
    // Two levels of one steepness are one column: a trace of a ridge decides.
    let size = 1e-7 * (0..POINTS).map(|k| rows[(k, 2)].powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let ridged = Mat::from_fn(POINTS + 5, 5, |k, c| match k.checked_sub(POINTS) {
        None => rows[(k, c)],
        Some(own) => f64::from(u8::from(own == c)) * size,
    });
    let right = Mat::from_fn(POINTS + 5, 1, |k, _| if k < POINTS { right[(k, 0)] } else { 0.0 });
    let found = ridged.qr().solve_lstsq(&right);
    (0..5).map(|c| found[(c, 0)]).map(|x| if x.is_finite() { x } else { 0.0 }).collect()
}

// A number of one fit against the same number of another one.

/// A difference with its variance.
#[derive(Clone, Copy)]
pub(super) struct Difference {
    pub value: f64,
    pub variance: f64,
    pub freedom: f64,
}

impl Difference {
    /// The difference of two independent values, each with its variance and degrees of freedom (Welch and
    /// Satterthwaite).
    pub(super) fn of(a: (f64, f64, f64), b: (f64, f64, f64)) -> Difference {
        let variance = a.1 + b.1;
        let doubt = a.1 * a.1 / a.2 + b.1 * b.1 / b.2;
        let freedom = if doubt > 0.0 { variance * variance / doubt } else { a.2.min(b.2) };
        Difference { value: b.0 - a.0, variance, freedom }
    }

    /// How often equal arms would differ so.
    pub(super) fn p_value(self) -> f64 {
        if self.variance > 0.0 {
            f_tail(self.value * self.value / self.variance, 1.0, self.freedom)
        } else {
            1.0
        }
    }

    /// Half the width of an interval that misses the truth with probability `p`.
    fn half(self, p: f64) -> f64 {
        t_critical(p, self.freedom) * self.variance.sqrt()
    }

    pub(super) fn interval(self, p: f64) -> [f64; 2] {
        [self.value - self.half(p), self.value + self.half(p)]
    }
}

// Variation from run to run: it is not in the spread of a residual, but two parts of one log show it.

impl Side {
    /// This side with enlarged errors, so that fits of two parts of its logs, which are of one arm, differ by
    /// no more than these: the spread of a residual contains neither the variation from run to run and from
    /// path to path, nor the error of the model. One factor for all errors, the mean over joints and
    /// velocities of squared differences of friction over their variance, 1 at least.
    #[must_use]
    pub fn repeated(mut self, [first, second]: [&Side; 2]) -> Side {
        let factor =
            Curves::of(first, second).iter().filter_map(Curves::relative_change).collect::<Vec<f64>>();
        let factor = (factor.iter().sum::<f64>() / factor.len().max(1) as f64).max(1.0);
        if let Some(all) = &mut self.uncertainty {
            all.covariance.iter_mut().flatten().for_each(|c| *c *= factor);
        }
        let larger = |std: &mut Option<f64>| *std = std.map(|std| std * factor.sqrt());
        self.parameters.iter_mut().for_each(|p| larger(&mut p.std));
        self.friction.iter_mut().flat_map(|f| &mut f.std).for_each(larger);
        self
    }
}

// One joint's friction curves side by side.
//
// Two questions are answered for a curve: does it differ at any of a few velocities, and does its viscous
// friction differ? The second takes all velocities together (generalised least squares on a line through
// zero), and finds differences that no single velocity shows: errors of the curves at several velocities are
// those of the same few coefficients. Half of a joint's share of the level goes to each.

/// Friction is compared at these shares of the rms velocity: where it breaks loose, where it bends, and where
/// the joint is as fast as it gets.
const VELOCITIES: [f64; 5] = [0.1, 0.3, 0.7, 1.2, 1.8];
/// rad/s, where the logs' velocities are not known.
const ORDINARY: f64 = 0.5;

/// The friction of one joint in both fits.
pub(super) struct Curves {
    /// Joint, from 0.
    joint: usize,
    points: Vec<Point>,
    /// How much steeper `b`'s curve is, if the covariance of both determines it.
    steeper: Option<Difference>,
}

/// A velocity, both frictions there and their difference.
struct Point {
    velocity: f64,
    a: f64,
    b: f64,
    difference: Difference,
}

impl Curves {
    /// The curves of every joint whose friction is known in both fits.
    pub(super) fn of(a: &Side, b: &Side) -> Vec<Curves> {
        let known = |j: &usize| a.knows_friction(*j) && b.knows_friction(*j);
        (0..a.friction.len()).filter(known).map(|j| Curves::of_joint(a, b, j)).collect()
    }

    fn of_joint(a: &Side, b: &Side, joint: usize) -> Curves {
        let top = match (a.velocity(joint), b.velocity(joint)) {
            (Some(a), Some(b)) => a.min(b),
            (one, other) => one.or(other).unwrap_or(ORDINARY),
        };
        let at = |share: f64| {
            let velocity = share * top;
            let (own, other) = (a.friction_at(joint, velocity), b.friction_at(joint, velocity));
            Point { velocity, a: own.0, b: other.0, difference: Difference::of(own, other) }
        };
        let points: Vec<Point> = VELOCITIES.into_iter().map(at).collect();
        let steeper = steeper(a, b, joint, &points);
        Curves { joint, points, steeper }
    }

    /// The mean over velocities of squared differences over their variance: 1 where the curves differ as
    /// their errors say.
    pub(super) fn relative_change(&self) -> Option<f64> {
        let of = |p: &Point| p.difference.value.powi(2) / p.difference.variance;
        let all: Vec<f64> = self.points.iter().map(of).filter(|z| z.is_finite()).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// How many numbers are compared.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// The difference: intervals miss with probability `p` each, and equal curves are called different with
    /// probability `share`.
    pub(super) fn difference(&self, p: f64, share: f64) -> FrictionDifference {
        let of = |what: &dyn Fn(&Point) -> f64| self.points.iter().map(what).collect::<Vec<f64>>();
        let relative = |[low, high]: [f64; 2], size: f64| match size.abs() {
            0.0 => [f64::NEG_INFINITY, f64::INFINITY],
            size => [low / size, high / size],
        };
        let surest =
            self.points.iter().min_by(|x, y| x.difference.p_value().total_cmp(&y.difference.p_value()));
        let at_points = surest.map_or(1.0, |s| self.points.len() as f64 * s.difference.p_value());
        let on_the_line = self.steeper.map_or(1.0, Difference::p_value);
        let asked = if self.steeper.is_some() { 2.0 } else { 1.0 };
        let change = match (surest, self.steeper, self.points.last()) {
            // Seen in the slope alone: its part of the friction where the joint is fastest.
            (_, Some(steeper), Some(fast)) if asked * at_points >= share && asked * on_the_line < share => {
                relative(steeper.interval(share / asked).map(|end| end * fast.velocity), fast.a)
            }
            (Some(surest), ..) => {
                relative(surest.difference.interval(share / (asked * self.points.len() as f64)), surest.a)
            }
            _ => [0.0; 2],
        };
        let p_value = (asked * at_points.min(on_the_line)).min(1.0);
        FrictionDifference {
            joint: self.joint + 1,
            velocities: of(&|r| r.velocity),
            a: of(&|r| r.a),
            b: of(&|r| r.b),
            difference: of(&|r| r.difference.value),
            interval: self.points.iter().map(|r| r.difference.interval(p)).collect(),
            change,
            p_value,
            differs: p_value < share,
        }
    }
}

/// The slope of the difference as a line through zero, N·m·s/rad, by generalised least squares.
fn steeper(a: &Side, b: &Side, joint: usize, points: &[Point]) -> Option<Difference> {
    let velocities: Vec<f64> = points.iter().map(|r| r.velocity).collect();
    let (own, other) =
        (a.friction_covariance(joint, &velocities)?, b.friction_covariance(joint, &velocities)?);
    let covariance = Mat::from_fn(points.len(), points.len(), |i, k| own[i][k] + other[i][k]);
    let weighted = Solver::new(&covariance, |_| true).solve(&velocities);
    let sum = |x: &dyn Fn(usize) -> f64| (0..points.len()).map(|k| weighted[k] * x(k)).sum::<f64>();
    let known = sum(&|k| velocities[k]);
    (known > 0.0 && known.is_finite()).then(|| Difference {
        value: sum(&|k| points[k].difference.value) / known,
        variance: known.recip(),
        freedom: points.iter().map(|r| r.difference.freedom).fold(f64::INFINITY, f64::min),
    })
}
