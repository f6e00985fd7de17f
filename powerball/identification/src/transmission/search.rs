//! The search for effects of a transmission, judged on logs that were not fitted.
//!
//! The module also lists the effects that a transmission may have in addition to friction and rotor.

use super::Transmission;
use super::fit::{FittedLaw, noise_share};
use super::products::{Column, Evidence, Products, Scales};
use crate::estimate::distribution::t_critical;
use powerball_controller::JointNumber;
use serde::Serialize;
use std::collections::BTreeMap;

/// An effect must lower the squared error by this share whichever part of the logs is held out.
const LEAST_GAIN: f64 = 0.1;
/// Least share of the motor torque's rms that an effect must explain: no user would notice less.
const LEAST_SIZE: f64 = 0.01;
/// It may move the ratio by this share, or by what the ratio without it is uncertain by, twice its standard
/// error: an effect that moves it further replaces the link's torque itself.
const SAME_RATIO: f64 = 0.2;
/// Probability of so large a coefficient by chance, by blocks. They depend on each other a little, and some
/// twenty settings are tried on each joint.
const LEVEL: f64 = 1e-4;
/// Effects on one joint at most.
const MOST: usize = 3;
/// Another effect whose residual is at most this many times that of the chosen one could be there instead.
const AS_GOOD: f64 = 1.1;
/// If more of a motor's torque stays, it does not belong to this joint: less than half of its square is
/// explained.
const UNRELATED: f64 = 0.7;
/// A link torque of which this share is noise determines no ratio.
const NOISE: f64 = 0.5;

/// An effect that was found.
#[derive(Debug)]
pub(super) struct Found {
    candidate: Candidate,
    gain: Vec<f64>,
    rivals: Vec<&'static str>,
}

/// Squares that are left when each part is held out in turn, and the part's own.
fn held_out(evidence: &Evidence, fixed: &[Candidate], options: &[Candidate]) -> Option<Vec<f64>> {
    let left = |part: usize| {
        let others = evidence.of(|k| k != part);
        Some(FittedLaw::best(&others, evidence.noise, fixed, options)?.left(&evidence.parts[part]))
    };
    (0..evidence.parts.len()).map(left).collect()
}

/// Ratio, rotor and friction alone.
///
/// # Errors
/// In words, where the motor's torque is not that of the joint, or the ratio is not determined.
pub(super) fn base(evidence: &Evidence, joint: JointNumber) -> Result<FittedLaw, String> {
    let all = evidence.of(|_| true);
    if noise_share(&all, evidence.noise) > NOISE {
        return Err(format!(
            "tau{joint} without friction and inertia hardly rises above its noise: let the joint carry a \
                load that changes"
        ));
    }
    let no_fit = || format!("motor{joint} and tau{joint} do not fit together: check both columns");
    let fit = FittedLaw::best(&evidence.fitted(), evidence.noise, &[], &[]).ok_or_else(no_fit)?;
    let whole = FittedLaw::best(&all, evidence.noise, &[], &[]).ok_or_else(no_fit)?;
    let left = share(evidence, &[]).ok_or_else(no_fit)?;
    let sure = whole.standard_errors(evidence, |_| true)[0] * critical(evidence, whole.columns.len());
    if left > UNRELATED || whole.ratio().abs() < sure || fit.ratio() * whole.ratio() <= 0.0 {
        return Err(format!(
            "motor{joint} does not follow tau{joint}: {:.0} % of it remains on logs that were not fitted, \
                with the ratio, rotor and friction that fit best. Is it this joint's motor, and is it \
             measured?",
            100.0 * left
        ));
    }
    Ok(fit)
}

/// The |t| that chance exceeds with probability [`LEVEL`].
fn critical(evidence: &Evidence, columns: usize) -> f64 {
    t_critical(LEVEL, evidence.blocks.len().saturating_sub(columns).max(1) as f64)
}

/// Share of the motor torque's rms that stays on the logs to judge on; without them, on each part in turn.
fn share(evidence: &Evidence, effects: &[Candidate]) -> Option<f64> {
    let left = held_out(evidence, effects, &[])?;
    let squares = evidence.parts.iter().map(|part| part.of(Column::Motor, Column::Motor));
    let counts = |part: usize| !evidence.held_out || part + 1 == evidence.parts.len();
    let pairs = left.iter().zip(squares).enumerate().filter(|(part, _)| counts(*part));
    let (left, all) = pairs.fold((0.0, 0.0), |(a, b), (_, (left, all))| (a + left.max(0.0), b + all));
    (all > 0.0).then(|| (left / all).sqrt())
}

/// Adds one effect after the other while one passes.
pub(super) fn search(evidence: &Evidence) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    while found.len() < MOST {
        let fixed: Vec<Candidate> = found.iter().map(|f| f.candidate).collect();
        match step(evidence, &fixed) {
            Some(next) => found.push(next),
            None => break,
        }
    }
    found
}

