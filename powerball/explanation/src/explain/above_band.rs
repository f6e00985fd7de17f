//! Ripple that is too fast for the band of the regression.
//!
//! Teeth that pass at 30 Hz leave nothing in a band of 10 Hz, in which inertia is identified: above it
//! accelerations are noise. A ripple needs none. The residual above the band is summed by order, and the
//! highest peak of all joints is compared with those of time-shift surrogates, in which the same torque is
//! seen at other positions: the single-step test of Westfall and Young (1993) at one level for all joints and
//! orders. It must then lower the error above the band on the validation set, with the same phase.

use super::comparison::{Comparison, Step, relative_score};
use super::model::{Accepted, Model, Origin};
use super::study::Study;
use crate::effects::position_ripple::{BINS, PositionRipple, Settings, Spectrum};
use crate::effects::{Candidate, Context, Effect};
use powerball_controller::JointNumber;
use powerball_identification::estimate::distribution::{MANY, f_tail};
use powerball_identification::estimate::residual_stats;
use powerball_identification::evidence::{Chance, rotated};
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording};
use powerball_logs::signal::Band;
use std::f64::consts::{LN_2, TAU};
use std::slice;

/// Ripples of a joint, at most.
const MOST: usize = 4;
/// Below this height no surrogate is computed: among all these orders chance reaches it.
const LOWEST: f64 = 8.0;

/// Finds the ripples and takes them into the model. Returns the step that names them, if any.
pub(crate) fn ripple_above_band(study: &Study<'_>, model: &mut Model, number: usize) -> Option<Step> {
    let before = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let square_before = model.fit.residual.squares();
    let found = search(study, model);
    let score = found.iter().map(|f| f.score).fold(0.0, f64::max);
    let mut joints: Vec<JointNumber> = found.iter().map(|f| f.candidate.joints[0]).collect();
    joints.dedup();
    for ripple in found {
        model.add_above_band(study, ripple.accepted_by(number, study.data.dof()));
    }
    let after = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let margin = relative_score(study.rule(), score);
    let comparison = Comparison {
        margin,
        rivals: Vec::new(),
        twin: None,
        distinct_margin: margin,
        joints: joints.clone(),
    };
    let effect: &'static dyn Effect = &PositionRipple;
    let step = Step { number, effect, square_before, comparison, question: None, before, after };
    (!joints.is_empty()).then_some(step)
}

/// A ripple that passed.
struct Ripple {
    candidate: Candidate,
    /// Coefficients of its cosine and sine, N·m.
    coefficients: Vec<f64>,
    p_value: f64,
    gain: f64,
    score: f64,
}

impl Ripple {
    /// This ripple, accepted by a step, in the model of an arm with `dof` joints.
    fn accepted_by(self, number: usize, dof: usize) -> Accepted {
        let Ripple { candidate, coefficients, p_value, gain, .. } = self;
        Accepted {
            candidate,
            origin: Origin::AboveBand { number, coefficients },
            p_value,
            fold_gain: gain,
            explained: vec![0.0; dof],
        }
    }
}

