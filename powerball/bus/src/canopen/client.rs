//! The master's end of an SDO transfer, driven by polling: no clock, no bus, no allocation.
//!
//! One transfer at a time and node. [`Client::read`] and [`Client::write`] give the first frame; every
//! received frame goes to [`Client::receive`], and time to [`Client::poll`]. Both say what to send, and when
//! the transfer has ended.

use super::sdo::{AbortCode, Chunk, Request, Response, Transfer};
use super::{Cob, Frame, Micros, NodeId, Object};
use core::fmt;

/// Most bytes of one value: enough for the drive's strings.
pub const CAPACITY: usize = 64;

/// A value of up to [`CAPACITY`] bytes, little endian as on the wire.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Value {
    bytes: [u8; CAPACITY],
    len: usize,
}

impl Value {
    /// No byte.
    pub const EMPTY: Value = Value { bytes: [0; CAPACITY], len: 0 };

    /// `data` as a value, or `None` where it is longer than [`CAPACITY`].
    pub fn new(data: &[u8]) -> Option<Value> {
        let mut value = Value::EMPTY;
        value.push(data).then_some(value)
    }

    /// The low `size` bytes (at most 8) of `number`, two's complement.
    pub fn number(number: i64, size: usize) -> Value {
        let mut value = Value::EMPTY;
        value.bytes.iter_mut().zip(number.to_le_bytes()).take(size.min(8)).for_each(|(to, from)| *to = from);
        value.len = size.min(8);
        value
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }

    /// The value as an unsigned number, if it has one to four bytes.
    pub fn unsigned(&self) -> Option<u32> {
        let bytes = self.as_slice();
        matches!(bytes.len(), 1..=4)
            .then(|| bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)))
    }

    /// The value as a signed number, if it has one to four bytes.
    pub fn signed(&self) -> Option<i32> {
        self.unsigned().map(|raw| super::pdo::sign_extend(raw, self.len as u8 * 8))
    }

    /// Appends `data`; false, and nothing appended, where it does not fit.
    fn push(&mut self, data: &[u8]) -> bool {
        let end = self.len + data.len();
        let Some(room) = self.bytes.get_mut(self.len..end) else { return false };
        room.copy_from_slice(data);
        self.len = end;
        true
    }
}

impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SdoError {
    /// The node refused or gave up.
    Aborted(AbortCode),
    /// The node did not answer in time.
    Timeout,
    /// The node sent a wrong answer; the client ended the transfer with this abort code.
    Protocol(AbortCode),
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SdoError::Aborted(code) => write!(f, "SDO abort {code}"),
            SdoError::Timeout => f.write_str("no SDO answer in time"),
            SdoError::Protocol(code) => write!(f, "SDO protocol violated by the node ({})", code.text()),
        }
    }
}

impl core::error::Error for SdoError {}

/// The result of a call: a frame to send, and whether the transfer has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// To be sent now.
    pub send: Option<Frame>,
    /// The transfer has ended: the value that was read (empty after a write), or why there is none.
    pub done: Option<Result<Value, SdoError>>,
}

impl Step {
    const NOTHING: Step = Step { send: None, done: None };
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    /// A write was requested; `sent` bytes of the value are out (all of them where expedited).
    Download {
        sent: usize,
        started: bool,
        toggle: bool,
    },
    Upload {
        size: Option<u32>,
        started: bool,
        toggle: bool,
    },
}

/// The state of one transfer with one node.
#[derive(Clone, Copy, Debug)]
pub struct Client {
    node: NodeId,
    object: Object,
    value: Value,
    phase: Phase,
    deadline: Micros,
    timeout: Micros,
}

impl Client {
    /// A client of `node`'s server that waits `timeout` for each answer.
    pub const fn new(node: NodeId, timeout: Micros) -> Client {
        let object = Object::new(0, 0);
        Client { node, object, value: Value::EMPTY, phase: Phase::Idle, deadline: 0, timeout }
    }

