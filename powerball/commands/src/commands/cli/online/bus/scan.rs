//! `powerball bus scan`.

use super::super::output;
use super::{Failure, Where, printable, refused, wait};
use clap::Args;
use powerball_bus::canopen::sdo::Request;
use powerball_bus::canopen::{Cob, Frame, NodeId, Object, nmt, objects};
use powerball_bus::transport::blocking::{self, TransferError};
use powerball_bus::transport::{Bus, BusError, Event};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Ask all 127 nodes who they are, and list those that answer. Nothing is changed and nothing moves.
///
/// Where two nodes have the same id, one request is answered twice: the scan says so.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus scan --bus socketcan:can0")]
pub(crate) struct Scan {
    #[command(flatten)]
    place: Where,
}

/// One node that answered.
#[derive(Debug, Default)]
struct Found {
    device_type: Option<u32>,
    identity: [Option<u32>; 4],
    texts: [Option<String>; 3],
    nmt: Option<nmt::State>,
    /// One request was answered more than once.
    twice: bool,
}

impl Scan {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut bus = self.place.open()?;
        let mut found = ask(&mut *bus)?;
        for (id, node) in &mut found {
            let Some(id) = NodeId::new(*id) else { continue };
            let mut number = |object| {
                optional(blocking::read(&mut *bus, id, object)).map(|v| v.and_then(|v| v.unsigned()))
            };
            node.device_type = number(objects::DEVICE_TYPE)?;
            for (sub, part) in (1..).zip(&mut node.identity) {
                *part = number(Object::new(objects::VENDOR_ID.index, sub))?;
            }
            let names = [objects::DEVICE_NAME, objects::HARDWARE_VERSION, objects::SOFTWARE_VERSION];
            for (object, text) in names.into_iter().zip(&mut node.texts) {
                let value = optional(blocking::read(&mut *bus, id, object))?;
                *text = value.map(|v| printable(v.as_slice()));
            }
        }
        if self.place.json {
            let nodes: Vec<_> = found.iter().map(|(id, node)| node.in_json(*id)).collect();
            let twice: Vec<u8> = found.iter().filter(|(_, node)| node.twice).map(|(id, _)| *id).collect();
            let result = json!({ "bus": self.place.bus.to_string(), "nodes": nodes, "used_twice": twice });
            output::data(&result.to_string());
        } else {
            output::print(in_words(&found).trim_end());
        }
        if found.is_empty() {
            return Err(Failure::Refused(format!(
                "no node answers on {}: check bit rate, termination and logic supply",
                self.place.bus
            )));
        }
        Ok(())
    }
}

/// Asks everybody at once, and those who answer for their serial numbers: of two devices with one id both
/// answer.
fn ask(bus: &mut dyn Bus) -> Result<BTreeMap<u8, Found>, Failure> {
    let mut found: BTreeMap<u8, Found> = BTreeMap::new();
    let heard = ask_all(bus, 1..=127, objects::DEVICE_TYPE)?;
    for frame in &heard {
        match Cob::of(frame) {
            Some(Cob::SdoResponse(id)) => drop(found.entry(id.raw()).or_default()),
            Some(Cob::Heartbeat(id)) => {
                found.entry(id.raw()).or_default().nmt = nmt::State::decode(frame).map(|(_, state)| state);
            }
            _ => {}
        }
    }
    let again = ask_all(bus, found.keys().copied(), objects::SERIAL_NUMBER)?;
    for (id, node) in &mut found {
        let count =
            |heard: &[Frame], object| heard.iter().filter(|frame| answers(frame, *id, object)).count();
        node.twice = count(&heard, objects::DEVICE_TYPE) > 1 || count(&again, objects::SERIAL_NUMBER) > 1;
    }
    Ok(found)
}

/// Whether a frame is a node's answer about an object, which stands in its second to fourth byte.
fn answers(frame: &Frame, id: u8, object: Object) -> bool {
    let [low, high] = object.index.to_le_bytes();
    matches!(Cob::of(frame), Some(Cob::SdoResponse(node)) if node.raw() == id)
        && frame.bytes().get(1..4) == Some(&[low, high, object.sub])
}

