//! The `powerball` command: it parses, calls the library and prints.

mod cli;
pub mod demo;
pub mod model_arm;

pub use cli::main;
