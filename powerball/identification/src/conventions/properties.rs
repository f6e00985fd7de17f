//! Properties of the torque columns, one question each: their unit, their sign, the side of the gear, whether
//! they were measured, whether they contain gravity, and whether they are late.

use super::arm_file::FACTOR;
use super::asked::{Torques, median};
use super::fit::{Judged, LONGEST, Rows, judge, of_joint_alone};
use super::physics::Energies;
use super::result::{GravityIs, Kind, Side};
use super::search::Found;
use dyngen::Arm;
use dyngen::exact::rational::to_f64;
use powerball_logs::log::Log;

// The unit of the torques: by the weight and inertia that they would give an arm of this size.
//
// Weight grows with the cube of the reach, inertia with its fifth power. Of arms from a pendulum of half a
// metre to a UR10e, weight as a mass at full reach over reach³ is 0.2 to 21 kg/m³, and inertia over reach⁵
// is 0.04 to 21 kg/m³. A unit that is a thousand times too small or a gear ratio that is missing is far
// beyond both.

/// The geometric mean of both above this is not that of an arm, kg/m³.
const HEAVIEST: f64 = 100.0;
/// Inertia alone above this.
const HEAVIEST_INERTIA: f64 = 300.0;
/// Both below these are not that of an arm either.
const LIGHTEST: [f64; 2] = [0.2, 0.02];
/// Torques that stay below this share of every joint's limit are too small, where they carry the arm's
/// weight.
const IDLE: f64 = 0.03;
/// Weight below this share of inertia is not a weight: arms have once to thirty times as much.
const WEIGHTLESS: f64 = 0.15;
/// Factors agree with numbers of the arm file within this.
const AGREE: f64 = 1.2;

/// The result from the size of the torques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    Plausible,
    TooLarge,
    TooSmall,
    Unknown,
}

/// The unit that torques seem to be in.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Unit {
    NewtonMetre,
    Milli,
    /// Before the gear: each column is to be multiplied by its gear ratio.
    BeforeGear(Vec<f64>),
    /// Currents: each column is to be multiplied by its torque constant where the arm file has it.
    Ampere(Option<Vec<f64>>),
    /// Before the gear, or currents: all factors are alike, and both are of that size.
    GearOrAmpere,
    /// Some columns are in another unit than most.
    OfItsOwn(Vec<f64>),
    Unknown,
}

/// Weight and inertia over reach, kg/m³, and the largest share of a joint's torque limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) weight: Option<f64>,
    pub(super) inertia: Option<f64>,
    pub(super) of_limit: Option<f64>,
}

impl Size {
    pub(super) fn of(found: &Found<'_>) -> Size {
        let (rows, arm) = (&found.rows, found.rows.data.body.arm());
        let fit = &found.judged.fits[0];
        let reach = arm.length();
        let g = rows.data.body.gravity().iter().map(|x| x * x).sum::<f64>().sqrt();
        let (_, largest) = weight(rows, &fit.theta);
        let over = |x: f64| (x.is_finite() && x > 0.0).then_some(x);
        let mut squares = (0.0, 0usize);
        for recording in rows.data.recordings.iter() {
            squares.0 += recording.v.iter().map(|v| v * v).sum::<f64>();
            squares.1 += recording.len();
        }
        let velocity = squares.0 / squares.1.max(1) as f64;
        let inertia = 2.0 * found.energies[0].kinetic(fit).value.abs() / velocity;
        Size {
            weight: if acts(rows) { over(largest / g / reach.powi(4)) } else { None },
            inertia: over(inertia / reach.powi(5)),
            of_limit: of_limit(found, arm),
        }
    }

    /// Whether the torques carry no weight, though they move an arm.
    pub(super) fn is_weightless(&self) -> bool {
        matches!((self.weight, self.inertia), (Some(weight), Some(inertia)) if weight < WEIGHTLESS * inertia)
    }