fn search(study: &Study<'_>, model: &Model) -> Vec<Ripple> {
    let rule = study.rule();
    let of = |data: &Data<'_>| -> Vec<Vec<Trace>> {
        let context = Context::for_columns(data, &model.fit, rule);
        // Made once, before joints ask for them from several threads.
        context.rigid();
        context.friction();
        let joints: Vec<usize> = (0..data.dof()).collect();
        parallel::map(&joints, |j| traces(&context, model, *j))
    };
    let (mut fitted, validation) = (of(&study.data), of(&study.validation));
    let mut found: Vec<Ripple> = Vec::new();
    let mut chance: Option<Chance> = None;
    for j in 0..fitted.len() {
        for _ in 0..MOST {
            let left: Vec<&[f64]> = fitted[j].iter().map(|trace| trace.twice.as_slice()).collect();
            let Some(peak) = highest(&fitted[j], &left).filter(|peak| peak.height > LOWEST) else { break };
            let order = refined(&fitted[j], peak.order);
            let joint = JointNumber::from_index(j);
            let candidate = Candidate::on(joint, Settings { order }, BINS / 2);
            let wave = Wave::of(&fitted[j], order);
            let accepted = model.accepted.iter().map(|a| &a.candidate);
            if accepted.chain(found.iter().map(|f| &f.candidate)).any(|c| is_the_same(c, &candidate)) {
                fitted[j].iter_mut().for_each(|trace| trace.take_out(order, wave.coefficients));
                continue;
            }
            let Some(gain) = wave.gain_on(&validation[j], rule.family_wise) else { break };
            if gain.min(wave.gain(&fitted[j])) < rule.least_gain {
                break;
            }
            let chance = chance.get_or_insert_with(|| heights_by_chance(&fitted, rule.searched_surrogates()));
            let p_value = chance.p_value(peak.height);
            if p_value > rule.family_wise {
                break;
            }
            let coefficients = wave.coefficients;
            fitted[j].iter_mut().for_each(|trace| trace.take_out(order, coefficients));
            let score = 2.0 * peak.height - rule.penalty(2, BINS as f64 / 2.0);
            let ripple = Ripple { candidate, coefficients: coefficients.to_vec(), p_value, gain, score };
            if raises_error(study, model, &ripple) {
                break;
            }
            found.push(ripple);
        }
    }
    found
}

/// Whether two ripples of a joint are one: their orders differ by less than a path can tell.
fn is_the_same(a: &Candidate, b: &Candidate) -> bool {
    let order = |c: &Candidate| Settings::of(c).map(|settings| settings.order);
    let (Some(x), Some(y)) = (order(a), order(b)) else { return false };
    a.joints == b.joints && (x - y).abs() < APART
}

/// Whether the error on the validation set rises in the band: a ripple that is there passes it slowly where
/// the joint turns back.
fn raises_error(study: &Study<'_>, model: &Model, ripple: &Ripple) -> bool {
    let joint = ripple.candidate.joints[0].index();
    let columns = study.on_validation(&model.fit, &[]).columns(&ripple.candidate);
    let mut residual = model.residual_on_validation(study);
    let before = residual.squares()[joint];
    residual.subtract(&columns, &ripple.coefficients);
    residual.squares()[joint] > before
}

// The residual of a joint's torque above the band of the fit: along each recording, by order of the joint's
// position, and as one ripple.

/// A joint along one recording, while it moves.
pub(super) struct Trace {
    /// By sample: position, and velocity's size; none where the sample does not count.
    motion: Vec<Option<(f64, f64)>>,
    /// The residual above the band, passed twice through the high-pass: the filter is symmetric in
    /// time, so the product of this with any signal is that of both high-passed.
    pub(super) twice: Vec<f64>,
    /// Squared error above the band over samples that count, (N·m)².
    square: f64,
    band: Band,
    rate: f64,
}

/// The traces of a joint on all recordings of a context.
pub(super) fn traces(context: &Context<'_>, model: &Model, joint: usize) -> Vec<Trace> {
    let data = context.data;
    let rows = &data.joints[joint];
    let n = data.dof();
    let laws: Vec<_> = (model.accepted.iter().zip(model.coefficients()))
        .flat_map(|(a, c)| a.effect().placed_laws(context, &a.candidate).into_iter().zip(c))
        .flat_map(|(placed, c)| placed.into_iter().map(move |(at, law, share)| (at, law, share * c)))
        .filter(|(at, law, _)| at.index() == joint && !law.moves_link())
        .collect();
    let of = |(r, recording): (usize, &Recording)| {
        let own =
            |torque: &[Vec<f64>]| -> Vec<f64> { torque[r].iter().skip(joint).step_by(n).copied().collect() };
        // Above the widest band a rigid torque is noise of accelerations; friction changes its sign there.
        let rigid = data.band.filtered(&own(context.rigid()));
        let predicted = rigid.iter().zip(own(context.friction())).map(|(rigid, friction)| rigid + friction);
        let mut left: Vec<f64> = recording.torque[joint].iter().zip(predicted).map(|(t, p)| t - p).collect();
        for (at, law, coefficient) in &laws {
            let along = context.law_along(r, *at, *law);
            left.iter_mut().zip(along).for_each(|(l, v)| *l -= coefficient * v);
        }
        let mut motion = vec![None; recording.len()];
        let (q, v): (Vec<f64>, Vec<f64>) = recording.position(joint).zip(recording.velocity(joint)).unzip();
        let kept = rows.band.kept(recording.len());
        for k in &rows.kept[r] {
            let end = (kept[*k] + rows.band.decimation).min(motion.len());
            for at in kept[*k]..end {
                motion[at] = Some((q[at], v[at].abs()));
            }
        }
        Trace::new(left, motion, rows.band.clone(), recording.rate)
    };
    data.recordings.iter().enumerate().map(of).collect()
}

