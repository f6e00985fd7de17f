//! Laws of torque that a rigid arm with Eq. 16 friction lacks.

use core::any::TypeId;
use core::f64::consts::FRAC_2_PI;
use nalgebra::RealField;

/// What is known at one instant; one entry a joint. What a slice does not hold counts as zero.
#[derive(Clone, Copy, Debug)]
pub struct Instant<'a, T> {
    /// Positions, rad (m where prismatic).
    pub q: &'a [T],
    /// Velocities, rad/s.
    pub dq: &'a [T],
    /// Accelerations, rad/s².
    pub ddq: &'a [T],
    /// Torque of the rigid arm, N·m.
    pub rigid: &'a [T],
    /// Eq. 16 friction, N·m.
    pub friction: &'a [T],
    /// Temperatures of the joints, °C.
    pub temperature: &'a [T],
    /// Time since the arm began to work, as cold as when its model was recorded, s.
    pub running: T,
}

/// One basis function, N·m for a coefficient of 1 (rad for laws that move the link).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<T> {
    /// 1: a constant torque.
    Constant,
    /// |q̇|: viscous friction that differs with the direction.
    VelocityMagnitude,
    /// |τ_rigid|·tanh(γ·q̇): gears rub harder under load.
    Load {
        /// γ, s/rad.
        steepness: T,
    },
    /// tanh(γ·q̇)·exp(−(q̇/v)²): Stribeck's bump.
    Stribeck {
        /// γ, s/rad.
        steepness: T,
        /// v, rad/s.
        velocity: T,
    },
    /// tanh(γ·q̇)·|q̇|^p.
    Power {
        /// γ, s/rad.
        steepness: T,
        /// p.
        power: T,
    },
    /// Dahl's presliding state z, −1 to 1, wound up over a distance: dz/dq = (1 − z·sign q̇)·sign q̇/δ; 0 at
    /// the start.
    Presliding {
        /// δ, rad.
        distance: T,
    },
    /// q: a spring's pull.
    Position,
    /// cos(k·q).
    Cosine {
        /// k, cycles a joint turn.
        order: T,
    },
    /// sin(k·q).
    Sine {
        /// k, cycles a joint turn.
        order: T,
    },
    /// tanh(γ·q̇)·cos(k·q): Coulomb friction that differs from place to place.
    DirectionCosine {
        /// k, cycles a joint turn.
        order: T,
        /// γ, s/rad.
        steepness: T,
    },
    /// tanh(γ·q̇)·sin(k·q).
    DirectionSine {
        /// k, cycles a joint turn.
        order: T,
        /// γ, s/rad.
        steepness: T,
    },
    /// f(q̇)·e^(−t/T): Eq. 16 friction that warmth takes away.
    CoolFriction {
        /// T, s.
        time_constant: T,
    },
    /// q̇·e^(−t/T): its viscous part alone.
    CoolVelocity {
        /// T, s.
        time_constant: T,
    },
    /// f(q̇)·(ϑ − ϑ₀)/10 K with a measured temperature.
    HotFriction {
        /// ϑ₀, °C.
        reference: T,
    },
    /// q̇·(ϑ − ϑ₀)/10 K.
    HotVelocity {
        /// ϑ₀, °C.
        reference: T,
    },
    /// tanh(γ·q̇ₖ) of another joint k.
    OtherDirection {
        /// k, from 0.
        other: usize,
        /// γ, s/rad.
        steepness: T,
    },
    /// q̇ₖ of another joint k.
    OtherVelocity {
        /// k, from 0.
        other: usize,
    },
    /// q̈ₖ of another joint k.
    OtherAcceleration {
        /// k, from 0.
        other: usize,
    },
    /// tanh(γ·(a·q̇ + b·q̇ₖ)): Coulomb friction of a motor that turns with two joints.
    SumDirection {
        /// k, from 0.
        other: usize,
        /// a: how far the motor turns with this joint.
        own: T,
        /// b: how far it turns with the other one.
        theirs: T,
        /// γ, s/rad.
        steepness: T,
    },
    /// a·q̇ + b·q̇ₖ: its viscous friction.
    SumVelocity {
        /// k, from 0.
        other: usize,
        /// a.
        own: T,
        /// b.
        theirs: T,
    },
    /// a·q̈ + b·q̈ₖ: its rotor's inertia.
    SumAcceleration {
        /// k, from 0.
        other: usize,
        /// a.
        own: T,
        /// b.
        theirs: T,
    },
    /// qₖ of another joint k.
    OtherPosition {
        /// k, from 0.
        other: usize,
    },
    /// qᵢ·qₖ of two joints.
    PositionProduct {
        /// i and k, from 0.
        joints: [usize; 2],
    },
    /// cos(a·qᵢ + b·qₖ) of two joints.
    CosineOfTwo {
        /// i and k, from 0.
        joints: [usize; 2],
        /// a and b.
        orders: [T; 2],
    },
    /// sin(a·qᵢ + b·qₖ) of two joints.
    SineOfTwo {
        /// i and k, from 0.
        joints: [usize; 2],
        /// a and b.
        orders: [T; 2],
    },
    /// q̇·q̇ₖ with another joint k.
    VelocityProduct {
        /// k, from 0.
        other: usize,
    },
    /// q̇·|q̇ₖ| with another joint k.
    VelocityByMagnitude {
        /// k, from 0.
        other: usize,
    },
    /// τ of the rigid arm with friction: a factor between current and torque.
    Torque,
    /// τ·|τ|/s: a factor that changes with the torque.
    TorqueMagnitude {
        /// s, N·m.
        scale: T,
    },
    /// τ·(τ/s)².
    TorqueSquare {
        /// s, N·m.
        scale: T,
    },
    /// −τ_rigid while the motor crosses its play after a reversal, else 0.
    Gap {
        /// The play, rad.
        gap: T,
    },
    /// Where the load turns, the link leaves the flank and flies through the play: −τ_rigid on the way, and
    /// the impulse with which the other flank takes it up, without a bounce.
    Flight {
        /// The play times the inertia that flies, N·m·s².
        reach: T,
    },
    /// The link gives way by −τ_rigid/K for a coefficient 1/K, rad/(N·m). Moves the link.
    Compliance,
    /// The link hangs to the side its load pushes it to: −tanh(50·τ_rigid/s). Moves the link.
    HangingBack {
        /// s, N·m: the largest load.
        scale: T,
    },
}

