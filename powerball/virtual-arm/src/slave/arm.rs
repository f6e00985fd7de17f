//! All nodes over one plant: the other end of a bus.
//!
//! The module also describes a joint's module.

use super::dictionary::Identity;
use super::hand::Hand;
use super::node::Node;
use super::{Fault, Sample};
use crate::{Plant, PlantEffect, Simulation};
use chacha20::ChaCha8Rng;
use powerball_bus::canopen::{Frame, Micros, NodeId, Object};
use powerball_bus::transport::{Bus, BusError, Event, Peer};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::VecDeque;

/// The drives' tick, µs: servo and physics.
const TICK: Micros = 500;

/// Share of the friction's steep part that the drives feed forward.
const TUNED: f64 = 0.9;

/// The parts of a virtual arm.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The plant with its effects.
    pub plant: Plant,
    /// The module of each joint.
    pub modules: Vec<Module>,
    /// Joint positions at the start, rad.
    pub start: Vec<f64>,
    /// Age of the plant at the start, s: what warms has been warming for this time.
    pub age: f64,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

impl Setup {
    /// This setup with drives that have a current mode.
    #[must_use]
    pub fn with_current_mode(mut self, mode: CurrentMode) -> Setup {
        self.modules.iter_mut().for_each(|module| module.current_mode = Some(mode));
        self
    }
}

/// An arm of CiA 402 drives.
#[derive(Clone, Debug)]
pub struct VirtualArm {
    simulation: Simulation,
    nodes: Vec<Node>,
    noise: Noise,
    /// Torques of the last ticks, newest last, for drives that log late.
    history: VecDeque<Vec<f64>>,
    offsets: Vec<f64>,
    /// Torque by the measured current of the torque that it truly is, by joint.
    gains: Vec<f64>,
    torque: Vec<f64>,
    hand: Option<Hand>,
    ticks: u64,
}

/// Noise of the current sensors.
#[derive(Debug)]
struct Noise {
    rng: ChaCha8Rng,
    slow: Vec<f64>,
}

impl Clone for Noise {
    /// A generator of the same noise from here on: the generator has no `Clone`, so its state is copied.
    fn clone(&self) -> Self {
        Noise { rng: ChaCha8Rng::deserialize_state(&self.rng.serialize_state()), slow: self.slow.clone() }
    }
}

impl VirtualArm {
    /// An arm at rest with closed brakes, its nodes about to boot. `None` where plant, modules and start do
    /// not have the same number of joints.
    pub fn new(setup: Setup) -> Option<Self> {
        let Setup { plant, modules, start, age, seed } = setup;
        let n = plant.dynamics().dof();
        if modules.len() != n || start.len() != n || plant.friction().len() != n {
            return None;
        }
        let simulation = Simulation::new(plant, &start, age);
        // Drives are tuned where they are built in, to what they have to move and to most of its friction.
        let friction = simulation.plant().friction().iter().map(|f| TUNED * f.gamma1.max(f.gamma3));
        let tuned = simulation.inertias().into_iter().zip(friction);
        let nodes = modules.into_iter().zip(tuned).map(|(m, (i, f))| Node::new(m, [i, f])).collect();
        let (mut offsets, mut gains) = (vec![0.0; n], vec![1.0; n]);
        for effect in simulation.plant().effects() {
            match effect {
                PlantEffect::EncoderOffset { joint, offset } => offsets[*joint] += offset,
                PlantEffect::TorqueConstant { joint, gain } => gains[*joint] *= gain,
                _ => {}
            }
        }
        let noise = Noise { rng: ChaCha8Rng::seed_from_u64(seed), slow: vec![0.0; n] };
        let torque = vec![0.0; n];
        let history = VecDeque::new();
        Some(VirtualArm { simulation, nodes, noise, history, offsets, gains, torque, hand: None, ticks: 0 })
    }

    /// The nodes, one a joint.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The plant as it truly moves.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// This arm with a hand on its links.
    #[must_use]
    pub fn with_hand(mut self, hand: Hand) -> Self {
        self.hand = Some(hand);
        self
    }

    /// Sets the plant's age, s: what warms has been warming for this time.
    pub fn set_age(&mut self, age: f64) {
        self.simulation.set_time(age);
    }

    /// Torques that the drives give, N·m.
    pub fn torques(&self) -> &[f64] {
        &self.torque
    }

    /// Makes something go wrong at a node; nothing happens where no node has this number.
    pub fn fault(&mut self, node: NodeId, fault: Fault) {
        let now = self.ticks * TICK;
        if let Some(node) = self.nodes.iter_mut().find(|n| n.id() == node) {
            node.fault(fault, now);
        }
    }