/// The best effect in addition to others, where one passes.
fn step(evidence: &Evidence, fixed: &[Candidate]) -> Option<Found> {
    let before = held_out(evidence, fixed, &[])?;
    let others = Kind::ALL.into_iter().filter(|kind| fixed.iter().all(|f| f.kind != *kind));
    let tried: Vec<(Kind, Vec<f64>)> =
        others.filter_map(|kind| Some((kind, held_out(evidence, fixed, &kind.candidates())?))).collect();
    let gain = |after: &[f64]| -> Vec<f64> { after.iter().zip(&before).map(|(a, b)| 1.0 - a / b).collect() };
    let least = |after: &[f64]| gain(after).into_iter().fold(f64::INFINITY, f64::min);
    let whole = evidence.of(|_| true).of(Column::Motor, Column::Motor);
    let taken = |after: &[f64]| before.iter().sum::<f64>() - after.iter().sum::<f64>();
    let passes = |kind: Kind, after: &[f64]| {
        let large = least(after) > LEAST_GAIN && taken(after) > LEAST_SIZE.powi(2) * whole;
        let candidate = large.then(|| sure(evidence, fixed, kind)).flatten();
        candidate.map(|candidate| (candidate, after.iter().sum::<f64>()))
    };
    let passed = tried.iter().filter_map(|(kind, after)| Some((passes(*kind, after)?, after)));
    let ((candidate, total), after) = passed.min_by(|((_, a), _), ((_, b), _)| a.total_cmp(b))?;
    let is_rival = |(kind, after): &&(Kind, Vec<f64>)| {
        *kind != candidate.kind && after.iter().sum::<f64>() <= AS_GOOD * total
    };
    let rivals = tried.iter().filter(is_rival).map(|(kind, _)| kind.name()).collect();
    Some(Found { candidate, gain: gain(after), rivals })
}

/// The setting of a kind that fits best, where its coefficient is sure and the fitted logs hold it as well.
fn sure(evidence: &Evidence, fixed: &[Candidate], kind: Kind) -> Option<Candidate> {
    let fit = |products: &Products| FittedLaw::best(products, evidence.noise, fixed, &kind.candidates());
    let whole = fit(&evidence.of(|_| true))?;
    let (last, error) = (whole.theta.last()?, *whole.standard_errors(evidence, |_| true).last()?);
    let fitted = fit(&evidence.fitted())?;
    let moves = |with: &FittedLaw, wanted: &dyn Fn(usize) -> bool| {
        let without = FittedLaw::best(&evidence.of(wanted), evidence.noise, fixed, &[])?;
        let allowed =
            (2.0 * without.standard_errors(evidence, wanted)[0]).max(SAME_RATIO * without.ratio().abs());
        Some((with.ratio() - without.ratio()).abs() > allowed)
    };
    let agrees = fitted.theta.last()? * last > 0.0
        && !moves(&whole, &|_| true)?
        && !moves(&fitted, &|part| evidence.is_fitted(part))?;
    let candidate = *fitted.effects.last()?;
    (agrees && last.abs() > error * critical(evidence, whole.columns.len())).then_some(candidate)
}

/// The report about a joint, torques at the link in `unit`.
pub(super) fn tell(
    evidence: &Evidence,
    scales: &Scales,
    (joint, unit): (JointNumber, &'static str),
    base: &FittedLaw,
    found: &[Found],
) -> Transmission {
    let candidates: Vec<Candidate> = found.iter().map(|f| f.candidate).collect();
    let fitted = evidence.fitted();
    let with = FittedLaw::best(&fitted, evidence.noise, &candidates, &[]).unwrap_or_else(|| base.clone());
    let effect = |(which, f): (usize, &Found)| TransmissionEffect {
        effect: f.candidate.kind.name(),
        parameters: f.candidate.figures(scales, with.effect(which)),
        gain: f.gain.clone(),
        rivals: f.rivals.clone(),
    };
    Transmission {
        joint,
        unit,
        ratio: with.ratio(),
        std: with.standard_errors(evidence, |part| evidence.is_fitted(part))[0],
        rotor_inertia: with.at_link(1),
        viscous: with.at_link(2),
        offset: with.at_link(3),
        coulomb: with.at_link(4),
        width: scales.widths[with.width],
        left: share(evidence, &[]).unwrap_or(f64::NAN),
        left_with: share(evidence, &candidates).unwrap_or(f64::NAN),
        effects: found.iter().enumerate().map(effect).collect(),
    }
}

// Effects that a transmission may have in addition to friction and rotor.

/// Figures of an effect by name, SI units.
pub type Figures = BTreeMap<&'static str, f64>;

/// An effect of a joint's transmission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TransmissionEffect {
    /// The effect's name.
    pub effect: &'static str,
    /// The effect's figures, at the link.
    pub parameters: Figures,
    /// By which share the squared error on logs that were not fitted falls, by direction: which part of the
    /// logs was held out.
    pub gain: Vec<f64>,
    /// Other effects that lower these errors nearly as much in its place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rivals: Vec<&'static str>,
}

impl TransmissionEffect {
    /// The effect's name with its figures.
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
    /// The candidate's column, with Coulomb friction of a width.
    pub(super) fn column(self, width: usize) -> Column {
        match self.kind {
            Kind::LoadFriction => Column::Load(width),
            Kind::Hysteresis => Column::Presliding(self.setting),
            Kind::Stribeck => Column::Bump(self.setting),
            Kind::VelocityNonlinearity => Column::Power(self.setting),
            Kind::TimeDelay => Column::LinkRate,
        }
    }

    /// The effect's figures, for a coefficient at the link.
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
