//! Readers of generated files, one for each language.

mod batch;
pub(crate) mod c;
mod cursor;
pub(crate) mod head;
mod kernel;
pub(crate) mod rust;
pub(crate) mod wgsl;
