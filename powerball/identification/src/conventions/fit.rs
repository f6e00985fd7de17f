//! The judgement of a reading: the shared rigid arm and textbook friction, fitted to one part of the logs and
//! judged by the other, both ways round.
//!
//! The module also makes the rows of a regression for one reading of the positions; every reading of the
//! torques is judged on them.

use super::asked::Torques;
use crate::estimate::{NormalEquations, Solver};
use faer::Mat;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataError, DataOptions, Recording, RigidArm};

/// Joints are weighted by their residual of the fit, but at least by this share of their torque.
const FLOOR: f64 = 0.03;
/// Passes of that weighting.
const PASSES: usize = 4;
/// Steps of a fit with a factor by joint, and how hard each factor is held back.
const STEPS: usize = 20;
const HELD: f64 = 3e-3;

/// A joint's rows in a part with a reading of its torque.
struct Sums {
    normal: NormalEquations,
    rows: f64,
}

impl Sums {
    /// Mean square of the torque.
    fn power(&self) -> f64 {
        self.normal.square / self.rows.max(1.0)
    }

    /// Mean square of what coefficients, by column of the joint, leave of it.
    fn left(&self, theta: &[f64]) -> f64 {
        self.normal.left(theta).max(0.0) / self.rows.max(1.0)
    }
}

/// A fit to one part.
#[derive(Clone, Debug)]
pub(super) struct PartFit {
    /// All coefficients.
    pub(super) theta: Vec<f64>,
    /// The normal equations with their weights.
    pub(super) solver: Solver,
}

/// The residuals of a reading.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    /// By part that is judged and joint: mean square of the residual over that of the torque; NaN for a joint
    /// that does not move.
    pub(super) left: [Vec<f64>; 2],
    /// Mean square of the torque by joint, both parts together.
    pub(super) power: Vec<f64>,
    /// By part that is fitted.
    pub(super) fits: [PartFit; 2],
}

impl Judged {
    /// The held-out error of a joint as a share of its torque, both parts together.
    pub(super) fn share(&self, joint: usize) -> f64 {
        (0.5 * (self.left[0][joint] + self.left[1][joint])).sqrt()
    }
}

/// Judges a reading; `ridge` holds parameters back that a part hardly determines, as a share of each column's
/// squares.
pub(super) fn judge(rows: &Rows<'_>, read: &Torques, ridge: f64) -> Judged {
    let sums: Vec<[Sums; 2]> =
        (0..rows.dof()).map(|joint| [0, 1].map(|part| sums(rows, read, joint, part))).collect();
    let fits = [0, 1].map(|part| fit(rows, &sums, part, ridge));
    // Part 0 is judged by the fit to part 1, and the other way round.
    let left = [0, 1].map(|part| {
        let judged = |joint: usize| {
            if !rows.moves(joint) {
                return f64::NAN;
            }
            let of = &sums[joint][part];
            let power = of.power().max(f64::MIN_POSITIVE);
            of.left(&rows.of_joint(joint, &fits[1 - part].theta)) / power
        };
        (0..rows.dof()).map(judged).collect()
    });
    let power = |of: &[Sums; 2]| {
        let total = |f: fn(&Sums) -> f64| of.iter().map(f).sum::<f64>();
        total(|s| s.normal.square) / total(|s| s.rows).max(1.0)
    };
    Judged { left, power: sums.iter().map(power).collect(), fits }
}

fn sums(rows: &Rows<'_>, read: &Torques, joint: usize, part: usize) -> Sums {
    let torque = rows.torque(read, joint, part);
    let dot = |x: &Vec<f64>| x.iter().zip(&torque).map(|(x, y)| x * y).sum::<f64>();
    let Part { columns, gram, .. } = &rows.joints[joint][part];
    let normal = NormalEquations {
        gram: gram.clone(),
        right: columns.iter().map(dot).collect(),
        square: dot(&torque),
    };
    Sums { normal, rows: torque.len() as f64 }
}

