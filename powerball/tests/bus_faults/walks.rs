//! Random walks: faults, acts of the caller and repairs in any order and at any time, in all modes. Whatever
//! came before, on the wire three things hold: nothing that moves after a latched cause until the caller
//! enables again; a stop of every drive soon after every cause; no set-point beyond a joint's limits.

use crate::faults::Fault;
use crate::world::{CYCLE, VICTIM, World};
use chacha20::ChaCha8Rng;
use powerball::bus::canopen::{Cob, Micros, NodeId};
use powerball::bus::cia402::{Command, Controlword};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Cause, ControlMode, Phase, TorqueGuard};
use rand::{RngExt, SeedableRng};

const SEEDS: u64 = 16;
const STEPS: usize = 40;
/// A stop has reached all drives by then: the slowest cell of the matrix, and the frames' time on the wire.
/// Counted from when the driver knows its cause.
const STOPPED: Micros = 2 * CYCLE;
/// A frame that was queued before may be on the wire for this long.
const WIRE: Micros = 2_500;

/// More torque than joint 3 has wherever it would be beyond its start by 0.04 rad: half of the pilot's swing.
static WALL: TorqueGuard<6> =
    TorqueGuard::new(&|q, _, _| [0.0, 0.0, if q[2] > 0.0 { 1e3 } else { 0.0 }, 0.0, 0.0, 0.0]);

/// What the walk draws from; a copy draws the same.
struct Draws(ChaCha8Rng);

impl Clone for Draws {
    fn clone(&self) -> Self {
        Draws(ChaCha8Rng::deserialize_state(&self.0.serialize_state()))
    }
}

#[derive(Clone)]
pub(crate) struct Walk {
    pub(crate) world: World,
    draws: Draws,
    control: ControlMode,
    /// What was done, for who reads a failure.
    pub(crate) done: Vec<String>,
    /// When causes were latched, and the times of the caller's acts that allow motion.
    pub(crate) causes: Vec<Micros>,
    pub(crate) enabled: Vec<Micros>,
    /// Spans in which the driver followed set-points.
    running: Vec<(Micros, Micros)>,
    fault: Option<Fault>,
    guarded: bool,
    wrong: Option<String>,
}

impl Walk {
    fn new(seed: u64) -> Walk {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let commutated = rng.random_bool(0.8);
        let guarded = rng.random_bool(0.3);
        let mut walk = Walk::of(ControlMode::ALL[(seed % 4) as usize], commutated, rng);
        if guarded {
            walk.world.driver.guard_torque(WALL);
            walk.guarded = true;
        }
        walk
    }

    /// In a mode, with nothing done yet.
    pub(crate) fn of(control: ControlMode, commutated: bool, rng: ChaCha8Rng) -> Walk {
        let mut profile = LWA4P;
        profile.reactions.commutation_settle = 50_000;
        profile.reactions.boot_timeout = 500_000;
        let mut world = World::new(commutated, profile);
        world.pilot.enable = false;
        let (done, causes, enabled, running) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Walk {
            world,
            draws: Draws(rng),
            control,
            done,
            causes,
            enabled,
            running,
            fault: None,
            guarded: false,
            wrong: None,
        }
    }

    /// Lets time pass, a turn at a time, and watches the driver's cause.
    pub(crate) fn pass(&mut self, time: Micros) {
        let until = self.world.now() + time;
        while self.world.now() < until {
            let before = (self.world.driver.phase(), self.world.driver.cause().copied());
            self.world.turn();
            let now = self.world.now();
            match (before.0, self.world.driver.phase(), self.running.last_mut()) {
                (Phase::Running, Phase::Running, Some((_, until))) => *until = now,
                (_, Phase::Running, _) => self.running.push((now, now)),
                _ => {}
            }
            let cause = self.world.driver.cause().copied();
            match cause {
                Some(cause) if before.1.is_none() => {
                    self.causes.push(now);
                    self.done.push(format!("{now}: {cause}"));
                    let live = matches!(before.0, Phase::Enabling | Phase::Running);
                    // A queue that is full, or a bus that is off, carries no stop; a silent node tells
                    // nobody.
                    let carries = now >= self.world.full_until && !matches!(cause, Cause::BusOff);
                    if live && carries {
                        self.must_stop(now);
                    }
                }
                _ => {}
            }
        }
    }

