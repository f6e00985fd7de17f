//! A driver on a bus, with the loop that connects them.

#[cfg(unix)]
use super::Watchdog;
use super::events::Observed;
use super::{Bus, BusError, Event, Interrupt, blocking};
use crate::canopen::client::Value;
use crate::canopen::objects::CONSUMER_HEARTBEAT;
use crate::canopen::{Frame, Micros, NodeId, nmt};
use crate::driver::{BusEvent, Cause, Driver, Phase, QueueFull, Refusal, Transmit};
use std::fmt;

/// For the arm to come to rest with closed brakes and without torque, µs.
const STOP: Micros = 5_000_000;

/// A [`Driver`] with the [`Bus`] of its arm.
///
/// However a program leaves it, by an error, a panic or a signal ([`Master::with_interrupt`]), the arm is
/// stopped: a master that is dropped while joints may have torque sends quick stop, closes the brakes, takes
/// the torque away and ends the drives' watch on it. If a program dies without leaving it (SIGKILL, an
/// abort), a second process can send the stop (`Master::with_watchdog`); a machine that loses its power sends
/// nothing, and then the drives' own watching stops them.
#[derive(Debug)]
pub struct Master<B: Bus, const N: usize> {
    driver: Driver<N>,
    bus: B,
    cycle: u64,
    reported: bool,
    observed: Observed<N>,
    interrupt: Interrupt,
    #[cfg(unix)]
    watchdog: Option<Watchdog>,
}

/// The result of a [`step`](Master::step).
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

/// The reason why the arm did not reach the requested state.
#[derive(Clone, Debug, PartialEq)]
pub enum ArmError {
    /// The driver does not do it.
    Refused(Refusal),
    /// The driver stopped the arm, with the drive's report of its error.
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
            ArmError::Slow(wanted, now) => {
                write!(f, "timeout: expected that the driver {wanted}, but it {now}")
            }
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
        let observed = Observed::of(&driver);
        Master {
            driver,
            bus,
            cycle: 0,
            reported: true,
            observed,
            interrupt: Interrupt::default(),
            #[cfg(unix)]
            watchdog: None,
        }
    }

    /// Adds a second process that stops the arm if this one dies. It ends once the arm rests.
    #[cfg(unix)]
    #[must_use]
    pub fn with_watchdog(mut self, watchdog: Watchdog) -> Self {
        self.watchdog = Some(watchdog);
        self
    }

    /// Lets signals stop this master: the stop is sent within 10 ms of a signal.
    #[must_use]
    pub fn with_interrupt(mut self, interrupt: Interrupt) -> Self {
        interrupt.guard(true);
        self.interrupt = interrupt;
        self
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

    /// The bus, for transfers that the driver does not make.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Waits for the next thing to do, at most until `until`, and does it.
    ///
    /// # Errors
    /// If the bus no longer exists. The driver handles a bus that is off or full.
    pub fn step(&mut self, until: Micros) -> Result<Moment, BusError> {
        let deadline = self.driver.deadline().min(until);
        let received = self.bus.receive(deadline)?;
        let mut out = Out { bus: &mut self.bus, wrong: None };
        let driver = &mut self.driver;
        match received {
            Some((at, Event::Frame(frame))) => driver.receive(&frame, at, &mut out),
            Some((at, Event::ErrorPassive)) => driver.event(BusEvent::ErrorPassive, at, &mut out),
            Some((at, Event::BusOff)) => driver.event(BusEvent::BusOff, at, &mut out),
            Some((at, Event::Overrun)) => driver.event(BusEvent::Overrun, at, &mut out),
            Some((at, Event::NotSent)) => driver.event(BusEvent::TransmitQueueFull, at, &mut out),
            Some((_, Event::Restarted)) | None => {}
        }
        let now = out.bus.now();
        if self.interrupt.is_asked() {
            driver.interrupt(now, &mut out);
        }
        driver.poll(now, &mut out);
        match out.wrong {
            Some(BusError::Off) => driver.event(BusEvent::BusOff, now, &mut out),
            Some(wrong) => return Err(wrong),
            None => {}
        }
        self.observed.compare(&self.driver);
        let cycle = self.driver.counters().cycles;
        if cycle != self.cycle {
            (self.cycle, self.reported) = (cycle, false);
            return Ok(Moment::Cycle);
        }
        if !self.reported && self.driver.cycle_complete() {
            self.reported = true;
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
        // The driver reads the drive's report of its error.
        let until = self.bus.now() + 300_000;
        while self.step(until)? != Moment::Over {}
        match self.driver.cause() {
            Some(cause) => {
                let cause = *cause;
                let others = self.driver.notes().filter(|note| note.cause != cause);
                let reported = self.driver.details().to_string();
                let way_out = matches!(cause, Cause::WrongIdentity(..)).then(|| {
                    "accept that explicitly (--accept-unverified), or correct the profile".to_string()
                });
                let reported: Vec<String> = (!reported.is_empty())
                    .then_some(reported)
                    .into_iter()
                    .chain(way_out)
                    .chain(others.map(|note| format!("also {}", note.cause)))
                    .collect();
                Err(ArmError::Stopped(cause, reported.join("; ")))
            }
            None => Ok(()),
        }
    }

    /// Stops the arm and waits until it stands with closed brakes and without torque.
    ///
    /// # Errors
    /// Those of [`wait_for`](Self::wait_for).
    pub fn stop(&mut self) -> Result<(), ArmError> {
        self.bring_to_rest()?;
        self.check()
    }

    fn bring_to_rest(&mut self) -> Result<(), ArmError> {
        let now = self.bus.now();
        let mut out = Out { bus: &mut self.bus, wrong: None };
        self.driver.stop(now, &mut out);
        let until = now + STOP;
        while !self.is_at_rest() {
            if self.step(until)? == Moment::Over {
                return Err(ArmError::Slow(Phase::Ready, self.driver.phase()));
            }
        }
        Ok(())
    }

    fn is_at_rest(&self) -> bool {
        matches!(self.driver.phase(), Phase::Ready | Phase::Idle | Phase::Faulted)
    }

    /// Ends the drives' watch on this master before it leaves, so that none of them treats its silence as an
    /// emergency. A node that does not answer is not changed.
    fn disarm_watch(&mut self) {
        // Off the bus no node receives it; and if there is another master, the nodes belong to it.
        let silent = matches!(self.driver.cause(), Some(Cause::BusOff | Cause::OtherMaster(_)));
        if self.driver.phase() == Phase::Idle || silent {
            return;
        }
        let nodes: Vec<NodeId> = self.driver.profile().joints.iter().map(|joint| joint.node).collect();
        for node in &nodes {
            let _ = self.bus.send(&nmt::Command::EnterPreOperational.frame(Some(*node)));
        }
        for node in nodes {
            let off = Value::number(0, 4);
            let _ = blocking::write_within(&mut self.bus, node, CONSUMER_HEARTBEAT, off, DISARM);
        }
    }
}

/// For each drive's answer when the watch is disarmed, µs.
const DISARM: Micros = 20_000;

impl<B: Bus, const N: usize> Drop for Master<B, N> {
    fn drop(&mut self) {
        // If this fails, the drives stop themselves, as they watch the master.
        if self.is_at_rest() || self.bring_to_rest().is_ok() {
            self.disarm_watch();
            #[cfg(unix)]
            if let Some(watchdog) = self.watchdog.take() {
                watchdog.dismiss();
            }
        }
        self.interrupt.guard(false);
    }
}
