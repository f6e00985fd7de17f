mod correction;
mod laws;
mod measured;
mod model;
mod names;
#[cfg(feature = "virtual-arm")]
mod on_virtual_arm;
mod plant;
#[cfg(feature = "virtual-arm")]
mod repeats;
#[cfg(feature = "virtual-arm")]
pub(super) mod small_arms;

use super::NamedEffect;
use crate::controller::JointNumber;

/// The figures of an effect as explained.json has them.
fn figures(effect: &NamedEffect) -> serde_json::Value {
    serde_json::to_value(&effect.figures).unwrap()
}

/// Joints by their numbers.
fn numbered(joints: &[usize]) -> Vec<JointNumber> {
    joints.iter().map(|number| JointNumber::from_index(number - 1)).collect()
}
