//! What the driver asks of a transport, and what a transport tells it.

use crate::bus::canopen::Frame;

/// The transport's queue holds no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueFull;

/// The sending side of a transport. Nothing here blocks.
pub trait Transmit {
    /// Queues `frame`.
    ///
    /// # Errors
    /// [`QueueFull`] where it could not be queued; the frame is lost then.
    fn send(&mut self, frame: Frame) -> Result<(), QueueFull>;

    /// Throws away what is queued and not yet on the bus. Called before a stop: no set-point may leave after
    /// it.
    fn discard_queued(&mut self);
}

/// What a transport tells of its controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BusEvent {
    /// The controller is error passive: a warning.
    ErrorPassive,
    /// The controller is off the bus. It must not be restarted into motion: the driver is silent until it is
    /// acknowledged.
    BusOff,
    /// A frame that was queued could not be sent.
    TransmitQueueFull,
}
