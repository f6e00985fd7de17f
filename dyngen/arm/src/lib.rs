//! What the generator and the checker share: the arm file, exact numbers, the table of functions.
//!
//! Use it by the crate `dyngen`, which has all of it under the same paths.

pub mod arm;
pub mod diagnostic;
#[doc(hidden)]
pub mod exact;
#[doc(hidden)]
pub mod file;
pub mod function;
mod language;

pub use arm::Arm;
pub use diagnostic::{Diagnostic, Diagnostics};
pub use function::Function;
pub use language::Language;
