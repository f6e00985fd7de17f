//! SocketCAN: the CAN interfaces of Linux.

use super::{Bus, BusError, Clock, Event, readable};
use crate::canopen::{Frame, Micros};
use embedded_can::Frame as _;
use socketcan::{CanFrame, CanSocket, Socket, SocketOptions};
use std::fmt;
use std::io::ErrorKind;
use std::time::{Duration, SystemTime};

/// Classes of error frames, as linux/can/error.h numbers them.
const CONTROLLER: u32 = 0x004;
const BUS_OFF: u32 = 0x040;
const RESTARTED: u32 = 0x100;
/// In the second byte of an error frame of the controller: receiver or transmitter is error-passive.
const PASSIVE: u8 = 0x30;
/// There too: received frames were lost, or frames to be sent.
const RECEIVED_LOST: u8 = 0x01;
const SENT_LOST: u8 = 0x02;
/// The kernel's queue is full.
const ENOBUFS: i32 = 105;
/// The interface is down, which it is after bus-off without a restart.
const ENETDOWN: i32 = 100;

/// A frame that has waited for longer carries a stamp of a clock that was set meanwhile.
const OLDEST: Duration = Duration::from_secs(1);

/// A CAN interface of Linux, classic frames.
pub struct SocketCan {
    socket: CanSocket,
    interface: String,
    clock: Clock,
}

impl fmt::Debug for SocketCan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SocketCan").field("interface", &self.interface).finish_non_exhaustive()
    }
}

impl SocketCan {
    /// Opens an interface that is up. Its bit rate and its restart after bus-off are the system's to set.
    ///
    /// # Errors
    /// Where there is no such interface, or no permission.
    pub fn open(interface: &str) -> Result<Self, BusError> {
        let failed = |e| BusError::io(format_args!("socketcan:{interface}"), e);
        let socket = CanSocket::open(interface).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        socket.set_error_filter(CONTROLLER | BUS_OFF | RESTARTED).map_err(failed)?;
        socket.set_recv_timestamp(true).map_err(failed)?;
        Ok(SocketCan { socket, interface: interface.to_string(), clock: Clock::start() })
    }

    /// When the kernel received a frame, on this bus's clock. Its stamp is of the system's clock, which may
    /// be set: an age that makes no sense is not believed.
    fn at(&self, stamp: SystemTime) -> Micros {
        let age = SystemTime::now().duration_since(stamp).unwrap_or_default();
        let age = if age < OLDEST { age.as_micros() as Micros } else { 0 };
        self.now().saturating_sub(age)
    }

    fn failed(&self, e: &std::io::Error) -> BusError {
        BusError::io(format_args!("socketcan:{}", self.interface), e)
    }
}

/// The event for a driver in an error frame with these class bits and data.
fn event(class: u32, data: &[u8]) -> Option<Event> {
    let controller = |bits| class & CONTROLLER != 0 && data.get(1).is_some_and(|status| status & bits != 0);
    if class & BUS_OFF != 0 {
        Some(Event::BusOff)
    } else if class & RESTARTED != 0 {
        Some(Event::Restarted)
    } else if controller(SENT_LOST) {
        Some(Event::NotSent)
    } else if controller(PASSIVE) {
        Some(Event::ErrorPassive)
    } else if controller(RECEIVED_LOST) {
        Some(Event::Overrun)
    } else {
        None
    }
}

impl Bus for SocketCan {
    fn now(&self) -> Micros {
        self.clock.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let Some(out) = CanFrame::new(frame.id(), frame.bytes()) else { return Ok(()) };
        match self.socket.write_frame(&out) {
            Ok(()) => Ok(()),
            Err(e) if e.kind() == ErrorKind::WouldBlock || e.raw_os_error() == Some(ENOBUFS) => {
                Err(BusError::Full)
            }
            Err(e) if e.raw_os_error() == Some(ENETDOWN) => Err(BusError::Off),
            Err(e) => Err(self.failed(&e)),
        }
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        loop {
            match self.socket.read_frame_with_timestamp() {
                Ok((CanFrame::Data(data), stamp)) => {
                    if let Some(frame) = Frame::new(data.id(), data.data()) {
                        return Ok(Some((self.at(stamp), Event::Frame(frame))));
                    }
                }
                Ok((CanFrame::Error(error), _)) => {
                    if let Some(event) = event(error.error_bits(), error.data()) {
                        return Ok(Some((self.now(), event)));
                    }
                }
                Ok((CanFrame::Remote(_), _)) => {}
                Err(e) if e.kind() == ErrorKind::WouldBlock => {
                    let left = self.clock.left(until);
                    if left.is_zero() {
                        return Ok(None);
                    }
                    readable(&self.socket, left)?;
                }
                Err(e) if e.raw_os_error() == Some(ENETDOWN) => return Ok(Some((self.now(), Event::BusOff))),
                Err(e) => return Err(self.failed(&e)),
            }
        }
    }

    /// The kernel's queue cannot be cleared from here: its frames are still sent, unless the interface is
    /// off.
    fn flush(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_frames_say_what_a_driver_must_know() {
        assert_eq!(event(BUS_OFF, &[0; 8]), Some(Event::BusOff));
        assert_eq!(event(RESTARTED, &[0; 8]), Some(Event::Restarted));
        assert_eq!(event(CONTROLLER, &[0, 0x20, 0, 0, 0, 0, 0, 0]), Some(Event::ErrorPassive));
        assert_eq!(event(CONTROLLER, &[0, 0x01, 0, 0, 0, 0, 0, 0]), Some(Event::Overrun));
        assert_eq!(event(CONTROLLER, &[0, 0x22, 0, 0, 0, 0, 0, 0]), Some(Event::NotSent));
        assert_eq!(event(CONTROLLER, &[0, 0x08, 0, 0, 0, 0, 0, 0]), None);
        assert_eq!(event(0x002, &[0; 8]), None);
    }

    #[test]
    fn an_interface_that_is_not_there_is_named() {
        let error = SocketCan::open("nocan7").unwrap_err().to_string();
        assert!(error.contains("socketcan:nocan7"), "{error}");
    }
}
