//! A driver's events, for the program's event log (crate `tracing`): changes, not every cycle.
//!
//! `error` where the arm is stopped by a cause, `warn` for what the driver notes and tolerates, `info` for
//! its phases, `debug` for the state of each drive. Without a listener, and in a cycle without a change, this
//! costs some comparisons.

use crate::cia402::State;
use crate::driver::{Cause, Driver, Note, Phase};
use powerball_controller::JointNumber;

/// Name of these events in RUST_LOG: the part of `powerball` that users know.
const EVENTS: &str = "powerball::bus";

/// The state that the events have reported so far.
#[derive(Debug)]
pub(super) struct Observed<const N: usize> {
    phase: Phase,
    states: [Option<State>; N],
    note: Option<Note>,
}

impl<const N: usize> Observed<N> {
    /// An observer that has not reported anything of `driver` yet.
    pub(super) fn of(driver: &Driver<N>) -> Self {
        Observed { phase: driver.phase(), states: states(driver), note: driver.notes().last().copied() }
    }

    /// Reports the changes since the last call.
    pub(super) fn compare(&mut self, driver: &Driver<N>) {
        self.notes(driver);
        let states = states(driver);
        if states != self.states {
            for (j, (before, now)) in self.states.iter().zip(&states).enumerate().filter(|(_, (a, b))| a != b)
            {
                if let Some(state) = now {
                    let joint = JointNumber::from_index(j).number();
                    tracing::debug!(target: EVENTS, joint, first = before.is_none(), "joint {joint}: the \
                        drive is {state}");
                }
            }
            self.states = states;
        }
        if driver.phase() != self.phase {
            self.phase = driver.phase();
            match driver.cause() {
                Some(cause) if self.phase == Phase::Faulted => {
                    tracing::error!(target: EVENTS, details = %driver.details(), "the arm was stopped: \
                        {cause}");
                }
                _ => {
                    tracing::info!(target: EVENTS, cycles = driver.counters().cycles, "the driver \
                        {}", self.phase)
                }
            }
        }
    }

    fn notes(&mut self, driver: &Driver<N>) {
        let last = driver.notes().last().copied();
        let known =
            |note: &Note| self.note.is_some_and(|last| (last.at, last.cause) == (note.at, note.cause));
        if last.as_ref().is_some_and(|note| !known(note)) {
            let new = driver.notes().position(known).map_or(0, |at| at + 1);
            for note in driver.notes().skip(new) {
                let bus_time = note.at as f64 * 1e-6;
                match &note.cause {
                    // Such a cause stops the start, or the caller accepted it.
                    what @ (Cause::WrongIdentity(..) | Cause::Sdo(..)) if driver.cause() != Some(what) => {
                        tracing::warn!(target: EVENTS, bus_time, "{what}: accepted");
                    }
                    cause => tracing::warn!(target: EVENTS, bus_time, "noted: {cause}"),
                }
            }
            self.note = last;
        }
    }
}

fn states<const N: usize>(driver: &Driver<N>) -> [Option<State>; N] {
    std::array::from_fn(|j| driver.joints()[j].status.map(|status| status.state()))
}
