//! Weighted least squares in the minimal set, friction shapes included, with honest standard errors.

mod band;
mod bounded;
mod consistent;
mod design;
pub mod distribution;
mod estimates;
mod fit;
mod mountings;
mod reduced;
mod robust;
mod solve;
mod spectrum;
mod stream;
mod uncertainty;
mod variable_projection;

pub use band::{InBand, bands_of_logs, reduce_in_bands, solve_in_band};
pub use bounded::bounded;
pub use consistent::{Consistent, ConsistentFit, ConsistentReport, TorqueMetric, consistent_fit, nearest};
pub use design::{Added, Design, Folds, Gram, runs};
pub use estimates::in_set_of;
pub use estimates::{
    BaseModel, Estimates, JointFriction, JointVerdict, ParameterEstimate, ResidualStats, TorqueCurve, curves,
    estimates, residual_stats, stats_of, verdicts,
};
pub use fit::known;
pub use fit::{Fit, Term, fit, friction_columns};
pub use fit::{MEAN_OVER, variance_inflation};
pub use mountings::Together;
pub use reduced::{FrictionKind, Solution, solve_reduced};
pub use robust::over_blocks;
pub use robust::{Robust, solve_instrumental, solve_robust};
pub use solve::{NormalEquations, Solver};
pub use spectrum::noise_floor;
pub(crate) use spectrum::noise_in_band;
pub use stream::{States, Stream, StreamFit};
pub use uncertainty::{Path, StandardErrors, Uncertainty, friction_row, standard_errors};
pub use variable_projection::Layout;

#[cfg(test)]
pub(crate) mod tests;