    /// From `now` on every drive hears a quick stop soon.
    fn must_stop(&mut self, now: Micros) {
        self.world.run(STOPPED);
        for (joint, at) in LWA4P.joints.iter().zip(self.world.quick_stops(now.saturating_sub(CYCLE))) {
            if at.is_none_or(|at| at > now + STOPPED) && self.world.now() >= self.world.full_until {
                self.wrong = Some(format!("node {} hears no stop after {now}: {at:?}", joint.node));
            }
        }
    }

    fn step(&mut self) {
        let now = self.world.now();
        let act = self.draws.0.random_range(0..100u32);
        match (act, self.world.driver.phase()) {
            (_, Phase::Idle) => {
                if let Some(fault) = self.fault.take() {
                    fault.repair(&mut self.world);
                }
                self.done.push(format!("{now}: start, {:?}", self.control));
                let _ = self.world.driver.start(self.control, true);
                self.pass(3_000_000);
            }
            (0..60, Phase::Ready) => {
                self.done.push(format!("{now}: enable"));
                self.enabled.push(now);
                let _ = self.world.driver.enable();
                self.pass(800_000);
            }
            (0..60, Phase::Faulted) => {
                if let Some(fault) = self.fault.take().filter(|_| self.draws.0.random_bool(0.8)) {
                    fault.repair(&mut self.world);
                }
                self.done.push(format!("{now}: acknowledge"));
                let _ = self.world.driver.acknowledge();
                self.pass(300_000);
            }
            (60..70, _) => {
                self.done.push(format!("{now}: stop"));
                self.world.stop();
            }
            (70..75, _) => {
                // Acts at the wrong time are refused, and change nothing.
                let allowed = self.world.driver.phase() == Phase::Ready;
                if self.world.driver.enable().is_ok() {
                    assert!(allowed);
                    self.enabled.push(now);
                }
            }
            (75..80, _) if self.fault.is_none() => {
                self.world.pilot.bad = self.draws.0.random_range(1..6);
                self.world.pilot.bad_value =
                    [f64::NAN, 9.0, -0.3, f64::INFINITY][self.draws.0.random_range(0..4)];
                self.done.push(format!("{now}: bad set-points {}", self.world.pilot.bad_value));
            }
            (80..83, _) => {
                let time = self.draws.0.random_range(1_000..40_000);
                self.done.push(format!("{now}: the caller gives nothing for {time} µs"));
                self.world.hold_pilot(time);
            }
            (83..86, _) => {
                let time = self.draws.0.random_range(1_000..60_000);
                self.done.push(format!("{now}: nobody polls for {time} µs"));
                self.world.run_without_driver(time);
            }
            _ if self.fault.is_none() => {
                let faults: Vec<Fault> = Fault::of(self.control).collect();
                let fault = faults[self.draws.0.random_range(0..faults.len())];
                self.done.push(format!("{now}: {fault:?}"));
                fault.inject(&mut self.world);
                self.fault = Some(fault);
            }
            _ => {}
        }
        let time = self.draws.0.random_range(1_000..150_000);
        self.pass(time);
    }

    /// Reads all that reached the drives.
    pub(crate) fn judge(&mut self) -> Result<(), String> {
        if let Some(wrong) = self.wrong.take() {
            return Err(wrong);
        }
        for (at, node, word) in self.world.words(0) {
            let moves = word.decode(Controlword::default()) == Command::EnableOperation;
            let forbidden = self.causes.iter().any(|from| {
                let allowed = self.enabled.iter().find(|enabled| *enabled > from);
                at > from + WIRE && allowed.is_none_or(|allowed| at < *allowed)
            });
            if moves && forbidden {
                return Err(format!(
                    "node {node} is commanded to move ({word:?}) at {at}, with a cause latched"
                ));
            }
        }
        self.set_points()
    }

