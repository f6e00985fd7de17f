//! Serial adapters that speak slcan (Lawicel's lines of text), on a serial port of any system or a pseudo
//! terminal.
//!
//! The status flags of the adapter are read four times a second, if it answers at all: some do not, and a
//! program at the other end of a pseudo terminal need not. Source: Lawicel's CAN232 and CANUSB manuals, and
//! for lines that an adapter sends by itself Linux's drivers/net/can/slcan.

mod line;
#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests;

#[cfg(unix)]
use super::readable;
use super::{Bus, BusError, Clock, Event};
use crate::canopen::{Frame, Micros};
pub(super) use line::speed;
use line::{Flags, Line, Lines, State, encode};
use serial2::{SerialPort, Settings};
use std::collections::VecDeque;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

/// Bytes that may wait for the device: about thirty frames.
const ROOM: usize = 1024;
/// An adapter answers a command within this, µs: some are behind a radio link, or on a busy machine.
const ANSWER: Micros = 500_000;
/// Time from one question for the status flags to the next, µs.
const ASKING: Micros = 250_000;
/// Time without an answer after which an adapter counts as removed, µs.
const SILENCE: Micros = 1_000_000;
/// Windows takes 0 for "for ever".
const WRITE_TIMEOUT: Duration = if cfg!(windows) { Duration::from_millis(1) } else { Duration::ZERO };

/// A bus behind a serial adapter.
#[derive(Debug)]
pub struct Slcan {
    port: SerialPort,
    name: String,
    lines: Lines,
    inbox: VecDeque<(Micros, Event)>,
    /// Bytes that the device has not taken yet.
    out: VecDeque<u8>,
    clock: Clock,
    state: State,
    /// The adapter refused a command, and its flags are not yet known.
    refused: bool,
    /// The flags before, which reading has cleared.
    before: Flags,
    /// When to ask for the flags again; `None` where the adapter has none.
    ask_at: Option<Micros>,
    /// Time of the last question without an answer.
    asked: Option<Micros>,
    /// The adapter may refuse the half frame that a flush left.
    forgiven: bool,
}

impl Slcan {
    /// Opens a serial device, sets the bit rate of the bus in bit/s, and opens the adapter's channel. The
    /// speed of the serial line itself stays as the system has it.
    ///
    /// # Errors
    /// Where slcan has no command for the bit rate, the device cannot be opened or written, or the adapter
    /// refuses.
    pub fn open(device: &Path, bitrate: u32) -> Result<Self, BusError> {
        let name = device.display().to_string();
        let digit = speed(bitrate).map_err(|why| BusError::Io(format!("slcan:{name}: {why}")))?;
        let raw = |mut settings: Settings| {
            settings.set_raw();
            Ok(settings)
        };
        let failed = |e| BusError::io(format_args!("slcan:{name}"), e);
        let mut port = SerialPort::open(device, raw).map_err(failed)?;
        port.set_write_timeout(WRITE_TIMEOUT).map_err(failed)?;
        port.set_read_timeout(Duration::ZERO).map_err(failed)?;
        port.discard_buffers().map_err(failed)?;
        let mut bus = Slcan {
            port,
            name,
            lines: Lines::default(),
            inbox: VecDeque::new(),
            out: VecDeque::new(),
            clock: Clock::start(),
            state: State::Active,
            refused: false,
            before: Flags(0),
            ask_at: None,
            asked: None,
            forgiven: false,
        };
        bus.begin(digit, bitrate)?;
        Ok(bus)
    }

