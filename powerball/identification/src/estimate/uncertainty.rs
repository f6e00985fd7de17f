//! The joint covariance of all coefficients of a fit, and their weights along its logs: a comparison of two
//! fits needs both in addition to their values.
//!
//! The module also computes standard errors under coloured noise.

use super::distribution::{freedom_of, t_quantile_975};
use super::reduced::Solution;
use super::solve::{NormalEquations, Solver};
use super::spectrum::{Power, deconvolved};
use super::variable_projection::{FRICTION, tangent};
use faer::Mat;
use faer::linalg::solvers::Solve;
use serde::{Deserialize, Serialize};

/// The covariance of a fit's coefficients. Their order: the minimal set; five a joint, which are the levels
/// γ1 and γ3, γ5, and the tangents γ1·Δln γ2 and γ3·Δln γ4; a constant torque a joint where the friction law
/// has one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// The names of the minimal set.
    pub parameters: Vec<String>,
    /// Joints n.
    pub joints: usize,
    /// Lower triangle by rows, SI units.
    pub covariance: Vec<Vec<f64>>,
    /// Degrees of freedom of each coefficient's standard error; 0 where the logs do not determine it, or
    /// where it is at its bound.
    pub freedom: Vec<f64>,
    /// By joint: the weights of the model along the fitted logs.
    pub path: Vec<Path>,
}

/// The weights of the coefficients in the torque of one joint along logs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// The coefficients that load the joint, as places in the order of [`Uncertainty`].
    pub columns: Vec<usize>,
    /// Mean products of their columns, lower triangle by rows.
    pub products: Vec<Vec<f64>>,
    /// Mean square of the joint's torque, (N·m)².
    pub torque: f64,
}

impl Uncertainty {
    /// The uncertainty of a solution of the minimal set `names`.
    #[must_use]
    pub fn of(names: &[String], solution: &Solution, errors: &StandardErrors) -> Uncertainty {
        let layout = solution.layout;
        let lower = |i: usize| (0..=i).map(|k| errors.covariance[(i, k)]).collect();
        let freedom = |c: usize| errors.std[c].map_or(0.0, |_| freedom_of(errors.quantile[c]));
        Uncertainty {
            parameters: names.to_vec(),
            joints: layout.dof,
            covariance: (0..layout.size()).map(lower).collect(),
            freedom: (0..layout.size()).map(freedom).collect(),
            path: (0..layout.dof).map(|j| path(solution, j)).collect(),
        }
    }

    /// The place of a joint's friction coefficient, 0 to 4.
    #[must_use]
    pub fn friction(&self, joint: usize, which: usize) -> usize {
        self.parameters.len() + FRICTION * joint + which
    }

    /// The place of a joint's constant torque, where the law has one.
    #[must_use]
    pub fn constant(&self, joint: usize) -> Option<usize> {
        let at = self.parameters.len() + FRICTION * self.joints + joint;
        (at < self.freedom.len()).then_some(at)
    }

    /// The covariance of two coefficients.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance.get(a.max(b)).and_then(|row| row.get(a.min(b))).copied().unwrap_or(0.0)
    }

    /// Whether the parts fit together: a file may have been changed by hand.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let least = self.parameters.len() + FRICTION * self.joints;
        let size = self.freedom.len();
        let rows = |rows: &[Vec<f64>], size: usize| {
            rows.len() == size && rows.iter().enumerate().all(|(i, row)| row.len() == i + 1)
        };
        let path = |p: &Path| rows(&p.products, p.columns.len()) && p.columns.iter().all(|c| *c < size);
        (size == least || size == least + self.joints)
            && rows(&self.covariance, size)
            && self.path.len() == self.joints
            && self.path.iter().all(path)
    }
}

/// Eq. 16's columns of a joint at one velocity, and those of the tangents of its steepnesses: the factors of
/// the coefficients of [`Uncertainty`], without units except for that of γ5.
#[must_use]
pub fn friction_row([gamma2, gamma4]: [f64; 2], velocity: f64) -> [f64; FRICTION] {
    let saturating = |gamma: f64| (gamma * velocity).tanh();
    [saturating(gamma2), saturating(gamma4), velocity, tangent(gamma2, velocity), tangent(gamma4, velocity)]
}

