//! Network management: commands, node states, boot-up and heartbeat (CiA 301).

use super::{Cob, Frame, NodeId};
use core::fmt;

/// A command of the master: the state that a node has to enter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// To operational: PDOs run.
    Start,
    /// To stopped: only NMT and heartbeat.
    Stop,
    /// To pre-operational: SDO, no PDO.
    EnterPreOperational,
    /// Restart the application.
    ResetNode,
    /// Restart the communication alone.
    ResetCommunication,
}

impl Command {
    /// The command's byte.
    pub const fn code(self) -> u8 {
        match self {
            Command::Start => 0x01,
            Command::Stop => 0x02,
            Command::EnterPreOperational => 0x80,
            Command::ResetNode => 0x81,
            Command::ResetCommunication => 0x82,
        }
    }

    /// The command of a byte.
    pub const fn from_code(code: u8) -> Option<Command> {
        Some(match code {
            0x01 => Command::Start,
            0x02 => Command::Stop,
            0x80 => Command::EnterPreOperational,
            0x81 => Command::ResetNode,
            0x82 => Command::ResetCommunication,
            _ => return None,
        })
    }

    /// The frame with this command for `node`, or for every node if `None`.
    pub const fn frame(self, node: Option<NodeId>) -> Frame {
        let address = match node {
            Some(node) => node.raw(),
            None => 0,
        };
        Frame::fixed(Cob::Nmt.id(), [self.code(), address])
    }

    /// The command in `frame` where it is one for `node` (or for all).
    pub fn decode(frame: &Frame, node: NodeId) -> Option<Command> {
        match (Cob::of(frame)?, frame.bytes()) {
            (Cob::Nmt, &[code, address]) if address == 0 || address == node.raw() => Command::from_code(code),
            _ => None,
        }
    }
}

/// The state that a node reports in its heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Reported once after a reset.
    BootUp,
    /// Stopped.
    Stopped,
    /// Operational.
    Operational,
    /// Pre-operational.
    PreOperational,
    /// Anything else.
    Unknown(u8),
}

impl State {
    /// The state's byte.
    pub const fn code(self) -> u8 {
        match self {
            State::BootUp => 0x00,
            State::Stopped => 0x04,
            State::Operational => 0x05,
            State::PreOperational => 0x7F,
            State::Unknown(code) => code,
        }
    }

    /// The state of a byte; the node guarding toggle bit is ignored.
    pub const fn from_code(code: u8) -> State {
        match code & 0x7F {
            0x00 => State::BootUp,
            0x04 => State::Stopped,
            0x05 => State::Operational,
            0x7F => State::PreOperational,
            other => State::Unknown(other),
        }
    }

    /// Heartbeat (or boot-up) frame of `node`.
    pub const fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Heartbeat(node).id(), [self.code()])
    }

    /// Node and state in a heartbeat frame; `None` if `frame` is not a heartbeat, or does not have one byte.
    pub fn decode(frame: &Frame) -> Option<(NodeId, State)> {
        match (Cob::of(frame)?, frame.bytes()) {
            (Cob::Heartbeat(node), &[code]) => Some((node, State::from_code(code))),
            _ => None,
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            State::BootUp => f.write_str("boot-up"),
            State::Stopped => f.write_str("stopped"),
            State::Operational => f.write_str("operational"),
            State::PreOperational => f.write_str("pre-operational"),
            State::Unknown(code) => write!(f, "unknown (0x{code:02X})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: NodeId = NodeId::clamped(5);

    #[test]
    fn a_node_hears_its_own_and_everybodys_commands_only() {
        let other = NodeId::clamped(6);
        assert_eq!(Command::decode(&Command::Start.frame(Some(NODE)), NODE), Some(Command::Start));
        assert_eq!(Command::decode(&Command::ResetNode.frame(None), NODE), Some(Command::ResetNode));
        assert_eq!(Command::decode(&Command::Start.frame(Some(other)), NODE), None);
    }

    #[test]
    fn heartbeats_need_exactly_one_byte() {
        let frame = State::Operational.frame(NODE);
        assert_eq!(frame.to_string(), "705#05");
        assert_eq!(State::decode(&frame), Some((NODE, State::Operational)));
        assert_eq!(State::decode(&frame.truncated(0)), None);
        assert_eq!(State::decode(&Frame::fixed(0x705, [0x85])), Some((NODE, State::Operational)));
    }
}
