//! Columns of laws of the motion alone: whatever the model becomes, they stay as they are.

use crate::controller::JointNumber;
use crate::controller::correction::Law;
use std::collections::HashMap;
use std::mem::{Discriminant, discriminant, size_of};
use std::sync::{Mutex, PoisonError};

/// What is kept at most, bytes. What is made after that is made anew each time.
const MOST: usize = 256 << 20;

/// The columns of one data set that were made already. Every step of a search asks for most of them again.
#[derive(Debug, Default)]
pub(crate) struct MotionColumns {
    made: Mutex<Made>,
}

/// A joint and a kind of law.
type Kind = (JointNumber, Discriminant<Law<f64>>);

/// A law with its settings, and its values.
#[derive(Debug)]
struct Known {
    law: Law<f64>,
    values: Vec<f64>,
}

#[derive(Debug, Default)]
struct Made {
    columns: HashMap<Kind, Vec<Known>>,
    bytes: usize,
}

impl MotionColumns {
    /// The values of a law at a joint; `make` makes them where they have not been made. Laws of torques
    /// change with the model and are made each time.
    pub(super) fn get(&self, joint: JointNumber, law: Law<f64>, make: impl FnOnce() -> Vec<f64>) -> Vec<f64> {
        if law.needs_torque() || law.moves_link() {
            return make();
        }
        let key = (joint, discriminant(&law));
        let known = |made: &Made| {
            made.columns.get(&key)?.iter().find(|known| known.law == law).map(|known| known.values.clone())
        };
        if let Some(values) = known(&self.made.lock().unwrap_or_else(PoisonError::into_inner)) {
            return values;
        }
        // Others go on while it is made.
        let values = make();
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = size_of::<f64>() * values.len();
        if made.bytes + bytes <= MOST && known(&made).is_none() {
            made.bytes += bytes;
            made.columns.entry(key).or_default().push(Known { law, values: values.clone() });
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_of_the_motion_are_made_once_and_laws_of_torques_each_time() {
        let columns = MotionColumns::default();
        let joint = JointNumber::from_index;
        let get = |j, law, values: [f64; 2]| columns.get(joint(j), law, || values.to_vec());
        let sine = |order| Law::Sine { order };
        assert_eq!(get(0, sine(3.0), [1.0, 2.0]), [1.0, 2.0]);
        assert_eq!(get(0, sine(3.0), [9.0, 9.0]), [1.0, 2.0]);
        // Another setting, another joint, another law.
        assert_eq!(get(0, sine(4.0), [3.0, 4.0]), [3.0, 4.0]);
        assert_eq!(get(1, sine(3.0), [5.0, 6.0]), [5.0, 6.0]);
        assert_eq!(get(0, Law::Cosine { order: 3.0 }, [7.0, 8.0]), [7.0, 8.0]);
        let load = Law::Load { steepness: 10.0 };
        assert_eq!(get(0, load, [1.0, 1.0]), [1.0, 1.0]);
        assert_eq!(get(0, load, [2.0, 2.0]), [2.0, 2.0]);
    }
}
