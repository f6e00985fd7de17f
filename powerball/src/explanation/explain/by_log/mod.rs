//! What differs between logs: all of them, fitted or for validation, under one model, and what is another in one of them. What all logs share falls out: a model that errs in all of them alike makes none odd.

mod changes;

pub(super) use changes::{Changed, Together, changes};