fn path(solution: &Solution, joint: usize) -> Path {
    let parts = &solution.parts[joint];
    let rows: u64 = parts.iter().map(|part| part.rows).sum();
    if rows == 0 {
        return Path::default();
    }
    let mut sum = NormalEquations::zero(solution.layout.size());
    parts.iter().for_each(|part| part.add_to(&mut sum, 1.0 / rows as f64));
    let NormalEquations { gram, square: torque, .. } = sum;
    let columns: Vec<usize> = (0..solution.layout.size()).filter(|c| gram[(*c, *c)] > 0.0).collect();
    let row = |i: usize| (0..=i).map(|k| gram[(columns[i], columns[k])]).collect();
    let products = (0..columns.len()).map(row).collect();
    Path { columns, products, torque }
}

// Standard errors under coloured noise.
//
// With the noise of joint j independent between octaves g, of power λ_g in each (see
// [`powerball_logs::summary::Octaves`]), the weighted least-squares estimate has the covariance
//
// H⁻¹·(Σ_g w_g²·λ_g·D_g)·H⁻¹, H = Σ_g w_g·D_g, D_g = A_gᵀ·A_g.
//
// The powers come from the residual of the fit in each octave. The fit has adapted to the noise, more in slow
// octaves than in fast ones; the expectation of the residual is linear in the λ,
//
// E‖r_g‖² = (n_g − 2·w_g·tr(H⁻¹D_g))·λ_g + Σ_h w_h²·tr(H⁻¹D_g H⁻¹D_h)·λ_h,
//
// and solving these equations gives unbiased powers (Rao's MINQUE for this structure). How well a power is
// known enters by Satterthwaite's degrees of freedom.
//
// Octaves leak into each other, so noise is not quite independent between them. The covariance uses powers
// from which the leaks are removed (`spectrum.rs`).

/// The errors of all coefficients, tangents among them.
#[derive(Clone, Debug, PartialEq)]
pub struct StandardErrors {
    /// Standard errors; `None` where a coefficient is not determined or at a bound.
    pub std: Vec<Option<f64>>,
    /// Half the width of a 95 % interval in standard errors: Student's t with the degrees of freedom of each.
    pub quantile: Vec<f64>,
    /// The covariance of all coefficients; 0 where one is not determined.
    pub covariance: Mat<f64>,
}

/// One joint's rows of one octave.
struct Group {
    joint: usize,
    octave: usize,
    weight: f64,
    rows: f64,
    /// Residual of the fit, sum of squares.
    left: f64,
    /// L⁻¹·D·L⁻ᵀ, which has the traces of H⁻¹·D.
    turned: Mat<f64>,
}

/// The variance of a coefficient over that which it would have alone; above this, double precision holds no
/// digit of the friction at a velocity, in which large coefficients cancel each other.
const INFLATION: f64 = 1e10;

/// The normal equations over the columns that are determined. Where both terms of a joint's friction have
/// nearly one steepness, its columns depend on each other, and the first term stands for both.
fn determined(solution: &Solution) -> Solver {
    let (products, layout) = (solution.products(), solution.layout);
    let solver = products.solver(|c| solution.free[c]);
    let inverse = solver.inverse_diagonal();
    let is_inflated = |c: usize| inverse[c].is_finite() && inverse[c] * products.gram[(c, c)] > INFLATION;
    let is_one = |j: &usize| (0..FRICTION).any(|which| is_inflated(layout.friction(*j, which)));
    let second: Vec<usize> =
        (0..layout.dof).filter(is_one).flat_map(|j| [1, 4].map(|which| layout.friction(j, which))).collect();
    match second.is_empty() {
        true => solver,
        false => products.solver(|c| solution.free[c] && !second.contains(&c)),
    }
}

