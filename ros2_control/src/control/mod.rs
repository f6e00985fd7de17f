//! Control laws over an arm's functions in C: what `include/powerball_control.h` says, in Rust.

pub mod abi;
mod functions;

pub use functions::ArmFunctions;

use functions::{Memory, Table};
use nalgebra::SVector;
use powerball::controller::dynamics::{ArmModel, Reference, State};
use powerball::controller::laws::{ComputedTorque, Limiter, MomentumObserver, largest_pole};

/// Which law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// The weight alone.
    Gravity,
    /// Inverse dynamics with a PD of the acceleration.
    ComputedTorque,
}

/// How an arm is controlled.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which law.
    pub law: Law,
    /// Time between two cycles, s.
    pub period: f64,
    /// Angular frequency of the errors, rad/s; 0 takes the law's default.
    pub bandwidth: f64,
    /// Damping ratio of the errors.
    pub damping: f64,
    /// Angular frequency of the low pass over external torques, rad/s.
    pub observer_bandwidth: f64,
    /// The most torque of each joint, N·m.
    pub effort_limits: Vec<f64>,
    /// The most change of it, N·m/s.
    pub effort_rate_limits: Vec<f64>,
}

/// What a cycle is asked with: one number a joint in each.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Measured positions, rad, and velocities, rad/s.
    pub state: [&'a [f64]; 2],
    /// Positions, velocities and accelerations that are wanted; `None` for those of the last cycle.
    pub reference: Option<[&'a [f64]; 3]>,
    /// Time since the last cycle, s.
    pub period: f64,
}

/// Why a cycle gives no torque: its state or its period is no number, or nothing was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused;

/// A controlled arm of any number of joints.
pub trait Control {
    /// Joints.
    fn joints(&self) -> usize;
    /// Begins anew at these positions, rad.
    ///
    /// # Errors
    /// Where one is no number.
    fn start(&mut self, position: &[f64]) -> Result<(), Refused>;
    /// A cycle: torques for the joints and external torques, N·m.
    ///
    /// # Errors
    /// [`Refused`]; nothing changes then.
    fn update(&mut self, asked: &Asked<'_>, effort: &mut [f64], external: &mut [f64]) -> Result<(), Refused>;
}

/// A control of an arm's functions.
///
/// # Errors
/// What does not fit, in words.
///
/// # Safety
/// The functions are as the header declares them.
pub unsafe fn open(arm: &ArmFunctions, options: &Options) -> Result<Box<dyn Control>, String> {
    Ok(match arm.joints {
        1 => Box::new(Loop::<1>::new(arm, options)?),
        2 => Box::new(Loop::<2>::new(arm, options)?),
        3 => Box::new(Loop::<3>::new(arm, options)?),
        4 => Box::new(Loop::<4>::new(arm, options)?),
        5 => Box::new(Loop::<5>::new(arm, options)?),
        6 => Box::new(Loop::<6>::new(arm, options)?),
        7 => Box::new(Loop::<7>::new(arm, options)?),
        8 => Box::new(Loop::<8>::new(arm, options)?),
        other => return Err(known(other).err().unwrap_or_default()),
    })
}

/// Whether there is a control for this many joints.
fn known(joints: usize) -> Result<(), String> {
    if (1..=8).contains(&joints) {
        Ok(())
    } else {
        Err(format!("the arm has {joints} joints: 1 to 8 can be controlled"))
    }
}

type Joints<const N: usize> = SVector<f64, N>;

struct Loop<const N: usize> {
    arm: Table<N>,
    /// None: the weight alone.
    law: Option<ComputedTorque<f64, N>>,
    limiter: Limiter<f64, N>,
    observer: MomentumObserver<f64, N>,
    /// Friction and effects along the reference, and along what is measured.
    wanted: Memory<N>,
    measured: Memory<N>,
    /// What these took of the torque in the last cycle, as measured, N·m.
    lost: Joints<N>,
    /// None before the start.
    reference: Option<Reference<f64, N>>,
    /// Since the start, s.
    running: f64,
}

impl<const N: usize> Loop<N> {
    fn new(arm: &ArmFunctions, options: &Options) -> Result<Self, String> {
        let table = Table::<N>::of(arm)?;
        let limits = |values: &[f64], what: &str| -> Result<Joints<N>, String> {
            if values.len() != N || !values.iter().all(|x| x.is_finite() && *x > 0.0) {
                return Err(format!(
                    "{what} are {values:?}: a positive number for each of {N} joints is needed"
                ));
            }
            Ok(SVector::from_column_slice(values))
        };
        let torque = limits(&options.effort_limits, "effort limits, N·m,")?;
        let rate = limits(&options.effort_rate_limits, "effort rate limits, N·m/s,")?;
        positive(options.period, "the period, s,")?;
        positive(options.observer_bandwidth, "the observer's bandwidth, rad/s,")?;
        let law = match options.law {
            Law::Gravity => None,
            Law::ComputedTorque => Some(computed_torque(&table, options)?),
        };
        let none = SVector::zeros();
        Ok(Loop {
            arm: table,
            law,
            limiter: Limiter::new(torque, rate, none),
            observer: MomentumObserver::new(options.observer_bandwidth),
            wanted: Memory::of(arm)?,
            measured: Memory::of(arm)?,
            lost: none,
            reference: None,
            running: 0.0,
        })
    }
}

fn positive(value: f64, what: &str) -> Result<(), String> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(format!("{what} is {value}: it must be positive"))
    }
}

