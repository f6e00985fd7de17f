//! A node of zencan-node on powerball's bus in memory, and powerball's CANopen as its master: boot-up and
//! heartbeat, SDO expedited and segmented, aborts, mapping of PDOs, SYNC, NMT.

#![cfg(test)]

use powerball::bus::canopen::client::Value;
use powerball::bus::canopen::pdo::{Entry, Mapping};
use powerball::bus::canopen::{Cob, Frame, Micros, NodeId, Object, cob, nmt};
use powerball::bus::transport::{Bus, Event, Memory, Peer, blocking};
use std::collections::VecDeque;
use std::fmt;
use zencan_node::common::NodeId as ZencanId;
use zencan_node::common::messages::{CanId, CanMessage};
use zencan_node::{Callbacks, Node};

mod zencan {
    zencan_node::include_modules!(NODE);
}

const NODE: NodeId = NodeId::clamped(5);
const COMMANDED: Object = Object::new(0x2000, 0);
const KEPT: Object = Object::new(0x2001, 0);

struct Zencan {
    node: Node<'static>,
    now: Micros,
    out: VecDeque<Frame>,
}

impl fmt::Debug for Zencan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Zencan").field("now", &self.now).finish_non_exhaustive()
    }
}

impl Zencan {
    fn process(&mut self) {
        self.node.process(self.now);
        while let Some(message) = zencan::NODE_MBOX.next_transmit_message() {
            let CanId::Std(id) = message.id else { panic!("an extended identifier") };
            self.out.push_back(Frame::from_raw(id, &message.data[..usize::from(message.dlc)]).unwrap());
        }
    }
}

impl Peer for Zencan {
    fn receive(&mut self, frame: &Frame, now: Micros) {
        self.now = now;
        // What is not for the node it gives back.
        let _ = zencan::NODE_MBOX.store_message(CanMessage::new(CanId::Std(frame.raw_id()), frame.bytes()));
        self.process();
    }

    fn advance(&mut self, now: Micros) {
        self.now = now;
        self.process();
    }

    fn wake(&self) -> Micros {
        self.now + 1_000
    }

    fn transmit(&mut self) -> Option<Frame> {
        self.out.pop_front()
    }
}

/// What comes within `time`.
fn hear(bus: &mut Memory<Zencan>, time: Micros) -> Vec<Frame> {
    let until = bus.now() + time;
    let mut heard = Vec::new();
    while let Some((_, event)) = bus.receive(until).unwrap() {
        heard.extend(match event {
            Event::Frame(frame) => Some(frame),
            _ => None,
        });
    }
    heard
}

fn states(heard: &[Frame]) -> Vec<nmt::State> {
    heard
        .iter()
        .filter_map(nmt::State::decode)
        .map(|(node, state)| (node == NODE).then_some(state).unwrap())
        .collect()
}

#[test]
fn a_node_of_zencan_is_mastered() {
    let id = ZencanId::new(NODE.raw()).unwrap();
    let node =
        Node::new(id, Callbacks::default(), &zencan::NODE_MBOX, &zencan::NODE_STATE, &zencan::OD_TABLE);
    let mut bus = Memory::new(Zencan { node, now: 0, out: VecDeque::new() }, 500_000);

    let heard = states(&hear(&mut bus, 350_000));
    // zencan-node 0.0.5 boots without the boot-up message of CiA 301: its first heartbeat says
    // pre-operational.
    assert!(heard.len() >= 4 && heard.iter().all(|s| *s == nmt::State::PreOperational), "{heard:?}");

    let read = |bus: &mut Memory<Zencan>, object| blocking::read(bus, NODE, object);
    let write = |bus: &mut Memory<Zencan>, object, number, size| {
        blocking::write(bus, NODE, object, Value::number(number, size)).unwrap();
        assert_eq!(read(bus, object).unwrap().as_slice(), Value::number(number, size).as_slice(), "{object}");
    };
    // Who it is; its name comes in segments.
    for (sub, value) in [(1, 0xCAFEi64), (2, 1032), (3, 7)] {
        let part = read(&mut bus, Object::new(0x1018, sub)).unwrap();
        assert_eq!(part.as_slice(), Value::number(value, 4).as_slice());
    }
    let name = read(&mut bus, Object::new(0x1008, 0)).unwrap();
    assert_eq!(name.as_slice(), b"a node of zencan");
    write(&mut bus, COMMANDED, 0xBEEF, 2);
    write(&mut bus, KEPT, -77_000, 4);
    let refused = read(&mut bus, Object::new(0x2FFF, 0)).unwrap_err().to_string();
    assert!(refused.contains("0x06020000"), "{refused}");

    // PDOs as the driver sets them: off, count 0, entries, count, type, on.
    let (rpdo, tpdo) = (
        Mapping::of(&[Entry::new(KEPT, 32)]),
        Mapping::of(&[Entry::new(COMMANDED, 16), Entry::new(KEPT, 32)]),
    );
    for (base, cob, mapping, kind) in
        [(0x1400, Cob::Rpdo(1, NODE), rpdo, 255), (0x1800, Cob::Tpdo(1, NODE), tpdo, 1)]
    {
        let on = i64::from(cob.id());
        blocking::write(&mut bus, NODE, Object::new(base, 1), Value::number(on | 1 << 31, 4)).unwrap();
        write(&mut bus, Object::new(base + 0x200, 0), 0, 1);
        for (k, entry) in mapping.entries().iter().enumerate() {
            write(&mut bus, Object::new(base + 0x200, k as u8 + 1), i64::from(entry.to_u32()), 4);
        }
        write(&mut bus, Object::new(base + 0x200, 0), mapping.entries().len() as i64, 1);
        write(&mut bus, Object::new(base, 2), kind, 1);
        blocking::write(&mut bus, NODE, Object::new(base, 1), Value::number(on, 4)).unwrap();
    }
    bus.send(&nmt::Command::Start.frame(Some(NODE))).unwrap();
    assert_eq!(states(&hear(&mut bus, 150_000)).last(), Some(&nmt::State::Operational));

    // A set-point goes there and comes back with the next SYNC.
    for number in [123_456i32, -9] {
        bus.send(&Frame::from_raw(Cob::Rpdo(1, NODE).id(), &number.to_le_bytes()).unwrap()).unwrap();
        hear(&mut bus, 5_000);
        bus.send(&cob::SYNC).unwrap();
        let heard = hear(&mut bus, 5_000);
        let data = heard.iter().find(|frame| Cob::of(frame) == Some(Cob::Tpdo(1, NODE))).unwrap();
        let values: Vec<u32> = tpdo.unpack(data.bytes()).unwrap().map(|(_, raw)| raw).collect();
        assert_eq!(values, [0xBEEF, number as u32]);
        assert_eq!(read(&mut bus, KEPT).unwrap().as_slice(), number.to_le_bytes());
    }

    bus.send(&nmt::Command::ResetNode.frame(Some(NODE))).unwrap();
    assert_eq!(states(&hear(&mut bus, 150_000)).last(), Some(&nmt::State::PreOperational));
}