    /// Whether no transfer is under way.
    pub fn is_idle(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// The object of the transfer under way, or of the last one.
    pub fn object(&self) -> Object {
        self.object
    }

    /// Begins to read `object`, and gives the frame to send. A transfer under way is forgotten.
    pub fn read(&mut self, object: Object, now: Micros) -> Frame {
        self.object = object;
        self.value = Value::EMPTY;
        self.phase = Phase::Upload { size: None, started: false, toggle: false };
        self.send(Request::Upload { object }, now)
    }

    /// Begins to write `value` to `object`, and gives the frame to send. A transfer under way is forgotten.
    pub fn write(&mut self, object: Object, value: Value, now: Micros) -> Frame {
        self.object = object;
        self.value = value;
        let bytes = value.as_slice();
        let (transfer, sent) = match bytes.len() {
            1..=4 => (Transfer::Expedited(Chunk::first(bytes, 4)), bytes.len()),
            len => (Transfer::Segmented(Some(len as u32)), 0),
        };
        self.phase = Phase::Download { sent, started: false, toggle: false };
        self.send(Request::Download { object, transfer }, now)
    }

    /// Forgets the transfer without telling the node.
    pub fn cancel(&mut self) {
        self.phase = Phase::Idle;
    }

    /// Checks the time: ends the transfer if the node did not answer, and informs the node.
    pub fn poll(&mut self, now: Micros) -> Step {
        if self.is_idle() || now < self.deadline {
            return Step::NOTHING;
        }
        self.give_up(AbortCode::TIMEOUT, SdoError::Timeout)
    }

    /// Takes a received frame. Frames of other nodes are ignored, and so are answers without a request.
    pub fn receive(&mut self, frame: &Frame, now: Micros) -> Step {
        if self.is_idle() || Cob::of(frame) != Some(Cob::SdoResponse(self.node)) {
            return Step::NOTHING;
        }
        let response = match Response::decode(frame.bytes()) {
            Ok(response) => response,
            // Cut short on its way: as good as lost. The deadline still runs.
            Err(_) if frame.bytes().len() != 8 => return Step::NOTHING,
            Err(_) => return self.violated(AbortCode::COMMAND),
        };
        match (response, self.phase) {
            // An abort for another object is late news of a transfer that we gave up.
            (Response::Abort { object, code }, _) if object == self.object => {
                self.finish(Err(SdoError::Aborted(code)))
            }
            (Response::Download { object }, Phase::Download { sent, started: false, .. })
                if object == self.object =>
            {
                if sent == self.value.len && sent > 0 {
                    return self.finish(Ok(Value::EMPTY));
                }
                self.next_segment(sent, false, now)
            }
            (Response::DownloadSegment { toggle }, Phase::Download { sent, started: true, toggle: ours }) => {
                if toggle != ours {
                    self.violated(AbortCode::TOGGLE)
                } else if sent == self.value.len {
                    self.finish(Ok(Value::EMPTY))
                } else {
                    self.next_segment(sent, !toggle, now)
                }
            }
            (Response::Upload { object, transfer }, Phase::Upload { started: false, .. })
                if object == self.object =>
            {
                match transfer {
                    Transfer::Expedited(chunk) => {
                        self.value.push(chunk.as_slice());
                        self.finish(Ok(self.value))
                    }
                    Transfer::Segmented(Some(size)) if size as usize > CAPACITY => {
                        self.violated(AbortCode::MEMORY)
                    }
                    Transfer::Segmented(size) => self.ask_segment(size, false, now),
                }
            }
            (
                Response::UploadSegment { toggle, chunk, last },
                Phase::Upload { size, started: true, toggle: ours },
            ) => {
                if toggle != ours {
                    self.violated(AbortCode::TOGGLE)
                } else if !self.value.push(chunk.as_slice()) {
                    self.violated(AbortCode::MEMORY)
                } else if !last {
                    self.ask_segment(size, !toggle, now)
                } else if size.is_some_and(|size| size as usize != self.value.len) {
                    self.violated(AbortCode::LENGTH)
                } else {
                    self.finish(Ok(self.value))
                }
            }
            // A late or doubled answer: not ours to act on. The deadline still runs.
            _ => Step::NOTHING,
        }
    }

    fn send(&mut self, request: Request, now: Micros) -> Frame {
        self.deadline = now.saturating_add(self.timeout);
        Frame::fixed(Cob::SdoRequest(self.node).id(), request.encode())
    }

    fn next_segment(&mut self, sent: usize, toggle: bool, now: Micros) -> Step {
        let chunk = Chunk::first(self.value.as_slice().get(sent..).unwrap_or(&[]), 7);
        let sent = sent + chunk.as_slice().len();
        self.phase = Phase::Download { sent, started: true, toggle };
        let last = sent == self.value.len;
        Step { send: Some(self.send(Request::DownloadSegment { toggle, chunk, last }, now)), done: None }
    }

    fn ask_segment(&mut self, size: Option<u32>, toggle: bool, now: Micros) -> Step {
        self.phase = Phase::Upload { size, started: true, toggle };
        Step { send: Some(self.send(Request::UploadSegment { toggle }, now)), done: None }
    }

    fn violated(&mut self, code: AbortCode) -> Step {
        self.give_up(code, SdoError::Protocol(code))
    }

    fn give_up(&mut self, code: AbortCode, error: SdoError) -> Step {
        let abort = Request::Abort { object: self.object, code };
        let frame = Frame::fixed(Cob::SdoRequest(self.node).id(), abort.encode());
        Step { send: Some(frame), ..self.finish(Err(error)) }
    }

    fn finish(&mut self, result: Result<Value, SdoError>) -> Step {
        self.phase = Phase::Idle;
        Step { send: None, done: Some(result) }
    }
}

#[cfg(test)]
mod tests;
