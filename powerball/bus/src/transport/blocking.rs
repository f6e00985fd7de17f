//! SDO transfers that wait for their end, for commands and tools. Other frames that arrive meanwhile are
//! ignored.

use super::{Bus, BusError, Event};
use crate::canopen::client::{Client, SdoError, Value};
use crate::canopen::{Cob, Frame, Micros, NodeId, Object};

/// For each answer of a node, µs.
const TIMEOUT: Micros = 200_000;

/// Why a transfer did not happen.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransferError {
    /// The node refused, or did not answer.
    #[error("node {node}, {object}: {error}")]
    Node {
        /// The node.
        node: NodeId,
        /// The object.
        object: Object,
        /// Why.
        error: SdoError,
    },
    /// The bus itself.
    #[error("{0}")]
    Bus(BusError),
}

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
/// Those of [`read`].
pub fn write(bus: &mut dyn Bus, node: NodeId, object: Object, value: Value) -> Result<(), TransferError> {
    write_within(bus, node, object, value, TIMEOUT)
}

/// Writes like [`write()`], with `timeout` µs for each answer.
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

/// Writes one value to an object of several nodes: the requests leave one behind the other, before any answer
/// is awaited, so that a dead node keeps none of the others waiting. Gives each node's answer, in their
/// order.
pub fn write_all(
    bus: &mut dyn Bus,
    nodes: &[NodeId],
    object: Object,
    value: Value,
) -> Vec<Result<(), TransferError>> {
    let begin = |client: &mut Client, now: Micros| client.write(object, value, now);
    run_all(bus, nodes, object, begin).into_iter().map(|answer| answer.map(|_| ())).collect()
}

/// Reads one object of several nodes, in the same way.
pub fn read_all(bus: &mut dyn Bus, nodes: &[NodeId], object: Object) -> Vec<Result<Value, TransferError>> {
    run_all(bus, nodes, object, |client, now| client.read(object, now))
}

fn run_all(
    bus: &mut dyn Bus,
    nodes: &[NodeId],
    object: Object,
    begin: impl Fn(&mut Client, Micros) -> Frame,
) -> Vec<Result<Value, TransferError>> {
    type Answer = Option<Result<Value, TransferError>>;
    let mut running: Vec<(Client, Answer)> = Vec::new();
    for node in nodes {
        let mut client = Client::new(*node, TIMEOUT);
        let sent = bus.send(&begin(&mut client, bus.now()));
        running.push((client, sent.err().map(|e| Err(e.into()))));
    }
    while running.iter().any(|(_, answer)| answer.is_none()) {
        let event = bus.receive(bus.now() + TIMEOUT / 10);
        let now = bus.now();
        for ((client, answer), node) in running.iter_mut().zip(nodes).filter(|((_, a), _)| a.is_none()) {
            let step = match &event {
                Ok(Some((at, Event::Frame(frame)))) if Cob::of(frame) == Some(Cob::SdoResponse(*node)) => {
                    client.receive(frame, *at)
                }
                Ok(Some((_, Event::BusOff))) => {
                    *answer = Some(Err(BusError::Off.into()));
                    continue;
                }
                Err(gone) => {
                    *answer = Some(Err(gone.clone().into()));
                    continue;
                }
                _ => client.poll(now),
            };
            if let Some(Err(e)) = step.send.map(|frame| bus.send(&frame)) {
                *answer = Some(Err(e.into()));
            }
            if let Some(done) = step.done {
                let node = *node;
                *answer = Some(done.map_err(|error| TransferError::Node { node, object, error }));
            }
        }
    }
    running.into_iter().filter_map(|(_, answer)| answer).collect()
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
