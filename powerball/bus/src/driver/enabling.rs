//! From ready to following set-points: each joint through its drive's states, and the commutation search.

use super::arm::Arm;
use super::cause::{Cause, Hindrance};
use super::joint::{Joint, Transmit};
use crate::canopen::Micros;
use crate::canopen::client::{SdoError, Value};
use crate::cia402::{Command, Controlword, State, schunk};

/// How far a joint is on its way to "operation enabled".
#[derive(Clone, Copy, Debug, PartialEq)]
enum Progress {
    /// The joint's turn has not come.
    Waiting,
    /// Through the drive's states; in `state` until `deadline`.
    Walking { state: State, deadline: Micros },
    /// Enabled; the extended status was read `reads` times, next at `next`. From the second read on the brake
    /// is open.
    Commutating { reads: u8, next: Micros },
    /// Commutated just now: the supply recovers.
    Settling { until: Micros },
    /// Enabled and commutated, halted until all are.
    Done,
}

/// The joints on their way, one after the other where the profile says so.
#[derive(Clone, Debug)]
pub(super) struct Enabling<const N: usize> {
    joints: [Progress; N],
}

impl<const N: usize> Enabling<N> {
    pub(super) const fn new() -> Self {
        Enabling { joints: [Progress::Waiting; N] }
    }

    /// Whether joint `j` has its torque on the driver's command.
    pub(super) fn is_released(&self, j: usize) -> bool {
        !matches!(self.joints.get(j), None | Some(Progress::Waiting | Progress::Walking { .. }))
    }

    /// Whether the drive of joint `j` may be in this state. Where a walking joint should be is judged where
    /// it walks.
    pub(super) fn allows(&self, j: usize, state: State) -> bool {
        match self.joints.get(j) {
            Some(Progress::Waiting) => !state.has_torque(),
            Some(Progress::Walking { .. }) | None => true,
            Some(_) => state == State::OperationEnabled,
        }
    }

    /// The controlword for joint `j` now; `running` is that of a joint that follows set-points.
    pub(super) fn word(&self, j: usize, joint: &Joint, running: Controlword) -> Controlword {
        match self.joints.get(j) {
            None | Some(Progress::Waiting) => Controlword::command(Command::DisableVoltage),
            Some(Progress::Walking { .. } | Progress::Commutating { reads: 0, .. } | Progress::Done) => {
                joint.walk()
            }
            Some(Progress::Commutating { .. } | Progress::Settling { .. }) => running,
        }
    }

    /// Takes the joints further; true when all are enabled.
    ///
    /// # Errors
    /// The cause, where one of them cannot be.
    pub(super) fn poll(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) -> Result<bool, Cause> {
        for j in 0..N {
            let before = self.joints.get(..j).unwrap_or_default();
            let turn = !arm.profile.reactions.one_at_a_time
                || before.iter().all(|progress| *progress == Progress::Done);
            let Some(progress) = self.joints.get(j).copied() else { continue };
            let next = match progress {
                Progress::Waiting if turn => Some(begin_walk(arm, j)),
                Progress::Walking { state, deadline } => walk(arm, j, state, deadline)?,
                Progress::Commutating { next, .. } => {
                    self.poll_commutation(arm, j, next, tx)?;
                    None
                }
                Progress::Settling { until } if arm.now >= until => Some(Progress::Done),
                _ => None,
            };
            self.put(j, next);
        }
        Ok(self.joints.iter().all(|progress| *progress == Progress::Done))
    }

    fn put(&mut self, j: usize, next: Option<Progress>) {
        if let (Some(place), Some(next)) = (self.joints.get_mut(j), next) {
            *place = next;
        }
    }