impl Trace {
    pub(super) fn new(left: Vec<f64>, motion: Vec<Option<(f64, f64)>>, band: Band, rate: f64) -> Trace {
        let high = high_passed(&band, &left);
        let square = high.iter().zip(&motion).filter(|(_, m)| m.is_some()).map(|(h, _)| h * h).sum();
        Trace { motion, twice: high_passed(&band, &high), square, band, rate }
    }

    /// Positions with values at those samples.
    fn at_positions<'t>(&'t self, values: &'t [f64]) -> impl Iterator<Item = (f64, f64)> + 't {
        self.motion.iter().zip(values).filter_map(|(m, value)| Some((m.as_ref()?.0, *value)))
    }

    /// Takes a ripple out.
    pub(super) fn take_out(&mut self, order: f64, [cosine, sine]: [f64; 2]) {
        let wave = |m: &Option<(f64, f64)>| {
            m.map_or(0.0, |(q, _)| cosine * (order * q).cos() + sine * (order * q).sin())
        };
        let ripple: Vec<f64> = self.motion.iter().map(wave).collect();
        let high = high_passed(&self.band, &high_passed(&self.band, &ripple));
        self.twice.iter_mut().zip(high).for_each(|(t, h)| *t -= h);
    }

    /// The power that the high-pass keeps of a ripple of an order at a velocity.
    fn kept(&self, order: f64, velocity: f64) -> f64 {
        let frequency = order * velocity / TAU;
        if frequency < 0.45 * self.rate {
            (1.0 - self.band.amplitude(frequency, self.rate)).powi(2)
        } else {
            0.0
        }
    }
}

fn high_passed(band: &Band, signal: &[f64]) -> Vec<f64> {
    signal.iter().zip(band.filtered(signal)).map(|(x, low)| x - low).collect()
}

/// Velocities are sorted into this many bins, for the frequencies at which an order passes.
const VELOCITIES: usize = 200;

/// How often a joint moves at which velocity.
struct Velocities {
    /// The highest, rad/s.
    top: f64,
    counts: Vec<f64>,
}

impl Velocities {
    fn of(traces: &[Trace]) -> Velocities {
        let all = || traces.iter().flat_map(|t| t.motion.iter().flatten().map(|(_, v)| *v));
        let top = all().fold(1e-9, f64::max);
        let mut counts = vec![0.0; VELOCITIES];
        all().for_each(|v| counts[((v / top * VELOCITIES as f64) as usize).min(VELOCITIES - 1)] += 1.0);
        Velocities { top, counts }
    }

    /// Samples in which a ripple of an order passes above the band, each by the power that is kept.
    fn above(&self, traces: &[Trace], order: f64) -> f64 {
        let Some(trace) = traces.first() else { return 0.0 };
        let velocity = |k: usize| self.top * (k as f64 + 0.5) / VELOCITIES as f64;
        self.counts.iter().enumerate().map(|(k, count)| count * trace.kept(order, velocity(k))).sum()
    }

