//! The predefined connection set (CiA 301): which identifier carries what, of which node.

use super::Frame;
use core::fmt;

/// A node's number, 1 … 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u8);

impl NodeId {
    /// `raw` as a node's number, or `None` outside 1 … 127.
    pub const fn new(raw: u8) -> Option<NodeId> {
        if raw >= 1 && raw <= 127 { Some(NodeId(raw)) } else { None }
    }

    /// For constant tables: the number clamped into 1 … 127.
    pub const fn clamped(raw: u8) -> NodeId {
        NodeId(if raw < 1 {
            1
        } else if raw > 127 {
            127
        } else {
            raw
        })
    }

    /// The number.
    pub const fn raw(self) -> u8 {
        self.0
    }

    const fn plus(self, base: u16) -> u16 {
        base + self.0 as u16
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The type of a frame, by its identifier in the predefined connection set. "T" and "R" are the node's view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cob {
    /// Network management command of the master.
    Nmt,
    /// SYNC.
    Sync,
    /// Time stamp.
    Time,
    /// Emergency of a node.
    Emcy(NodeId),
    /// Process data that a node sends; PDO number 1 … 4.
    Tpdo(u8, NodeId),
    /// Process data that a node receives; PDO number 1 … 4.
    Rpdo(u8, NodeId),
    /// SDO server (node) to client (master).
    SdoResponse(NodeId),
    /// SDO client (master) to server (node).
    SdoRequest(NodeId),
    /// Boot-up, heartbeat, node guarding.
    Heartbeat(NodeId),
}

impl Cob {
    /// The identifier. A PDO number outside 1 … 4 is taken into that range.
    pub const fn id(self) -> u16 {
        const fn pdo(number: u8) -> u16 {
            let k = if number < 1 {
                1
            } else if number > 4 {
                4
            } else {
                number
            };
            (k as u16 - 1) * 0x100
        }
        match self {
            Cob::Nmt => 0,
            Cob::Sync => 0x80,
            Cob::Time => 0x100,
            Cob::Emcy(node) => node.plus(0x80),
            Cob::Tpdo(k, node) => node.plus(0x180 + pdo(k)),
            Cob::Rpdo(k, node) => node.plus(0x200 + pdo(k)),
            Cob::SdoResponse(node) => node.plus(0x580),
            Cob::SdoRequest(node) => node.plus(0x600),
            Cob::Heartbeat(node) => node.plus(0x700),
        }
    }

    /// The message type of identifier `id`, or `None` if the set does not define it.
    pub const fn from_id(id: u16) -> Option<Cob> {
        let Some(node) = NodeId::new((id & 0x7F) as u8) else {
            return match id {
                0 => Some(Cob::Nmt),
                0x80 => Some(Cob::Sync),
                0x100 => Some(Cob::Time),
                _ => None,
            };
        };
        Some(match id & !0x7F {
            0x80 => Cob::Emcy(node),
            base @ (0x180 | 0x280 | 0x380 | 0x480) => Cob::Tpdo((base >> 8) as u8, node),
            base @ (0x200 | 0x300 | 0x400 | 0x500) => Cob::Rpdo((base >> 8) as u8 - 1, node),
            0x580 => Cob::SdoResponse(node),
            0x600 => Cob::SdoRequest(node),
            0x700 => Cob::Heartbeat(node),
            _ => return None,
        })
    }

    /// The message type of `frame`.
    pub const fn of(frame: &Frame) -> Option<Cob> {
        Cob::from_id(frame.raw_id())
    }
}

/// A SYNC frame without counter: the drives know no 0x1019.
pub const SYNC: Frame = Frame::fixed(0x80, []);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_and_meanings_are_inverse() {
        let mut known = 0;
        for id in 0..=0x7FFu16 {
            if let Some(cob) = Cob::from_id(id) {
                assert_eq!(cob.id(), id, "{cob:?}");
                known += 1;
            }
        }
        // NMT, SYNC, TIME, and twelve functions of 127 nodes each.
        assert_eq!(known, 3 + 12 * 127);
    }

    #[test]
    fn the_sets_numbers_are_cia_301s() {
        let node = NodeId::new(5).unwrap();
        let of = |cob: Cob| cob.id();
        assert_eq!([of(Cob::Tpdo(1, node)), of(Cob::Tpdo(4, node))], [0x185, 0x485]);
        assert_eq!([of(Cob::Rpdo(1, node)), of(Cob::Rpdo(4, node))], [0x205, 0x505]);
        assert_eq!([of(Cob::SdoRequest(node)), of(Cob::SdoResponse(node))], [0x605, 0x585]);
        assert_eq!([of(Cob::Emcy(node)), of(Cob::Heartbeat(node))], [0x85, 0x705]);
    }
}
