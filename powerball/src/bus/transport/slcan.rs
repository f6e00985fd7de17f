//! Serial adapters that speak slcan (Lawicel's lines of text), on a serial device or a pseudo terminal.

use super::{Bus, BusError, Clock, Event, readable};
use crate::bus::canopen::{Frame, Micros};
use rustix::termios::{OptionalActions, QueueSelector, isatty, tcflush, tcgetattr, tcsetattr};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

/// Closes the channel, sets 500 kbit/s, opens it.
const OPEN: &[u8] = b"C\rS6\r\rO\r";
/// A line longer than this is noise.
const LONGEST: usize = 64;

/// A bus behind a serial adapter.
#[derive(Debug)]
pub struct Slcan {
    port: File,
    name: String,
    line: Vec<u8>,
    inbox: VecDeque<(Micros, Event)>,
    /// Bytes that the device has not taken yet.
    out: VecDeque<u8>,
    clock: Clock,
}

/// Bytes that may wait for the device: about thirty frames.
const ROOM: usize = 1024;

impl Slcan {
    /// Opens a serial device at 500 kbit/s on the bus.
    ///
    /// # Errors
    /// Where the device cannot be opened or written.
    pub fn open(device: &Path) -> Result<Self, BusError> {
        let name = device.display().to_string();
        let port = rustix::fs::open(
            device,
            rustix::fs::OFlags::RDWR | rustix::fs::OFlags::NOCTTY | rustix::fs::OFlags::NONBLOCK,
            rustix::fs::Mode::empty(),
        )
        .map_err(|e| BusError::io(format_args!("slcan:{name}"), e))?;
        if isatty(&port) {
            let failed = |e| BusError::io(format_args!("slcan:{name}: its line cannot be set"), e);
            let mut line = tcgetattr(&port).map_err(failed)?;
            line.make_raw();
            tcsetattr(&port, OptionalActions::Now, &line).map_err(failed)?;
        }
        let mut bus = Slcan {
            port: File::from(port),
            name,
            line: Vec::new(),
            inbox: VecDeque::new(),
            out: VecDeque::new(),
            clock: Clock::start(),
        };
        bus.out.extend(OPEN);
        bus.drain()?;
        Ok(bus)
    }

    /// Writes what the device takes without waiting.
    fn drain(&mut self) -> Result<(), BusError> {
        while !self.out.is_empty() {
            match self.port.write(self.out.as_slices().0) {
                Ok(0) => break,
                Ok(taken) => drop(self.out.drain(..taken)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => break,
                Err(e) => return Err(BusError::io(format_args!("slcan:{}", self.name), e)),
            }
        }
        Ok(())
    }

    fn fill(&mut self) -> Result<(), BusError> {
        let mut buffer = [0; 512];
        match self.port.read(&mut buffer) {
            Ok(0) => Err(BusError::Io(format!("slcan:{}: the device is gone", self.name))),
            Ok(len) => {
                let now = self.clock.now();
                for byte in &buffer[..len] {
                    match byte {
                        b'\r' => {
                            self.inbox.extend(decode(&self.line).map(|frame| (now, Event::Frame(frame))));
                            self.line.clear();
                        }
                        // The bell is an error answer to the command before.
                        0x07 => self.line.clear(),
                        _ if self.line.len() >= LONGEST => self.line.clear(),
                        _ => self.line.push(*byte),
                    }
                }
                Ok(())
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(()),
            Err(e) => Err(BusError::io(format_args!("slcan:{}", self.name), e)),
        }
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        let _ = self.port.write(b"C\r");
    }
}

impl Bus for Slcan {
    fn now(&self) -> Micros {
        self.clock.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.out.len() > ROOM {
            self.drain()?;
            if self.out.len() > ROOM {
                return Err(BusError::Full);
            }
        }
        self.out.extend(encode(frame));
        self.drain()
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        loop {
            self.drain()?;
            if let Some(event) = self.inbox.pop_front() {
                return Ok(Some(event));
            }
            let left = self.clock.left(until);
            if readable(&self.port, left)? {
                self.fill()?;
            } else if left.is_zero() {
                return Ok(None);
            }
        }
    }

    fn flush(&mut self) {
        self.out.clear();
        let _ = tcflush(&self.port, QueueSelector::OFlush);
    }
}

/// `t1234DEADBEEF\r`.
fn encode(frame: &Frame) -> Vec<u8> {
    let mut line = format!("t{:03X}{}", frame.raw_id(), frame.bytes().len());
    frame.bytes().iter().for_each(|byte| line.push_str(&format!("{byte:02X}")));
    line.push('\r');
    line.into_bytes()
}

/// The frame in a line without its end; `None` for answers, extended and remote frames.
fn decode(line: &[u8]) -> Option<Frame> {
    let (b't', rest) = line.split_first().map(|(kind, rest)| (*kind, rest))? else { return None };
    let hex = |digits: &[u8]| -> Option<u16> {
        digits.iter().try_fold(0u16, |sum, d| Some(sum << 4 | char::from(*d).to_digit(16)? as u16))
    };
    let (id, rest) = rest.split_at_checked(3)?;
    let (len, rest) = rest.split_at_checked(1)?;
    let len = usize::from(hex(len)?);
    // A time stamp of four digits may follow.
    let data = rest.get(..2 * len)?;
    let bytes: Option<Vec<u8>> = data.chunks_exact(2).map(|pair| Some(hex(pair)? as u8)).collect();
    Frame::from_raw(hex(id)?, &bytes?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_the_protocol() {
        let frame = Frame::from_raw(0x123, &[0xDE, 0xAD, 0xBE, 0xEF]).unwrap();
        assert_eq!(encode(&frame), b"t1234DEADBEEF\r");
        assert_eq!(decode(b"t1234deadbeef"), Some(frame));
        assert_eq!(decode(b"t1234DEADBEEF0A1B"), Some(frame));
        for line in [
            &b""[..],
            b"z",
            b"t12",
            b"t1234DEAD",
            b"T000001231AA",
            b"r1230",
            b"t12x0",
            b"t1239112233445566778899",
        ] {
            assert_eq!(decode(line), None);
        }
    }
}