    fn samples(&self) -> f64 {
        self.counts.iter().sum()
    }
}

/// Range of orders whose median gives the noise there, in cycles per turn.
const AROUND: f64 = 64.0;
/// An order is examined if this share of a joint's samples passes it above the band.
const LEAST_SHARE: f64 = 0.1;
/// Orders above this share of those that bins can hold are weakened by the bins.
const HIGHEST: f64 = 0.8 * BINS as f64 / 2.0;

/// The order that stands out most.
pub(super) struct Peak {
    pub(super) order: f64,
    /// Power of the order over that of noise around it: where there is noise alone, P(height > h) = e^(−h).
    pub(super) height: f64,
}

/// The highest peak of a joint, from one value a sample for each trace.
pub(super) fn highest(traces: &[Trace], values: &[&[f64]]) -> Option<Peak> {
    let spectrum =
        Spectrum::new(|| traces.iter().zip(values).flat_map(|(trace, values)| trace.at_positions(values)))?;
    let velocities = Velocities::of(traces);
    let least = LEAST_SHARE * velocities.samples();
    let block = (AROUND / spectrum.order(1)).ceil() as usize;
    let mut best: Option<Peak> = None;
    for first in (0..spectrum.values.len()).step_by(block) {
        let orders = first..(first + block).min(spectrum.values.len());
        let (from, to) = (spectrum.order(first), spectrum.order(orders.end));
        if to > HIGHEST {
            break;
        }
        // What passes the band changes slowly with the order.
        let (low, high) = (velocities.above(traces, from), velocities.above(traces, to));
        let above = |k: usize| low + (high - low) * (k - first) as f64 / orders.len() as f64;
        let power: Vec<(usize, f64)> = orders
            .clone()
            .filter(|k| above(*k) > least)
            .map(|k| (k, spectrum.values[k].norm_sqr() / above(k)))
            .collect();
        let mut sorted: Vec<f64> = power.iter().map(|(_, power)| *power).collect();
        sorted.sort_by(f64::total_cmp);
        // The median of what is distributed as e^(−h).
        let Some(noise) = sorted.get(sorted.len() / 2).map(|median| median / LN_2).filter(|n| *n > 0.0)
        else {
            continue;
        };
        for (k, power) in power {
            let height = power / noise;
            if best.as_ref().is_none_or(|b| height > b.height) {
                best = Some(Peak { order: spectrum.order(k), height });
            }
        }
    }
    best
}

/// Draws the surrogates.
const SEED: u64 = 12;

/// The highest peaks of all joints where the torque is shifted in time against the positions.
fn heights_by_chance(joints: &[Vec<Trace>], count: usize) -> Chance {
    Chance::of_search(count, SEED, |shift| {
        let of = |traces: &Vec<Trace>| {
            let shifted =
                |trace: &Trace| rotated(&trace.twice, slice::from_ref(&(0..trace.twice.len())), shift);
            let shifted: Vec<Vec<f64>> = traces.iter().map(shifted).collect();
            let values: Vec<&[f64]> = shifted.iter().map(Vec::as_slice).collect();
            highest(traces, &values).map_or(0.0, |peak| peak.height)
        };
        joints.iter().map(of).fold(0.0, f64::max)
    })
}

/// A ripple of an order, as a joint's traces have it.
pub(super) struct Wave {
    order: f64,
    /// Coefficients of cos(k·q) and sin(k·q), N·m.
    pub(super) coefficients: [f64; 2],
}

impl Wave {
    pub(super) fn of(traces: &[Trace], order: f64) -> Wave {
        let above = Velocities::of(traces).above(traces, order).max(f64::MIN_POSITIVE);
        Wave { order, coefficients: products(traces, order).map(|p| 2.0 * p / above) }
    }

    /// The share of the squared error above the band by which it lowers it.
    pub(super) fn gain(&self, traces: &[Trace]) -> f64 {
        let square: f64 = traces.iter().map(|trace| trace.square).sum();
        let own = 0.5 * self.power() * Velocities::of(traces).above(traces, self.order);
        if square > 0.0 { (2.0 * self.product(traces) - own) / square } else { 0.0 }
    }

