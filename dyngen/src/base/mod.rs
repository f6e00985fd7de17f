//! Parameter sets: exact relations, published groupings, the choice of columns.

pub mod choice;
pub mod coefficients;
pub mod preference;
mod published;
pub mod sets;
pub mod symmetry;

pub use crate::parameters::{ParameterSet, SetKind, SetParameter, span};
pub use sets::Sets;
