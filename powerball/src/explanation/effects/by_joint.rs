//! A figure of several joints.

use super::Found;
use serde::{Serialize, Serializer};

/// A figure for each joint that an effect is on, in the order of the joints found; as JSON the number alone
/// where it is on one.
#[derive(Clone, Debug, PartialEq)]
pub struct ByJoint(pub Vec<f64>);

impl ByJoint {
    /// A figure of everything that was found.
    pub(super) fn of(found: &[Found<'_>], figure: impl Fn(&Found<'_>) -> f64) -> ByJoint {
        ByJoint(found.iter().map(figure).collect())
    }

    /// The figure of the only joint; `None` where there are several.
    #[must_use]
    pub fn single(&self) -> Option<f64> {
        match self.0.as_slice() {
            [one] => Some(*one),
            _ => None,
        }
    }
}

impl Serialize for ByJoint {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.single() {
            Some(one) => one.serialize(to),
            None => self.0.serialize(to),
        }
    }
}
