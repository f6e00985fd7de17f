//! Why something was not done, as the exceptions of the package.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;
use std::fmt::Display;

// Exit code 1 of the commands, and exit code 2.
pyo3::import_exception!(powerball._errors, RefusedError);
pyo3::import_exception!(powerball._errors, InputError);

/// The input was read, but the data or the arm have no answer.
pub(crate) fn refused(why: impl Display) -> PyErr {
    RefusedError::new_err(why.to_string())
}

/// Wrong use, or an input that cannot be read.
pub(crate) fn input(why: impl Display) -> PyErr {
    InputError::new_err(why.to_string())
}

/// An argument of a wrong shape or value.
pub(crate) fn value(why: impl Display) -> PyErr {
    PyValueError::new_err(why.to_string())
}
