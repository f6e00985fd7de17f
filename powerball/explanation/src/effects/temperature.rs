//! Friction that changes as the joint warms: lubricant thins.

use super::candidate::{geometric, scaled};
use super::words::{Words, list, number};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use powerball_logs::regression::Recording;
use serde::Serialize;

/// τ = c·f(q̇)·e^(−t/T) on the clock common to all logs, or, where temperatures were logged, c·f(q̇)·(ϑ −
/// ϑ₀)/10 K; f is the whole friction or its viscous part.
pub(super) struct Temperature;

/// Settings of this effect: the part of friction that changes, and its cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The part of friction that changes.
    pub of: Friction,
    /// The quantity with which it changes.
    pub with: Warmth,
}

/// The part of a joint's friction that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Friction {
    /// All of Eq. 16.
    Whole,
    /// The viscous part of Eq. 16.
    Viscous,
}

/// The quantity with which friction changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warmth {
    /// Friction changes with the running time.
    RunningTime {
        /// T, s.
        time_constant: f64,
    },
    /// Friction changes with the logged temperature.
    Logged {
        /// ϑ₀: the temperature at the start of the logs, °C.
        reference: f64,
    },
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Change from cold to warm (or over 10 K), as a share of the cold friction.
    pub change: ByJoint,
    /// Time constant T, s; 0 if the change follows a logged temperature.
    pub time_constant: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let one = |(k, (change, time)): (usize, (&f64, &f64))| {
            let change = words.size(k, 100.0 * change);
            match *time > 0.0 {
                true => format!("{change} % of the friction when cold, within {} s", number(*time)),
                false => format!("{change} % for 10 K"),
            }
        };
        list(self.change.0.iter().zip(&self.time_constant.0).enumerate().map(one))
    }
}

/// Time constants tried on a joint, and the least, s: what fades faster is how a log begins, not warmth.
const TRIED: usize = 7;
const LEAST: f64 = 15.0;

impl Effect for Temperature {
    fn name(&self) -> &'static str {
        "temperature"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn needs_running_time(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Warmth
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let clock = |r: &Recording| r.clock + r.len() as f64 / r.rate;
        let end = context.data.recordings.iter().map(clock).fold(0.0, f64::max);
        // To much slower than the logs are long.
        let constants = geometric(LEAST, (2.0 * end).max(4.0 * LEAST), TRIED);
        let recordings = &context.data.recordings;
        let measured = recordings.iter().all(|r| r.temperature.is_some());
        let at_start = |j: usize| recordings.first()?.temperature.as_ref()?.get(j)?.first().copied();
        let mut candidates = Vec::new();
        for j in context.moving_joints() {
            for of in [Friction::Whole, Friction::Viscous] {
                let on = |with, searched| Candidate::on(j, Settings { of, with }, searched);
                for time_constant in &constants {
                    let with = Warmth::RunningTime { time_constant: *time_constant };
                    candidates.push(on(with, 2 * TRIED));
                }
                if let Some(reference) = at_start(j.index()).filter(|_| measured) {
                    candidates.push(on(Warmth::Logged { reference }, 2));
                }
            }
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let Some(Settings { of, with }) = Settings::of(candidate) else { return Vec::new() };
        vec![match (of, *with) {
            (Friction::Whole, Warmth::RunningTime { time_constant }) => Law::CoolFriction { time_constant },
            (Friction::Viscous, Warmth::RunningTime { time_constant }) => Law::CoolVelocity { time_constant },
            (Friction::Whole, Warmth::Logged { reference }) => Law::HotFriction { reference },
            (Friction::Viscous, Warmth::Logged { reference }) => Law::HotVelocity { reference },
        }]
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let Some(Settings { of, with: Warmth::RunningTime { time_constant } }) = Settings::of(candidate)
        else {
            return Vec::new();
        };
        let near = |f: f64| {
            let time_constant = scaled(*time_constant, f, share).max(LEAST);
            let with = Warmth::RunningTime { time_constant };
            candidate.with(Settings { of: *of, with })
        };
        [0.65, 0.8, 1.25, 1.5].map(near).to_vec()
    }

    /// Friction that is negative in the cold or in the warmth of the logs is impossible.
    fn possible(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> bool {
        let j = candidate.joints[0];
        let viscous = context.fit.friction(j.index())[4];
        let degrees = |reference: f64| {
            let all = context.data.recordings.iter().filter_map(|r| r.temperature.as_ref()?.get(j.index()));
            let all = all.flatten().map(|t| t - reference);
            all.fold([0.0f64, 0.0f64], |[low, high], t| [low.min(t), high.max(t)])
        };
        match Settings::of(candidate) {
            Some(Settings { of: Friction::Whole, with: Warmth::RunningTime { .. } }) => c[0] > -1.0,
            Some(Settings { of: Friction::Viscous, with: Warmth::RunningTime { .. } }) => {
                viscous + c[0] >= 0.0
            }
            Some(Settings { of: Friction::Whole, with: Warmth::Logged { reference } }) => {
                degrees(*reference).iter().all(|t| 1.0 + c[0] * t > 0.0)
            }
            Some(Settings { of: Friction::Viscous, with: Warmth::Logged { reference } }) => {
                degrees(*reference).iter().all(|t| viscous + c[0] * t >= 0.0)
            }
            None => true,
        }
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let change = |f: &Found<'_>| {
            let c = f.coefficients[0];
            let viscous = context.fit.friction(f.candidate.joints[0].index())[4];
            match Settings::of(f.candidate) {
                Some(Settings { of: Friction::Whole, with: Warmth::RunningTime { .. } }) => -c / (1.0 + c),
                Some(Settings { of: Friction::Viscous, with: Warmth::RunningTime { .. } }) => {
                    -c / (viscous + c)
                }
                Some(Settings { of: Friction::Viscous, .. }) => c / viscous.max(1e-9),
                _ => c,
            }
        };
        let time = |f: &Found<'_>| match Settings::of(f.candidate).map(|settings| settings.with) {
            Some(Warmth::RunningTime { time_constant }) => time_constant,
            _ => 0.0,
        };
        Figures { change: ByJoint::of(found, change), time_constant: ByJoint::of(found, time) }.into()
    }
}
