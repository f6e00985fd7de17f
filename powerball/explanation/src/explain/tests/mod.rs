mod again;
mod laws;
#[path = "../../../../../tests/support/measured.rs"]
mod logs_of_arms;
mod loops;
mod measured;
mod model;
mod names;
mod on_virtual_arm;
mod plant;
mod repeats;
pub(super) mod small_arms;

use super::NamedEffect;
use powerball_controller::JointNumber;

/// The figures of an effect as explained.json has them.
fn figures(effect: &NamedEffect) -> serde_json::Value {
    serde_json::to_value(&effect.figures).unwrap()
}

/// Joints by their numbers.
fn numbered(joints: &[usize]) -> Vec<JointNumber> {
    joints.iter().map(|number| JointNumber::from_index(number - 1)).collect()
}