/// A law at a joint with its coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T> {
    /// The joint, from 0.
    pub joint: usize,
    /// The coefficient.
    pub coefficient: T,
    /// The law.
    pub law: Law<T>,
}

/// What a law remembers from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory<T> {
    started: bool,
    /// The last position, the farthest one in the present direction, or the link's in its play.
    place: T,
    /// Presliding state, the direction of the last reversal's end, or the link's velocity in its play.
    wound: T,
    /// Where the motion last reversed, or the last sample's time.
    turned: Option<T>,
}

impl<T: RealField + Copy> Default for Memory<T> {
    fn default() -> Self {
        Memory { started: false, place: T::zero(), wound: T::zero(), turned: None }
    }
}

fn of<T: RealField + Copy>(signal: &[T], joint: usize) -> T {
    signal.get(joint).copied().unwrap_or_else(T::zero)
}

/// a·qᵢ + b·qₖ.
fn angle<T: RealField + Copy>(q: &[T], [i, k]: [usize; 2], [a, b]: [T; 2]) -> T {
    a * of(q, i) + b * of(q, k)
}

fn number<T: RealField>(x: f64) -> T {
    nalgebra::convert(x)
}

/// sin x.
fn sine<T: RealField + Copy>(x: T) -> T {
    if is_single::<T>() { wave(x, T::zero()) } else { x.sin() }
}

/// cos x.
fn cosine<T: RealField + Copy>(x: T) -> T {
    if is_single::<T>() { wave(x, T::one()) } else { x.cos() }
}

/// Without `std` a single's own sine computes with doubles, which a microcontroller does in software.
fn is_single<T: 'static>() -> bool {
    TypeId::of::<T>() == TypeId::of::<f32>()
}

/// sin(x + ahead·π/2) with operations of single precision alone, within 1.2·10⁻⁷ up to 800 rad, and beyond to
/// what x is known to.
fn wave<T: RealField + Copy>(x: T, ahead: T) -> T {
    // π/2 in parts of 15, 15 and 24 bits: products of the first two with the number of turns are exact (Cody
    // and Waite).
    const PARTS: [f64; 3] = [1.570_800_781_25, -4.454_515_874_385_834e-6, 6.077_100_628_276_71e-11];
    // Taylor's series of sin r − r and cos r − 1, interpolated for |r| ≤ π/4.
    const SINE: [f64; 4] = [
        2.724_931_391_639_984e-6,
        -1.984_008_267_754_688_9e-4,
        8.333_331_905_305_386e-3,
        -0.166_666_671_633_720_4,
    ];
    const COSINE: [f64; 4] =
        [2.454_743_662_383_407_4e-5, -1.388_830_016_367_137_4e-3, 4.166_666_418_313_98e-2, -0.5];
    let turns = (x * number(FRAC_2_PI)).round();
    let r = PARTS.iter().fold(x, |r, part| r - turns * number(*part));
    let z = r * r;
    let series = |all: [f64; 4]| all.iter().fold(T::zero(), |sum, a| sum * z + number(*a)) * z;
    let quarters = turns + ahead;
    let half_turns = (quarters * number(0.5)).floor();
    let is_even = quarters == half_turns * number(2.0);
    let side = if is_even { r + r * series(SINE) } else { T::one() + series(COSINE) };
    if half_turns == (half_turns * number(0.5)).floor() * number(2.0) { side } else { -side }
}

