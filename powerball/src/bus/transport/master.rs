//! A driver on a bus: the loop that neither of them has.

use super::{Bus, BusError, Event};
use crate::bus::canopen::{Frame, Micros};
use crate::bus::driver::{BusEvent, Cause, Driver, Phase, QueueFull, Refusal, Transmit};
use std::fmt;

/// A [`Driver`] with the [`Bus`] that its arm is on.
#[derive(Debug)]
pub struct Master<B, const N: usize> {
    driver: Driver<N>,
    bus: B,
    cycle: u64,
    told: bool,
}

/// What has happened in a [`step`](Master::step).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// A SYNC has left: new set-points may be given.
    Cycle,
    /// All process data of the cycle is there.
    Data,
    /// Something else, or nothing yet.
    Other,
    /// The time is over.
    Over,
}

/// Why an arm is not where it was asked to be.
#[derive(Clone, Debug, PartialEq)]
pub enum ArmError {
    /// The driver does not do it.
    Refused(Refusal),
    /// The driver stopped the arm, with what the drive tells of its error.
    Stopped(Cause, String),
    /// The driver did not come to the phase in time.
    Slow(Phase, Phase),
    /// The bus itself.
    Bus(BusError),
}

impl fmt::Display for ArmError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ArmError::Refused(refusal) => refusal.fmt(f),
            ArmError::Stopped(cause, details) if details.is_empty() => {
                write!(f, "the arm was stopped: {cause}")
            }
            ArmError::Stopped(cause, details) => write!(f, "the arm was stopped: {cause}; {details}"),
            ArmError::Slow(wanted, now) => write!(f, "the driver {now}, and not soon enough {wanted}"),
            ArmError::Bus(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for ArmError {}

impl From<Refusal> for ArmError {
    fn from(refusal: Refusal) -> Self {
        ArmError::Refused(refusal)
    }
}

impl From<BusError> for ArmError {
    fn from(e: BusError) -> Self {
        ArmError::Bus(e)
    }
}

/// The bus as the driver's way out, and what went wrong on it.
struct Out<'a, B> {
    bus: &'a mut B,
    wrong: Option<BusError>,
}

impl<B: Bus> Transmit for Out<'_, B> {
    fn send(&mut self, frame: Frame) -> Result<(), QueueFull> {
        self.bus.send(&frame).map_err(|e| {
            if e != BusError::Full {
                self.wrong = Some(e);
            }
            QueueFull
        })
    }

    fn discard_queued(&mut self) {
        self.bus.flush();
    }
}

impl<B: Bus, const N: usize> Master<B, N> {
    /// A driver and the bus of its arm.
    pub fn new(driver: Driver<N>, bus: B) -> Self {
        Master { driver, bus, cycle: 0, told: true }
    }

    /// The driver.
    pub fn driver(&self) -> &Driver<N> {
        &self.driver
    }

    /// The driver, to start, enable or acknowledge it, or to give it set-points.
    pub fn driver_mut(&mut self) -> &mut Driver<N> {
        &mut self.driver
    }

    /// The bus.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// The bus, for what the driver does not do.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Waits for the next thing to do, at most until `until`, and does it.
    ///
    /// # Errors
    /// Where the bus is gone. A bus that is off or full is the driver's to judge.
    pub fn step(&mut self, until: Micros) -> Result<Moment, BusError> {
        let deadline = self.driver.deadline().min(until);
        let received = self.bus.receive(deadline)?;
        let mut out = Out { bus: &mut self.bus, wrong: None };
        let driver = &mut self.driver;
        match received {
            Some((at, Event::Frame(frame))) => driver.receive(&frame, at, &mut out),
            Some((at, Event::ErrorPassive)) => driver.event(BusEvent::ErrorPassive, at, &mut out),
            Some((at, Event::BusOff)) => driver.event(BusEvent::BusOff, at, &mut out),
            Some((_, Event::Restarted)) | None => {}
        }
        let now = out.bus.now();
        driver.poll(now, &mut out);
        match out.wrong {
            Some(BusError::Off) => driver.event(BusEvent::BusOff, now, &mut out),
            Some(wrong) => return Err(wrong),
            None => {}
        }
        let cycle = self.driver.counters().cycles;
        if cycle != self.cycle {
            (self.cycle, self.told) = (cycle, false);
            return Ok(Moment::Cycle);
        }
        if !self.told && self.driver.cycle_complete() {
            self.told = true;
            return Ok(Moment::Data);
        }
        Ok(if received.is_none() && self.bus.now() >= until { Moment::Over } else { Moment::Other })
    }

    /// Runs until the driver is in a phase.
    ///
    /// # Errors
    /// Where the arm is stopped by a cause, the time is over, or the bus is gone.
    pub fn wait_for(&mut self, phase: Phase, timeout: Micros) -> Result<(), ArmError> {
        let until = self.bus.now() + timeout;
        while self.driver.phase() != phase {
            let over = self.step(until)? == Moment::Over;
            if phase != Phase::Faulted {
                self.check()?;
            }
            if over {
                return Err(ArmError::Slow(phase, self.driver.phase()));
            }
        }
        Ok(())
    }

    /// An error where the arm is stopped by a cause.
    ///
    /// # Errors
    /// With the latched cause.
    pub fn check(&mut self) -> Result<(), ArmError> {
        if self.driver.phase() != Phase::Faulted {
            return Ok(());
        }
        // The driver reads what the drive tells of its error.
        let until = self.bus.now() + 300_000;
        while self.step(until)? != Moment::Over {}
        match self.driver.cause() {
            Some(cause) => Err(ArmError::Stopped(*cause, self.driver.details().to_string())),
            None => Ok(()),
        }
    }

    /// Stops the arm and waits until it stands with closed brakes and without torque.
    ///
    /// # Errors
    /// As [`wait_for`](Self::wait_for).
    pub fn stop(&mut self) -> Result<(), ArmError> {
        let now = self.bus.now();
        let mut out = Out { bus: &mut self.bus, wrong: None };
        self.driver.stop(now, &mut out);
        let until = now + 5_000_000;
        while !matches!(self.driver.phase(), Phase::Ready | Phase::Idle | Phase::Faulted) {
            if self.step(until)? == Moment::Over {
                return Err(ArmError::Slow(Phase::Ready, self.driver.phase()));
            }
        }
        self.check()
    }
}
