//! The number of a joint in its arm.

use core::fmt;

/// A joint's place in its arm. It counts from 0 in memory, as slices do, and from 1 wherever it is printed or
/// written, as people and files do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointNumber(usize);

impl JointNumber {
    /// The joint at a place in a slice, from 0.
    #[must_use]
    pub const fn from_index(index: usize) -> Self {
        JointNumber(index)
    }

    /// The joint's place in a slice, from 0.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0
    }

    /// The joint's number, from 1.
    #[must_use]
    pub const fn number(self) -> usize {
        self.0 + 1
    }
}

impl fmt::Display for JointNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.number().fmt(f)
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for JointNumber {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.number() as u64)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for JointNumber {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = usize::deserialize(deserializer)?;
        let index = number.checked_sub(1).ok_or_else(|| serde::de::Error::custom("joints count from 1"))?;
        Ok(JointNumber(index))
    }
}

#[cfg(test)]
mod tests {
    use super::JointNumber;

    #[test]
    fn a_joint_counts_from_zero_in_memory_and_from_one_where_it_is_written() {
        let joint = JointNumber::from_index(2);
        assert_eq!((joint.index(), joint.number(), joint.to_string().as_str()), (2, 3, "3"));
        assert_eq!(format!("{joint:>3}"), "  3");
    }

    #[cfg(feature = "serde")]
    #[test]
    fn files_count_from_one() {
        let joint: JointNumber = serde_json::from_str("4").unwrap();
        assert_eq!(joint.index(), 3);
        assert_eq!(serde_json::to_string(&joint).unwrap(), "4");
        assert!(serde_json::from_str::<JointNumber>("0").is_err());
    }
}
