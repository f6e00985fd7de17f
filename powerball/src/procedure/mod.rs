//! The paper's procedure (§II.C, §III): what is done with an arm, and what its records say.

pub mod constant_speed;
pub mod gravity_free;
pub mod laws;
pub mod settling;
