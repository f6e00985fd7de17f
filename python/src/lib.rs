//! The compiled part of the Python package `powerball`: what numpy needs of dyngen and powerball, as plain values.
//!
//! Nothing is computed here. The package's own modules, in Python, give it the forms that users of numpy know.

mod arm;
mod evaluate;
mod failure;
mod work;

use pyo3::prelude::*;

/// The compiled part of the package `powerball`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::arm::Arm;
    #[pymodule_export]
    use super::evaluate::functions;
}