fn fit(rows: &Rows<'_>, sums: &[[Sums; 2]], part: usize, ridge: f64) -> PartFit {
    let (n, size, inertial) = (rows.dof(), rows.size(), rows.inertial());
    let mut variance: Vec<f64> = sums.iter().map(|of| of[part].power()).collect();
    let mut fitted = (vec![0.0; size], Solver::new(&Mat::zeros(size, size), |_| false));
    for _ in 0..PASSES {
        let mut normal = NormalEquations::zero(size);
        for joint in (0..n).filter(|j| variance[*j] > 0.0 && rows.moves(*j)) {
            normal.add(&rows.places[joint], &sums[joint][part].normal, 1.0 / variance[joint]);
        }
        (0..inertial).for_each(|c| normal.gram[(c, c)] *= 1.0 + ridge);
        let solver = normal.solver(|_| true);
        fitted = (solver.solve(&normal.right), solver);
        for (joint, variance) in variance.iter_mut().enumerate() {
            let of = &sums[joint][part];
            *variance = of.left(&rows.of_joint(joint, &fitted.0)).max(FLOOR * FLOOR * of.power());
        }
    }
    let (theta, solver) = fitted;
    PartFit { theta, solver }
}

/// The factors κ by joint with which the inertial torque of one body comes nearest to every joint's torque in
/// a part, with friction added: Gauss–Newton steps for body and factors together, factors are damped where
/// nothing determines them.
pub(super) fn factors_of_body(rows: &Rows<'_>, read: &Torques, part: usize, ridge: f64) -> Vec<f64> {
    let (n, size, inertial) = (rows.dof(), rows.size(), rows.inertial());
    let sums: Vec<[Sums; 2]> = (0..n).map(|joint| [0, 1].map(|part| sums(rows, read, joint, part))).collect();
    let mut theta = fit(rows, &sums, part, ridge).theta;
    let mut variance: Vec<f64> = sums.iter().map(|of| of[part].power()).collect();
    let mut kappa = vec![1.0; n];
    for step in 0..STEPS {
        let (mut gram, mut right) = (Mat::<f64>::zeros(size + n, size + n), vec![0.0; size + n]);
        for joint in (0..n).filter(|j| variance[*j] > 0.0 && rows.moves(*j)) {
            let (places, NormalEquations { gram: own, right: of_torque, .. }) =
                (&rows.places[joint], &sums[joint][part].normal);
            let (weight, to_body) = (1.0 / variance[joint], places.len() - FRICTION);
            let of = |i: usize| if i < to_body { kappa[joint] } else { 1.0 };
            // The torque of the body fitted so far is the column of the factor.
            let column = |i: usize| (0..to_body).map(|k| own[(k, i)] * theta[places[k]]).sum::<f64>();
            let mut square = 0.0;
            for (i, at) in places.iter().enumerate() {
                right[*at] += weight * of(i) * of_torque[i];
                for (k, to) in places.iter().enumerate() {
                    gram[(*to, *at)] += weight * of(i) * of(k) * own[(k, i)];
                }
                let with = column(i);
                gram[(size + joint, *at)] += weight * of(i) * with;
                gram[(*at, size + joint)] += weight * of(i) * with;
                if i < to_body {
                    square += with * theta[*at];
                    right[size + joint] += weight * of_torque[i] * theta[*at];
                }
            }
            gram[(size + joint, size + joint)] += weight * square * (1.0 + HELD);
            right[size + joint] += weight * square * HELD * (1.0 - kappa[joint]);
        }
        (0..inertial).for_each(|c| gram[(c, c)] *= 1.0 + ridge);
        let solved = Solver::new(&gram, |_| true).solve(&right);
        theta.copy_from_slice(&solved[..size]);
        for (joint, kappa) in kappa.iter_mut().enumerate() {
            let next = *kappa + solved[size + joint];
            *kappa = if next.is_finite() { next.clamp(0.6 * *kappa, 1.6 * *kappa) } else { *kappa };
        }
        // A factor common to all is the body's.
        let mean = (kappa.iter().map(|k| k.ln()).sum::<f64>() / n as f64).exp();
        kappa.iter_mut().for_each(|k| *k /= mean);
        theta[..inertial].iter_mut().for_each(|x| *x *= mean);
        // At first all joints have equal weight: otherwise one with another factor would be missed.
        for (joint, variance) in variance.iter_mut().enumerate().filter(|_| 2 * step > STEPS) {
            let of = &sums[joint][part];
            let mut own = theta.clone();
            own[..inertial].iter_mut().for_each(|x| *x *= kappa[joint]);
            *variance = of.left(&rows.of_joint(joint, &own)).max(FLOOR * FLOOR * of.power());
        }
    }
    kappa
}

