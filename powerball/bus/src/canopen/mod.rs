//! CANopen (CiA 301) as values: frames, identifiers and the messages in them, for both ends of the wire.
//!
//! Everything here is `no_std`, allocation-free and symmetrical: the master encodes what the virtual arm's
//! slaves decode, and the other way round, so that each layout is written once. Nothing here keeps time or
//! touches a bus.
//!
//! | module | content |
//! |---|---|
//! | [`frame`] | one classic CAN frame with an 11-bit identifier |
//! | [`cob`] | the predefined connection set: which identifier carries what, of which node |
//! | [`nmt`] | network management commands, node states, boot-up and heartbeat |
//! | [`sdo`] | service data objects: expedited and segmented, with abort codes in words |
//! | [`client`] | the master's end of an SDO transfer, driven by polling |
//! | [`pdo`] | process data: mapping entries, packing and unpacking |
//! | [`emcy`] | emergency messages, with SCHUNK's own codes in words |
//! | [`sync`] | SYNC and heartbeats in time: due, late, lost |
//! | [`objects`] | the communication objects (0x1000 … 0x1FFF) that a master needs |

pub mod client;
pub mod cob;
pub mod emcy;
pub mod frame;
pub mod nmt;
pub mod objects;
pub mod pdo;
pub mod sdo;
pub mod sync;

pub use cob::{Cob, NodeId};
pub use frame::Frame;
pub use objects::Object;

/// A point in time, or a span of it, in microseconds. Only differences matter; the core never reads a clock,
/// it is given the time.
pub type Micros = u64;
