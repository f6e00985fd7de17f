//! Least squares with some coefficients ≥ 0, by an active set.

use super::solve::{NormalEquations, Solver};
use faer::Mat;

/// Least squares from normal equations with some coefficients ≥ 0 (Lawson and Hanson, Solving Least Squares
/// Problems, 1974, ch. 23). Each coefficient that is set free lowers the error, so that no set occurs twice:
/// the optimum is reached after finitely many steps.
///
/// Returns the solution and the factor over the columns that are free.
#[must_use]
pub fn bounded(
    gram: &Mat<f64>,
    right: &[f64],
    wanted: impl Fn(usize) -> bool,
    non_negative: &[usize],
) -> (Vec<f64>, Solver) {
    let problem = Problem { gram, right, wanted, non_negative };
    let solver = problem.solver(&[]);
    let x = solver.solve(right);
    // As a rule no bound is active.
    if problem.is_within_bounds(&x) {
        return (x, solver);
    }
    let held: Vec<usize> = non_negative.to_vec();
    let solver = problem.solver(&held);
    let x = solver.solve(right);
    let mut now = Point { error: problem.error(&x), x, held, solver };
    while let Some(better) = problem.better(&now) {
        now = better;
    }
    (now.x, now.solver)
}

impl NormalEquations {
    /// Solves over the columns for which `wanted` holds, with some coefficients ≥ 0 (see [`bounded`]).
    #[must_use]
    pub fn solve_bounded(
        &self,
        wanted: impl Fn(usize) -> bool,
        non_negative: &[usize],
    ) -> (Vec<f64>, Solver) {
        bounded(&self.gram, &self.right, wanted, non_negative)
    }
}

struct Problem<'a, W> {
    gram: &'a Mat<f64>,
    right: &'a [f64],
    wanted: W,
    non_negative: &'a [usize],
}

/// The best solution with some coefficients held at 0.
struct Point {
    x: Vec<f64>,
    held: Vec<usize>,
    /// Over the columns that are free.
    solver: Solver,
    error: Error,
}

/// The sum of squared errors less that of x = 0, and the size of its terms, of which rounding is a share.
#[derive(Clone, Copy)]
struct Error {
    sum: f64,
    size: f64,
}

impl<W: Fn(usize) -> bool> Problem<'_, W> {
    fn solver(&self, held: &[usize]) -> Solver {
        Solver::new(self.gram, |c| (self.wanted)(c) && !held.contains(&c))
    }

    fn is_within_bounds(&self, x: &[f64]) -> bool {
        self.non_negative.iter().all(|c| x[*c] >= 0.0)
    }

    fn error(&self, x: &[f64]) -> Error {
        x.iter().enumerate().fold(Error { sum: 0.0, size: 0.0 }, |Error { sum, size }, (c, value)| {
            let square = value * self.product(c, x);
            let mixed = 2.0 * value * self.right[c];
            Error { sum: sum + square - mixed, size: size + square.abs() + mixed.abs() }
        })
    }

    fn product(&self, c: usize, x: &[f64]) -> f64 {
        x.iter().enumerate().map(|(k, value)| self.gram[(c, k)] * value).sum()
    }

    /// How fast the error falls where a held coefficient grows, for a column of length 1; `None` where it
    /// does not, or by rounding alone.
    fn slope(&self, c: usize, x: &[f64]) -> Option<f64> {
        let size: f64 = x.iter().enumerate().map(|(k, value)| (self.gram[(c, k)] * value).abs()).sum();
        let slope = self.right[c] - self.product(c, x);
        let falls = (self.wanted)(c) && slope > 1e-12 * (self.right[c].abs() + size);
        falls.then(|| slope / self.gram[(c, c)].sqrt())
    }

    /// A better point, with one more coefficient free; `None` at the optimum.
    fn better(&self, now: &Point) -> Option<Point> {
        let slope = |c: &usize| self.slope(*c, &now.x).map(|slope| (*c, slope));
        let mut falling: Vec<(usize, f64)> = now.held.iter().filter_map(slope).collect();
        falling.sort_by(|a, b| b.1.total_cmp(&a.1));
        falling
            .into_iter()
            .map(|(c, _)| self.freed(now, c))
            .find(|next| next.error.sum < now.error.sum - 1e-14 * (now.error.size + next.error.size))
    }

    /// The point after one coefficient is set free: straight towards the best solution; a coefficient that
    /// meets its bound on the way is held there, and the others continue.
    fn freed(&self, now: &Point, freed: usize) -> Point {
        let mut held: Vec<usize> = now.held.iter().copied().filter(|k| *k != freed).collect();
        let mut x = now.x.clone();
        loop {
            let solver = self.solver(&held);
            let best = solver.solve(self.right);
            let below = self.non_negative.iter().copied().filter(|k| best[*k] < 0.0);
            let share = |k: usize| x[k] / (x[k] - best[k]);
            let Some(first) = below.min_by(|a, b| share(*a).total_cmp(&share(*b))) else {
                return Point { error: self.error(&best), x: best, held, solver };
            };
            let share = share(first);
            x.iter_mut().zip(&best).for_each(|(x, best)| *x += share * (best - *x));
            x[first] = 0.0;
            held.push(first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// The best of all choices of what is held: each is solved, and of those within the bounds the least
    /// error counts.
    fn by_enumeration(problem: &Problem<'_, impl Fn(usize) -> bool>) -> f64 {
        let all = problem.non_negative;
        let held = |mask: usize| -> Vec<usize> {
            all.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1).map(|(_, c)| *c).collect()
        };
        let solved = (0..1usize << all.len()).map(|mask| problem.solver(&held(mask)).solve(problem.right));
        let errors = solved.filter(|x| problem.is_within_bounds(x)).map(|x| problem.error(&x).sum);
        errors.fold(f64::INFINITY, f64::min)
    }

    /// Random problems, among them some of nearly and exactly dependent columns, and of columns of very
    /// different lengths.
    #[test]
    fn no_choice_of_what_is_held_is_better() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(6);
        let mut active = 0;
        for round in 0..300 {
            let mut a = Mat::<f64>::from_fn(30, 9, |_, _| rng.random_range(-1.0..1.0));
            for i in 0..30 {
                match round % 4 {
                    1 => a[(i, 4)] = a[(i, 5)] + 1e-4 * a[(i, 4)],
                    2 => a[(i, 4)] = a[(i, 5)] - a[(i, 6)],
                    3 => (0..9).for_each(|c| a[(i, c)] *= 10f64.powi(c as i32 - 4)),
                    _ => {}
                }
            }
            let y: Vec<f64> = (0..30).map(|_| rng.random_range(-1.0..1.0)).collect();
            let gram = a.transpose() * &a;
            let right: Vec<f64> = (0..9).map(|c| (0..30).map(|i| a[(i, c)] * y[i]).sum()).collect();
            let non_negative = [1, 2, 4, 5, 6, 8];
            let problem =
                Problem { gram: &gram, right: &right, wanted: |_| true, non_negative: &non_negative };
            let (x, solver) = bounded(&gram, &right, |_| true, &non_negative);
            assert!(problem.is_within_bounds(&x), "round {round}: {x:?}");
            let (found, best) = (problem.error(&x).sum, by_enumeration(&problem));
            assert!(found <= best + 1e-9 * best.abs(), "round {round}: {found} where {best} can be had");
            assert!(solver.kept().iter().all(|c| !non_negative.contains(c) || x[*c] >= 0.0));
            active += usize::from(solver.kept().len() < 9);
        }
        assert!(active > 200, "{active}");
    }
}
