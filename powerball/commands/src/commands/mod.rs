//! The `powerball` command: it parses, calls the library and prints.

#[cfg(feature = "cli")]
mod cli;
pub mod demo;
pub mod model_arm;

#[cfg(feature = "cli")]
pub use cli::main;