/// The fit of one joint by itself, over both parts: its own inertial parameters, nothing shared.
pub(super) fn of_joint_alone(rows: &Rows<'_>, read: &Torques, joint: usize, part: usize) -> PartFit {
    let sums = sums(rows, read, joint, part);
    let solve = |weight: f64| {
        let mut normal = NormalEquations::zero(rows.size());
        normal.add(&rows.places[joint], &sums.normal, weight);
        let solver = normal.solver(|_| true);
        (solver.solve(&normal.right), solver)
    };
    let left = sums.left(&rows.of_joint(joint, &solve(1.0).0));
    let variance = left.max(FLOOR * FLOOR * sums.power()).max(f64::MIN_POSITIVE);
    let (theta, solver) = solve(1.0 / variance);
    PartFit { theta, solver }
}

// The rows of a regression for one reading of the positions; every reading of the torques is judged on them.
//
// The columns are those of the minimal set and a textbook friction: Coulomb, viscous, constant. They fall
// into two parts, each of which is fitted and judged by the other.

/// Friction columns of a joint: tanh(q̇/v₀), q̇, 1.
pub(super) const FRICTION: usize = 3;
/// v₀ of the Coulomb column, as a share of the joint's fast velocity.
const STEP: f64 = 0.02;
/// The band, Hz: below it arms are rigid, and encoder noise that is differentiated twice is small.
const BAND: f64 = 4.0;
/// A joint with fewer rows in a part is not judged.
const FEWEST: usize = 20;
/// The longest shift that can be tried, s: rows keep this distance from the ends of a recording.
pub(super) const LONGEST: f64 = 0.2;

/// The assumption about gravity in the torques.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gravity {
    Included,
    TakenOut,
}

/// One joint's rows in one part.
#[derive(Debug)]
pub(super) struct Part {
    /// (recording, sample of its grid) by row.
    pub(super) at: Vec<(usize, usize)>,
    /// By column of the joint.
    pub(super) columns: Vec<Vec<f64>>,
    /// The products of the columns.
    pub(super) gram: Mat<f64>,
}

/// The rows of all joints.
#[derive(Debug)]
pub(super) struct Rows<'a> {
    pub(super) data: Data<'a>,
    /// By log: the part that it belongs to; without one its halves are the parts.
    part: Vec<Option<usize>>,
    /// By joint: where its columns stand among all coefficients.
    pub(super) places: Vec<Vec<usize>>,
    /// By joint and part.
    pub(super) joints: Vec<[Part; 2]>,
    /// By recording and torque column, in the band at the rate of the grid.
    torque: Vec<Vec<Vec<f64>>>,
}

impl<'a> Rows<'a> {
    /// The rows of thin logs; the part of each log is `part`'s, or its first half is part 0 and its second
    /// half part 1.
    ///
    /// # Errors
    /// Those of [`Data::new`].
    pub(super) fn new(
        body: &'a RigidArm,
        logs: &[Log],
        part: &[Option<usize>],
        gravity: Gravity,
    ) -> Result<Rows<'a>, DataError> {
        let options = DataOptions { cutoff: BAND, block: 1.0, ..DataOptions::default() };
        let data = Data::new(body, logs, &options)?;
        let data = match gravity {
            Gravity::Included => data,
            Gravity::TakenOut => without_gravity(&data),
        };
        Ok(Rows::of(data, part))
    }

    /// These rows with the columns of another arm: `count` parameters, and their columns along a recording,
    /// samples × n × parameters.
    pub(super) fn of_columns(&self, count: usize, columns: impl Fn(&Recording) -> Vec<f64>) -> Rows<'a> {
        Rows::of(self.data.of_other_columns(count, columns), &self.part)
    }

    fn of(data: Data<'a>, part: &[Option<usize>]) -> Rows<'a> {
        let of_recording =
            |r: &Recording| (0..r.dof).map(|j| data.band.filtered(&r.smooth_torque(j))).collect();
        let torque = data.recordings.iter().map(of_recording).collect();
        let (mut places, mut joints) = (Vec::new(), Vec::new());
        for joint in 0..data.dof() {
            let (of_joint, parts) = joint_rows(&data, joint, part);
            places.push(of_joint);
            joints.push(parts);
        }
        Rows { data, part: part.to_vec(), places, joints, torque }
    }

    pub(super) fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Inertial parameters.
    pub(super) fn inertial(&self) -> usize {
        self.data.joints[0].inertial.len()
    }

    /// All coefficients: the minimal set, then the friction of each joint.
    pub(super) fn size(&self) -> usize {
        self.inertial() + FRICTION * self.dof()
    }

    /// Selects the coefficients of a joint's columns.
    fn of_joint(&self, joint: usize, theta: &[f64]) -> Vec<f64> {
        self.places[joint].iter().map(|place| theta[*place]).collect()
    }

    /// Whether a joint has enough rows to be judged.
    pub(super) fn moves(&self, joint: usize) -> bool {
        self.joints[joint].iter().all(|part| part.at.len() >= FEWEST)
    }

    /// The torque of a joint in a part, by this reading.
    pub(super) fn torque(&self, read: &Torques, joint: usize, part: usize) -> Vec<f64> {
        let (column, gain) = (read.column[joint], read.gain[joint]);
        let shift = (read.late[joint] * self.data.rate()).clamp(-1e4, 1e4);
        let of_row = |(recording, sample): &(usize, usize)| {
            gain * between(&self.torque[*recording][column], *sample as f64 + shift)
        };
        self.joints[joint][part].at.iter().map(of_row).collect()
    }
}

