//! Ways to a CAN bus: in memory, SocketCAN, serial adapters, and the UDP multicast of python-can.
//!
//! All of them are a [`Bus`]: frames out, frames in, and a clock that goes with them. The clock belongs to
//! the bus, so that a bus in memory can run faster than real time.

pub mod blocking;
mod events;
mod interrupt;
mod master;
mod memory;
#[cfg(unix)]
pub mod msgpack;
#[cfg(target_os = "linux")]
pub mod realtime;
mod slcan;
#[cfg(all(target_os = "linux", feature = "socketcan"))]
mod socketcan;
#[cfg(unix)]
mod udp;
mod url;
#[cfg(unix)]
mod watchdog;

pub use interrupt::{Interrupt, file_limit_is_an_error};
pub use master::{ArmError, Master, Moment};
pub use memory::{Memory, Peer};
pub use slcan::Slcan;
#[cfg(all(target_os = "linux", feature = "socketcan"))]
pub use socketcan::SocketCan;
#[cfg(unix)]
pub use udp::UdpMulticast;
pub use url::{BusUrl, Interface, UrlError};
#[cfg(unix)]
pub use watchdog::Watchdog;

use crate::canopen::{Frame, Micros};
use std::fmt;
use std::time::{Duration, Instant};

/// An event of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame of another node.
    Frame(Frame),
    /// The controller counts many errors and no longer drives the bus dominantly.
    ErrorPassive,
    /// The controller has left the bus.
    BusOff,
    /// The controller is on the bus again.
    Restarted,
    /// The receive buffer of the controller or the adapter was full: frames are lost.
    Overrun,
    /// A frame that was taken could not be sent.
    NotSent,
}

/// The reason why a bus failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BusError {
    /// Too many frames wait to be sent: this one was not taken.
    #[error("the bus takes no more frames: its transmit queue is full")]
    Full,
    /// The controller is off the bus.
    #[error("the controller is off the bus")]
    Off,
    /// An error of the system: what was tried, and the system's message.
    #[error("{0}")]
    Io(String),
}

impl BusError {
    /// An error with what was tried and the system's message.
    fn io(what: impl fmt::Display, error: impl fmt::Display) -> BusError {
        BusError::Io(format!("{what}: {error}"))
    }
}

/// One participant's side of a CAN bus.
pub trait Bus: fmt::Debug {
    /// Time on the bus's clock, µs since it was opened.
    fn now(&self) -> Micros;

    /// Gives a frame to the bus.
    ///
    /// # Errors
    /// [`BusError::Full`] and [`BusError::Off`] where the frame was not taken.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// The next event with its time, or `None` once the clock reaches `until`. Returns at once where an event
    /// waits.
    ///
    /// # Errors
    /// [`BusError::Io`] where the bus is gone.
    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError>;

    /// Throws away what waits to be sent, as far as the system lets it be reached.
    fn flush(&mut self);
}

impl<B: Bus + ?Sized> Bus for Box<B> {
    fn now(&self) -> Micros {
        (**self).now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        (**self).receive(until)
    }

    fn flush(&mut self) {
        (**self).flush();
    }
}

impl<B: Bus + ?Sized> Bus for &mut B {
    fn now(&self) -> Micros {
        (**self).now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        (**self).receive(until)
    }

    fn flush(&mut self) {
        (**self).flush();
    }
}

/// Opens a bus with other machines or programs on it.
///
/// # Errors
/// Where the system has no such bus, and for [`BusUrl::Virtual`], which has no one on it until an arm is put
/// there.
pub fn open(url: &BusUrl) -> Result<Box<dyn Bus>, BusError> {
    match url {
        BusUrl::Virtual => Err(BusError::Io(
            "virtual: this bus exists within one program only; give one that other programs reach"
                .to_string(),
        )),
        #[cfg(all(target_os = "linux", feature = "socketcan"))]
        BusUrl::SocketCan(interface) => Ok(Box::new(SocketCan::open(interface)?)),
        BusUrl::Slcan(device, bitrate) => Ok(Box::new(Slcan::open(device, *bitrate)?)),
        #[cfg(unix)]
        BusUrl::Udp(group, interface) => Ok(Box::new(UdpMulticast::open_on(*group, interface.as_ref())?)),
        #[allow(unreachable_patterns)]
        other => Err(BusError::Io(format!("{other}: this build has no such bus"))),
    }
}

/// The clock of a bus in real time.
#[derive(Clone, Copy, Debug)]
struct Clock(Instant);

impl Clock {
    fn start() -> Clock {
        Clock(Instant::now())
    }

    fn now(&self) -> Micros {
        self.0.elapsed().as_micros() as Micros
    }

    /// Time from now until a time of this clock.
    fn left(&self, until: Micros) -> Duration {
        Duration::from_micros(until.saturating_sub(self.now()))
    }
}

/// Waits until `file` can be read; false once `left` has passed. Unlike a socket's own timeout this is not
/// rounded to the kernel's ticks.
#[cfg(unix)]
fn readable(file: &impl std::os::fd::AsFd, left: Duration) -> Result<bool, BusError> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let timeout = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
    match poll(&mut [PollFd::new(file, PollFlags::IN)], Some(&timeout)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(e) => Err(BusError::io("waiting for the bus", e)),
    }
}