    /// Like [`Self::gain`], if other logs have the ripple with the same phase: more than noise gives with
    /// probability `level`.
    pub(super) fn gain_on(&self, traces: &[Trace], level: f64) -> Option<f64> {
        let above = Velocities::of(traces).above(traces, self.order);
        let deviation = (0.5 * self.power() * noise_around(traces, self.order) * above).sqrt();
        let standard = self.product(traces) / deviation;
        let by_chance = 0.5 * f_tail(standard * standard, 1.0, MANY);
        (standard > 0.0 && by_chance < level).then(|| self.gain(traces))
    }

    fn power(&self) -> f64 {
        self.coefficients.iter().map(|c| c * c).sum()
    }

    fn product(&self, traces: &[Trace]) -> f64 {
        products(traces, self.order).iter().zip(self.coefficients).map(|(p, c)| p * c).sum()
    }
}

/// Products of the residual above the band with cos(k·q) and sin(k·q).
fn products(traces: &[Trace], order: f64) -> [f64; 2] {
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (q, value) in traces.iter().flat_map(|trace| trace.at_positions(&trace.twice)) {
        let (s, c) = (order * q).sin_cos();
        cosine += value * c;
        sine += value * s;
    }
    [cosine, sine]
}

/// The contribution of noise to |Σ τ·e^(−i·k·q)|² in a sample that passes above the band, at orders around
/// one.
fn noise_around(traces: &[Trace], order: f64) -> f64 {
    let velocities = Velocities::of(traces);
    let near = (0..2 * NEIGHBOURS).map(|k| {
        let away = FIRST + APART * (k / 2) as f64;
        if k % 2 == 0 { order + away } else { order - away }
    });
    let mut power: Vec<f64> = near
        .filter(|order| *order > 0.0)
        .map(|order| (order, velocities.above(traces, order)))
        .filter(|(_, above)| *above > 0.0)
        .map(|(order, above)| products(traces, order).iter().map(|p| p * p).sum::<f64>() / above)
        .collect();
    power.sort_by(f64::total_cmp);
    power.get(power.len() / 2).map_or(f64::INFINITY, |median| median / LN_2)
}

/// Orders on either side that say what noise gives, how far the first is and how far they are apart: a path
/// of four radians distinguishes two orders that differ by that much.
const NEIGHBOURS: usize = 20;
const FIRST: f64 = 4.0;
pub(super) const APART: f64 = 1.5;

/// The order near a peak of the spectrum at which the joint's torque has most.
pub(super) fn refined(traces: &[Trace], peak: f64) -> f64 {
    let at = |k: i32| peak + REACH * f64::from(k) / f64::from(STEPS);
    let power = |order: &f64| products(traces, *order).iter().map(|p| p * p).sum::<f64>();
    let orders: Vec<f64> = (-STEPS..=STEPS).map(at).collect();
    let powers = parallel::map(&orders, power);
    let best = (0..orders.len()).max_by(|a, b| powers[*a].total_cmp(&powers[*b]));
    best.map_or(peak, |best| orders[best])
}

/// How far from a peak the best order is looked for, in how many steps.
const REACH: f64 = 0.3;
const STEPS: i32 = 20;