/// The errors of a solution.
///
/// With H = L·Lᵀ everything is computed in the coordinates L⁻¹·x, in which columns that nearly depend on each
/// other lose no digits; H⁻¹ itself is never formed.
#[must_use]
pub fn standard_errors(solution: &Solution) -> StandardErrors {
    let size = solution.layout.size();
    let solver = determined(solution);
    let rank = solver.kept().len();
    let whitened = |columns: &dyn Fn(usize) -> Vec<f64>, count: usize| -> Mat<f64> {
        let all: Vec<Vec<f64>> = (0..count).map(|c| solver.whitened(&columns(c))).collect();
        Mat::from_fn(rank, count, |r, c| all[c][r])
    };
    // L⁻¹, with a column for each coefficient: 0 where it is not determined.
    let back = whitened(&|c| (0..size).map(|r| f64::from(u8::from(r == c))).collect(), size);
    let mut groups = Vec::new();
    for (joint, (parts, weight)) in solution.parts.iter().zip(&solution.weights).enumerate() {
        for (octave, part) in parts.iter().enumerate().filter(|(_, p)| p.rows > 0 && *weight > 0.0) {
            let mut products = NormalEquations::zero(size);
            part.add_to(&mut products, 1.0);
            let half = whitened(&|c| products.gram.col_as_slice(c).to_vec(), size);
            let turned = whitened(&|r| (0..size).map(|c| half[(r, c)]).collect(), rank);
            let left = part.left(&solution.theta);
            groups.push(Group { joint, octave, weight: *weight, rows: part.rows as f64, left, turned });
        }
    }
    let powers = without_leaks(&groups, &powers(&groups));
    let (mut std, mut quantile) = (vec![None; size], vec![0.0; size]);
    let squares: Vec<Vec<f64>> = groups.iter().map(|group| diagonal_within(&group.turned, &back)).collect();
    for &c in solver.kept() {
        let (mut variance, mut doubt) = (0.0, 0.0);
        for ((group, square), (power, freedom)) in groups.iter().zip(&squares).zip(&powers) {
            let share = group.weight * group.weight * power * square[c];
            variance += share;
            doubt += share * share / freedom;
        }
        let freedom = if doubt > 0.0 { variance * variance / doubt } else { f64::from(u16::MAX) };
        (std[c], quantile[c]) = (Some(variance.sqrt()), t_quantile_975(freedom.max(1.0)));
    }
    let mut sum = Mat::<f64>::zeros(rank, rank);
    for (group, (power, _)) in groups.iter().zip(&powers) {
        sum += faer::Scale(group.weight * group.weight * power) * &group.turned;
    }
    StandardErrors { std, quantile, covariance: back.transpose() * (sum * &back) }
}

/// The diagonal of Xᵀ·A·X, not below 0.
fn diagonal_within(a: &Mat<f64>, x: &Mat<f64>) -> Vec<f64> {
    let turned = a * x;
    let of = |c: usize| (0..x.nrows()).map(|r| x[(r, c)] * turned[(r, c)]).sum::<f64>().max(0.0);
    (0..x.ncols()).map(of).collect()
}

/// The powers by group without what leaks between the octaves of a joint; each keeps its degrees of freedom.
fn without_leaks(groups: &[Group], powers: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let with: Vec<(&Group, &(f64, f64))> = groups.iter().zip(powers).collect();
    with.chunk_by(|(a, _), (b, _)| a.joint == b.joint)
        .flat_map(|joint| {
            let seen = |(group, (mean, freedom)): &(&Group, &(f64, f64))| Power {
                octave: group.octave,
                mean: *mean,
                freedom: *freedom,
            };
            let sharp = deconvolved(&joint.iter().map(seen).collect::<Vec<_>>());
            sharp.into_iter().zip(joint).map(|(power, (_, (_, freedom)))| (power, *freedom))
        })
        .collect()
}

/// λ and its degrees of freedom by group.
fn powers(groups: &[Group]) -> Vec<(f64, f64)> {
    let count = groups.len();
    let trace = |a: &Mat<f64>| -> f64 { (0..a.nrows()).map(|i| a[(i, i)]).sum() };
    let trace_of_product = |a: &Mat<f64>, b: &Mat<f64>| -> f64 {
        (0..a.nrows()).map(|i| (0..a.ncols()).map(|k| a[(i, k)] * b[(k, i)]).sum::<f64>()).sum()
    };
    let taken: Vec<f64> = groups.iter().map(|g| g.weight * trace(&g.turned)).collect();
    let matrix = Mat::from_fn(count, count, |g, h| {
        let other =
            groups[h].weight * groups[h].weight * trace_of_product(&groups[g].turned, &groups[h].turned);
        if g == h { groups[g].rows - 2.0 * taken[g] + other } else { other }
    });
    let left = Mat::from_fn(count, 1, |g, _| groups[g].left);
    let solved = matrix.partial_piv_lu().solve(&left);
    groups
        .iter()
        .enumerate()
        .map(|(g, group)| {
            // A power cannot be below the uncorrected residual; equations of few rows can give such a value.
            let power = solved[(g, 0)].max(group.left / group.rows);
            (power, (group.rows - taken[g]).max(1.0))
        })
        .collect()
}
