//! The driver on a bus, with the virtual arm at its other end: lost frames, interrupts, panics.

#![allow(clippy::unwrap_used, clippy::panic)]

use powerball::bus::canopen::{Frame, Micros};
use powerball::bus::cia402::State;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Cause, ControlMode};
use powerball::bus::driver::{Driver, Phase};
use powerball::bus::transport::{ArmError, Bus, BusError, Event, Interrupt, Master, Memory, Moment};
use powerball::virtual_arm::{VirtualArm, lwa4p};

fn bus() -> Memory<VirtualArm> {
    let mut setup = lwa4p::setup([0.1; 6], 1).unwrap();
    setup.modules.iter_mut().for_each(|module| module.commutated = true);
    Memory::new(VirtualArm::new(setup).unwrap(), LWA4P.bitrate)
}

/// A master whose joints all move.
fn moving<B: Bus>(bus: B) -> Master<B, 6> {
    let mut master = Master::new(Driver::new(LWA4P).unwrap(), bus);
    master.driver_mut().start(ControlMode::Velocity, false).unwrap();
    master.wait_for(Phase::Ready, 20_000_000).unwrap();
    master.driver_mut().enable().unwrap();
    master.wait_for(Phase::Running, 20_000_000).unwrap();
    fly(&mut master, 100);
    master
}

fn fly<B: Bus>(master: &mut Master<B, 6>, cycles: u64) {
    let end = master.driver().counters().cycles + cycles;
    while master.driver().counters().cycles < end && master.driver().phase() == Phase::Running {
        if master.step(Micros::MAX).unwrap() == Moment::Cycle {
            let velocity = master.driver().joints().map(|joint| (joint.velocity + 0.01).min(0.2));
            let _ = master.driver_mut().set(&velocity);
        }
    }
}

fn rests(bus: &Memory<VirtualArm>) {
    let arm = bus.peer();
    for (j, node) in arm.nodes().iter().enumerate() {
        assert!(node.brake_closed() && !node.state().has_torque(), "joint {}: {}", j + 1, node.state());
        assert!(arm.simulation().velocity(j).abs() < 1e-3);
        assert_ne!(node.state(), State::Fault);
        // Nothing was missed by the drive: no emergency stands in its error history.
        let history = powerball::bus::canopen::Object::new(0x1003, 0);
        assert_eq!(node.dictionary().get(history), 0, "joint {}", j + 1);
    }
}

/// A bus whose controller reports something in addition.
#[derive(Debug)]
struct Telling<B>(B, Option<Event>);

impl<B: Bus> Bus for Telling<B> {
    fn now(&self) -> Micros {
        self.0.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.0.send(frame)
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        match self.1.take() {
            Some(event) => Ok(Some((self.now(), event))),
            None => self.0.receive(until),
        }
    }

    fn flush(&mut self) {
        self.0.flush();
    }
}

#[test]
fn lost_frames_are_counted_and_one_that_was_not_sent_stops_the_arm() {
    let mut master = moving(Telling(bus(), None));
    master.bus_mut().1 = Some(Event::Overrun);
    fly(&mut master, 10);
    assert_eq!((master.driver().phase(), master.driver().counters().overruns), (Phase::Running, 1));
    master.bus_mut().1 = Some(Event::NotSent);
    fly(&mut master, 10);
    assert_eq!(master.driver().cause(), Some(&Cause::TransmitQueueFull));
}

#[test]
fn a_master_that_is_dropped_stops_the_arm_and_leaves_no_emergency() {
    let mut bus = bus();
    drop(moving(&mut bus));
    rests(&bus);
    // Long after the drives would have missed its heartbeat.
    let until = bus.now() + 1_000_000;
    while bus.now() < until {
        bus.receive(until).unwrap();
    }
    rests(&bus);
}

#[test]
fn a_panic_stops_the_arm() {
    let mut bus = bus();
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _master = moving(&mut bus);
        panic!("of the caller");
    }));
    assert!(panicked.is_err());
    rests(&bus);
}

/// The quick stop leaves with the next step, at most 10 ms later; asking twice does not cut it short.
#[test]
fn an_interrupt_is_a_latched_stop() {
    let mut bus = bus();
    let interrupt = Interrupt::default();
    let mut master = moving(&mut bus).with_interrupt(interrupt.clone());
    interrupt.ask();
    let asked = master.bus().now();
    while master.driver().phase() != Phase::Stopping {
        master.step(Micros::MAX).unwrap();
    }
    assert!(master.bus().now() - asked <= 10_000);
    interrupt.ask();
    let reported = master.wait_for(Phase::Running, 5_000_000).unwrap_err();
    assert!(matches!(reported, ArmError::Stopped(Cause::Interrupted, _)), "{reported}");
    assert!(master.driver_mut().enable().is_err());
    drop(master);
    rests(&bus);
}
