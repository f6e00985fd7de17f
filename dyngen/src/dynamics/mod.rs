//! Kinematics and the recursions that are emitted, as graphs, one file a function.

pub mod angles;
pub mod bars;
pub mod body;
pub mod build;
pub mod chain;
pub mod composite;
pub mod coriolis;
pub mod energy;
pub mod followers;
pub mod forward;
pub mod inverse;
pub mod moments;
pub mod momentum;
pub mod motion;
mod payload;
pub mod pose;
pub mod regressor;
pub mod regroup;
pub mod spin;
pub mod stage;
mod task;
mod total;
pub mod wrench;

pub use build::FunctionGraph;
pub use dyngen_arm::function::{self, Function};