#[cfg(test)]
mod traces_tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    const RATE: f64 = 250.0;

    /// A joint that swings along two paths, with noise and `ripple` on it, N·m.
    fn swinging(seed: u64, ripple: impl Fn(f64) -> f64) -> Vec<Trace> {
        swinging_at(RATE, seed, ripple)
    }

    fn swinging_at(rate: f64, seed: u64, ripple: impl Fn(f64) -> f64) -> Vec<Trace> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let band = Band::new(10.0, rate);
        let mut trace = |lag: f64| {
            let angle = |k: usize| 0.9 * k as f64 / rate + lag;
            let q = |k: usize| 1.2 * angle(k).sin() + 0.5 * (2.3 * angle(k)).cos();
            let v = |k: usize| 0.9 * (1.2 * angle(k).cos() - 1.15 * (2.3 * angle(k)).sin());
            let (mut left, mut slow) = (Vec::new(), 0.0);
            for k in 0..4000 {
                slow = 0.9 * slow + rng.random_range(-0.5..0.5);
                left.push(ripple(q(k)) + slow + rng.random_range(-1.0..1.0));
            }
            let motion = (0..4000).map(|k| (k > 100 && k < 3900).then(|| (q(k), v(k).abs()))).collect();
            Trace::new(left, motion, band.clone(), rate)
        };
        vec![trace(0.0), trace(2.0)]
    }

    fn peak(traces: &[Trace]) -> Peak {
        let left: Vec<&[f64]> = traces.iter().map(|t| t.twice.as_slice()).collect();
        highest(traces, &left).unwrap()
    }

    #[test]
    fn a_fast_ripple_is_found_with_its_order_size_and_phase() {
        let ripple = |q: f64| 0.3 * (161.3 * q).cos() - 0.2 * (161.3 * q).sin();
        let traces = swinging(1, ripple);
        let found = peak(&traces);
        let chance = heights_by_chance(&[swinging(1, ripple)], 99);
        assert!(chance.p_value(found.height) <= 0.01, "{} {chance:?}", found.height);
        let order = refined(&traces, found.order);
        assert!((order - 161.3).abs() < 0.1, "{order}");
        let wave = Wave::of(&traces, order);
        for (found, put_in) in wave.coefficients.iter().zip([0.3, -0.2]) {
            assert!((found - put_in).abs() < 0.04, "{:?}", wave.coefficients);
        }
        // Other logs have it, others do not, and others have it with another phase.
        let (gain, other) = (wave.gain(&traces), swinging(2, ripple));
        let on_validation = wave.gain_on(&other, 0.01).unwrap();
        assert!(gain > 0.02 && (on_validation / gain - 1.0).abs() < 0.5, "{gain} {on_validation}");
        assert!(wave.gain_on(&swinging(3, |_| 0.0), 0.01).is_none());
        assert!(wave.gain_on(&swinging(2, |q| -ripple(q)), 0.01).is_none());
    }

    /// Where a rate is low, the fastest samples cannot show the highest orders: those that are left out there
    /// shift no other.
    #[test]
    fn orders_keep_their_places_where_some_are_left_out() {
        let mut asked = 0;
        for order in (300..700).step_by(20).map(f64::from) {
            let traces = swinging_at(60.0, 1, |q| 2.0 * (order * q).cos());
            let velocities = Velocities::of(&traces);
            if velocities.above(&traces, order) > 1.1 * LEAST_SHARE * velocities.samples() {
                let found = peak(&traces).order;
                assert!((found - order).abs() < 0.5, "{order} {found}");
                asked += 1;
            }
        }
        assert!((3..20).contains(&asked), "{asked}");
    }

    #[test]
    fn what_is_taken_out_is_gone() {
        let mut traces = swinging(4, |q| 0.4 * (90.0 * q).sin());
        let before = peak(&traces).height;
        let wave = Wave::of(&traces, 90.0);
        traces.iter_mut().for_each(|trace| trace.take_out(wave.order, wave.coefficients));
        assert!(before > 30.0 && peak(&traces).height < 12.0, "{before} {}", peak(&traces).height);
    }

    /// Noise alone, slow or not, stands out no more than its surrogates do.
    #[test]
    fn noise_stands_out_as_its_surrogates_do() {
        let above: usize = (10..30)
            .map(|seed| {
                let traces = vec![swinging(seed, |_| 0.0)];
                let height = peak(&traces[0]).height;
                usize::from(heights_by_chance(&traces, 19).p_value(height) <= 0.05)
            })
            .sum();
        // One of twenty is expected; five or more come once in 400.
        assert!(above < 5, "{above} of 20");
    }
}
