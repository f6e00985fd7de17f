//! The compiled part of the Python package `powerball`: what numpy needs of dyngen and powerball, as plain
//! values.
//!
//! Nothing is computed here. The package's own modules, in Python, give it the forms that users of numpy
//! know.

mod arm;
mod evaluate;
mod explain;
mod failure;
mod identify;
mod logs;
mod motion;
mod servos;
mod session;
mod simulate;
mod source;
mod summary;
mod work;

use pyo3::prelude::*;

/// The compiled part of the package `powerball`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::arm::Arm;
    #[pymodule_export]
    use super::evaluate::functions;
    #[pymodule_export]
    use super::explain::{Explained, explain, rule};
    #[pymodule_export]
    use super::identify::{ComparedSide, Identified, Written, compare, friction_row, identify, verify};
    #[pymodule_export]
    use super::logs::{inspect, read_log};
    #[pymodule_export]
    use super::motion::{Excited, Trajectory, excite, write_whole};
    #[pymodule_export]
    use super::session::{virtual_effects, virtual_session};
    #[pymodule_export]
    use super::simulate::{simulate, simulate_function};
    #[pymodule_export]
    use super::source::{description, export_imported, generate, generate_model};
    #[pymodule_export]
    use super::summary::{Summary, summarize};

    /// The package's version, for `powerball.__version__`.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
