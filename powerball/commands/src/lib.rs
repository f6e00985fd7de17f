//! The top layer of `powerball`: the paper's procedure on a bus, pages of results, the command.

#[cfg(feature = "demo")]
pub mod commands;
#[cfg(feature = "procedure")]
pub mod procedure;
#[cfg(feature = "report")]
pub mod report;