    /// One tick: the drives decide, the plant moves.
    fn tick(&mut self) {
        self.ticks += 1;
        let (now, h) = (self.ticks * TICK, TICK as f64 * 1e-6);
        let before = self.torque.clone();
        for joint in 0..self.nodes.len() {
            let velocity = self.simulation.velocity(joint);
            let position = self.simulation.position(joint) + self.offsets[joint];
            // A drive controls the current that it measures; a wrong constant makes another torque of it.
            self.torque[joint] = self.nodes[joint].tick(h, now, [position, velocity]) / self.gains[joint];
        }
        self.measure(h, &before);
        for (joint, node) in self.nodes.iter().enumerate() {
            self.simulation.set_brake(joint, node.brake_closed());
        }
        let free = self.nodes.iter().all(|node| !node.brake_closed() && node.drive.in_current_mode());
        match self.hand.as_mut().filter(|_| free) {
            None => self.simulation.step(h, &self.torque),
            Some(hand) => {
                let [q, dq] = [self.simulation.links(), self.simulation.link_velocities()];
                let push = hand.pull(h, q, dq);
                let torque: Vec<f64> = self.torque.iter().zip(push).map(|(a, b)| a + b).collect();
                self.simulation.step(h, &torque);
            }
        }
    }

    /// The sensors' values at this instant, between two ticks: the current is the mean of `before` and
    /// after.
    fn measure(&mut self, h: f64, before: &[f64]) {
        let sensors = self.simulation.plant().sensors();
        let late = |effect: &PlantEffect| match effect {
            PlantEffect::TimeDelay { delay } => *delay,
            _ => 0.0,
        };
        let delay: f64 = self.simulation.plant().effects().iter().map(late).sum();
        let back = (delay / h).round() as usize;
        self.history.push_back(before.iter().zip(&self.torque).map(|(a, b)| 0.5 * (a + b)).collect());
        while self.history.len() > back + 1 {
            self.history.pop_front();
        }
        let keep = (-h / sensors.colour_time).exp();
        for (joint, node) in self.nodes.iter_mut().enumerate() {
            let mut normal = || -> f64 { StandardNormal.sample(&mut self.noise.rng) };
            let slow = &mut self.noise.slow[joint];
            *slow = keep * *slow + (1.0 - keep * keep).sqrt() * sensors.coloured[joint] * normal();
            let torque = self.history.front().map_or(0.0, |torque| torque[joint]);
            node.measure(Sample {
                position: self.simulation.position(joint) + self.offsets[joint],
                velocity: self.simulation.velocity(joint),
                torque: torque * self.gains[joint] + *slow + sensors.white[joint] * normal(),
            });
        }
    }
}

impl Peer for VirtualArm {
    fn receive(&mut self, frame: &Frame, now: Micros) {
        self.nodes.iter_mut().for_each(|node| node.receive(frame, now));
    }

    fn advance(&mut self, now: Micros) {
        while (self.ticks + 1) * TICK <= now {
            self.tick();
        }
    }

    fn wake(&self) -> Micros {
        (self.ticks + 1) * TICK
    }

    fn transmit(&mut self) -> Option<Frame> {
        self.nodes.iter_mut().find_map(Node::transmit)
    }
}

/// Puts an arm on a bus with others, in the bus's time, until `stop` says so or the bus is gone. Gives the
/// time, µs, by which the arm is behind the bus: a machine that is too slow for the physics slows the arm
/// down, and not its answers.
///
/// # Errors
/// What the bus says; a full queue loses the frame, as a drive does.
pub fn serve(arm: &mut impl Peer, bus: &mut impl Bus, stop: impl Fn() -> bool) -> Result<Micros, BusError> {
    let mut slipped = 0;
    while !stop() {
        let mut event = bus.receive(arm.wake() + slipped)?;
        while let Some((at, what)) = event {
            if let Event::Frame(frame) = what {
                arm.receive(&frame, at.saturating_sub(slipped));
                speak(arm, bus)?;
            }
            event = bus.receive(0)?;
        }
        let now = bus.now().saturating_sub(slipped);
        let behind = now.saturating_sub(arm.wake());
        if behind > CATCH_UP {
            slipped += behind;
        }
        arm.advance(bus.now().saturating_sub(slipped));
        speak(arm, bus)?;
    }
    Ok(slipped)
}

/// Longest interruption of the machine that is caught up, µs.
const CATCH_UP: Micros = 20_000;

/// Sends what the arm has to say.
fn speak(arm: &mut impl Peer, bus: &mut impl Bus) -> Result<(), BusError> {
    while let Some(frame) = arm.transmit() {
        match bus.send(&frame) {
            Ok(()) | Err(BusError::Full | BusError::Off) => {}
            Err(gone) => return Err(gone),
        }
    }
    Ok(())
}

// A joint's module: the facts with which its drive is set up.

/// A mode in which the set-point is a current. The maker's public files have none, so this is declared and
/// not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentMode {
    /// The mode's number in 0x6060.
    pub mode: i8,
    /// The object of its set-point: i16, per mille of the rated current.
    pub target: Object,
}

/// One joint's module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Module {
    /// The module's node.
    pub node: NodeId,
    /// Who it says that it is.
    pub identity: Identity,
    /// Software limits, rad.
    pub limits: [f64; 2],
    /// Greatest velocity, rad/s.
    pub velocity: f64,
    /// Greatest acceleration, rad/s².
    pub acceleration: f64,
    /// Torque at the current limit, N·m.
    pub torque: f64,
    /// Rated current, mA.
    pub rated_current: u32,
    /// Torque at the rated current, N·m; negative where the motor turns against the joint.
    pub rated_torque: f64,
    /// Whether the motor's commutation is found already.
    pub commutated: bool,
    /// A current mode, where there is one.
    pub current_mode: Option<CurrentMode>,
}
