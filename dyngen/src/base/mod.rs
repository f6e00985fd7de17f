//! Parameter sets: exact relations, published groupings, the choice of columns.

mod certificate;
pub mod choice;
pub mod coefficients;
mod coupled;
#[cfg(test)]
mod expanded;
mod functionals;
mod plain;
pub mod preference;
mod published;
mod roots;
pub mod sets;
mod steps;
pub mod symmetry;
mod tied;

pub use crate::parameters::{ParameterSet, SetKind, SetParameter, span};
pub use sets::Sets;
