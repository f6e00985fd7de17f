//! How well a path excites the parameters: Eq. 17.

use super::Error;
use super::fourier::Fourier;
use crate::mounting::together;
use chacha20::ChaCha8Rng;
use dyngen::arm::{Arm, Parameter, ParameterKind};
use dyngen::base::preference::Preference;
use dyngen::exact::rational::to_f64;
use dyngen::{Evaluator, Function, Model, SetKind};
use faer::Mat;
use powerball_logs::motion::Motion;
use rand::{RngExt, SeedableRng};

/// The figures of a path. Both refer to the regressor with its rows divided by the joints' largest torques
/// and its columns by their usual size, so that they have no units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioning {
    /// Largest over smallest singular value.
    pub condition: f64,
    /// Smallest singular value for one row, σ_p / √rows.
    pub least: f64,
    /// Geometric mean of the singular values for one row: the det(YᵀY) of D-optimality, to the power 1/2p.
    pub mean: f64,
}

/// The criterion of a good path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// G of Eq. 17, cond(Y) + λ₂/σ_p(Y).
    Condition {
        /// λ₂ against λ₁ = 1.
        lambda2: f64,
    },
    /// D-optimality: the smallest volume of the parameters' confidence region, 1/det(YᵀY).
    Volume,
}

impl Conditioning {
    /// The value that the search minimises.
    #[must_use]
    pub fn objective(&self, criterion: Criterion) -> f64 {
        match criterion {
            Criterion::Condition { lambda2 } => self.condition + lambda2 / self.least,
            Criterion::Volume => 1.0 / self.mean,
        }
    }

    /// From the squares of the singular values, ascending, of which the first `dependent` count as zero.
    fn of(squares: &[f64], dependent: usize) -> Conditioning {
        let singular: Vec<f64> = squares[dependent..].iter().map(|s| s.max(0.0).sqrt()).collect();
        match (singular.last(), singular.first()) {
            (Some(largest), Some(least)) if *least > 0.0 => Conditioning {
                condition: largest / least,
                least: *least,
                mean: (singular.iter().map(|s| s.ln()).sum::<f64>() / singular.len() as f64).exp(),
            },
            _ => Conditioning::NOTHING,
        }
    }

    /// The figures of a path that does not determine the parameters, or that was not evaluated.
    pub const NOTHING: Conditioning = Conditioning { condition: f64::INFINITY, least: 0.0, mean: 0.0 };
}

/// Condition numbers as publications give them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Condition number of the regressor in SI units, with rotor inertias as they act at the joint, k²·Im.
    pub raw: f64,
    /// Condition number with each column divided by its own length.
    pub normalised: f64,
}

/// The regressor of a set for one mounting.
#[derive(Clone, Debug)]
struct Regressor {
    evaluator: Evaluator,
    /// Each column of the set as a sum of the evaluator's columns; none where they are the same.
    sums: Option<Vec<Vec<(usize, f64)>>>,
}

impl Regressor {
    /// n × p values a sample.
    fn evaluate(&self, motion: &Motion, columns: usize) -> Vec<f64> {
        let mut own = vec![0.0; motion.len() * self.evaluator.outputs()];
        self.evaluator.evaluate(&motion.q, &motion.dq, &motion.ddq, &[], &mut own);
        let Some(sums) = &self.sums else { return own };
        let wide = self.evaluator.outputs() / motion.dof();
        let mut out = Vec::with_capacity(own.len() / wide * columns);
        for row in own.chunks_exact(wide) {
            out.extend(sums.iter().map(|sum| sum.iter().map(|(c, x)| x * row[*c]).sum::<f64>()));
        }
        out
    }
}

/// The regressor of an arm's set in all its mountings, ready to judge paths.
#[derive(Clone, Debug)]
pub struct Objective {
    regressors: Vec<Regressor>,
    dof: usize,
    columns: usize,
    rank: usize,
    row_weights: Vec<f64>,
    column_scales: Vec<f64>,
    /// k² of the columns that are rotor inertias, 1 of the others.
    reflected: Vec<f64>,
    instants: usize,
}

