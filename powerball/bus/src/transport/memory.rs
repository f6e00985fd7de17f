//! A bus in memory, on a clock of its own.
//!
//! Frames take the time that they take on a wire with the most stuffing, the lowest identifier goes first,
//! and time passes only while a caller waits. The same calls give the same events at the same times,
//! always.

use super::{Bus, BusError, Event};
use crate::canopen::{Frame, Micros};
use crate::driver::budget::worst_bits;
use std::collections::VecDeque;
use std::fmt;

/// Number of frames that may wait on one side: like SocketCAN's default queue, enough for a cycle of six
/// drives.
const QUEUE: usize = 32;

/// The other end of the bus: one or many nodes.
pub trait Peer: fmt::Debug {
    /// A frame from the wire at time `now`.
    fn receive(&mut self, frame: &Frame, now: Micros);

    /// Time has reached `now`.
    fn advance(&mut self, now: Micros);

    /// When the peer next wants [`advance`](Self::advance).
    fn wake(&self) -> Micros;

    /// The next frame that it sends, if any.
    fn transmit(&mut self) -> Option<Frame>;
}

/// A frame that waits for the wire, or is on it.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: Frame,
    from_peer: bool,
}

/// A bus with a [`Peer`] on the other end.
#[derive(Clone, Debug)]
pub struct Memory<P> {
    peer: P,
    now: Micros,
    /// µs for one bit; 0 for a wire that takes no time.
    bit_time: f64,
    waiting: Vec<Waiting>,
    on_wire: Option<(Micros, Waiting)>,
    inbox: VecDeque<(Micros, Event)>,
    off: bool,
}

impl<P: Peer> Memory<P> {
    /// A bus of `bitrate` bits a second; 0 for a wire that takes no time.
    pub fn new(peer: P, bitrate: u32) -> Self {
        let bit_time = if bitrate == 0 { 0.0 } else { 1e6 / f64::from(bitrate) };
        Memory {
            peer,
            now: 0,
            bit_time,
            waiting: Vec::new(),
            on_wire: None,
            inbox: VecDeque::new(),
            off: false,
        }
    }

    /// The other end.
    pub fn peer(&self) -> &P {
        &self.peer
    }

    /// The other end, to do something to it.
    pub fn peer_mut(&mut self) -> &mut P {
        &mut self.peer
    }

    /// Takes this side off the bus, or puts it on again; what waited is lost.
    pub fn set_off(&mut self, off: bool) {
        if self.off != off {
            self.off = off;
            self.flush();
            self.inbox.push_back((self.now, if off { Event::BusOff } else { Event::Restarted }));
        }
    }

    /// Advances to the next event, at most until `until`: a frame arrives, or the peer wakes.
    fn step(&mut self, until: Micros) {
        while let Some(frame) = self.peer.transmit() {
            self.waiting.push(Waiting { frame, from_peer: true });
        }
        if self.on_wire.is_none() {
            // Arbitration: the lowest identifier; the oldest where several are equal.
            let next = (0..self.waiting.len()).min_by_key(|k| self.waiting[*k].frame.raw_id());
            self.on_wire = next.map(|k| {
                let waiting = self.waiting.remove(k);
                let bits = worst_bits(waiting.frame.bytes().len());
                (self.now + (f64::from(bits) * self.bit_time).round() as Micros, waiting)
            });
        }
        let arrival = self.on_wire.as_ref().map_or(Micros::MAX, |(at, _)| *at);
        self.now = self.now.max(until.min(arrival).min(self.peer.wake()));
        if self.peer.wake() <= self.now {
            self.peer.advance(self.now);
        }
        if arrival <= self.now
            && let Some((at, Waiting { frame, from_peer })) = self.on_wire.take()
        {
            if !from_peer {
                self.peer.receive(&frame, at);
            } else if !self.off {
                self.inbox.push_back((at, Event::Frame(frame)));
            }
        }
    }
}

