//! The arm as the phases and the watches see it: its profile and mode, its joints, the time, and the way to
//! the bus. No phase changes here.

use super::budget::Budget;
use super::cause::{Cause, Refusal};
use super::demand::ControlMode;
use super::joint::{Joint, Transmit};
use super::notes::{Counters, Notes};
use super::profile::{ModeProfile, Profile};
use super::torque::TorqueGuard;
use crate::canopen::{Frame, Micros, NodeId, Object, nmt};
use crate::cia402::{Controlword, State};

/// What is common to all phases of the driver of `N` joints.
#[derive(Clone, Debug)]
pub(super) struct Arm<const N: usize> {
    pub(super) profile: Profile<N>,
    pub(super) control: ControlMode,
    pub(super) budget: Budget,
    pub(super) torque_guard: Option<TorqueGuard<N>>,
    /// Nodes that are others than the profile says are accepted.
    pub(super) other_nodes: bool,
    pub(super) joints: [Joint; N],
    pub(super) now: Micros,
    pub(super) counters: Counters,
    pub(super) notes: Notes,
    /// A frame could not be queued, and nobody has looked at that yet.
    pub(super) queue_full: bool,
}

impl<const N: usize> Arm<N> {
    pub(super) fn new(profile: Profile<N>) -> Result<Arm<N>, Refusal> {
        profile.check()?;
        let lost = Micros::from(profile.node_heartbeat_ms) * 3000;
        Ok(Arm {
            control: ControlMode::InterpolatedPosition,
            budget: Budget::of(&profile, &ModeProfile::NONE),
            torque_guard: None,
            other_nodes: false,
            joints: profile.joints.map(|joint| Joint::new(&joint, lost, profile.reactions.sdo_timeout)),
            now: 0,
            counters: Counters::default(),
            notes: Notes::default(),
            queue_full: false,
            profile,
        })
    }

    pub(super) fn node(&self, j: usize) -> NodeId {
        self.profile.joints.get(j).map_or(self.profile.master, |joint| joint.node)
    }

    pub(super) fn joint_of(&self, node: NodeId) -> Option<usize> {
        self.profile.joints.iter().position(|joint| joint.node == node)
    }

    pub(super) fn mode(&self) -> &ModeProfile {
        self.profile.mode(self.control).unwrap_or(&ModeProfile::NONE)
    }

    /// Time since `since`, µs.
    pub(super) const fn elapsed(&self, since: Micros) -> Micros {
        self.now.saturating_sub(since)
    }

    pub(super) fn note(&mut self, cause: Cause) {
        self.notes.add(self.now, cause);
    }

    /// The first joint whose drive is not in the right mode, without torque.
    pub(super) fn unready(&self) -> Option<usize> {
        let expected = self.mode().mode;
        let ready = |joint: &Joint| joint.state().is_some_and(may_be_enabled) && joint.mode == Some(expected);
        self.joints.iter().position(|joint| !ready(joint))
    }

    /// Bits of all transmit PDOs in use.
    pub(super) fn all_tpdos(&self) -> u8 {
        let used = self.profile.tpdos.iter().enumerate().filter(|(_, mapping)| !mapping.is_empty());
        used.fold(0, |bits, (k, _)| bits | 1 << k)
    }

    /// Whether all process data of this cycle has come.
    pub(super) fn is_whole(&self) -> bool {
        let all = self.all_tpdos();
        self.joints.iter().all(|joint| joint.presence.is_whole(all))
    }

    /// Ends every transfer with a drive's server.
    pub(super) fn cancel_transfers(&mut self) {
        self.joints.iter_mut().for_each(|joint| joint.client.cancel());
    }

    /// Reads an object of joint `j`'s drive.
    pub(super) fn read(&mut self, j: usize, object: Object, tx: &mut impl Transmit) {
        let now = self.now;
        if let Some(joint) = self.joints.get_mut(j) {
            let frame = joint.client.read(object, now);
            self.send(frame, tx);
        }
    }

    /// Whether the frame could be queued.
    pub(super) fn send(&mut self, frame: Frame, tx: &mut impl Transmit) -> bool {
        let sent = tx.send(frame).is_ok();
        if !sent {
            self.counters.queue_full += 1;
            self.queue_full = true;
        }
        sent
    }

    /// A command of network management to each node of the arm, and to no other device on the bus; whether
    /// all of them could be queued.
    pub(super) fn manage(&mut self, command: nmt::Command, tx: &mut impl Transmit) -> bool {
        let mut all = true;
        for j in 0..N {
            all &= self.send(command.frame(Some(self.node(j))), tx);
        }
        all
    }

    /// The receive PDO of joint `j` with a controlword, and its next set-point where it is `running`, or what
    /// holds it; true where it was queued, or is not to be sent.
    pub(super) fn send_joint(
        &mut self,
        j: usize,
        mut word: Controlword,
        running: bool,
        tx: &mut impl Transmit,
    ) -> bool {
        let (control, mode) = (self.control, *self.mode());
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return true;
        };
        // Before the first statusword the position is unknown, and nothing can be preset to it.
        if joint.status.is_none() {
            return true;
        }
        if running {
            joint.demand.push(joint.target);
        } else {
            joint.preset(control);
        }
        let mut raw = joint.raw(control, joint.demand.last()).value;
        if running && control == ControlMode::ProfilePosition {
            let (bits, target) = joint.announce(raw);
            word = word.with(bits);
            raw = target;
        }
        match joint.rpdo(profile, &mode, word, raw) {
            Some(frame) => self.send(frame, tx),
            None => true,
        }
    }
}

/// Whether a drive in this state can be enabled: it has no torque and no fault.
pub(super) fn may_be_enabled(state: State) -> bool {
    matches!(state, State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn)
}