    /// The result from the size of the torques, with the answer about gravity in them.
    pub(super) fn scale(&self, gravity: Option<GravityIs>) -> Scale {
        let (Some(inertia), weight) = (self.inertia, self.weight) else { return Scale::Unknown };
        let heavy = match weight.filter(|_| !self.is_weightless()) {
            Some(weight) => (weight * inertia).sqrt() > HEAVIEST,
            None => inertia > HEAVIEST_INERTIA,
        };
        let light = weight.is_some_and(|weight| weight < LIGHTEST[0] && inertia < LIGHTEST[1]);
        let idle = gravity == Some(GravityIs::Included) && self.of_limit.is_some_and(|share| share < IDLE);
        match (heavy, light || idle) {
            (true, _) => Scale::TooLarge,
            (_, true) => Scale::TooSmall,
            _ => Scale::Plausible,
        }
    }
}

/// The largest share of its limit that a joint's torque reaches in all but one of a hundred rows.
fn of_limit(found: &Found<'_>, arm: &Arm) -> Option<f64> {
    let share = |joint: usize| {
        let limit = arm.joints[joint].torque?;
        let mut torque: Vec<f64> =
            [0, 1].iter().flat_map(|part| found.rows.torque(&found.read.torques, joint, *part)).collect();
        torque.iter_mut().for_each(|t| *t = t.abs());
        torque.sort_by(f64::total_cmp);
        // The factor of the reading is not the log's.
        Some(torque.get(torque.len() * 99 / 100)? / limit / found.read.torques.gain[joint].abs())
    };
    (0..arm.dof()).map(share).collect::<Option<Vec<f64>>>()?.into_iter().max_by(f64::total_cmp)
}

/// The unit by size and by the factors that were found.
pub(super) fn unit(found: &Found<'_>, scale: Scale) -> Unit {
    let arm = found.rows.data.body.arm();
    let gains: Vec<f64> = found.read.torques.gain.iter().map(|g| g.abs()).collect();
    let filed = |of: &dyn Fn(usize) -> Option<f64>| {
        (0..arm.dof()).map(of).collect::<Option<Vec<f64>>>().filter(|x| x.iter().all(|x| *x > 0.0))
    };
    let ratios = filed(&|j| arm.joints[j].rotor_ratio.as_ref().map(|r| to_f64(r).abs()));
    let constants = filed(&|j| arm.joints[j].torque_constant.map(f64::abs));
    let agree = |numbers: &Option<Vec<f64>>| {
        numbers.as_ref().is_some_and(|numbers| {
            let ratios_in_log: Vec<f64> = numbers.iter().zip(&gains).map(|(n, g)| (n / g).ln()).collect();
            let common = median(ratios_in_log.clone());
            ratios_in_log.iter().all(|x| (x - common).abs() < AGREE.ln())
        })
    };
    if found.read.torques.is_scaled() {
        if agree(&ratios) {
            return ratios.map_or(Unit::Unknown, Unit::BeforeGear);
        }
        if agree(&constants) {
            return Unit::Ampere(constants);
        }
        // Most columns of one unit, and a few that are surely not of it; anything in between is reported
        // without a correction.
        let odd = gains.iter().filter(|g| g.ln().abs() > FACTOR.ln()).count();
        let usual = gains.iter().filter(|g| g.ln().abs() < AGREE.ln()).count();
        let few = 3 * odd <= gains.len() && odd + usual == gains.len() && scale != Scale::TooSmall;
        let own = |g: &f64| if g.ln().abs() > FACTOR.ln() { *g } else { 1.0 };
        return if few { Unit::OfItsOwn(gains.iter().map(own).collect()) } else { Unit::Ampere(None) };
    }
    match scale {
        Scale::Plausible => Unit::NewtonMetre,
        Scale::Unknown => Unit::Unknown,
        Scale::TooLarge => Unit::Milli,
        Scale::TooSmall => Unit::GearOrAmpere,
    }
}

// Signs: friction takes power, and energy of motion is positive.

