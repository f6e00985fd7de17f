//! Weighted least squares in the minimal set, friction shapes included, with honest standard errors.

mod consistent;
mod consistent_fit;
mod design;
pub mod distribution;
mod errors;
mod fit;
mod folds;
mod friction_shape;
mod identify;
mod noise;
mod reduced;
mod solve;
mod vary;
mod verify;

pub use consistent::{Consistent, nearest};
pub use consistent_fit::{ConsistentFit, ConsistentReport, consistent_fit};
pub use design::{Design, Gram, runs};
pub use errors::{Errors, errors};
pub use fit::{Fit, Term, fit, friction_columns};
pub use folds::Folds;
pub use identify::{Identified, JointFriction, ParameterEstimate, Spread, identify, spread, spread_of};
pub use noise::noise_floor;
pub use reduced::{FrictionLaw, Solution, solve_reduced};
pub use solve::{Solver, bounded};
pub use vary::Layout;
pub use verify::{JointVerdict, TorqueModel};
