//! The paper's procedure (§II.C, §III): what is done with an arm, and what its records say.

mod approach;
pub mod behind;
pub mod constant_velocity;
pub mod envelope;
pub mod friction;
pub mod gravity_free;
pub mod laws;
pub mod log_line;
pub mod record;
mod record_error;
pub mod resume;
pub mod settling;
mod told;
pub mod warm_up;

pub use approach::approach;
pub use behind::Behind;
pub use envelope::{Cleared, Envelope};
pub use log_line::{Columns, LogTime};
pub use record::{Record, Recorder, record, way};
pub use record_error::RecordError;
pub use told::Told;
