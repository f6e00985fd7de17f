//! One joint's motion that loads another: shared bearings, cables, belts through a joint.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use crate::controller::friction::TanhFriction;
use serde_json::{Value, json};

/// On joint i: c·tanh(γ·q̇ₖ), c·q̇ₖ or c·q̈ₖ of another joint k; or a friction of k's own steepnesses with
/// levels of its own, c₁·tanh(γ₂·q̇ₖ) + c₂·tanh(γ₄·q̇ₖ) + c₃·q̇ₖ (Eq. 16).
pub(super) struct JointCoupling;

const FORMS: [&str; 4] = ["coulomb", "viscous", "inertial", "friction"];
const FRICTION: usize = 3;

impl Effect for JointCoupling {
    fn name(&self) -> &'static str {
        "joint_coupling"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Speed(candidate.values[0] as usize)
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let joints: Vec<usize> = context.moving_joints().collect();
        let options = FORMS.len() * joints.len().saturating_sub(1);
        let mut candidates = Vec::new();
        for &i in &joints {
            for &k in joints.iter().filter(|k| **k != i) {
                for form in 0..FRICTION {
                    candidates.push(Candidate::on(i, form, vec![k as f64], options));
                }
                let [g1, g2, g3, g4, _] = context.fit.friction(k);
                let mut values = vec![k as f64];
                values.extend([(g1, g2), (g3, g4)].iter().filter(|level| level.0 > 0.0).map(|level| level.1));
                if values.len() > 1 {
                    candidates.push(Candidate::on(i, FRICTION, values, options));
                }
            }
        }
        candidates
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let other = candidate.values[0] as usize;
        match candidate.form {
            0 => vec![Law::OtherDirection { other, steepness: context.steepness(other) }],
            1 => vec![Law::OtherSpeed { other }],
            2 => vec![Law::OtherAcceleration { other }],
            _ => {
                let level = |steepness: &f64| Law::OtherDirection { other, steepness: *steepness };
                let mut laws: Vec<_> = candidate.values[1..].iter().map(level).collect();
                laws.push(Law::OtherSpeed { other });
                laws
            }
        }
    }

    fn parameters(&self, context: &Context<'_>, found: &[Found<'_>]) -> Value {
        // Of a friction: its share in that of the other joint, at that joint's top speed.
        let coefficient = |f: &Found<'_>| {
            if f.candidate.form < FRICTION {
                return f.coefficients[0];
            }
            let other = f.candidate.values[0] as usize;
            let speed = context.top_speed(other);
            let levels = f.candidate.values[1..].iter().map(|steepness| (steepness * speed).tanh());
            let felt: f64 = levels.chain([speed]).zip(f.coefficients).map(|(x, c)| c * x).sum();
            felt / TanhFriction::new(context.fit.friction(other)).torque(speed)
        };
        json!({
            "coefficient": found.iter().map(coefficient).collect::<Vec<_>>(),
            "from_joint": found.iter().map(|f| f.candidate.values[0] as usize + 1).collect::<Vec<_>>(),
            "law": found.iter().map(|f| FORMS[f.candidate.form]).collect::<Vec<_>>(),
        })
    }
}
