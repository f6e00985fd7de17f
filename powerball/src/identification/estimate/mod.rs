//! Weighted least squares in the minimal set, friction shapes included, with honest standard errors.

mod band;
mod base_model;
mod consistent;
mod consistent_fit;
mod curves;
mod design;
pub mod distribution;
mod errors;
mod estimates;
mod exchanged;
mod fit;
mod folds;
mod friction_shape;
mod instrumental;
mod mountings;
mod noise;
mod normal_equations;
mod ratio;
mod reduced;
mod robust;
mod rows;
mod solve;
mod spectrum;
mod stream;
mod torque_metric;
mod uncertainty;
mod variable_projection;
mod verdict;

pub use band::{InBand, bands_of, reduce_in_bands, solve_in_band};
pub use base_model::BaseModel;
#[cfg(feature = "explain")]
pub(crate) use base_model::in_set_of;
pub use consistent::{Consistent, nearest};
pub use consistent_fit::{ConsistentFit, ConsistentReport, consistent_fit};
pub use curves::{TorqueCurve, curves};
pub use design::{Design, Gram, runs};
pub use errors::{StandardErrors, standard_errors};
pub use estimates::{
    Estimates, JointFriction, ParameterEstimate, ResidualStats, estimates, residual_stats, stats_of,
};
pub use exchanged::exchanged;
pub use fit::{Fit, Term, fit, friction_columns};
#[cfg(feature = "explain")]
pub(crate) use fit::{MEAN_OVER, variance_inflation};
pub use folds::Folds;
pub use instrumental::solve_instrumental;
pub use mountings::Together;
pub use noise::noise_floor;
pub(crate) use noise::noise_in_band;
pub(crate) use ratio::over_blocks;
pub use reduced::{FrictionKind, Solution, solve_reduced};
pub use robust::{Robust, solve_robust};
pub use rows::Layout;
pub use solve::{Solver, bounded};
pub use stream::{States, Stream, StreamFit};
pub use torque_metric::TorqueMetric;
pub use uncertainty::{Path, Uncertainty, friction_row};
pub use verdict::{JointVerdict, verdicts};

#[cfg(test)]
#[cfg(feature = "virtual-arm")]
mod tests;