/// Standard errors from zero at which a sign is sure.
const SURE: f64 = 5.0;
/// Evidence against it must be nearer to zero than this.
const AGAINST: f64 = 3.0;

/// The joints that friction drives where it brakes the others: their torque or their position has the other
/// sign. Each joint is tested by itself, with inertial parameters of its own, so that the others do not
/// matter.
pub(super) fn driven_by_friction(rows: &Rows<'_>, read: &Torques, energies: &[Energies; 2]) -> Vec<usize> {
    let moving: Vec<usize> = (0..rows.dof()).filter(|j| rows.moves(*j)).collect();
    let sign_of = |joint: usize| {
        let clear = [0, 1]
            .map(|part| energies[part].friction(&of_joint_alone(rows, read, joint, part), joint).clear());
        match clear {
            [a, b] if a < -SURE && b < -SURE => -1,
            [a, b] if a > SURE && b > SURE => 1,
            _ => 0,
        }
    };
    let signs: Vec<(usize, i32)> = moving.into_iter().map(|j| (j, sign_of(j))).collect();
    let of = |sign: i32| signs.iter().filter(|(_, s)| *s == sign).map(|(j, _)| *j).collect::<Vec<usize>>();
    let (driven, braked) = (of(-1), of(1));
    // Where it drives most of them, all signs are reversed, and those of the others are not.
    if driven.len() > braked.len() { braked } else { driven }
}

/// The result about the sign that all torques have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Common {
    AsSaid,
    Reversed,
    Unknown,
}

/// The common sign of all torques: 1 or −1 if friction or the energy of motion shows it in both parts.
pub(super) fn common(judged: &Judged, energies: &[Energies; 2]) -> Common {
    let both = |of: &dyn Fn(usize) -> f64| [of(0), of(1)];
    let kinetic = both(&|part| energies[part].kinetic(&judged.fits[part]).clear());
    let friction = both(&|part| energies[part].all_friction(&judged.fits[part]).clear());
    let all = |x: [f64; 2], sign: f64, limit: f64| x.iter().all(|x| sign * x > limit);
    let says = |sign: f64| {
        (all(kinetic, sign, SURE) && all(friction, sign, -AGAINST))
            || (all(friction, sign, SURE) && all(kinetic, sign, -AGAINST))
    };
    match (says(1.0), says(-1.0)) {
        (true, false) => Common::AsSaid,
        (false, true) => Common::Reversed,
        _ => Common::Unknown,
    }
}

// On which side of the gear the torques are, by the friction in them.

/// Of the power that goes into the joint with the least friction, friction takes at most this share on the
/// link side. Sensors of a Kinova Gen3, a Panda and an xMate: 2 to 8 %.
const LINK: f64 = 0.12;
/// And at least this on the motor side: a UR10e 37 %, a pendulum with a gear ratio of 6 36 %.
const MOTOR: f64 = 0.25;

/// The least share of its power that friction takes of any joint, in both parts.
pub(super) fn least_share(
    rows: &Rows<'_>,
    read: &Torques,
    judged: &Judged,
    energies: &[Energies; 2],
) -> Option<f64> {
    let of = |joint: usize| {
        let shares = [0, 1].map(|part| {
            let torque = rows.torque(read, joint, part);
            let columns = &rows.joints[joint][part].columns;
            let velocity = &columns[columns.len() - 2];
            let power = torque.iter().zip(velocity).map(|(t, v)| (t * v).abs()).sum::<f64>();
            energies[part].friction(&judged.fits[part], joint).value.abs() * torque.len() as f64 / power
        });
        0.5 * (shares[0] + shares[1])
    };
    let shares = (0..rows.dof()).filter(|j| rows.moves(*j)).map(of).filter(|x| x.is_finite());
    shares.min_by(f64::total_cmp)
}

/// The side.
pub(super) fn side(share: f64) -> Option<Side> {
    if share < LINK { Some(Side::Link) } else { (share > MOTOR).then_some(Side::Motor) }
}