impl Objective {
    /// The objective for a set of an arm, given as it is mounted for each path; a path is judged at
    /// `instants` instants of one period. Where there are several mountings, the set is that of gravity in a
    /// general direction: it has all that any of them determines.
    ///
    /// # Errors
    /// The errors of [`Evaluator::new`].
    pub fn new(models: &[&Model], kind: SetKind, instants: usize) -> Result<Objective, Error> {
        let first = *models.first().ok_or_else(|| Error::Setting("no mounting was given".to_string()))?;
        let general;
        let reference = match models {
            [only] => *only,
            _ => {
                let arms: Vec<&Arm> = models.iter().map(|model| model.arm()).collect();
                general = Model::derive(together(&arms).map_err(Error::Setting)?)?;
                &general
            }
        };
        let set = reference.set(kind)?;
        let kept = reference.arm().kept_parameters();
        // The columns that carry each of the set's parameters, among those of all parameters.
        let sums: Option<Vec<Vec<(usize, f64)>>> = match kind {
            SetKind::Minimal => Some(customary(reference)?.into_iter().map(|c| vec![(c, 1.0)]).collect()),
            _ if models.len() > 1 => {
                let place = |p: &Parameter| kept.iter().position(|k| k == p);
                let value = |c| reference.sets().field.value(c);
                let mut sums = Vec::new();
                for parameter in &set.parameters {
                    let carriers = parameter.carriers.iter();
                    sums.push(carriers.filter_map(|(p, c)| Some((place(p)?, value(c)))).collect());
                }
                Some(sums)
            }
            _ => None,
        };
        let of = if sums.is_some() { SetKind::Full } else { kind };
        let regressor = |model: &&Model| -> Result<Regressor, Error> {
            Ok(Regressor { evaluator: Evaluator::new(model, Function::Regressor, of)?, sums: sums.clone() })
        };
        let regressors = models.iter().map(regressor).collect::<Result<Vec<_>, _>>()?;
        let reflected = match (&sums, kind) {
            (Some(sums), SetKind::Minimal) => sums
                .iter()
                .map(|sum| sum.iter().map(|(c, _)| reflected(first.arm(), &kept[*c])).product())
                .collect(),
            _ => vec![1.0; set.parameters.len()],
        };
        let columns = set.parameters.len();
        // Without a torque limit a joint's torques count as they are.
        let row_weights = first.arm().joints.iter().map(|j| 1.0 / j.torque.unwrap_or(1.0)).collect();
        Ok(Objective {
            regressors,
            dof: first.arm().dof(),
            columns,
            rank: set.rank,
            row_weights,
            column_scales: vec![1.0; columns],
            reflected,
            instants,
        })
    }

    /// Takes the usual size of each column from some typical paths, each one a mounting. The same sizes must
    /// serve all paths that are compared: a column scaled by its own size in each path would hide that the
    /// path leaves it small.
    pub fn scale_columns(&mut self, typical: &[Vec<Fourier>]) {
        self.column_scales.fill(1.0);
        let mut sum = vec![0.0; self.columns];
        for paths in typical {
            let gram = self.gram(paths);
            for (k, s) in sum.iter_mut().enumerate() {
                *s += gram[(k, k)] / typical.len() as f64;
            }
        }
        let positive = |s: &f64| if *s > 0.0 { s.sqrt() } else { 1.0 };
        self.column_scales = sum.iter().map(positive).collect();
    }

    /// The figures of a path for each mounting, together.
    #[must_use]
    pub fn judge(&self, paths: &[Fourier]) -> Conditioning {
        self.figures(&self.gram(paths))
    }

    /// The parameters of the set, and how many of them are independent.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rank)
    }

    /// Condition numbers of the stacked regressor along motions, one for each mounting, every sample a row
    /// for each joint.
    #[must_use]
    pub fn conditions(&self, motions: &[Motion]) -> Conditions {
        let gram = self.gram_of(motions, &vec![1.0; self.dof], &self.reflected);
        let lengths: Vec<f64> =
            (0..self.columns).map(|k| gram[(k, k)].sqrt().max(f64::MIN_POSITIVE)).collect();
        let unit = Mat::from_fn(self.columns, self.columns, |i, k| gram[(i, k)] / lengths[i] / lengths[k]);
        Conditions { raw: self.figures(&gram).condition, normalised: self.figures(&unit).condition }
    }

    /// Where the set's columns are dependent, only as many count as there are independent ones.
    fn figures(&self, gram: &Mat<f64>) -> Conditioning {
        match gram.self_adjoint_eigenvalues(faer::Side::Lower) {
            Ok(squares) => Conditioning::of(&squares, self.columns - self.rank),
            Err(_) => Conditioning::NOTHING,
        }
    }

    /// YᵀY of the scaled regressor over one period of each path, divided by the number of rows.
    fn gram(&self, paths: &[Fourier]) -> Mat<f64> {
        let motion = |path: &Fourier| {
            let step = path.period() / self.instants as f64;
            let mut motion = Motion::new(self.dof, step);
            // The series without start and stop, which hardly excite.
            (0..self.instants).for_each(|k| motion.push(path.series(k as f64 * step)));
            motion
        };
        let motions: Vec<Motion> = paths.iter().map(motion).collect();
        self.gram_of(&motions, &self.row_weights, &self.column_scales)
    }

    fn gram_of(&self, motions: &[Motion], weights: &[f64], scales: &[f64]) -> Mat<f64> {
        let (n, p) = (self.dof, self.columns);
        let rows: usize = motions.iter().map(|motion| motion.len() * n).sum();
        let mut gram = Mat::zeros(p, p);
        for (regressor, motion) in self.regressors.iter().zip(motions) {
            let mut y = regressor.evaluate(motion, p);
            for (r, row) in y.chunks_exact_mut(p).enumerate() {
                let weight = weights[r % n] / (rows as f64).sqrt();
                row.iter_mut().zip(scales).for_each(|(x, s)| *x *= weight / s);
            }
            let y = faer::MatRef::from_row_major_slice(&y, motion.len() * n, p);
            gram += y.transpose() * y;
        }
        gram
    }
}

