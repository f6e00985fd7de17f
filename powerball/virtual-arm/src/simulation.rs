//! The plant in time: the motion of the arm under the torques of its drives.
//!
//! Each step is linearly implicit in what is stiff. Friction is first a torque s·q̇' against the new velocity
//! q̇' with the secant s = f(q̇)/q̇ of the old one: Eq. 16's tanh(216 q̇) then dissipates at any step and
//! comes to rest without chatter. With the velocity so found, the chord of f from the old velocity to the new
//! one takes the secant's place: where friction has saturated, it no longer follows the velocity. An elastic
//! gear is a spring and a damper between two masses, taken at the end of the step. Everything else is taken
//! at its start.
//!
//! The module also has a drive's servo.

use super::dynamics::{Dynamics, solve_positive_definite};
use super::effect::{Gear, Instant, State};
use super::plant::Plant;

/// Velocities nearer than this have no chord, rad/s.
const REST: f64 = 1e-9;
/// A closed brake holds this much more than the joint can ask for, N·m, and turns a millionth of a radian a
/// second.
const BRAKE: f64 = 120.0;
const BRAKE_CREEP: f64 = 1e-6;
/// A winding gear's damping as a share of the critical one of the motor on its spring.
const GEAR_DAMPING: f64 = 0.1;

/// The motor's side of an elastic gear.
#[derive(Clone, Copy, Debug)]
struct Motor {
    gear: Gear,
    /// Inertia k²·Im at the joint, kg·m².
    inertia: f64,
    damping: f64,
    /// Position and velocity at the joint, rad and rad/s.
    position: f64,
    velocity: f64,
}

/// A plant that moves. Effects, friction and bodies are those of the [`Plant`]; sensors are not used here.
#[derive(Clone, Debug)]
pub struct Simulation {
    plant: Plant,
    /// The bodies as effects change them; a motor behind a winding gear is not part of them.
    dynamics: Dynamics,
    motors: Vec<Option<Motor>>,
    states: Vec<State>,
    time: f64,
    /// Steps until the bodies are computed again.
    stale: u32,
    q: Vec<f64>,
    dq: Vec<f64>,
    rigid: Vec<f64>,
    brakes: Vec<bool>,
}

impl Simulation {
    /// The plant at rest at the motor positions `q`, rad, at time `time`, s, with all brakes closed.
    pub fn new(plant: Plant, q: &[f64], time: f64) -> Self {
        let n = plant.dynamics().dof();
        let mut motors = vec![None; n];
        for (joint, gear) in plant.effects().iter().filter_map(|effect| effect.gear()) {
            let (row, body) =
                (plant.dynamics().chain().rows().get(joint), plant.dynamics().bodies().get(joint));
            let inertia = row.map_or(0.0, |r| r.ratio().powi(2)) * body.map_or(0.0, |b| b.rotor);
            let damping = 2.0 * GEAR_DAMPING * (gear.stiffness * inertia).sqrt();
            motors[joint] = Some(Motor { gear, inertia, damping, position: q[joint], velocity: 0.0 });
        }
        let mut simulation = Simulation {
            dynamics: plant.dynamics().clone(),
            states: vec![State::default(); plant.effects().len()],
            plant,
            motors,
            time,
            stale: 0,
            q: q.to_vec(),
            dq: vec![0.0; n],
            rigid: vec![0.0; n],
            brakes: vec![true; n],
        };
        simulation.refresh();
        // The links hang from their gears.
        let load = simulation.dynamics.gravity(q);
        for i in 0..n {
            if let Some(motor) = &simulation.motors[i] {
                simulation.q[i] -= motor.gear.windup(load[i]);
            }
        }
        simulation.rigid = simulation.dynamics.gravity(&simulation.q);
        simulation
    }

