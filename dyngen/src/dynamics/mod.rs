//! Kinematics, the Lagrangian (exact), and the recursions that are emitted (graph), one file a function.

pub mod body;
pub mod chain;
pub mod composite;
pub mod coriolis;
pub mod elements;
pub mod energy;
pub mod forward;
pub mod function;
pub mod inverse;
pub mod lagrangian;
pub mod moments;
pub mod momentum;
pub mod motion;
pub mod pose;
pub mod regressor;
pub mod regroup;
pub mod spin;
pub mod stage;
pub mod wrench;

pub use function::{Function, FunctionGraph};
