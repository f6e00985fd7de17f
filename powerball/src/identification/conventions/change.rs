//! One thing that may be other than it is said to be about a log's columns.

use super::reading::{Positions, Torques};
use super::rows::Gravity;

/// A change of the reading.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    /// The torque columns of some joints have the other sign.
    TorqueReversed(Vec<usize>),
    /// The torque columns of two joints were exchanged.
    TorquesExchanged(usize, usize),
    /// Each torque column is to be multiplied by a factor of its own.
    Factors(Vec<f64>),
    /// All torque columns are late, s.
    Late(f64),
    /// The torques hold nothing of gravity, which would act on these joints.
    GravityOut(Vec<usize>),
    /// The position column of a joint has the other sign.
    PositionReversed(usize),
    /// Position and torque of a joint have the other sign: its axis points the other way.
    AxisReversed(usize),
    /// The position columns of two joints were exchanged.
    PositionsExchanged(usize, usize),
    /// All columns of two joints were exchanged.
    JointsExchanged(usize, usize),
    /// Positions are in degrees.
    Degrees,
    /// Joints are counted from the tip.
    FromTip,
}

/// A reading of all columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) torques: Torques,
    pub(super) positions: Positions,
    pub(super) gravity: Gravity,
}

impl Reading {
    /// As the columns are said to be.
    pub(super) fn plain(dof: usize) -> Reading {
        Reading { torques: Torques::plain(dof), positions: Positions::plain(dof), gravity: Gravity::Included }
    }

    /// The same with a change.
    pub(super) fn with(&self, change: &Change) -> Reading {
        let mut read = self.clone();
        match change {
            Change::TorqueReversed(joints) => {
                joints.iter().for_each(|j| read.torques = read.torques.reversed(*j));
            }
            Change::TorquesExchanged(a, b) => read.torques = read.torques.exchanged(*a, *b),
            Change::Factors(factors) => {
                read.torques.gain.iter_mut().zip(factors).for_each(|(gain, factor)| *gain *= factor);
            }
            Change::Late(by) => read.torques = read.torques.later(*by),
            Change::GravityOut(_) => read.gravity = Gravity::TakenOut,
            Change::PositionReversed(j) => read.positions = read.positions.reversed(*j),
            Change::AxisReversed(j) => {
                read.torques = read.torques.reversed(*j);
                read.positions = read.positions.reversed(*j);
            }
            Change::PositionsExchanged(a, b) => read.positions = read.positions.exchanged(*a, *b),
            Change::JointsExchanged(a, b) => {
                read.torques = read.torques.exchanged(*a, *b);
                read.positions = read.positions.exchanged(*a, *b);
            }
            Change::Degrees => read.positions.scale *= 1f64.to_radians(),
            Change::FromTip => {
                let n = read.positions.column.len();
                for k in 0..n / 2 {
                    read.torques = read.torques.exchanged(k, n - 1 - k);
                    read.positions = read.positions.exchanged(k, n - 1 - k);
                }
            }
        }
        read
    }
}

impl Change {
    /// The joint whose torque or position alone it reverses.
    pub(super) fn reverses(&self) -> Option<usize> {
        match self {
            Change::TorqueReversed(joints) if joints.len() == 1 => Some(joints[0]),
            Change::PositionReversed(j) => Some(*j),
            _ => None,
        }
    }

    /// The joints whose held-out error must fall; `None` where it must on a third of all.
    pub(super) fn concerned(&self) -> Option<Vec<usize>> {
        match self {
            Change::TorqueReversed(joints) | Change::GravityOut(joints) => Some(joints.clone()),
            Change::PositionReversed(j) | Change::AxisReversed(j) => Some(vec![*j]),
            Change::TorquesExchanged(a, b)
            | Change::PositionsExchanged(a, b)
            | Change::JointsExchanged(a, b) => Some(vec![*a, *b]),
            Change::Factors(_) | Change::Late(_) | Change::Degrees | Change::FromTip => None,
        }
    }
}

/// A factor nearer to one than this is no other unit.
pub(super) const FACTOR: f64 = 1.4;