impl<P: Peer> Bus for Memory<P> {
    fn now(&self) -> Micros {
        self.now
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.off {
            return Err(BusError::Off);
        }
        if self.waiting.iter().filter(|w| !w.from_peer).count() >= QUEUE {
            return Err(BusError::Full);
        }
        self.waiting.push(Waiting { frame: *frame, from_peer: false });
        Ok(())
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        loop {
            if let Some(event) = self.inbox.pop_front() {
                return Ok(Some(event));
            }
            if self.now >= until {
                return Ok(None);
            }
            self.step(until);
        }
    }

    fn flush(&mut self) {
        self.waiting.retain(|w| w.from_peer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers every frame with its identifier plus one, and says something every millisecond.
    #[derive(Debug, Default)]
    struct Echo {
        out: VecDeque<Frame>,
        ticks: Micros,
        heard: Vec<(Micros, u16)>,
    }

    impl Peer for Echo {
        fn receive(&mut self, frame: &Frame, now: Micros) {
            self.heard.push((now, frame.raw_id()));
            self.out.extend(Frame::from_raw(frame.raw_id() + 1, frame.bytes()));
        }

        fn advance(&mut self, now: Micros) {
            self.ticks = now / 1000 + 1;
        }

        fn wake(&self) -> Micros {
            self.ticks * 1000
        }

        fn transmit(&mut self) -> Option<Frame> {
            self.out.pop_front()
        }
    }

    fn frame(id: u16, len: usize) -> Frame {
        Frame::from_raw(id, &[0; 8][..len]).unwrap()
    }

    #[test]
    fn the_lowest_identifier_goes_first_and_frames_take_their_time() {
        let mut bus = Memory::new(Echo::default(), 500_000);
        for id in [0x300, 0x100, 0x200] {
            bus.send(&frame(id, 8)).unwrap();
        }
        let mut got = Vec::new();
        while let Some((at, Event::Frame(frame))) = bus.receive(10_000).unwrap() {
            got.push((at, frame.raw_id()));
        }
        assert_eq!(bus.peer().heard.iter().map(|h| h.1).collect::<Vec<_>>(), [0x100, 0x200, 0x300]);
        // An answer waits for the frame that is on the wire, and wins over what waits with it.
        assert_eq!(got.iter().map(|g| g.1).collect::<Vec<_>>(), [0x101, 0x201, 0x301]);
        let one = worst_bits(8) as Micros * 2;
        assert_eq!(bus.peer().heard[0].0, one);
        assert_eq!(got[2].0, 6 * one);
        assert_eq!(bus.now(), 10_000);
    }

    #[test]
    fn a_full_queue_says_so_and_a_flush_empties_it() {
        let mut bus = Memory::new(Echo::default(), 500_000);
        let taken = (0..100).take_while(|_| bus.send(&frame(0x100, 8)).is_ok()).count();
        assert_eq!((taken, bus.send(&frame(0x100, 8))), (QUEUE, Err(BusError::Full)));
        bus.flush();
        assert_eq!(bus.receive(5_000).unwrap(), None);
        assert!(bus.peer().heard.is_empty());
    }

    #[test]
    fn off_the_bus_nothing_goes_and_nothing_comes() {
        let mut bus = Memory::new(Echo::default(), 500_000);
        bus.send(&frame(0x100, 8)).unwrap();
        bus.set_off(true);
        assert_eq!(bus.receive(5_000).unwrap(), Some((0, Event::BusOff)));
        assert_eq!(bus.send(&frame(0x100, 8)), Err(BusError::Off));
        assert_eq!(bus.receive(5_000).unwrap(), None);
        bus.set_off(false);
        bus.send(&frame(0x100, 0)).unwrap();
        assert_eq!(bus.receive(9_000).unwrap(), Some((5_000, Event::Restarted)));
        assert!(matches!(bus.receive(9_000).unwrap(), Some((_, Event::Frame(_)))));
    }
}
