//! Friction that changes as the joint warms: lubricant thins.

use super::candidate::{by_joint, geometric};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ = c·f(q̇)·e^(−t/T) on the clock common to all logs, f the whole friction (form 0) or its viscous part
/// (form 1); where temperatures were logged, c·f(q̇)·(ϑ − ϑ₀)/10 K (forms 2 and 3), ϑ₀ that at the start of
/// the logs.
pub(super) struct Temperature;

impl Effect for Temperature {
    fn name(&self) -> &'static str {
        "temperature"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Warmth
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let clock = |r: &crate::logs::regression::Recording| r.clock + r.len() as f64 / r.rate;
        let end = context.data.recordings.iter().map(clock).fold(0.0, f64::max);
        // From the first seconds to much slower than the logs are long.
        let constants = geometric(10.0, (2.0 * end).max(40.0), 7);
        let recordings = &context.data.recordings;
        let measured = recordings.iter().all(|r| r.temperature.is_some());
        let at_start = |j: usize| recordings.first()?.temperature.as_ref()?.get(j)?.first().copied();
        let mut candidates = Vec::new();
        for j in context.moving_joints() {
            for form in 0..2 {
                candidates.extend(constants.iter().map(|t| Candidate::on(j, form, vec![*t], 14)));
                if let Some(reference) = at_start(j).filter(|_| measured) {
                    candidates.push(Candidate::on(j, form + 2, vec![reference], 2));
                }
            }
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let setting = candidate.values[0];
        vec![match candidate.form {
            0 => Law::CoolFriction { time_constant: setting },
            1 => Law::CoolSpeed { time_constant: setting },
            2 => Law::HotFriction { reference: setting },
            _ => Law::HotSpeed { reference: setting },
        }]
    }

    fn neighbours(&self, candidate: &Candidate) -> Vec<Candidate> {
        let near = |f: f64| {
            let values = candidate.values.iter().map(|t| t * f).collect();
            Candidate { values, ..candidate.clone() }
        };
        if candidate.form < 2 { [0.65, 0.8, 1.25, 1.5].map(near).to_vec() } else { Vec::new() }
    }

    fn parameters(&self, context: &Context<'_>, found: &[Found<'_>]) -> Value {
        // From cold to warm, as a share of what it was cold.
        let change = |f: &Found<'_>| {
            let c = f.coefficients[0];
            let viscous = context.fit.friction(f.candidate.joints[0])[4];
            match f.candidate.form {
                0 => -c / (1.0 + c),
                1 => -c / (viscous + c),
                2 => c,
                _ => c / viscous.max(1e-9),
            }
        };
        let time = |f: &Found<'_>| if f.candidate.form < 2 { f.candidate.values[0] } else { 0.0 };
        json!({ "change": by_joint(found, change), "time_constant": by_joint(found, time) })
    }
}
