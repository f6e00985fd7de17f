//! The whole loop on the virtual arm: an effect that the model is not told of, found again from the logs alone.

mod session;

pub use session::{Session, SessionError};
