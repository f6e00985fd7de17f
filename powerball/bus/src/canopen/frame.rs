//! One classic CAN frame with an 11-bit identifier: all that CANopen on this arm uses.

use core::fmt;
use embedded_can::{Id, StandardId};

/// A data frame: 11-bit identifier and up to 8 bytes. Bytes behind its length are zero, so that equal frames
/// compare equal.
///
/// Remote and extended frames cannot be made: CiA 301 advises against the former, and the arm knows none of
/// the latter.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// A frame with identifier `id` (at most 0x7FF) and `data` (at most 8 bytes), or `None` where either is
    /// too large.
    pub fn from_raw(id: u16, data: &[u8]) -> Option<Frame> {
        if id > 0x7FF {
            return None;
        }
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Frame { id, len: data.len() as u8, data: bytes })
    }

    /// Another crate's frame as this one; `None` where it is extended or remote.
    pub fn from_can(frame: &impl embedded_can::Frame) -> Option<Frame> {
        match frame.id() {
            Id::Standard(id) if frame.is_data_frame() => Frame::from_raw(id.as_raw(), frame.data()),
            _ => None,
        }
    }

    /// Converts this frame to the type of another crate; `None` if that crate refuses it.
    pub fn to_can<F: embedded_can::Frame>(&self) -> Option<F> {
        F::new(StandardId::new(self.id)?, self.bytes())
    }

    /// A frame of a length known when compiling; the identifier comes from [`super::cob`] and is masked to 11
    /// bits.
    pub(crate) const fn fixed<const L: usize>(id: u16, data: [u8; L]) -> Frame {
        const { assert!(L <= 8, "a CAN frame holds 8 bytes") };
        let mut bytes = [0; 8];
        let mut i = 0;
        while i < L {
            bytes[i] = data[i];
            i += 1;
        }
        Frame { id: id & 0x7FF, len: L as u8, data: bytes }
    }

    /// Identifier, 0 … 0x7FF.
    pub const fn raw_id(&self) -> u16 {
        self.id
    }

    /// The frame's bytes.
    pub fn bytes(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// The frame with only its first `len` bytes.
    #[must_use]
    pub fn truncated(&self, len: usize) -> Frame {
        let mut short = *self;
        short.len = short.len.min(len.min(8) as u8);
        short.data.iter_mut().skip(usize::from(short.len)).for_each(|b| *b = 0);
        short
    }
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        match id.into() {
            Id::Standard(id) => Frame::from_raw(id.as_raw(), data),
            Id::Extended(_) => None,
        }
    }

    /// Always `None`: there are no remote frames here.
    fn new_remote(_: impl Into<Id>, _: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        Id::Standard(StandardId::new(self.id).unwrap_or(StandardId::MAX))
    }

    fn dlc(&self) -> usize {
        usize::from(self.len)
    }

    fn data(&self) -> &[u8] {
        self.bytes()
    }
}

/// The text of `candump` and `cansend`: `185#4002F401`.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:03X}#", self.id)?;
        self.bytes().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, Frame as _};

    #[test]
    fn only_what_fits_becomes_a_frame() {
        assert!(Frame::from_raw(0x7FF, &[0; 8]).is_some());
        assert!(Frame::from_raw(0x800, &[]).is_none());
        assert!(Frame::from_raw(0, &[0; 9]).is_none());
        assert!(Frame::new(ExtendedId::ZERO, &[]).is_none());
        assert!(Frame::new_remote(StandardId::ZERO, 0).is_none());
    }

    #[test]
    fn shows_as_candump_does() {
        let frame = Frame::from_raw(0x185, &[0x40, 0x02]).unwrap();
        assert_eq!(frame.to_string(), "185#4002");
        assert_eq!(frame.id(), Id::Standard(StandardId::new(0x185).unwrap()));
        assert_eq!((frame.dlc(), frame.data()), (2, &[0x40, 0x02][..]));
        assert_eq!(Frame::from_can(&frame), Some(frame));
        assert_eq!(frame.to_can(), Some(frame));
    }

    #[test]
    fn a_truncated_frame_equals_a_short_one() {
        let frame = Frame::fixed(0x185, [1, 2, 3]);
        assert_eq!(frame.truncated(2), Frame::fixed(0x185, [1, 2]));
        assert_eq!(frame.truncated(7), frame);
    }
}