/// Asks each of some nodes for an object and gives what is heard until half a second later.
fn ask_all(
    bus: &mut dyn Bus,
    ids: impl IntoIterator<Item = u8>,
    object: Object,
) -> Result<Vec<Frame>, Failure> {
    let mut heard = Vec::new();
    for id in ids.into_iter().filter_map(NodeId::new) {
        let request = Request::Upload { object }.encode();
        let Some(frame) = Frame::from_raw(Cob::SdoRequest(id).id(), &request) else { continue };
        while let Err(e) = bus.send(&frame) {
            if e != BusError::Full {
                return Err(refused(e));
            }
            heard.extend(wait(bus, 2_000)?);
        }
    }
    heard.extend(wait(bus, 500_000)?);
    let frames = heard.into_iter().filter_map(|(_, event)| match event {
        Event::Frame(frame) => Some(frame),
        _ => None,
    });
    Ok(frames.collect())
}

/// A value that a node refuses or does not report is left empty; a bus that fails is an error.
fn optional<T>(result: Result<T, TransferError>) -> Result<Option<T>, Failure> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(TransferError::Node { .. }) => Ok(None),
        Err(e) => Err(e.into()),
    }
}

impl Found {
    fn in_json(&self, id: u8) -> serde_json::Value {
        let [vendor, product, revision, serial] = self.identity;
        let [name, hardware, software] = &self.texts;
        json!({
            "node": id, "device_type": self.device_type, "vendor": vendor, "product": product, "revision": revision,
            "serial": serial, "name": name, "hardware": hardware, "software": software,
            "nmt": self.nmt.map(|state| state.to_string()),
        })
    }
}

fn in_words(found: &BTreeMap<u8, Found>) -> String {
    let mut out =
        String::from("node  device type  vendor      product     revision    serial      name, software\n");
    for (id, node) in found {
        let hex = |value: Option<u32>| value.map_or("-".to_string(), |v| format!("0x{v:08X}"));
        let _ = write!(out, "{id:>4}  {:<11}", hex(node.device_type));
        for part in node.identity {
            let _ = write!(out, "  {:<10}", hex(part));
        }
        let text = |k: usize| node.texts[k].as_deref().unwrap_or("-");
        let _ = writeln!(out, "  {}, {}", text(0), text(2));
    }
    for (id, _) in found.iter().filter(|(_, node)| node.twice) {
        let _ = writeln!(out, "node {id}: one request is answered twice: two devices have this id");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use powerball_bus::canopen::Micros;
    use std::collections::VecDeque;

    /// Nodes 3 and 5; two devices have id 5, and differ in their serial numbers.
    #[derive(Debug, Default)]
    struct Twins {
        now: Micros,
        queue: VecDeque<Frame>,
    }

    impl Bus for Twins {
        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            if let Some(Cob::SdoRequest(id)) = Cob::of(frame)
                && let Some([_, low, high, sub, ..]) = frame.bytes().first_chunk::<8>()
            {
                let serials: &[u8] = match id.raw() {
                    3 => &[1],
                    5 => &[2, 3],
                    _ => &[],
                };
                for serial in serials {
                    let data = [0x43, *low, *high, *sub, *serial, 0, 0, 0];
                    self.queue.extend(Frame::from_raw(Cob::SdoResponse(id).id(), &data));
                }
            }
            Ok(())
        }

        fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
            let frame = self.queue.pop_front();
            self.now = if frame.is_some() { self.now + 100 } else { until };
            Ok(frame.map(|frame| (self.now, Event::Frame(frame))))
        }

        fn now(&self) -> Micros {
            self.now
        }

        fn flush(&mut self) {}
    }

    #[test]
    fn two_devices_with_one_id_are_named() {
        let found = ask(&mut Twins::default()).unwrap_or_default();
        let twice: Vec<(u8, bool)> = found.iter().map(|(id, node)| (*id, node.twice)).collect();
        assert_eq!(twice, [(3, false), (5, true)]);
        let words = in_words(&found);
        assert!(
            words.contains("node 5: one request is answered twice") && !words.contains("node 3:"),
            "{words}"
        );
    }

    #[test]
    fn what_a_device_calls_itself_cannot_steer_a_terminal() {
        assert_eq!(printable(b"\x1b[31mERB\x07 145\r\n"), "[31mERB 145");
        assert_eq!(printable("a\u{9b}2J\u{202e}b µ".as_bytes()), "a2Jb µ");
    }
}