    /// Ends what the adapter did before, then sets its speed and opens its channel.
    fn begin(&mut self, digit: usize, bitrate: u32) -> Result<(), BusError> {
        let speed = format!("S{digit}");
        if !self.end_session()? {
            return self.unheard(&[&speed, "O"]);
        }
        match self.command(&speed)? {
            // Who answers no command now will not do so later.
            None => return self.unheard(&["O"]),
            Some(Line::Refused) => {
                return Err(self.wrong(format_args!("the adapter refuses {bitrate} bit/s ({speed})")));
            }
            Some(_) => {}
        }
        if self.command("O")? == Some(Line::Refused) {
            return Err(self.wrong("the adapter does not open its channel (O)"));
        }
        if let Some(Line::Flags(flags)) = self.command("F")? {
            self.judge(flags);
            self.ask_at = Some(self.now() + ASKING);
        }
        Ok(())
    }

    /// Ends what an earlier program began; false where the adapter answers nothing.
    fn end_session(&mut self) -> Result<bool, BusError> {
        // The first two end half a command. A channel that is closed may refuse to be closed. The version
        // comes last: what is heard before it answers none of the commands that follow.
        self.out.extend(b"\r\rC\rV\r");
        let (end, mut answers) = (self.now() + ANSWER, false);
        while let Some(line) = self.hear(end)? {
            answers |= matches!(line, Line::Done | Line::Refused | Line::Version);
            if line == Line::Version {
                break;
            }
        }
        Ok(answers)
    }

    /// Gives a command and waits for its answer; `None` where none comes. What else comes is taken as always.
    fn command(&mut self, command: &str) -> Result<Option<Line>, BusError> {
        self.out.extend(command.bytes().chain([b'\r']));
        let end = self.now() + ANSWER;
        while let Some(line) = self.hear(end)? {
            match line {
                Line::Done | Line::Refused | Line::Flags(_) => return Ok(Some(line)),
                other => self.take(&other),
            }
        }
        Ok(None)
    }

    /// Gives commands to an adapter that does not answer.
    fn unheard(&mut self, commands: &[&str]) -> Result<(), BusError> {
        self.out.extend(commands.iter().flat_map(|command| command.bytes().chain([b'\r'])));
        self.drain()
    }

    /// The next line until `until`; only for the beginning, where nothing else waits.
    fn hear(&mut self, until: Micros) -> Result<Option<Line>, BusError> {
        loop {
            self.drain()?;
            let left = self.clock.left(until);
            // One byte after the other: what follows the line stays in the device.
            let mut byte = [0];
            if self.ready(left)? && self.read(&mut byte)? > 0 {
                if let Some(line) = self.lines.push(byte[0]) {
                    return Ok(Some(line));
                }
            } else if left.is_zero() {
                return Ok(None);
            }
        }
    }

    fn wrong(&self, what: impl std::fmt::Display) -> BusError {
        BusError::Io(format!("slcan:{}: {what}", self.name))
    }

    fn gone(&self, e: impl std::fmt::Display) -> BusError {
        self.wrong(format_args!("the device was removed or fails: {e}"))
    }

    /// Whether bytes wait, or may come while they are read.
    #[cfg(unix)]
    fn ready(&mut self, left: Duration) -> Result<bool, BusError> {
        readable(&self.port, left)
    }

    #[cfg(not(unix))]
    fn ready(&mut self, left: Duration) -> Result<bool, BusError> {
        self.port.set_read_timeout(left).map_err(|e| self.gone(e))?;
        Ok(true)
    }

    /// Writes what the device takes without waiting.
    fn drain(&mut self) -> Result<(), BusError> {
        while !self.out.is_empty() {
            match self.port.write(self.out.as_slices().0) {
                Ok(0) => break,
                Ok(taken) => drop(self.out.drain(..taken)),
                Err(e) if waits(e.kind()) => break,
                Err(e) => return Err(self.gone(e)),
            }
        }
        Ok(())
    }

    /// How many bytes came; 0 where none did in time.
    fn read(&self, buffer: &mut [u8]) -> Result<usize, BusError> {
        match self.port.read(buffer) {
            Ok(0) => Err(self.gone("end of file")),
            Ok(len) => Ok(len),
            Err(e) if waits(e.kind()) => Ok(0),
            Err(e) => Err(self.gone(e)),
        }
    }

