//! Where the numbers lie that functions are given.

use super::interval::Interval;
use super::precision::Precision;
use super::program::Variable;
use crate::arm::Arm;
use crate::dynamics::function::Argument;

/// The ranges of everything that a function is given, from an arm file's limits.
#[derive(Clone, Debug)]
pub(super) struct Limits<'a> {
    arm: &'a Arm,
    coordinates: Vec<usize>,
    parameters: Option<&'a [f64]>,
}

impl<'a> Limits<'a> {
    pub(super) fn new(arm: &'a Arm, parameters: Option<&'a [f64]>) -> Self {
        Limits { arm, coordinates: arm.coordinates(), parameters }
    }

    /// What the file, or the values, state about a number; `None` where the file has no such limit.
    pub(super) fn range(&self, (argument, i): Variable) -> Option<Interval> {
        let joint = self.coordinates.get(i).and_then(|joint| self.arm.joints.get(*joint));
        match argument {
            Argument::Positions => joint?.position.map(|[low, high]| Interval { low, high }),
            Argument::Velocities | Argument::ReferenceVelocities => joint?.velocity.map(Interval::within),
            Argument::Accelerations | Argument::ReferenceAccelerations => {
                joint?.acceleration.map(Interval::within)
            }
            Argument::Torques => joint?.torque.map(Interval::within),
            Argument::Errors
            | Argument::Wrench
            | Argument::Payload
            | Argument::PositionDirection
            | Argument::VelocityDirection => Some(Interval::within(1.0)),
            Argument::Parameters => match self.parameters {
                None => Some(Interval::within(1.0)),
                // Given as the nearest number of either format.
                Some(values) => {
                    values.get(i).map(|x| Interval::point(*x).widened(Precision::Single.half_ulp(x.abs())))
                }
            },
        }
    }

    /// Which limit the file lacks, in words.
    pub(super) fn missing(&self, arguments: impl Iterator<Item = Argument>) -> Option<String> {
        let of = |argument: Argument| {
            let what = match argument {
                Argument::Positions => "position",
                Argument::Velocities | Argument::ReferenceVelocities => "velocity",
                Argument::Accelerations | Argument::ReferenceAccelerations => "acceleration",
                Argument::Torques => "torque",
                Argument::Errors
                | Argument::Wrench
                | Argument::Payload
                | Argument::PositionDirection
                | Argument::VelocityDirection
                | Argument::Parameters => return None,
            };
            let lacks = |i: &usize| self.range((argument, *i)).is_none();
            let joint = (0..self.coordinates.len()).find(lacks).and_then(|i| self.coordinates.get(i))?;
            Some(format!("the arm file gives no {what} of joint {}", joint + 1))
        };
        arguments.filter_map(of).next()
    }
}
