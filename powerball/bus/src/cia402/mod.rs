//! The drive profile CiA 402 as values: states, commands, modes, objects. For both ends of the wire, without
//! I/O.

pub mod objects;
pub mod schunk;
pub mod status;

pub use status::{Command, Controlword, Mode, State, Statusword};