    /// Takes what came; false where nothing did.
    fn fill(&mut self) -> Result<bool, BusError> {
        let mut buffer = [0; 512];
        let len = self.read(&mut buffer)?;
        for byte in buffer.iter().take(len) {
            if let Some(line) = self.lines.push(*byte) {
                self.take(&line);
            }
        }
        Ok(len > 0)
    }

    fn take(&mut self, line: &Line) {
        match line {
            Line::Frame(frame) => self.tell(Event::Frame(*frame)),
            Line::Flags(flags) => self.judge(*flags),
            Line::State(state) => self.enter(*state),
            Line::Lost { received, sent } => self.lost(*received, *sent),
            Line::Refused if std::mem::take(&mut self.forgiven) => {}
            Line::Refused if self.ask_at.is_some() => {
                self.refused = true;
                if self.asked.is_none() {
                    self.ask_at = Some(self.now());
                }
            }
            // The reason is unknown: the frame was not sent.
            Line::Refused => self.tell(Event::NotSent),
            Line::Done | Line::Version | Line::Other => {}
        }
    }

    fn judge(&mut self, flags: Flags) {
        self.asked = None;
        let refused = std::mem::take(&mut self.refused);
        self.lost(flags.overrun(), flags.not_sent());
        // A question just before the refusal may have taken the reason with it.
        let before = std::mem::replace(&mut self.before, flags);
        if flags.with(before).off(refused) {
            self.enter(State::Off);
        } else if refused && !flags.not_sent() && self.state != State::Off {
            self.tell(Event::NotSent);
        }
        // Flags are latched and cleared: they say that a controller went off the bus, never that it came
        // back.
        if self.state != State::Off {
            self.enter(if flags.passive() { State::Passive } else { State::Active });
        }
    }

    fn lost(&mut self, received: bool, sent: bool) {
        if received {
            self.tell(Event::Overrun);
        }
        if sent {
            self.tell(Event::NotSent);
        }
    }

    fn enter(&mut self, state: State) {
        match (std::mem::replace(&mut self.state, state), state) {
            (State::Active | State::Passive, State::Off) => self.tell(Event::BusOff),
            (State::Off, State::Active | State::Passive) => self.tell(Event::Restarted),
            (State::Active, State::Passive) => self.tell(Event::ErrorPassive),
            _ => {}
        }
    }

    fn tell(&mut self, event: Event) {
        self.inbox.push_back((self.now(), event));
    }

    /// Asks for the flags where it is time.
    fn ask(&mut self) {
        let now = self.now();
        if self.ask_at.is_some_and(|at| at <= now) {
            self.ask_at = Some(now + ASKING);
            self.asked.get_or_insert(now);
            self.out.extend(b"F\r");
        }
    }
}

/// Nothing is there yet, or a signal came between.
fn waits(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::TimedOut)
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // The first end is that of half a frame.
        let _ = self.port.write(b"\rC\r");
    }
}

impl Bus for Slcan {
    fn now(&self) -> Micros {
        self.clock.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.state == State::Off {
            return Err(BusError::Off);
        }
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
            self.ask();
            self.drain()?;
            if let Some(event) = self.inbox.pop_front() {
                return Ok(Some(event));
            }
            let next = self.ask_at.map_or(until, |at| at.min(until));
            let more = self.ready(self.clock.left(next))? && self.fill()?;
            if !more && self.asked.is_some_and(|at| self.now() > at + SILENCE) {
                return Err(self.gone(format_args!("no answer for {} s", SILENCE / 1_000_000)));
            }
            if !more && self.clock.left(until).is_zero() {
                return Ok(None);
            }
        }
    }

    fn flush(&mut self) {
        self.out.clear();
        let _ = self.port.discard_output_buffer();
        // Half a frame may have left: without its end the next frame, a stop, would be lost with it.
        self.out.push_back(b'\r');
        self.forgiven = true;
    }
}
