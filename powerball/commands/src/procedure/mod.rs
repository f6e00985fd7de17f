//! The paper's procedure (§II.C, §III): the motions of an arm, and the results from their records.

pub mod constant_velocity;
pub mod envelope;
pub mod follow;
pub mod friction;
pub mod gravity_free;
pub mod laws;
pub mod log_line;
pub mod record;
pub mod resume;
pub mod settling;
pub mod torque_loop;
pub mod warm_up;

#[cfg(feature = "demo")]
pub use envelope::built_in_masses;
pub use envelope::{Cleared, Envelope};
pub use log_line::{Behind, Columns, LogTime, MotionLog, RecordProgress};
pub use record::{Record, RecordError, Recorder, record, way};
pub use settling::approach;
