//! How well a path excites the parameters: Eq. 17.

use super::Error;
use super::fourier::Fourier;
use dyngen::{Evaluator, Function, Model, SetKind};
use faer::Mat;

/// The figures of a path. Both refer to the regressor with its rows divided by the joints' largest torques and its
/// columns by their usual size, so that they have no units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Largest over smallest singular value.
    pub condition: f64,
    /// Smallest singular value for one row, σ_p / √rows.
    pub least: f64,
}

impl Figures {
    /// G of Eq. 17 with λ₁ = 1 and the given λ₂.
    pub fn objective(&self, lambda2: f64) -> f64 {
        self.condition + lambda2 / self.least
    }
}

/// The regressor of an arm's set, ready to judge paths.
#[derive(Clone, Debug)]
pub struct Objective {
    evaluator: Evaluator,
    dof: usize,
    columns: usize,
    rank: usize,
    row_weights: Vec<f64>,
    column_scales: Vec<f64>,
    instants: usize,
}

impl Objective {
    /// The objective for a set of an arm; a path is judged at `instants` instants of one period.
    ///
    /// # Errors
    /// As [`Evaluator::new`].
    pub fn new(model: &Model, kind: SetKind, instants: usize) -> Result<Objective, Error> {
        let evaluator = Evaluator::new(model, Function::Regressor, kind)?;
        let set = model.set(kind)?;
        let columns = set.parameters.len();
        // Without a torque limit a joint's torques count as they are.
        let row_weights = model.arm().joints.iter().map(|j| 1.0 / j.torque.unwrap_or(1.0)).collect();
        Ok(Objective {
            evaluator,
            dof: model.arm().dof(),
            columns,
            rank: set.rank,
            row_weights,
            column_scales: vec![1.0; columns],
            instants,
        })
    }

    /// Takes the usual size of each column from some typical paths. The same sizes must serve all paths that are
    /// compared: a column scaled by its own size in each path would hide that the path leaves it small.
    pub fn scale_columns(&mut self, typical: &[Fourier]) {
        self.column_scales.fill(1.0);
        let mut sum = vec![0.0; self.columns];
        for path in typical {
            let gram = self.gram(path);
            for (k, s) in sum.iter_mut().enumerate() {
                *s += gram[(k, k)] / typical.len() as f64;
            }
        }
        let positive = |s: &f64| if *s > 0.0 { s.sqrt() } else { 1.0 };
        self.column_scales = sum.iter().map(positive).collect();
    }

    /// The figures of a path.
    pub fn judge(&self, path: &Fourier) -> Figures {
        let nothing = Figures { condition: f64::INFINITY, least: 0.0 };
        let Ok(squares) = self.gram(path).self_adjoint_eigenvalues(faer::Side::Lower) else { return nothing };
        // Ascending; where the set's columns are dependent, only as many count as there are independent ones.
        let singular: Vec<f64> = squares.iter().map(|s| s.max(0.0).sqrt()).collect();
        let (largest, least) = (singular.last(), singular.get(self.columns - self.rank));
        match (largest, least) {
            (Some(largest), Some(least)) if *least > 0.0 => {
                Figures { condition: largest / least, least: *least }
            }
            _ => nothing,
        }
    }

    /// YᵀY of the scaled regressor over one period, divided by the number of rows.
    fn gram(&self, path: &Fourier) -> Mat<f64> {
        let (n, p) = (self.dof, self.columns);
        let [mut q, mut dq, mut ddq] = [(); 3].map(|()| Vec::with_capacity(self.instants * n));
        for k in 0..self.instants {
            // The series without start and stop, which hardly excite.
            let s = path.period() * k as f64 / self.instants as f64;
            for [x, v, a] in path.series(s) {
                q.push(x);
                dq.push(v);
                ddq.push(a);
            }
        }
        let mut regressor = vec![0.0; self.instants * n * p];
        self.evaluator.evaluate(&q, &dq, &ddq, &[], &mut regressor);
        let rows = self.instants * n;
        for (r, row) in regressor.chunks_exact_mut(p).enumerate() {
            let weight = self.row_weights[r % n] / (rows as f64).sqrt();
            row.iter_mut().zip(&self.column_scales).for_each(|(x, s)| *x *= weight / s);
        }
        let y = faer::MatRef::from_row_major_slice(&regressor, rows, p);
        y.transpose() * y
    }
}
