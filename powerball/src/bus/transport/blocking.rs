//! SDO transfers that wait for their end, for commands and tools. What else comes meanwhile is passed by.

use super::{Bus, BusError, Event};
use crate::bus::canopen::client::{Client, SdoError, Value};
use crate::bus::canopen::{Frame, Micros, NodeId, Object};
use std::fmt;

/// For each answer of a node, µs.
const TIMEOUT: Micros = 200_000;

/// Why a transfer did not happen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TransferError {
    /// The node refused, or did not answer.
    Node {
        /// The node.
        node: NodeId,
        /// The object.
        object: Object,
        /// Why.
        error: SdoError,
    },
    /// The bus itself.
    Bus(BusError),
}

impl fmt::Display for TransferError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransferError::Node { node, object, error } => write!(f, "node {node}, {object}: {error}"),
            TransferError::Bus(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for TransferError {}

impl From<BusError> for TransferError {
    fn from(e: BusError) -> Self {
        TransferError::Bus(e)
    }
}

/// Reads an object of a node.
///
/// # Errors
/// Where the node refuses or is silent, or the bus fails.
pub fn read(bus: &mut dyn Bus, node: NodeId, object: Object) -> Result<Value, TransferError> {
    let mut client = Client::new(node, TIMEOUT);
    let first = client.read(object, bus.now());
    run(bus, node, client, first)
}

/// Writes an object of a node.
///
/// # Errors
/// As [`read`].
pub fn write(bus: &mut dyn Bus, node: NodeId, object: Object, value: Value) -> Result<(), TransferError> {
    write_within(bus, node, object, value, TIMEOUT)
}

/// The same with `timeout` µs for each answer.
pub(super) fn write_within(
    bus: &mut dyn Bus,
    node: NodeId,
    object: Object,
    value: Value,
    timeout: Micros,
) -> Result<(), TransferError> {
    let mut client = Client::new(node, timeout);
    let first = client.write(object, value, bus.now());
    run(bus, node, client, first).map(|_| ())
}

fn run(bus: &mut dyn Bus, node: NodeId, mut client: Client, first: Frame) -> Result<Value, TransferError> {
    let object = client.object();
    bus.send(&first)?;
    loop {
        let until = bus.now() + TIMEOUT / 10;
        let step = match bus.receive(until)? {
            Some((at, Event::Frame(frame))) => client.receive(&frame, at),
            Some((_, Event::BusOff)) => return Err(BusError::Off.into()),
            _ => client.poll(bus.now()),
        };
        if let Some(frame) = step.send {
            bus.send(&frame)?;
        }
        if let Some(done) = step.done {
            return done.map_err(|error| TransferError::Node { node, object, error });
        }
    }
}