    /// Interpolation points with their differences, and velocities, as the drives got them.
    fn set_points(&self) -> Result<(), String> {
        let period = LWA4P.period_seconds();
        for joint in &LWA4P.joints {
            let mut last: Option<(Micros, [f64; 2])> = None;
            let outside = |q: f64| q < joint.position[0] - 1e-3 || q > joint.position[1] + 1e-3;
            for (at, q, follows) in self.points(joint.node) {
                // A joint that commutates is commanded to stay where it is, wherever its jerk takes it.
                let running = self.running.iter().any(|(from, until)| (from + CYCLE..=*until).contains(&at));
                if !(follows && running) {
                    last = None;
                    continue;
                }
                if self.control != ControlMode::InterpolatedPosition {
                    let velocity = joint.units.position(q) / joint.units.counts_per_radian.signum();
                    if self.control == ControlMode::Velocity && velocity.abs() > 1.01 * joint.velocity {
                        return Err(format!("{velocity} rad/s at {at}"));
                    }
                    continue;
                }
                let q = joint.units.position(q);
                if outside(q) {
                    return Err(format!("node {}: {q} rad at {at}", joint.node));
                }
                if self.guarded && joint.node == VICTIM && q > 1e-4 {
                    return Err(format!("node {}: {q} rad at {at}, where it has no torque", joint.node));
                }
                if let Some((_, [before, v])) = last {
                    let (now, count) = ((q - before) / period, 1.0 / joint.units.counts_per_radian.abs());
                    let change = (now - v).abs() / period;
                    let rounding = 4.0 * count / (period * period);
                    if now.abs() > 1.06 * joint.velocity || change > 1.06 * joint.acceleration + rounding {
                        return Err(format!("node {}: {now} rad/s, {change} rad/s² at {at}", joint.node));
                    }
                    last = Some((at, [q, now]));
                } else {
                    last = Some((at, [q, 0.0]));
                }
            }
        }
        Ok(())
    }

    /// The set-points of a node, raw, and whether it followed them.
    fn points(&self, node: NodeId) -> impl Iterator<Item = (Micros, i32, bool)> + '_ {
        let bits = LWA4P.mode(self.control).map_or(0, |mode| mode.running_bits);
        self.world.bus.peer().heard.iter().filter_map(move |(at, frame)| {
            let Some(Cob::Rpdo(1, of)) = Cob::of(frame) else { return None };
            let bytes = frame.bytes();
            let word = u16::from_le_bytes([bytes[0], bytes[1]]);
            let raw = match bytes.get(2..6) {
                Some(wide) => i32::from_le_bytes(wide.try_into().unwrap()),
                None => i32::from(i16::from_le_bytes([bytes[2], bytes[3]])),
            };
            (of == node).then_some((*at, raw, word & 0x10F == 0x0F && word & bits == bits))
        })
    }
}

#[test]
fn whatever_happens_in_whatever_order() {
    let only = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok());
    let (mut ran, mut stopped) = (0, 0);
    for seed in only.map_or(0..SEEDS, |seed: u64| seed..seed + 1) {
        let mut walk = Walk::new(seed);
        for _ in 0..STEPS {
            walk.step();
            ran += usize::from(walk.world.driver.phase() == Phase::Running);
        }
        stopped += walk.causes.len();
        if let Err(wrong) = walk.judge() {
            panic!("SEED={seed}: {wrong}; what was done:\n{}", walk.done.join("\n"));
        }
    }
    if only.is_none() {
        assert!(ran > 70 && stopped > 40, "{ran} times running, {stopped} causes: the walks see too little");
    }
}
