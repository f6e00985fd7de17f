//! One joint's motion that loads another: shared bearings, cables, belts through a joint.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::JointNumber;
use crate::controller::correction::Law;
use crate::controller::friction::TanhFriction;
use serde::Serialize;

/// On joint i: c·tanh(γ·q̇ₖ) (cross-joint Coulomb friction), c·q̇ₖ or c·q̈ₖ of another joint k; or a friction
/// of k's own steepnesses with levels of its own, c₁·tanh(γ₂·q̇ₖ) + c₂·tanh(γ₄·q̇ₖ) + c₃·q̇ₖ (Eq. 16).
pub(super) struct JointCoupling;

/// Whose motion is felt, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The joint k whose motion is felt.
    pub from: JointNumber,
    /// How it is felt.
    pub kind: Kind,
}

/// How another joint's motion is felt.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// As cross-joint Coulomb friction.
    Coulomb,
    /// In proportion to its velocity.
    Viscous,
    /// In proportion to its acceleration.
    Inertial,
    /// As its whole friction, with levels of its own.
    Friction {
        /// γ₂ and γ₄ of the joint, where their levels are not zero, s/rad.
        steepness: Vec<f64>,
    },
}

impl Kind {
    /// The name in results.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Kind::Coulomb => "coulomb",
            Kind::Viscous => "viscous",
            Kind::Inertial => "inertial",
            Kind::Friction { .. } => "friction",
        }
    }
}

/// Kinds that there are.
const KINDS: usize = 4;

/// What it is, one entry a pair of joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The coefficient of the law in SI units; of a friction its share in that of the other joint at that
    /// joint's top velocity.
    pub coefficient: Vec<f64>,
    /// The joint whose motion is felt.
    pub from_joint: Vec<JointNumber>,
    /// How it is felt: [`Kind::name`].
    pub law: Vec<&'static str>,
}

impl Effect for JointCoupling {
    fn name(&self) -> &'static str {
        "joint_coupling"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    /// A joint may feel several others.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.joints == b.joints && from(a) == from(b)
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Velocity(from(candidate).unwrap_or(candidate.joints[0]))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let joints: Vec<JointNumber> = context.moving_joints().collect();
        let options = KINDS * joints.len().saturating_sub(1);
        let mut candidates = Vec::new();
        for &i in &joints {
            for &k in joints.iter().filter(|k| **k != i) {
                let mut on = |kind| candidates.push(Candidate::on(i, Settings { from: k, kind }, options));
                [Kind::Coulomb, Kind::Viscous, Kind::Inertial].into_iter().for_each(&mut on);
                let [g1, g2, g3, g4, _] = context.fit.friction(k.index());
                let levels = [(g1, g2), (g3, g4)].into_iter().filter(|level| level.0 > 0.0);
                let steepness: Vec<f64> = levels.map(|level| level.1).collect();
                if !steepness.is_empty() {
                    on(Kind::Friction { steepness });
                }
            }
        }
        candidates
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let Some(Settings { from, kind }) = Settings::of(candidate) else { return Vec::new() };
        let other = from.index();
        match kind {
            Kind::Coulomb => vec![Law::OtherDirection { other, steepness: context.steepness(*from) }],
            Kind::Viscous => vec![Law::OtherSpeed { other }],
            Kind::Inertial => vec![Law::OtherAcceleration { other }],
            Kind::Friction { steepness } => {
                let level = |steepness: &f64| Law::OtherDirection { other, steepness: *steepness };
                steepness.iter().map(level).chain([Law::OtherSpeed { other }]).collect()
            }
        }
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let mut figures = Figures { coefficient: Vec::new(), from_joint: Vec::new(), law: Vec::new() };
        for f in found {
            let Some(Settings { from, kind }) = Settings::of(f.candidate) else { continue };
            figures.coefficient.push(coefficient(context, *from, kind, f.coefficients));
            figures.from_joint.push(*from);
            figures.law.push(kind.name());
        }
        figures.into()
    }
}

fn from(candidate: &Candidate) -> Option<JointNumber> {
    Settings::of(candidate).map(|settings| settings.from)
}

/// The one number that stands for a coupling (see [`Figures::coefficient`]).
fn coefficient(context: &Context<'_>, from: JointNumber, kind: &Kind, coefficients: &[f64]) -> f64 {
    let Kind::Friction { steepness } = kind else { return coefficients[0] };
    let velocity = context.top_speed(from);
    let levels = steepness.iter().map(|steepness| (steepness * velocity).tanh());
    let felt: f64 = levels.chain([velocity]).zip(coefficients).map(|(x, c)| c * x).sum();
    felt / TanhFriction::new(context.fit.friction(from.index())).torque(velocity)
}
