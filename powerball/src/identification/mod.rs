//! From rows to parameters: fits, their errors, and the paths that excite them.

pub mod chain;
pub mod estimate;
pub mod excite;
pub mod motion;
pub mod mounting;
