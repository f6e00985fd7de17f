//! Whether the logs to judge on run the same path as the fitted ones: then what is a
//! function of the path cannot be judged.

use crate::explanation::rule::Rule;
use crate::logs::regression::{Data, Recording};

/// Whether every recording of `other` repeats one of `data`.
#[must_use]
pub(crate) fn repeats(rule: &Rule, data: &Data<'_>, other: &Data<'_>) -> bool {
    let again = |o: &Recording| data.recordings.iter().any(|r| same_path(rule, r, o));
    other.recordings.iter().all(again)
}

fn same_path(rule: &Rule, a: &Recording, b: &Recording) -> bool {
    let n = a.dof;
    let samples = a.len().min(b.len());
    // A short stretch that agrees is no path.
    if samples * 2 < a.len().max(b.len()) || (a.rate - b.rate).abs() > 0.05 * a.rate {
        return false;
    }
    let (mut common, mut own) = (0.0, [0.0; 2]);
    for j in 0..n {
        let mean = |r: &Recording| (0..samples).map(|k| r.q[k * n + j]).sum::<f64>() / samples.max(1) as f64;
        let (mean_a, mean_b) = (mean(a), mean(b));
        for k in 0..samples {
            let (x, y) = (a.q[k * n + j] - mean_a, b.q[k * n + j] - mean_b);
            common += x * y;
            own[0] += x * x;
            own[1] += y * y;
        }
    }
    common > rule.same_path * (own[0] * own[1]).sqrt()
}