// Whether torques were measured or commanded, by samples as they were logged.
//
// Two recordings never measure the same: torques that repeat bit by bit while the positions do not were
// commanded. Noise that no position column shares was measured.

/// Samples that must repeat.
const REPEATS: usize = 50;
/// Noise above this share of a torque's rms is measured noise.
const NOISE: f64 = 2e-3;
/// … where less than this share of its variance follows the positions.
const FOLLOWS: f64 = 0.3;

/// Whether torques were measured or commanded, from two logs or from the noise.
pub(super) fn kind(logs: &[&Log]) -> Option<Kind> {
    for (k, a) in logs.iter().enumerate() {
        if logs[..k].iter().any(|b| repeats(a, b)) {
            return Some(Kind::Commanded);
        }
    }
    let noisy = |log: &&&Log| log.torque.iter().zip(&log.q).filter(|(x, q)| is_noisy(x, q)).count();
    let all: usize = logs.iter().map(|log| log.torque.len()).sum();
    (2 * logs.iter().map(|log| noisy(&log)).sum::<usize>() > all).then_some(Kind::Measured)
}

/// Whether the torques of one log are those of another while its positions are not.
fn repeats(a: &Log, b: &Log) -> bool {
    let count = a.t.len().min(b.t.len());
    let same = |x: &[Vec<f64>], y: &[Vec<f64>]| {
        x.iter()
            .zip(y)
            .all(|(x, y)| x[..count].iter().zip(&y[..count]).filter(|(x, y)| x == y).count() > count * 9 / 10)
    };
    let changes = |x: &[f64]| x[..count].windows(2).filter(|w| w[0] != w[1]).count() > REPEATS;
    count > REPEATS && a.torque.iter().any(|x| changes(x)) && same(&a.torque, &b.torque) && !same(&a.q, &b.q)
}

/// Whether a torque has noise that is not that of the joint's position.
fn is_noisy(torque: &[f64], q: &[f64]) -> bool {
    let n = torque.len().min(20_000);
    if n < 100 {
        return false;
    }
    let third = |x: &[f64]| -> Vec<f64> {
        x[..n].windows(4).map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).collect()
    };
    let (t, q) = (third(torque), third(q));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let noise = dot(&t, &t);
    // White noise has twenty times its variance in third differences.
    let deviation = (noise / 20.0 / n as f64).sqrt();
    let rms = (dot(&torque[..n], &torque[..n]) / n as f64).sqrt();
    let follows = dot(&t, &q).powi(2) / (dot(&q, &q) * noise).max(f64::MIN_POSITIVE);
    deviation > NOISE * rms && follows < FOLLOWS
}

// Whether the torques contain gravity.
//
// The first moments of the links show twice: in gravity and in inertia. Where gravity was taken out of the
// torques, inertia still shows them, and the weight that they would have is missing.

/// Samples that are used.
const SAMPLES: usize = 500;
/// Gravity acts on a joint where it is more than this share of its torque.
const ACTS: f64 = 0.2;

/// The rms torque of gravity by joint from a fit's inertial parameters, N·m, and the largest of any joint.
pub(super) fn weight(rows: &Rows<'_>, theta: &[f64]) -> (Vec<f64>, f64) {
    let (n, body) = (rows.dof(), rows.data.body);
    let all: usize = rows.data.recordings.iter().map(|r| r.len()).sum();
    let every = all.div_ceil(SAMPLES).max(1);
    let mut q = Vec::new();
    for recording in rows.data.recordings.iter() {
        recording.q.chunks_exact(n).step_by(every).for_each(|sample| q.extend_from_slice(sample));
    }
    let still = vec![0.0; q.len()];
    let torque = body.torque(&q, &still, &still, &theta[..rows.inertial()]);
    let count = (torque.len() / n).max(1) as f64;
    let rms = |j: usize| (torque.iter().skip(j).step_by(n).map(|x| x * x).sum::<f64>() / count).sqrt();
    let largest = torque.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    ((0..n).map(rms).collect(), largest)
}

