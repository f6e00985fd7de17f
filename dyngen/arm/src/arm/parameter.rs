//! The eleven dynamic parameters of a link, Eq. 10 of the paper.

use std::fmt;

/// One of the eleven dynamic parameters of a link, in the order of Eq. 10.
///
/// All are expressed in the link's frame and about its origin: mass `m` in kg, first moments `mx`, `my`,
/// `mz` in kg·m, inertias in kg·m². `Ixy` is the product of inertia, so the tensor's off-diagonal element
/// is `-Ixy` (Eq. 8). `Im` is the inertia of the rotor that drives the joint, kg·m².
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs)]
pub enum ParameterKind {
    M,
    Mx,
    My,
    Mz,
    Ixx,
    Ixy,
    Ixz,
    Iyy,
    Iyz,
    Izz,
    Im,
}

impl ParameterKind {
    /// All eleven, in order.
    pub const ALL: [ParameterKind; 11] = {
        use ParameterKind::*;
        [M, Mx, My, Mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz, Im]
    };

    /// The name without the link's number.
    pub fn name(self) -> &'static str {
        ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "Im"][self as usize]
    }

    /// The kind of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            ParameterKind::M => "kg",
            ParameterKind::Mx | ParameterKind::My | ParameterKind::Mz => "kg·m",
            _ => "kg·m²",
        }
    }
}

/// A parameter of the arm: which one, of which link (from 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Parameter {
    /// Link index from 0; printed from 1.
    pub link: usize,
    /// Which of the eleven.
    pub kind: ParameterKind,
}

impl Parameter {
    /// The parameter of that name: `Iyy2`, `mx3`, `m1`, with the link's number from 1.
    pub fn parse(name: &str) -> Option<Self> {
        let split = name.find(|c: char| c.is_ascii_digit())?;
        let (kind, number) = name.split_at(split);
        if number.starts_with('0') {
            return None;
        }
        let link = number.parse::<usize>().ok()?.checked_sub(1)?;
        Some(Parameter { link, kind: ParameterKind::parse(kind)? })
    }

    /// Position in the vector of all parameters, eleven a link.
    pub fn index(self) -> usize {
        self.link * 11 + self.kind as usize
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.kind.name(), self.link + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for link in [0, 5, 11] {
            for kind in ParameterKind::ALL {
                let p = Parameter { link, kind };
                assert_eq!(Parameter::parse(&p.to_string()), Some(p));
            }
        }
        for bad in ["", "m", "m0", "mx", "Ixy", "I1", "mq1", "m01", "m1x"] {
            assert_eq!(Parameter::parse(bad), None, "{bad}");
        }
    }
}
