//! The signals that a motor's torque is compared with.

use crate::controller::correction::{Instant, Law, Memory};
use crate::logs::regression::Recording;
use crate::logs::signal::difference;

/// One signal. What has a setting is there once for each that is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    /// The motor's torque.
    Motor,
    /// τ, the torque on the link's side.
    Link,
    /// q̈.
    Acceleration,
    /// q̇.
    Velocity,
    /// 1.
    Constant,
    /// τ̇.
    LinkRate,
    /// tanh(q̇/γ).
    Coulomb(usize),
    /// |τ|·tanh(q̇/γ).
    Load(usize),
    /// Dahl's state.
    Presliding(usize),
    /// tanh(γ·q̇)·exp(−(q̇/v)²).
    Bump(usize),
    /// tanh(γ·q̇)·|q̇|^p.
    Power(usize),
}

/// The settings that are tried on a joint.
#[derive(Clone, Debug)]
pub(super) struct Scales {
    /// γ, rad/s.
    pub widths: Vec<f64>,
    /// Distances of presliding, rad.
    pub distances: Vec<f64>,
    /// Velocities of a Stribeck bump, rad/s.
    pub bumps: Vec<f64>,
    /// Where the sign of a law has changed, s/rad.
    steepness: f64,
}

impl Scales {
    /// Powers of q̇.
    pub(super) const POWERS: [f64; Column::POWERS] = [0.5, 2.0, 3.0];

    /// For a joint whose fast velocity is `top`, rad/s.
    pub(super) fn new(top: f64) -> Scales {
        Scales {
            // From a step to a third of the velocities: friction that is sharper than what is tried would be
            // taken for presliding.
            widths: geometric(1e-3 * top, 0.3 * top, Column::WIDTHS),
            distances: geometric(1e-4, 0.02, Column::DISTANCES),
            bumps: geometric(0.02 * top, 0.3 * top, Column::BUMPS),
            steepness: 200.0 / top,
        }
    }
}

/// `count` numbers from `low` to `high` in equal ratios.
fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| low * (high / low).powf(k as f64 / (count - 1) as f64)).collect()
}

impl Column {
    pub(super) const WIDTHS: usize = 17;
    pub(super) const DISTANCES: usize = 8;
    pub(super) const BUMPS: usize = 5;
    pub(super) const POWERS: usize = 3;
    /// Columns in all.
    pub(super) const COUNT: usize = 6 + 2 * Self::WIDTHS + Self::DISTANCES + Self::BUMPS + Self::POWERS;

    /// All of them, each at its [`Column::index`].
    pub(super) fn all() -> Vec<Column> {
        let mut all = vec![
            Column::Motor,
            Column::Link,
            Column::Acceleration,
            Column::Velocity,
            Column::Constant,
            Column::LinkRate,
        ];
        all.extend((0..Self::WIDTHS).map(Column::Coulomb));
        all.extend((0..Self::WIDTHS).map(Column::Load));
        all.extend((0..Self::DISTANCES).map(Column::Presliding));
        all.extend((0..Self::BUMPS).map(Column::Bump));
        all.extend((0..Self::POWERS).map(Column::Power));
        all
    }

    /// Its place among all.
    pub(super) fn index(self) -> usize {
        let loads = 6 + Self::WIDTHS;
        let presliding = loads + Self::WIDTHS;
        let bumps = presliding + Self::DISTANCES;
        match self {
            Column::Motor => 0,
            Column::Link => 1,
            Column::Acceleration => 2,
            Column::Velocity => 3,
            Column::Constant => 4,
            Column::LinkRate => 5,
            Column::Coulomb(k) => 6 + k,
            Column::Load(k) => loads + k,
            Column::Presliding(k) => presliding + k,
            Column::Bump(k) => bumps + k,
            Column::Power(k) => bumps + Self::BUMPS + k,
        }
    }

    /// Whether its coefficient cannot be negative: inertia, and what takes power. Friction may grow slower
    /// than in proportion to the velocity, and either torque may be the later one.
    pub(super) fn is_non_negative(self) -> bool {
        !matches!(self, Column::Motor | Column::Link | Column::Constant | Column::LinkRate | Column::Power(_))
    }

    /// The signal along a recording; nothing for the motor's, which no recording holds.
    pub(super) fn signal(self, scales: &Scales, recording: &Recording, joint: usize) -> Vec<f64> {
        let link = &recording.torque[joint];
        let along = |law: Law<f64>| -> Vec<f64> {
            let mut memory = Memory::default();
            let states = recording.position(joint).zip(recording.velocity(joint)).zip(link);
            states
                .map(|((q, dq), torque)| {
                    let now = Instant {
                        q: &[q],
                        dq: &[dq],
                        ddq: &[],
                        rigid: &[*torque],
                        friction: &[],
                        temperature: &[],
                        running: 0.0,
                    };
                    law.value(0, &now, &mut memory)
                })
                .collect()
        };
        let steepness = scales.steepness;
        match self {
            Column::Motor => Vec::new(),
            Column::Link => link.clone(),
            Column::Acceleration => recording.acceleration(joint).collect(),
            Column::Velocity => recording.velocity(joint).collect(),
            Column::Constant => along(Law::Constant),
            Column::LinkRate => difference::derivative(link, 1.0 / recording.rate),
            Column::Coulomb(k) => recording.velocity(joint).map(|v| (v / scales.widths[k]).tanh()).collect(),
            Column::Load(k) => along(Law::Load { steepness: 1.0 / scales.widths[k] }),
            Column::Presliding(k) => along(Law::Presliding { distance: scales.distances[k] }),
            Column::Bump(k) => along(Law::Stribeck { steepness, velocity: scales.bumps[k] }),
            Column::Power(k) => along(Law::Power { steepness, power: Scales::POWERS[k] }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_is_at_its_index() {
        let all = Column::all();
        assert_eq!(all.len(), Column::COUNT);
        assert!(all.iter().enumerate().all(|(k, column)| column.index() == k));
    }
}
