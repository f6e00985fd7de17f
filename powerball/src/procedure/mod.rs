//! What is done with an arm: moved, and recorded while it moves.

mod approach;
pub mod record;

pub use approach::approach;
pub use record::{Record, RecordError, Recorder, record, way};
