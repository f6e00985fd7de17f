//! `powerball bus scan`.

use super::super::output;
use super::{Failure, Where, refused, wait};
use crate::bus::canopen::client::SdoError;
use crate::bus::canopen::sdo::Request;
use crate::bus::canopen::{Cob, Frame, NodeId, Object, nmt, objects};
use crate::bus::transport::blocking::{self, TransferError};
use crate::bus::transport::{Bus, BusError, Event};
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Ask all 127 nodes who they are, and list those that answer. Nothing is changed and nothing moves.
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
                *text = value.map(|v| String::from_utf8_lossy(v.as_slice()).into_owned());
            }
        }
        if self.place.json {
            let nodes: Vec<_> = found.iter().map(|(id, node)| node.in_json(*id)).collect();
            output::print(&json!({ "bus": self.place.bus.to_string(), "nodes": nodes }).to_string());
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

/// Asks everybody at once and listens for half a second.
fn ask(bus: &mut dyn Bus) -> Result<BTreeMap<u8, Found>, Failure> {
    let mut heard = Vec::new();
    for id in (1..=127).filter_map(NodeId::new) {
        let request = Request::Upload { object: objects::DEVICE_TYPE }.encode();
        let Some(frame) = Frame::from_raw(Cob::SdoRequest(id).id(), &request) else { continue };
        while let Err(e) = bus.send(&frame) {
            if e != BusError::Full {
                return Err(refused(e));
            }
            heard.extend(wait(bus, 2_000)?);
        }
    }
    heard.extend(wait(bus, 500_000)?);
    let mut found: BTreeMap<u8, Found> = BTreeMap::new();
    for (_, event) in heard {
        let Event::Frame(frame) = event else { continue };
        match Cob::of(&frame) {
            Some(Cob::SdoResponse(id)) => drop(found.entry(id.raw()).or_default()),
            Some(Cob::Heartbeat(id)) => {
                found.entry(id.raw()).or_default().nmt = nmt::State::decode(&frame).map(|(_, state)| state);
            }
            _ => {}
        }
    }
    Ok(found)
}

/// What a node refuses or does not say is left empty; a bus that fails is an error.
fn optional<T>(result: Result<T, TransferError>) -> Result<Option<T>, Failure> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(TransferError::Node { error: SdoError::Aborted(_) | SdoError::Timeout, .. }) => Ok(None),
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
    out
}