/// The value of a signal between its samples, by a cubic through the four nearest.
fn between(x: &[f64], at: f64) -> f64 {
    let first = (at.floor() as isize - 1).clamp(0, x.len().saturating_sub(4) as isize) as usize;
    let Some(&[a, b, c, d]) = x.get(first..first + 4) else { return x.first().copied().unwrap_or(0.0) };
    let s = at - first as f64 - 1.0;
    let (before, after) = (s * (s - 1.0) / 6.0, (s + 1.0) * (s - 2.0) / 2.0);
    -before * (s - 2.0) * a + after * (s - 1.0) * b - after * s * c + before * (s + 1.0) * d
}

/// The columns of the same parameters without gravity.
fn without_gravity<'a>(data: &Data<'a>) -> Data<'a> {
    data.of_other_columns(data.body.names().len(), |r| {
        let still = vec![0.0; r.q.len()];
        let mut columns = data.body.regressor(&r.q, &r.v, &r.a);
        columns.iter_mut().zip(data.body.regressor(&r.q, &still, &still)).for_each(|(c, g)| *c -= g);
        columns
    })
}

fn joint_rows(data: &Data<'_>, joint: usize, part: &[Option<usize>]) -> (Vec<usize>, [Part; 2]) {
    let (rows, p) = (&data.joints[joint], data.joints[joint].inertial.len());
    let step = STEP * data.top_velocity(joint);
    let friction =
        |f: &dyn Fn(f64) -> f64| rows.column(&data.recordings, |_, r| r.velocity(joint).map(f).collect());
    let is_there = |c: &usize| rows.inertial[*c].iter().any(|x| *x != 0.0);
    let used: Vec<usize> = (0..p).filter(is_there).collect();
    let own = [friction(&|v| (v / step).tanh()), friction(&|v| v), friction(&|_| 1.0)];
    let columns: Vec<&[f64]> =
        used.iter().map(|c| rows.inertial[*c].as_slice()).chain(own.iter().map(Vec::as_slice)).collect();
    let places = used.iter().copied().chain((0..FRICTION).map(|k| p + FRICTION * joint + k)).collect();
    let empty = || Part { at: Vec::new(), columns: vec![Vec::new(); columns.len()], gram: Mat::zeros(0, 0) };
    let mut parts = [empty(), empty()];
    let margin = (LONGEST * data.rate()).ceil() as usize;
    for (r, recording) in data.recordings.iter().enumerate() {
        let (kept, length) = (data.band.kept(recording.len()), recording.len());
        for (row, k) in rows.rows[r].clone().zip(&rows.kept[r]) {
            let sample = kept[*k];
            if sample < margin || sample + margin + 2 > length {
                continue;
            }
            let to = part[recording.log].unwrap_or(usize::from(2 * sample > length));
            parts[to].at.push((r, sample));
            parts[to].columns.iter_mut().zip(&columns).for_each(|(x, from)| x.push(from[row]));
        }
    }
    for part in &mut parts {
        // The torque comes with each reading.
        part.gram = NormalEquations::of(&part.columns, &[]).gram;
    }
    (places, parts)
}