    fn poll_commutation(
        &mut self,
        arm: &mut Arm<N>,
        j: usize,
        next: Micros,
        tx: &mut impl Transmit,
    ) -> Result<(), Cause> {
        let now = arm.now;
        let Some(joint) = arm.joints.get_mut(j) else { return Ok(()) };
        if !joint.client.is_idle() {
            let step = joint.client.poll(now);
            if let Some(frame) = step.send {
                arm.send(frame, tx);
            }
            return step.done.map_or(Ok(()), |result| self.answer(arm, j, result));
        }
        if now >= next {
            arm.read(j, schunk::EXTENDED_STATUS, tx);
        }
        Ok(())
    }

    /// The drive's answer on whether its commutation search is done. Until it is, the joint is commanded to
    /// stay where it is.
    ///
    /// # Errors
    /// The cause, where the search cannot be awaited any longer.
    pub(super) fn answer(
        &mut self,
        arm: &Arm<N>,
        j: usize,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let (reactions, now) = (&arm.profile.reactions, arm.now);
        let Some(Progress::Commutating { reads, .. }) = self.joints.get(j).copied() else { return Ok(()) };
        let found = match result {
            Ok(value) => value.unsigned().is_some_and(|status| status as u8 & schunk::COMMUTATED != 0),
            Err(SdoError::Timeout) => false,
            Err(error) => return Err(Cause::Sdo(arm.node(j), schunk::EXTENDED_STATUS, error)),
        };
        let next = match (found, reads) {
            (true, 0) => Progress::Done,
            (true, _) => Progress::Settling { until: now + reactions.commutation_settle },
            (false, reads) if reads >= reactions.commutation_tries => {
                return Err(Cause::NoCommutation(arm.node(j)));
            }
            (false, reads) => {
                let next = now + reactions.commutation_interval;
                Progress::Commutating { reads: reads + 1, next }
            }
        };
        self.put(j, Some(next));
        Ok(())
    }
}

fn begin_walk<const N: usize>(arm: &Arm<N>, j: usize) -> Progress {
    let deadline = arm.now + arm.profile.reactions.transition_timeout;
    let state = arm.joints.get(j).and_then(Joint::state).unwrap_or(State::SwitchOnDisabled);
    Progress::Walking { state, deadline }
}

/// The next step of a joint that was in `state`, and should be further by `deadline`.
fn walk<const N: usize>(
    arm: &Arm<N>,
    j: usize,
    state: State,
    deadline: Micros,
) -> Result<Option<Progress>, Cause> {
    let Some((joint, now_in)) = arm.joints.get(j).and_then(|joint| Some((joint, joint.state()?))) else {
        return Ok(None);
    };
    match (step_of(state), step_of(now_in)) {
        // Only SCHUNK's drives say when their commutation search is done.
        (_, Some(4)) if arm.profile.sync_timeout_factor.is_none() => Ok(Some(Progress::Done)),
        (_, Some(4)) => Ok(Some(Progress::Commutating { reads: 0, next: arm.now })),
        (Some(before), Some(after)) if after > before => {
            let deadline = arm.now + arm.profile.reactions.transition_timeout;
            Ok(Some(Progress::Walking { state: now_in, deadline }))
        }
        (Some(before), Some(after)) if after == before && arm.now < deadline => Ok(None),
        (before, after) => {
            let why = Hindrance::of(joint.status, after == before);
            Err(Cause::Transition(arm.node(j), now_in, next_of(state), why))
        }
    }
}

/// Steps on the way to "operation enabled"; states that are not on it have none.
fn step_of(state: State) -> Option<u8> {
    match state {
        State::SwitchOnDisabled => Some(1),
        State::ReadyToSwitchOn => Some(2),
        State::SwitchedOn => Some(3),
        State::OperationEnabled => Some(4),
        _ => None,
    }
}

/// The next state on the way.
fn next_of(state: State) -> State {
    match state {
        State::ReadyToSwitchOn => State::SwitchedOn,
        State::SwitchedOn | State::OperationEnabled => State::OperationEnabled,
        _ => State::ReadyToSwitchOn,
    }
}