impl<T: RealField + Copy> Law<T> {
    /// Whether the law needs the torques of an instant.
    #[must_use]
    pub fn needs_torque(&self) -> bool {
        matches!(
            self,
            Law::Load { .. }
                | Law::CoolFriction { .. }
                | Law::HotFriction { .. }
                | Law::Torque
                | Law::TorqueMagnitude { .. }
                | Law::TorqueSquare { .. }
                | Law::Gap { .. }
                | Law::Flight { .. }
        ) || self.moves_link()
    }

    /// Whether its torque is the same on whichever joint it acts: it depends on joints that it names itself.
    #[must_use]
    pub fn is_equal_on_all(&self) -> bool {
        matches!(
            self,
            Law::Constant
                | Law::OtherDirection { .. }
                | Law::OtherVelocity { .. }
                | Law::OtherAcceleration { .. }
                | Law::OtherPosition { .. }
                | Law::PositionProduct { .. }
                | Law::CosineOfTwo { .. }
                | Law::SineOfTwo { .. }
        )
    }

    /// Whether the law moves the link, so that the torque of the whole arm is another: [`Law::shift`] has it.
    #[must_use]
    pub fn moves_link(&self) -> bool {
        matches!(self, Law::Compliance | Law::HangingBack { .. })
    }

    /// How far the link of a joint under `load` N·m is from where its motor is, rad for a coefficient of 1.
    #[must_use]
    pub fn shift(&self, load: T) -> T {
        match *self {
            Law::Compliance => -load,
            Law::HangingBack { scale } => -(number::<T>(50.0) * load / scale).tanh(),
            _ => T::zero(),
        }
    }

    /// The torque for a coefficient of 1. Instants must be given in the order of time, each once.
    #[must_use]
    pub fn value(&self, joint: usize, now: &Instant<'_, T>, memory: &mut Memory<T>) -> T {
        let (q, dq) = (of(now.q, joint), of(now.dq, joint));
        let torque = || of(now.rigid, joint) + of(now.friction, joint);
        let heat = |reference: T| match now.temperature.get(joint) {
            Some(t) => (*t - reference) / number::<T>(10.0),
            None => T::zero(),
        };
        match *self {
            Law::Constant => T::one(),
            Law::VelocityMagnitude => dq.abs(),
            Law::Load { steepness } => of(now.rigid, joint).abs() * (steepness * dq).tanh(),
            Law::Stribeck { steepness, velocity } => {
                let x = dq / velocity;
                (steepness * dq).tanh() * (-(x * x)).exp()
            }
            Law::Power { steepness, power } => (steepness * dq).tanh() * dq.abs().powf(power),
            Law::Presliding { distance } => memory.wind(q, distance),
            Law::Position => q,
            Law::Cosine { order } => cosine(order * q),
            Law::Sine { order } => sine(order * q),
            Law::DirectionCosine { order, steepness } => (steepness * dq).tanh() * cosine(order * q),
            Law::DirectionSine { order, steepness } => (steepness * dq).tanh() * sine(order * q),
            Law::CoolFriction { time_constant } => {
                of(now.friction, joint) * (-now.running / time_constant).exp()
            }
            Law::CoolVelocity { time_constant } => dq * (-now.running / time_constant).exp(),
            Law::HotFriction { reference } => of(now.friction, joint) * heat(reference),
            Law::HotVelocity { reference } => dq * heat(reference),
            Law::OtherDirection { other, steepness } => (steepness * of(now.dq, other)).tanh(),
            Law::OtherVelocity { other } => of(now.dq, other),
            Law::OtherAcceleration { other } => of(now.ddq, other),
            Law::SumDirection { other, own, theirs, steepness } => {
                (steepness * (own * dq + theirs * of(now.dq, other))).tanh()
            }
            Law::SumVelocity { other, own, theirs } => own * dq + theirs * of(now.dq, other),
            Law::SumAcceleration { other, own, theirs } => {
                own * of(now.ddq, joint) + theirs * of(now.ddq, other)
            }
            Law::OtherPosition { other } => of(now.q, other),
            Law::PositionProduct { joints: [i, k] } => of(now.q, i) * of(now.q, k),
            Law::CosineOfTwo { joints, orders } => cosine(angle(now.q, joints, orders)),
            Law::SineOfTwo { joints, orders } => sine(angle(now.q, joints, orders)),
            Law::VelocityProduct { other } => dq * of(now.dq, other),
            Law::VelocityByMagnitude { other } => dq * of(now.dq, other).abs(),
            Law::Torque => torque(),
            Law::TorqueMagnitude { scale } => torque() * torque().abs() / scale,
            Law::TorqueSquare { scale } => {
                let share = torque() / scale;
                torque() * (share * share)
            }
            Law::Gap { gap } => {
                if memory.crosses(q, gap) {
                    -of(now.rigid, joint)
                } else {
                    T::zero()
                }
            }
            Law::Flight { reach } => memory.fly(of(now.rigid, joint), reach, now.running),
            Law::Compliance | Law::HangingBack { .. } => T::zero(),
        }
    }
}

