//! The fit by the estimator that is asked for.

use super::error::IdentifyError;
use super::gather::Gathered;
use super::options::{Estimator, IdentifyOptions};
use crate::controller::JointNumber;
use crate::identification::estimate::{
    InBand, Solution, StandardErrors, solve_in_band, solve_instrumental, solve_reduced, solve_robust,
    standard_errors,
};

/// A fit with its errors.
#[derive(Debug)]
pub(super) struct Fitted {
    pub solution: Solution,
    pub errors: StandardErrors,
    /// By joint: which of [`BANDS`](crate::logs::summary::BANDS).
    pub bands: Vec<usize>,
}

/// From this share of doubted samples on a joint is told of.
const DOUBTED: f64 = 0.01;

/// Fits what was gathered.
pub(super) fn fit(
    gathered: &Gathered,
    options: &IdentifyOptions<'_>,
    warnings: &mut Vec<String>,
) -> Result<Fitted, IdentifyError> {
    let (body, law) = (gathered.body(), options.friction);
    // What looks at single samples has one band, and logs of one mounting.
    let (logs, widest) = (&gathered.mounted[0].logs, vec![0; body.dof()]);
    match options.estimator {
        Estimator::Weighted => {
            let InBand { solution, bands } = solve_in_band(gathered.bands(), law);
            Ok(weighted(solution, bands))
        }
        Estimator::Instrumental => {
            let start = solve_reduced(gathered.bands().widest(), law);
            let (solution, errors) =
                solve_instrumental(body, logs, &options.data, &start).map_err(IdentifyError::Instruments)?;
            Ok(Fitted { solution, errors, bands: widest })
        }
        Estimator::Robust => {
            let robust = solve_robust(body, logs, &options.data, law)?;
            for (j, share) in robust.doubted.iter().enumerate().filter(|(_, share)| **share > DOUBTED) {
                warnings.push(format!(
                    "joint {}: {:.1} % of the torque samples were beyond belief and counted less",
                    JointNumber::from_index(j),
                    100.0 * share
                ));
            }
            Ok(weighted(robust.solution, widest))
        }
    }
}

fn weighted(solution: Solution, bands: Vec<usize>) -> Fitted {
    Fitted { errors: standard_errors(&solution), solution, bands }
}