    /// The number of joints n.
    pub fn dof(&self) -> usize {
        self.q.len()
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Sets the time: effects that warm up or begin do so as if it were `time` s.
    pub fn set_time(&mut self, time: f64) {
        (self.time, self.stale) = (time, 0);
    }

    /// Time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// True joint positions on the links' side, rad.
    pub fn links(&self) -> &[f64] {
        &self.q
    }

    /// True joint velocities on the links' side, rad/s.
    pub fn link_velocities(&self) -> &[f64] {
        &self.dq
    }

    /// Position of a joint where its encoder sits, on the motor's side of the gear, rad at the joint.
    pub fn position(&self, joint: usize) -> f64 {
        self.motors[joint].map_or(self.q[joint], |motor| motor.position)
    }

    /// Velocity of a joint where its encoder sits, rad/s.
    pub fn velocity(&self, joint: usize) -> f64 {
        self.motors[joint].map_or(self.dq[joint], |motor| motor.velocity)
    }

    /// Closes or opens a joint's brake.
    pub fn set_brake(&mut self, joint: usize, closed: bool) {
        self.brakes[joint] = closed;
    }

    /// The inertia that each drive moves directly, kg·m²: the diagonal of the mass matrix at the present
    /// pose, rotors included, or the motor alone if its gear is elastic.
    pub fn inertias(&self) -> Vec<f64> {
        let n = self.dof();
        let matrix = self.plant.dynamics().mass_matrix(&self.q);
        let motors = self.motors.iter().enumerate();
        motors.map(|(i, motor)| motor.map_or(matrix[i * n + i], |motor| motor.inertia)).collect()
    }

    /// One step of `h` s under the drives' torques `tau` at the joints, N·m, which hold their value within
    /// it.
    ///
    /// A plant that is no possible arm, or a torque that is not a number, stops where it is.
    pub fn step(&mut self, h: f64, tau: &[f64]) {
        let n = self.dof();
        if self.stale == 0 {
            self.refresh();
        }
        self.stale -= 1;
        let bias = self.dynamics.inverse(&self.q, &self.dq, &vec![0.0; n]);
        let inertia = self.dynamics.mass_matrix(&self.q);
        let load = self.load();
        let free: Vec<f64> = (0..n).map(|i| bias[i] + load[i]).collect();
        self.time += h;

        // A first step gives the new velocities except for the change of friction on the way to them.
        let [old, rest] =
            [self.velocities(), vec![[0.0; 2]; n]].map(|velocities| (self.friction(&velocities), velocities));
        let secants = chords(&rest, &old, |i| self.slope(i));
        let Some((first, _)) = self.solve(h, tau, &inertia, &free, &rest.0, &secants) else { return };
        let new = (self.friction(&first), first);
        let chords = chords(&old, &new, |i| self.slope(i));
        let offsets: Vec<[f64; 2]> =
            (0..n).map(|i| [0, 1].map(|side| old.0[i][side] - chords[i][side] * old.1[i][side])).collect();
        let Some((velocities, change)) = self.solve(h, tau, &inertia, &free, &offsets, &chords) else {
            return;
        };
        for i in 0..n {
            self.rigid[i] = bias[i] + (0..n).map(|j| inertia[i * n + j] * change[j]).sum::<f64>();
            let [link, motor] = velocities[i];
            self.q[i] += h * link;
            self.dq[i] = link;
            if let Some(behind) = &mut self.motors[i] {
                behind.velocity = motor;
                behind.position += h * motor;
            }
        }
    }

    /// Velocities of links and motors, rad/s.
    fn velocities(&self) -> Vec<[f64; 2]> {
        (0..self.dof()).map(|i| [self.dq[i], self.velocity(i)]).collect()
    }

    /// The new velocities of links and motors, and the links' accelerations, where friction on either side is
    /// an offset plus a slope times the new velocity. `None` stops the arm.
    fn solve(
        &mut self,
        h: f64,
        tau: &[f64],
        inertia: &[f64],
        free: &[f64],
        offsets: &[[f64; 2]],
        slopes: &[[f64; 2]],
    ) -> Option<(Vec<[f64; 2]>, Vec<f64>)> {
        let n = self.dof();
        let mut matrix = inertia.to_vec();
        let mut right = vec![0.0; n];
        let mut windings = vec![None; n];
        for i in 0..n {
            right[i] =
                (0..n).map(|j| inertia[i * n + j] * self.dq[j]).sum::<f64>() - h * (free[i] + offsets[i][0]);
            matrix[i * n + i] += h * slopes[i][0];
            let brake = self.brake(i);
            match &self.motors[i] {
                None => {
                    right[i] += h * (tau[i] - offsets[i][1]);
                    matrix[i * n + i] += h * (slopes[i][1] + brake);
                }
                Some(motor) => {
                    // Motor: m w = a + h c v, link: … + h (spring + c (w − v)); w is eliminated.
                    let (spring, touching) = motor.gear.torque(motor.position - self.q[i]);
                    let c = if touching { h * motor.gear.stiffness + motor.damping } else { 0.0 };
                    let m = motor.inertia + h * (slopes[i][1] + brake + c);
                    let a = motor.inertia * motor.velocity + h * (tau[i] - offsets[i][1] - spring);
                    matrix[i * n + i] += h * c - (h * c).powi(2) / m;
                    right[i] += h * (spring + c * a / m);
                    windings[i] = Some((a, h * c, m));
                }
            }
        }
        let Some(links) = solve_positive_definite(matrix, right).filter(|v| v.iter().all(|v| v.is_finite()))
        else {
            self.dq.fill(0.0);
            return None;
        };
        let motor = |i: usize| windings[i].map_or(links[i], |(a, hc, m)| (a + hc * links[i]) / m);
        let velocities = (0..n).map(|i| [links[i], motor(i)]).collect();
        let change = links.iter().zip(&self.dq).map(|(new, old)| (new - old) / h).collect();
        Some((velocities, change))
    }

    /// The bodies as the effects make them now, without the motors that move on their own.
    fn refresh(&mut self) {
        // Ten times a second at least: what begins at some time does not begin to the millisecond.
        self.stale = 20;
        let changed = self.plant.changed_dynamics(self.time);
        let base = changed.as_ref().unwrap_or(self.plant.dynamics());
        let mut bodies = base.bodies().to_vec();
        for (body, motor) in bodies.iter_mut().zip(&self.motors) {
            if motor.is_some() {
                body.rotor = 0.0;
            }
        }
        if let Some(dynamics) = Dynamics::new(base.chain().clone(), bodies) {
            self.dynamics = dynamics;
        }
    }

    /// A closed brake as a torque over the motor's velocity, N·m·s/rad.
    fn brake(&self, joint: usize) -> f64 {
        if self.brakes[joint] { BRAKE / self.velocity(joint).abs().max(BRAKE_CREEP) } else { 0.0 }
    }

    /// Torques against the motion, N·m, at given velocities: of the effects that rub, on the links' side, and
    /// of Eq. 16, on the motors'.
    fn friction(&self, velocities: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut rubbing = vec![0.0; self.dof()];
        if self.plant.effects().iter().any(|effect| effect.rubs_at().is_some()) {
            let dq: Vec<f64> = velocities.iter().map(|velocity| velocity[0]).collect();
            let now = self.now(&dq);
            for effect in self.plant.effects().iter().filter(|effect| effect.rubs_at().is_some()) {
                effect.add_torque(&now, &mut State::default(), &mut rubbing);
            }
        }
        let laws = self.plant.friction().iter().zip(velocities);
        rubbing.into_iter().zip(laws).map(|(rub, (law, velocity))| [rub, law.torque(velocity[1])]).collect()
    }

    /// The slope of Eq. 16 at a motor's velocity, N·m·s/rad.
    fn slope(&self, joint: usize) -> [f64; 2] {
        [0.0, self.plant.friction()[joint].slope(self.velocity(joint))]
    }

    /// Torques against the motion of all effects that do not rub, N·m.
    fn load(&mut self) -> Vec<f64> {
        let mut load = vec![0.0; self.dof()];
        let mut states = std::mem::take(&mut self.states);
        let now = self.now(&self.dq);
        for (effect, state) in self.plant.effects().iter().zip(&mut states) {
            if effect.rubs_at().is_none() {
                effect.add_torque(&now, state, &mut load);
            }
        }
        self.states = states;
        load
    }

    fn now<'a>(&'a self, dq: &'a [f64]) -> Instant<'a> {
        let (friction, dynamics) = (self.plant.friction(), &self.dynamics);
        Instant { t: self.time, q: &self.q, dq, rigid: &self.rigid, friction, dynamics }
    }
}

/// Friction at two sets of velocities, and those velocities.
type AtVelocities = (Vec<[f64; 2]>, Vec<[f64; 2]>);

/// The chord of the friction between two velocities, never negative; the slope where they are one.
fn chords(a: &AtVelocities, b: &AtVelocities, slope: impl Fn(usize) -> [f64; 2]) -> Vec<[f64; 2]> {
    let chord = |i: usize, side: usize| {
        let way = b.1[i][side] - a.1[i][side];
        if way.abs() > REST { (b.0[i][side] - a.0[i][side]) / way } else { slope(i)[side] }
    };
    (0..a.0.len()).map(|i| [0, 1].map(|side| chord(i, side).max(0.0))).collect()
}

// A drive's servo: position over velocity over current, as cascades are.

/// How hard a servo holds on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Position loop: rad/s for each rad of following error.
    pub position: f64,
    /// Velocity loop: N·m for each rad/s.
    pub velocity: f64,
    /// Integral part of the velocity loop: N·m/s for each rad/s.
    pub integral: f64,
    /// Torque at the current limit, N·m.
    pub limit: f64,
    /// Coulomb friction that is fed forward with the sign of the wanted velocity, N·m: without it a joint
    /// dwells at each reversal until the integrator has turned round.
    pub friction: f64,
}