/// The law with its gains, where its sampled loop is stable.
fn computed_torque<const N: usize>(
    arm: &Table<N>,
    options: &Options,
) -> Result<ComputedTorque<f64, N>, String> {
    let mut law = ComputedTorque::for_period(options.period);
    positive(options.damping, "the damping ratio")?;
    if options.bandwidth != 0.0 {
        positive(options.bandwidth, "the bandwidth, rad/s,")?;
        law = ComputedTorque::of_bandwidth(options.bandwidth);
    }
    law.derivative *= options.damping;
    // B stands in the gains and in the arm: the loop has the same poles at every pose.
    let inertia = arm.mass_matrix(&SVector::zeros());
    if inertia.cholesky().is_none() {
        return Err(
            "the model's mass matrix is not positive at q = 0: no arm can have its values".to_string()
        );
    }
    let [stiffness, damping] = law.stiffness_and_damping(&inertia);
    let pole = largest_pole(&inertia, &stiffness, &damping, options.period);
    if pole.is_stable() {
        return Ok(law);
    }
    Err(format!(
        "a bandwidth of {} rad/s with a damping ratio of {} is unstable at {} Hz and a cycle of delay \
         (largest pole {:.3}): take less, {:.3} rad/s by default",
        law.proportional.max().sqrt(),
        options.damping,
        1.0 / options.period,
        pole.0,
        0.1 / options.period
    ))
}

/// One number a joint, where all are numbers.
fn finite<const N: usize>(values: &[f64]) -> Option<Joints<N>> {
    let all = <[f64; N]>::try_from(values).ok()?;
    all.iter().all(|x| x.is_finite()).then(|| all.into())
}

impl<const N: usize> Control for Loop<N> {
    fn joints(&self) -> usize {
        N
    }

    fn start(&mut self, position: &[f64]) -> Result<(), Refused> {
        let q = finite::<N>(position).ok_or(Refused)?;
        let none = SVector::zeros();
        // What holds the arm is where the torque comes from: its limit of rate does not let it sag first.
        let Limiter { torque, rate, .. } = self.limiter;
        let held = self.arm.gravity(&q).zip_map(&torque, |held, most| held.max(-most).min(most));
        self.limiter = Limiter::new(torque, rate, held);
        self.observer = MomentumObserver::new(self.observer.bandwidth);
        self.wanted.begin();
        self.measured.begin();
        (self.lost, self.running) = (none, 0.0);
        self.reference = Some(Reference::at_rest(q));
        Ok(())
    }

    fn update(&mut self, asked: &Asked<'_>, effort: &mut [f64], external: &mut [f64]) -> Result<(), Refused> {
        let [q, dq] = asked.state;
        let state = State { q: finite(q).ok_or(Refused)?, dq: finite(dq).ok_or(Refused)? };
        let last = self.reference.ok_or(Refused)?;
        let period = asked.period;
        if !(period.is_finite() && period > 0.0) {
            return Err(Refused);
        }
        self.running += period;
        let goal = asked.reference.map_or(last, |[q, dq, ddq]| match (finite(q), finite(dq), finite(ddq)) {
            (Some(q), Some(dq), Some(ddq)) => Reference { q, dq, ddq },
            _ => Reference::at_rest(last.q),
        });
        self.reference = Some(goal);

        let now = Reference { q: state.q, dq: state.dq, ddq: SVector::zeros() };
        let lost = self.measured.added(&self.arm, &now, self.running);
        let acted = self.limiter.last() - (self.lost + lost) * 0.5;
        self.lost = lost;
        let seen = self.observer.advance(&self.arm, &state, &acted, period);

        let torque = match &self.law {
            None => self.arm.gravity(&state.q),
            Some(law) => {
                law.torque(&self.arm, &state, &goal) + self.wanted.added(&self.arm, &goal, self.running)
            }
        };
        effort.copy_from_slice(self.limiter.limit(&torque, period).as_slice());
        external.copy_from_slice(seen.as_slice());
        Ok(())
    }
}

#[cfg(test)]
mod tests;