/// Whether gravity acts on any joint of the arm where it was.
pub(super) fn acts(rows: &Rows<'_>) -> bool {
    let (n, body) = (rows.dof(), rows.data.body);
    let of_g = 1e-3 * body.gravity().iter().map(|x| x * x).sum::<f64>().sqrt();
    rows.data.recordings.iter().any(|recording| {
        let q: Vec<f64> = recording.q.iter().take(n).copied().collect();
        let still = vec![0.0; n];
        of_g > 0.0 && body.regressor(&q, &still, &still).iter().any(|y| y.abs() > of_g)
    })
}

/// The joints on which gravity acts, by a fit to torques that it was taken out of.
pub(super) fn acts_on(rows: &Rows<'_>, theta: &[f64], power: &[f64]) -> Vec<usize> {
    let (rms, _) = weight(rows, theta);
    (0..rows.dof()).filter(|j| rows.moves(*j) && rms[*j] > ACTS * power[*j].sqrt()).collect()
}

// Whether the torque columns are late.

/// Steps of the first look and of the last, s.
const COARSE: f64 = 0.02;
const FINE: f64 = 0.0025;
/// A delay that is worth telling, s.
const SEEN: f64 = 0.04;
/// The two parts agree on a delay within this, or within a tenth of it, s.
const DELAYS_AGREE: f64 = 0.01;

/// How late all torque columns are by both parts, s; `None` where they disagree or the best is at the end of
/// what is tried.
pub(super) fn common_delay(rows: &Rows<'_>, read: &Torques, ridge: f64) -> Option<f64> {
    let largest = read.late.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > 0.0 {
        return None;
    }
    let at = |late: f64| judge(rows, &read.later(late), ridge);
    let count = (LONGEST / COARSE).round() as i32;
    let coarse: Vec<(f64, Judged)> =
        (-count..=count).map(|k| f64::from(k) * COARSE).map(|late| (late, at(late))).collect();
    let best = |tried: &[(f64, Judged)], parts: &[usize]| {
        let score = |judged: &Judged| parts.iter().map(|part| sum(&judged.left[*part])).sum::<f64>();
        tried.iter().map(|(late, judged)| (*late, score(judged))).min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let [one, other] = [0, 1].map(|part| best(&coarse, &[part]));
    let (one, other, both) = (one?.0, other?.0, best(&coarse, &[0, 1])?.0);
    if both.abs() > LONGEST - 0.5 * COARSE || both == 0.0 && one == 0.0 && other == 0.0 {
        return if both == 0.0 { fine(&at, both).filter(|late| *late != 0.0) } else { None };
    }
    if (one - other).abs() > COARSE + DELAYS_AGREE.max(0.1 * both.abs()) {
        return None;
    }
    fine(&at, both)
}

/// The best near a coarse one.
fn fine(at: &impl Fn(f64) -> Judged, near: f64) -> Option<f64> {
    let (mut best, mut step) = ((near, both(&at(near))), 0.5 * COARSE);
    while step >= FINE {
        for late in [best.0 - step, best.0 + step] {
            let left = both(&at(late));
            if left < best.1 {
                best = (late, left);
            }
        }
        step *= 0.5;
    }
    Some(best.0)
}

fn both(judged: &Judged) -> f64 {
    sum(&judged.left[0]) + sum(&judged.left[1])
}

fn sum(left: &[f64]) -> f64 {
    left.iter().filter(|x| x.is_finite()).map(|x| (x + 4e-4).ln()).sum()
}

/// Whether a delay of [`SEEN`] either way would show: errors rise by a tenth at least.
pub(super) fn would_show(rows: &Rows<'_>, read: &Torques, ridge: f64, judged: &Judged) -> bool {
    let joints = judged.left[0].iter().filter(|x| x.is_finite()).count().max(1) as f64;
    [-SEEN, SEEN].iter().all(|by| both(&judge(rows, &read.later(*by), ridge)) - both(judged) > 0.2 * joints)
}
