//! Frames that only a master sends, and that this one did not: another master is on the bus.

use super::{Cause, Driver, Phase, Transmit};
use crate::bus::canopen::nmt;
use crate::bus::canopen::{Cob, Frame, NodeId};
use core::fmt;

/// What another master was heard to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foreign {
    /// SYNC.
    Sync,
    /// A command of network management.
    Nmt,
    /// Set-points for a node of the arm.
    Setpoints(NodeId),
    /// A heartbeat with the master's own node id.
    Heartbeat(NodeId),
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Foreign::Sync => f.write_str("SYNC"),
            Foreign::Nmt => f.write_str("network management commands"),
            Foreign::Setpoints(node) => write!(f, "set-points for node {node}"),
            Foreign::Heartbeat(node) => write!(f, "the heartbeat of node {node}, which is this master's"),
        }
    }
}

impl<const N: usize> Driver<N> {
    /// Whether `frame` is one that only a master sends; it is judged then. A transport gives back nothing of what
    /// this end has sent, so it is another's.
    pub(super) fn is_foreign(&mut self, frame: &Frame, tx: &mut impl Transmit) -> bool {
        let master = self.profile.master;
        let foreign = match Cob::of(frame) {
            Some(Cob::Sync) => Foreign::Sync,
            Some(Cob::Nmt) => Foreign::Nmt,
            Some(Cob::Rpdo(_, node)) if self.joint_of(node).is_some() => Foreign::Setpoints(node),
            Some(Cob::Heartbeat(node)) if node == master => Foreign::Heartbeat(node),
            _ => return false,
        };
        // What is stopped already is told once.
        let told = matches!(self.phase, Phase::Stopping | Phase::Faulted | Phase::Resetting)
            && matches!(self.cause, Some(Cause::OtherMaster(_)));
        if !told {
            self.trip(Cause::OtherMaster(foreign), tx);
        }
        true
    }

    /// Before anything is sent: nobody else may be heard to master the arm.
    pub(super) fn poll_listening(&mut self) {
        if self.elapsed() >= self.profile.reactions.listen_time {
            self.enter(Phase::Boot);
        }
    }

    /// A command of network management to each node of the arm, and to no other device on the bus; whether all
    /// of them could be queued.
    pub(super) fn manage(&mut self, command: nmt::Command, tx: &mut impl Transmit) -> bool {
        let mut all = true;
        for j in 0..N {
            all &= self.send(command.frame(Some(self.node(j))), tx);
        }
        all
    }
}