/// Below this velocity the friction is not yet fed forward whole, rad/s.
const TURN: f64 = 5e-3;

impl Gains {
    /// Gains for an inertia in kg·m² at the joint: a velocity loop of 120 Hz, an integrator and a position
    /// loop that are slower by four.
    pub fn for_inertia(inertia: f64, limit: f64, friction: f64) -> Self {
        let bandwidth = std::f64::consts::TAU * 120.0;
        let velocity = inertia * bandwidth;
        Gains { position: bandwidth / 4.0, velocity, integral: velocity * bandwidth / 4.0, limit, friction }
    }
}

/// The servo of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// The gains.
    pub gains: Gains,
    /// Torque of the velocity loop's integrator, N·m.
    held: f64,
}

impl Servo {
    /// A servo that holds nothing yet.
    pub fn new(gains: Gains) -> Self {
        Servo { gains, held: 0.0 }
    }

    /// Clears the integrator.
    pub fn reset(&mut self) {
        self.held = 0.0;
    }

    /// The torque for the next `h` s, N·m: `wanted` and `actual` are position (rad) and velocity (rad/s),
    /// `forward` is torque that is fed forward.
    ///
    /// At the current limit the integrator waits, unless it leads away from the limit.
    pub fn torque(&mut self, h: f64, wanted: [f64; 2], actual: [f64; 2], forward: f64) -> f64 {
        let Gains { position, velocity, integral, limit, friction } = self.gains;
        let error = wanted[1] + position * (wanted[0] - actual[0]) - actual[1];
        let more = self.held + h * integral * error;
        let turning = friction * wanted[1] / wanted[1].hypot(TURN);
        let asked = forward + turning + velocity * error + more;
        if asked.abs() <= limit || asked * error < 0.0 {
            self.held = more.clamp(-limit, limit);
        }
        asked.clamp(-limit, limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PlantEffect, lwa4p};
    use powerball_controller::friction::TanhFriction;

    const POSE: [f64; 6] = [0.3, 0.6, -0.9, 0.2, 0.7, -0.4];

    fn open(plant: Plant) -> Simulation {
        let mut simulation = Simulation::new(plant, &POSE, 0.0);
        (0..6).for_each(|joint| simulation.set_brake(joint, false));
        simulation
    }

    fn without_friction() -> Plant {
        let plant = lwa4p::plant().unwrap();
        let smooth = vec![TanhFriction::new([0.0; 5]); 6];
        Plant::new(plant.dynamics().clone(), smooth, plant.sensors().clone())
    }

    fn energy(simulation: &Simulation) -> f64 {
        let dynamics = simulation.plant().dynamics();
        dynamics.kinetic_energy(&simulation.q, &simulation.dq) + dynamics.potential_energy(&simulation.q)
    }

    #[test]
    fn a_falling_arm_without_friction_keeps_its_energy_to_first_order() {
        let drift = |h: f64| {
            let mut simulation = open(without_friction());
            let before = energy(&simulation);
            (0..(0.5 / h).round() as usize).for_each(|_| simulation.step(h, &[0.0; 6]));
            assert!(simulation.dq.iter().any(|v| v.abs() > 0.2), "{:?}", simulation.dq);
            (energy(&simulation) - before).abs()
        };
        let (coarse, fine) = (drift(1e-3), drift(1e-4));
        assert!(coarse < 0.1 && fine < 0.15 * coarse, "{coarse} J, {fine} J");
    }

    #[test]
    fn stiff_friction_comes_to_rest_without_chatter_and_only_dissipates() {
        for h in [1e-3, 5e-3] {
            let mut simulation = open(lwa4p::plant().unwrap());
            simulation.dq = vec![0.8, -0.5, 0.5, 0.7, -0.6, 0.9];
            let hold = simulation.plant().dynamics().gravity(&POSE);
            let mut before: Vec<f64> = simulation.dq.iter().map(|v| v.abs()).collect();
            for step in 0..400 {
                let load = simulation.plant().dynamics().gravity(&simulation.q);
                simulation.step(h, &load);
                if step as f64 * h > 0.35 {
                    for (i, v) in simulation.dq.iter().enumerate() {
                        // Tails decay; nothing grows or changes sign from step to step.
                        assert!(v.abs() <= before[i] * 1.01 + 1e-6, "h {h}, joint {i}: {v}");
                        before[i] = v.abs();
                    }
                }
            }
            assert!(simulation.dq.iter().all(|v| v.abs() < 1e-3), "{:?}", simulation.dq);
            assert!(hold.iter().all(|t| t.is_finite()));
        }
    }

    #[test]
    fn a_constant_velocity_takes_gravity_and_friction() {
        // Joint 1 has no gravity: under a constant torque it ends where Eq. 16 says.
        let mut simulation = open(lwa4p::plant().unwrap());
        (1..6).for_each(|joint| simulation.set_brake(joint, true));
        (0..6000).for_each(|_| simulation.step(1e-3, &[12.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let friction = simulation.plant().friction()[0].torque(simulation.dq[0]);
        approx::assert_relative_eq!(friction, 12.0, max_relative = 1e-6);
    }

    #[test]
    fn brakes_hold_the_arm_and_open_ones_do_not() {
        let mut held = Simulation::new(lwa4p::plant().unwrap(), &POSE, 0.0);
        let mut loose = open(lwa4p::plant().unwrap());
        for _ in 0..2000 {
            held.step(1e-3, &[0.0; 6]);
            loose.step(1e-3, &[0.0; 6]);
        }
        let sag = |s: &Simulation| s.q.iter().zip(POSE).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(sag(&held) < 3e-6, "{}", sag(&held));
        assert!(sag(&loose) > 0.1, "{}", sag(&loose));
    }

    #[test]
    fn a_winding_gear_stretches_by_its_load_and_rings_at_its_frequency() {
        let (joint, stiffness) = (1, 2000.0);
        let plant = without_friction().with(PlantEffect::JointElasticity { joint, stiffness });
        let mut simulation = Simulation::new(plant, &POSE, 0.0);
        // The brake holds the motor, the link swings on the spring, the other joints are held.
        let rest = simulation.links()[joint];
        let load = simulation.dynamics.gravity(simulation.links())[joint];
        approx::assert_relative_eq!(POSE[joint] - rest, load / stiffness, max_relative = 2e-2);
        simulation.q[joint] += 2e-3;
        let h = 1e-4;
        let mut crossings = Vec::new();
        let mut before = simulation.q[joint] - rest;
        for k in 0..10_000 {
            simulation.step(h, &[0.0; 6]);
            let now = simulation.q[joint] - rest;
            if before < 0.0 && now >= 0.0 {
                crossings.push(k as f64 * h);
            }
            before = now;
        }
        let inertia = simulation.dynamics.mass_matrix(&simulation.q)[joint * 6 + joint];
        let period = (crossings[2] - crossings[0]) / 2.0;
        let want = std::f64::consts::TAU * (inertia / stiffness).sqrt();
        approx::assert_relative_eq!(period, want, max_relative = 0.03);
    }

    #[test]
    fn a_gear_with_play_lets_the_link_fall_through_it_once() {
        let (joint, gap) = (1, 0.02);
        let plant = without_friction().with(PlantEffect::Backlash { joint, gap });
        let mut simulation = Simulation::new(plant, &POSE, 0.0);
        let hang = simulation.position(joint) - simulation.links()[joint];
        simulation.q[joint] += 0.9 * gap * hang.signum();
        (0..3000).for_each(|_| simulation.step(1e-3, &[0.0; 6]));
        let after = simulation.position(joint) - simulation.links()[joint];
        approx::assert_relative_eq!(after, hang, max_relative = 0.05);
    }

    #[test]
    fn every_effect_can_move_with_the_arm() {
        use rand::SeedableRng;
        let plain = lwa4p::plant().unwrap();
        for name in PlantEffect::NAMES {
            let mut rng = chacha20::ChaCha8Rng::seed_from_u64(1);
            let effect = lwa4p::draw_effect(name, &plain, 20.0, 0.1..0.2, &mut rng).unwrap();
            let mut simulation = open(plain.clone().with(effect));
            let hold = simulation.plant().dynamics().gravity(&POSE);
            (0..1000).for_each(|_| simulation.step(1e-3, &hold));
            assert!(simulation.q.iter().chain(&simulation.dq).all(|x| x.is_finite()), "{name}");
            // Nothing carries what an effect adds: joints may fall, for a second.
            assert!(simulation.dq.iter().all(|v| v.abs() < 5.0), "{name}: {:?}", simulation.dq);
        }
    }

    #[test]
    #[ignore = "a measurement; run in release with --ignored --nocapture"]
    fn how_fast() {
        let mut simulation = open(lwa4p::plant().unwrap());
        let start = std::time::Instant::now();
        (0..100_000).for_each(|_| simulation.step(1e-3, &[0.0; 6]));
        println!("{:.0} times real time", 100.0 / start.elapsed().as_secs_f64());
    }
}
