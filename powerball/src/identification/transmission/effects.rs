//! What a transmission may hold beside friction and rotor.

use super::columns::{Column, Scales};
use serde::Serialize;
use std::collections::BTreeMap;

/// Figures of an effect by name, SI units.
pub type Figures = BTreeMap<&'static str, f64>;

/// An effect of a joint's transmission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TransmissionEffect {
    /// Its name.
    pub effect: &'static str,
    /// Its figures, at the link.
    pub parameters: Figures,
    /// By which share the squared error on logs that were not fitted falls, by direction: which part of the
    /// logs was held out.
    pub gain: Vec<f64>,
    /// Other effects that lower these errors nearly as much in its place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rivals: Vec<&'static str>,
}

impl TransmissionEffect {
    /// Its name with its figures.
    #[must_use]
    pub fn in_words(&self) -> String {
        let figures: Vec<String> =
            self.parameters.iter().map(|(name, x)| format!("{name} {x:.3e}")).collect();
        let or = match self.rivals.as_slice() {
            [] => String::new(),
            rivals => format!("; or {}", rivals.join(", ")),
        };
        format!("{} ({}{or})", self.effect, figures.join(", "))
    }
}

/// The kinds of effects. Friction laws of another shape are among them so that none of the others takes their
/// place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// μ·|τ|·tanh(q̇/γ).
    LoadFriction,
    /// c·z, Dahl's z.
    Hysteresis,
    /// c·tanh·exp(−(q̇/v)²).
    Stribeck,
    /// c·tanh·|q̇|^p.
    VelocityNonlinearity,
    /// The motor's torque comes later than the link's.
    TimeDelay,
}

/// A kind with its setting: which of the tried ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Candidate {
    pub kind: Kind,
    pub setting: usize,
}

impl Kind {
    pub(super) const ALL: [Kind; 5] =
        [Kind::LoadFriction, Kind::Hysteresis, Kind::Stribeck, Kind::VelocityNonlinearity, Kind::TimeDelay];

    /// The name that it has among the effects of docs/explain.md.
    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::LoadFriction => "load_friction",
            Kind::Hysteresis => "hysteresis",
            Kind::Stribeck => "stribeck",
            Kind::VelocityNonlinearity => "velocity_nonlinearity",
            Kind::TimeDelay => "time_delay",
        }
    }

    /// One candidate for each setting.
    pub(super) fn candidates(self) -> Vec<Candidate> {
        let settings = match self {
            Kind::LoadFriction | Kind::TimeDelay => 1,
            Kind::Hysteresis => Column::DISTANCES,
            Kind::Stribeck => Column::BUMPS,
            Kind::VelocityNonlinearity => Column::POWERS,
        };
        (0..settings).map(|setting| Candidate { kind: self, setting }).collect()
    }
}

impl Candidate {
    /// Its column beside Coulomb friction of a width.
    pub(super) fn column(self, width: usize) -> Column {
        match self.kind {
            Kind::LoadFriction => Column::Load(width),
            Kind::Hysteresis => Column::Presliding(self.setting),
            Kind::Stribeck => Column::Bump(self.setting),
            Kind::VelocityNonlinearity => Column::Power(self.setting),
            Kind::TimeDelay => Column::LinkRate,
        }
    }

    /// Its figures, for a coefficient at the link.
    pub(super) fn figures(self, scales: &Scales, coefficient: f64) -> Figures {
        let list = match self.kind {
            Kind::LoadFriction => vec![("coefficient", coefficient)],
            Kind::Hysteresis => vec![("distance", scales.distances[self.setting]), ("level", coefficient)],
            Kind::Stribeck => vec![("level", coefficient), ("velocity", scales.bumps[self.setting])],
            Kind::VelocityNonlinearity => {
                vec![("coefficient", coefficient), ("power", Scales::POWERS[self.setting])]
            }
            // τ(t − d) = τ − d·τ̇.
            Kind::TimeDelay => vec![("delay", -coefficient)],
        };
        list.into_iter().collect()
    }
}