impl<T: RealField + Copy> Memory<T> {
    /// Dahl's state at the next position, exact for a step of any size.
    fn wind(&mut self, q: T, distance: T) -> T {
        let step = if self.started { q - self.place } else { T::zero() };
        (self.started, self.place) = (true, q);
        if step != T::zero() {
            let side = step.signum();
            self.wound = side + (self.wound - side) * (-step.abs() / distance).exp();
        }
        self.wound
    }

    /// J·ẍ of a link that is x ahead of its motor, within the play: x = `place`/J, ẋ = `wound`/J. No torque
    /// passes in flight, so J·ẍ = −load; a flank stops it within a sample.
    fn fly(&mut self, load: T, reach: T, time: T) -> T {
        let flank = reach * number(0.5);
        if !self.started {
            // The motor pushes: the link is behind it.
            (self.started, self.place) = (true, -load.signum() * flank);
        }
        let step = self.turned.replace(time).map_or_else(T::zero, |before| time - before);
        if step <= T::zero() {
            return T::zero();
        }
        let before = self.wound;
        self.wound -= load * step;
        self.place += self.wound * step;
        if self.place.abs() >= flank {
            (self.place, self.wound) = (self.place.signum() * flank, T::zero());
        }
        (self.wound - before) / step
    }

    /// Whether the motor has moved less than the gap since its motion last reversed.
    fn crosses(&mut self, q: T, gap: T) -> bool {
        if !self.started {
            (self.started, self.place) = (true, q);
        }
        let step = q - self.place;
        let along = step * self.wound;
        // A reversal counts once it is larger than encoder steps.
        if along < T::zero() && step.abs() > gap * number(0.1) {
            (self.turned, self.wound, self.place) = (Some(self.place), step.signum(), q);
        } else if self.wound == T::zero() && step.abs() > gap {
            (self.wound, self.place) = (step.signum(), q);
        } else if along > T::zero() {
            self.place = q;
        }
        self.turned.is_some_and(|turned| (q - turned).abs() < gap)
    }
}

/// Adds the torque of every term, N·m, to `torque`; each term has its own memory.
pub fn add_torques<T: RealField + Copy>(
    terms: &[Term<T>],
    memory: &mut [Memory<T>],
    now: &Instant<'_, T>,
    torque: &mut [T],
) {
    for (term, memory) in terms.iter().zip(memory) {
        let value = term.law.value(term.joint, now, memory);
        if let Some(torque) = torque.get_mut(term.joint) {
            *torque += term.coefficient * value;
        }
    }
}

/// Moves positions from the motors' to the links', given the torque of the rigid arm at the motors'
/// positions.
pub fn move_links<T: RealField + Copy>(terms: &[Term<T>], rigid: &[T], q: &mut [T]) {
    for term in terms.iter().filter(|term| term.law.moves_link()) {
        if let Some(q) = q.get_mut(term.joint) {
            *q += term.coefficient * term.law.shift(of(rigid, term.joint));
        }
    }
}

/// K terms with what they remember: the correction of a controller.
#[derive(Clone, Debug)]
pub struct Corrector<T, const K: usize> {
    terms: [Term<T>; K],
    memory: [Memory<T>; K],
}

impl<T: RealField + Copy, const K: usize> Corrector<T, K> {
    /// A correction that remembers nothing yet.
    #[must_use]
    pub fn new(terms: [Term<T>; K]) -> Self {
        Corrector { terms, memory: [Memory::default(); K] }
    }

    /// Whether some term moves a link: then the rigid torque must be taken again where
    /// [`Corrector::move_links`] says.
    #[must_use]
    pub fn moves_links(&self) -> bool {
        self.terms.iter().any(|term| term.law.moves_link())
    }

    /// See [`move_links`].
    pub fn move_links(&self, rigid: &[T], q: &mut [T]) {
        move_links(&self.terms, rigid, q);
    }

    /// See [`add_torques`]; call it once a sample.
    pub fn add_torques(&mut self, now: &Instant<'_, T>, torque: &mut [T]) {
        add_torques(&self.terms, &mut self.memory, now, torque);
    }
}
