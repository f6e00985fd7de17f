//! The drive profile CiA 402 as values: states, commands, modes, objects. For both ends of the wire, without
//! I/O.

pub mod control;
pub mod mode;
pub mod objects;
pub mod schunk;
pub mod status;

pub use control::{Command, Controlword};
pub use mode::Mode;
pub use status::{State, Statusword};
