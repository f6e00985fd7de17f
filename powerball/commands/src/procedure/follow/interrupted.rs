//! A run that is asked to end, at every moment of it: the frames that are sent then, and the state of the
//! arm.

use super::tests::{master_on, numeric, parts, path, setup};
use super::*;
use powerball_bus::canopen::{Cob, Frame, Micros};
use powerball_bus::cia402::Controlword;
use powerball_bus::driver::Cause;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{ArmError, BusError, Event, Interrupt, Memory};
use powerball_identification::NumericArm;
use powerball_virtual_arm::VirtualArm;

/// A bus whose user is asked to end after a number of its steps, and the frames that the user sent from then
/// on.
#[derive(Debug)]
struct Asking {
    bus: Memory<VirtualArm>,
    interrupt: Interrupt,
    steps: usize,
    ask: usize,
    /// Which joints had torque when he was asked.
    torque: Vec<bool>,
    /// Sent in the step in which he was asked, and in all of them from then on.
    at_once: usize,
    sent: Vec<Frame>,
    /// The step with the last set-point of the approach, and with the first of the torque mode.
    change: [usize; 2],
}

impl Asking {
    fn new(ask: usize) -> Asking {
        let bus = Memory::new(VirtualArm::new(setup()).unwrap(), 500_000);
        let interrupt = Interrupt::default();
        let (torque, sent) = (Vec::new(), Vec::new());
        Asking { bus, interrupt, steps: 0, ask, torque, at_once: 0, sent, change: [0; 2] }
    }

    /// Controlwords for joint `j` among frames.
    fn words(frames: &[Frame], j: usize) -> impl Iterator<Item = u16> {
        let node = LWA4P.joints[j].node;
        let of_joint = frames.iter().filter(move |frame| Cob::of(frame) == Some(Cob::Rpdo(1, node)));
        of_joint.filter_map(|frame| frame.bytes().first_chunk::<2>()).map(|word| u16::from_le_bytes(*word))
    }
}

fn enables(word: u16) -> bool {
    word & 0x8F == 0x0F && word & Controlword::HALT == 0
}

impl Bus for Asking {
    fn now(&self) -> Micros {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.steps > self.ask {
            self.sent.push(*frame);
        }
        if let (Some(Cob::Rpdo(1, _)), [low, high, setpoint @ ..]) = (Cob::of(frame), frame.bytes())
            && enables(u16::from_le_bytes([*low, *high]))
        {
            // Positions have four bytes, currents two.
            match (setpoint.len(), self.change) {
                (4, _) => self.change[0] = self.steps,
                (_, [_, 0]) => self.change[1] = self.steps,
                _ => {}
            }
        }
        self.bus.send(frame)
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        if self.steps == self.ask {
            self.torque = self.bus.peer().nodes().iter().map(|node| node.state().has_torque()).collect();
            self.interrupt.ask();
        } else if self.steps == self.ask.saturating_add(1) {
            self.at_once = self.sent.len();
        }
        self.steps += 1;
        self.bus.receive(until)
    }

    fn flush(&mut self) {
        self.bus.flush();
    }
}

/// Follows with computed torque, and what became of it.
fn follow(arm: &NumericArm<6>, path: &Path<6>, bus: &mut Asking) -> Result<(), RecordError> {
    let law = Law::Torque(ComputedTorque::for_period(0.005));
    let best = &parts(path, arm, false);
    let run = Run {
        path,
        arm,
        parts: None,
        best,
        give: 0.0,
        guard: None,
        law,
        contact: None,
        accept_unverified: true,
    };
    let interrupt = bus.interrupt.clone();
    let master = master_on(LWA4P, bus).with_interrupt(interrupt);
    run.follow(master, Envelope::new(|_| None), None, |_, _| ()).map(drop)
}

#[test]
fn a_run_that_is_asked_to_end_at_any_moment_stops_the_arm_at_once_and_moves_nothing_again() {
    let (arm, path) = (numeric(), path(0.01, 60));
    let mut whole = Asking::new(usize::MAX);
    follow(&arm, &path, &mut whole).unwrap();
    let [stop, torque] = whole.change;
    assert!(0 < stop && stop < torque && torque < whole.steps, "{:?} of {}", whole.change, whole.steps);
    // All of the run; closely where the approach ends and the arm is stopped, and where torque begins.
    let moments = (0..whole.steps)
        .step_by(whole.steps / 25)
        .chain((stop..stop + 120).step_by(3))
        .chain((torque - 60..torque + 60).step_by(6));
    let mut stopped = 0;
    for ask in moments {
        let mut bus = Asking::new(ask);
        let ended = follow(&arm, &path, &mut bus).unwrap_err();
        assert!(
            matches!(ended, RecordError::Arm(ArmError::Stopped(Cause::Interrupted, _))),
            "asked in step {ask}: {ended}"
        );
        for (j, had) in bus.torque.iter().enumerate() {
            let of = format!("asked in step {ask} of {}, joint {}", whole.steps, j + 1);
            assert!(Asking::words(&bus.sent, j).all(|word| !enables(word)), "{of}: enabled again");
            if *had {
                let at_once = Asking::words(&bus.sent[..bus.at_once], j).next();
                assert!(
                    at_once.is_some_and(|word| word & 0x86 == 0x02),
                    "{of}: {at_once:?} is no quick stop"
                );
                stopped += 1;
            }
            let node = &bus.bus.peer().nodes()[j];
            assert!(node.brake_closed() && !node.state().has_torque(), "{of}: it does not rest");
        }
    }
    assert!(stopped > 200, "only {stopped} joints had torque");
}
