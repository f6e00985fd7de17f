//! Parameter sets: exact relations, published groupings, the choice of columns, physical possibility.

pub mod choice;
pub mod coefficients;
pub mod possible;
pub mod preference;
mod published;
pub mod sets;
pub mod span;
pub mod symmetry;

pub use sets::{ParameterSet, SetKind, SetParameter};
