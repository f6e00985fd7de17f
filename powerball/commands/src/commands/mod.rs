//! The `powerball` command: it parses, calls the library and prints.

#[cfg(feature = "offline")]
mod cli;
#[cfg(feature = "demo")]
pub mod demo;
#[cfg(feature = "demo")]
pub mod model_arm;

#[cfg(feature = "offline")]
pub use cli::main;