/// k² where a column is a joint's rotor inertia, so that it counts at the joint; 1 else.
fn reflected(arm: &Arm, parameter: &Parameter) -> f64 {
    let joint = arm.joints.get(parameter.link).filter(|_| parameter.kind == ParameterKind::Im);
    let ratio = joint.and_then(|joint| joint.rotor_ratio.as_ref());
    ratio.map_or(1.0, |k| to_f64(k).powi(2))
}

/// The columns of the customary base parameters (Khalil and Dombre's regrouping) among those of all
/// parameters an arm keeps.
///
/// The minimal set's own choice of columns is the one whose code is cheapest. A condition number depends on
/// the choice, and published ones are those of the customary one; any choice determines the same torques.
fn customary(model: &Model) -> Result<Vec<usize>, Error> {
    let evaluator = Evaluator::new(model, Function::Regressor, SetKind::Full)?;
    let kept = model.arm().kept_parameters();
    let (n, p) = (model.arm().dof(), kept.len());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut draw = || -> Vec<f64> { (0..4 * p * n).map(|_| rng.random_range(-1.5..1.5)).collect() };
    let (q, dq, ddq) = (draw(), draw(), draw());
    let mut y = vec![0.0; 4 * p * n * p];
    evaluator.evaluate(&q, &dq, &ddq, &[], &mut y);
    // In the order of the preference, what is not a combination of columns before it.
    let (mut chosen, mut basis): (Vec<usize>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for parameter in Preference::ALL[0].order(model.arm()) {
        let Some(c) = kept.iter().position(|k| *k == parameter) else { continue };
        let mut column: Vec<f64> = y.iter().skip(c).step_by(p).copied().collect();
        let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let whole = length(&column);
        // Twice: once leaves the rounding of the first time.
        for _ in 0..2 {
            for unit in &basis {
                let along: f64 = unit.iter().zip(&column).map(|(a, b)| a * b).sum();
                column.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
            }
        }
        let left = length(&column);
        if left > 1e-9 * whole && whole > 0.0 {
            column.iter_mut().for_each(|x| *x /= left);
            basis.push(column);
            chosen.push(c);
        }
    }
    let rank = model.set(SetKind::Minimal)?.rank;
    match chosen.len() == rank {
        true => Ok(chosen),
        false => {
            Err(Error::Setting(format!("{} of {rank} base columns were found by numbers", chosen.len())))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Mounting;
    use super::*;
    use powerball_logs::regression::newton_euler;
    /// Two mountings determine what their stacked regressors do, by another formulation of the torque and all
    /// parameters apart; and the condition number is that of the stacked columns.
    #[test]
    fn mountings_count_together() {
        let arm = dyngen::Arm::parse(include_str!("../../../lwa4p.toml"), "lwa4p.toml").unwrap();
        let mountings = ["filed", "90,0"].map(|text| text.parse::<Mounting>().unwrap());
        let models = mountings.map(|m| Model::derive(m.of(&arm).unwrap()).unwrap());
        let objective = Objective::new(&[&models[0], &models[1]], SetKind::Minimal, 8).unwrap();
        let alone = Objective::new(&[&models[0]], SetKind::Minimal, 8).unwrap();
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(2);
        let motions = [(); 2].map(|()| {
            let mut motion = Motion::new(6, 0.01);
            (0..60).for_each(|_| motion.push((0..6).map(|_| [(); 3].map(|()| rng.random_range(-1.5..1.5)))));
            motion
        });
        let kept = arm.kept_parameters();
        let mut rows = Vec::new();
        for (mounting, motion) in mountings.iter().zip(&motions) {
            for [q, dq, ddq] in motion.samples() {
                let full = newton_euler::regressor(&arm, q, dq, ddq, mounting.gravity(&arm));
                rows.extend(
                    (0..6).map(|j| kept.iter().map(|p| full[j * 66 + p.index()]).collect::<Vec<f64>>()),
                );
            }
        }
        let singular = |columns: usize, at: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            let y = Mat::from_fn(rows.len(), columns, at);
            y.singular_values().unwrap()
        };
        let all = singular(kept.len(), &|r, c| rows[r][c]);
        let rank = all.iter().filter(|s| **s > 1e-9 * all[0]).count();
        assert_eq!(objective.size(), (rank, rank));
        assert!(rank > alone.size().1);
        let sums = objective.regressors[0].sums.clone().unwrap();
        let column = |r: usize, c: usize| -> f64 {
            sums[c].iter().map(|(k, x)| x * rows[r][*k]).sum::<f64>() / objective.reflected[c]
        };
        let own = singular(rank, &column);
        let conditions = objective.conditions(&motions);
        approx::assert_relative_eq!(conditions.raw, own[0] / own[rank - 1], max_relative = 1e-6);
        assert!(conditions.normalised < conditions.raw);
    }
}
