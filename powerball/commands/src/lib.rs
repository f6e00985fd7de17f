//! The top layer of `powerball`: the paper's procedure on a bus, pages of results, the command.

#[cfg(any(feature = "demo", feature = "offline"))]
pub mod commands;
#[cfg(feature = "procedure")]
pub mod procedure;
#[cfg(feature = "report")]
pub mod report;
