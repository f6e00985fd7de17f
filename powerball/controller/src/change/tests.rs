use super::*;
use chacha20::ChaCha8Rng;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// A colour with a long memory.
const COLOUR: Colour<f64> =
    Colour { coefficients: [1.1, -0.4, 0.15, 0.0, 0.05, -0.02], deviation: 0.3, margin: 0.0 };
const LEVEL: f64 = 500.0;
const RANGE: f64 = 0.1;

/// How a joint's innovations are distributed, all with variance 1.
#[derive(Clone, Copy, PartialEq)]
enum Law {
    Normal,
    /// Mostly small, at times ten times as large.
    Heavy,
    /// Normal, the same on all joints.
    Common,
}

/// Residuals of a colour along a motion with friction, one joint.
struct Noise {
    rng: ChaCha8Rng,
    past: [f64; ORDER],
    law: Law,
}

impl Noise {
    fn new(seed: u64, law: Law) -> Noise {
        Noise { rng: ChaCha8Rng::seed_from_u64(seed), past: [0.0; ORDER], law }
    }

    fn next(&mut self) -> f64 {
        let normal: [f64; 2] = [(); 2].map(|()| StandardNormal.sample(&mut self.rng));
        let e = match self.law {
            Law::Heavy if normal[1] > 2.2 => 6.0 * normal[0],
            Law::Heavy => 0.7 * normal[0],
            Law::Normal | Law::Common => normal[0],
        };
        let predicted: f64 = COLOUR.coefficients.iter().zip(&self.past).map(|(a, x)| a * x).sum();
        let r = predicted + COLOUR.deviation * e;
        self.past.copy_within(..ORDER - 1, 1);
        self.past[0] = r;
        r
    }
}

fn friction(k: u64) -> f64 {
    4.0 * (5.0 * (TAU * k as f64 / 150.0).cos()).tanh()
}

/// What changes on all joints together, N·m by its unit.
fn load(j: usize, k: u64) -> f64 {
    (TAU * k as f64 / 150.0 + j as f64).sin()
}

/// A residual that is added to a joint's noise, by joint and sample, N·m.
type More<'m> = &'m dyn Fn(usize, u64) -> f64;

/// The test of some equal joints: on each a constant and its friction, and a load on all.
struct Arm {
    joints: Vec<(Joint<f64>, Noise, [Whitener<f64>; 2])>,
    own: Vec<[Bet<f64, 1>; 2]>,
    all: Bet<f64, 1>,
}

impl Arm {
    fn new(seed: u64, joints: usize, law: Law, margin: f64) -> Arm {
        let joint = |j: usize| {
            let seed = if law == Law::Common { seed } else { 1000 * seed + j as u64 };
            let colour = Colour { margin, ..COLOUR };
            (Joint::new(colour, RANGE), Noise::new(seed, law), [Whitener::default(); 2])
        };
        Arm {
            joints: (0..joints).map(joint).collect(),
            own: vec![[Bet::default(); 2]; joints],
            all: Bet::default(),
        }
    }

    fn step(&mut self, k: u64, more: More<'_>) {
        let mut all = Vec::new();
        for (j, (joint, noise, [load_seen, constant])) in self.joints.iter_mut().enumerate() {
            let colour = *joint.colour();
            let columns = (load_seen.update(&colour, load(j, k)), constant.update(&colour, 1.0));
            let innovation = joint.update(noise.next() + more(j, k), friction(k));
            let (Some(innovation), (Some(load), Some(constant))) = (innovation, columns) else { continue };
            let [on_constant, on_friction] = &mut self.own[j];
            on_constant.update(&[Term { innovation, columns: [constant] }], k);
            on_friction.update(&[Term { innovation, columns: [innovation.friction] }], k);
            all.push(Term { innovation, columns: [load] });
        }
        self.all.update(&all, k);
    }

    /// The bet on all joints, then two a joint.
    fn standings(&self) -> Vec<Standing<f64>> {
        let bets: Vec<Bet<f64, 1>> =
            std::iter::once(self.all).chain(self.own.iter().flatten().copied()).collect();
        let weight = 1.0 / bets.len() as f64;
        bets.iter().map(|b| Standing { weight, capital: b.capital(), since: b.since() }).collect()
    }

    /// The sample of the first alarm, at most `most`.
    fn first_alarm(mut self, most: u64, more: More<'_>) -> Option<(u64, Alarm<f64>)> {
        (0..most).find_map(|k| {
            self.step(k, more);
            Some((k, alarm(self.standings(), LEVEL)?))
        })
    }
}

/// The mean time to an alarm, where runs that last longer than four levels count as that long.
fn mean_time(joints: usize, law: Law, margin: f64, more: More<'_>) -> f64 {
    let most = 4 * LEVEL as u64;
    let runs = 60;
    let time = |seed| {
        Arm::new(seed, joints, law, margin).first_alarm(most, more).map_or(most, |(k, _)| k + 1) as f64
    };
    (0..runs).map(time).sum::<f64>() / runs as f64
}

/// A constant residual for a mean of the innovations.
fn constant(mean: f64) -> f64 {
    mean * COLOUR.deviation / (1.0 - COLOUR.coefficients.iter().sum::<f64>())
}

#[test]
fn the_mean_time_to_a_false_alarm_is_at_least_the_level() {
    for joints in [1, 6] {
        assert!(mean_time(joints, Law::Normal, 0.0, &|_, _| 0.0) >= LEVEL, "{joints}");
    }
    // Innovations that are far from normal: cutting them so moves their means by up to a tenth.
    assert!(mean_time(2, Law::Heavy, 0.1, &|_, _| 0.0) >= LEVEL);
    // Nothing is assumed of how joints depend on each other.
    assert!(mean_time(6, Law::Common, 0.0, &|_, _| 0.0) >= LEVEL);
    // An error at the margin is none yet, and one of three times that is found long before the level.
    assert!(mean_time(1, Law::Normal, 0.3, &|_, _| constant(0.28)) >= LEVEL);
    assert!(mean_time(1, Law::Normal, 0.3, &|_, _| constant(0.9)) < 0.5 * LEVEL);
}

/// The heart of the guarantee, where it is closest: innovations of a mean at the margin multiply a bet's
/// capital by 1 on average, and by more where the mean is more.
#[test]
fn a_bet_is_fair_at_the_margin() {
    let gain = |mean: f64| {
        let mut noise = ChaCha8Rng::seed_from_u64(5);
        let mut bet = Bet::<f64, 1>::default();
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for k in 0..200_000 {
            if k % 100 == 0 {
                bet = Bet::default();
            }
            let e: f64 = StandardNormal.sample(&mut noise);
            // It bets on a mean of 0.6 at times and on nothing at others.
            let lure = if k % 100 < 25 { 0.6 } else { mean };
            let innovation = Innovation { value: e + lure, allowed: 0.3, friction: 0.0 };
            let terms = [Term { innovation, columns: [1.0] }];
            let more = bet.factor(&terms, &bet.usual_size()).0 - 1.0;
            bet.update(&terms, k);
            if k % 100 >= 25 && more != 0.0 {
                (sum, square, count) = (sum + more, square + more * more, count + 1.0);
            }
        }
        let mean = sum / count;
        (mean, (square / count - mean * mean).sqrt() / f64::sqrt(count))
    };
    let (fair, error) = gain(0.3 - 0.0085);
    // What is followed takes a little of it.
    assert!(fair < 4.0 * error && fair > -0.01, "{fair} {error}");
    let (won, error) = gain(0.6);
    assert!(won > 10.0 * error, "{won} {error}");
}

/// Friction that wanders slowly within its range is not a change, and more of it by three times the range is
/// one.
#[test]
fn friction_may_wander_within_its_range() {
    let wander = |share: f64| {
        move |j: usize, k: u64| {
            if j == 0 { share * (TAU * k as f64 / 30_000.0).sin() * friction(k) } else { 0.0 }
        }
    };
    for share in [RANGE, -RANGE] {
        assert!(mean_time(1, Law::Normal, 0.0, &wander(share)) >= LEVEL);
    }
    // At the end of the range from the beginning: it is followed there.
    assert!(mean_time(1, Law::Normal, 0.0, &|_, k| RANGE * friction(k)) >= LEVEL);
    assert!(mean_time(1, Law::Normal, 0.0, &|_, k| 3.0 * RANGE * friction(k)) < 0.5 * LEVEL);
}

/// When a change began and where is known, and on several joints it adds up: the bet on all of them finds
/// it first.
#[test]
fn a_change_is_seen_where_and_when_it_is() {
    let (mut late, mut wrong, mut apart) = (0, 0, 0);
    for seed in 0..50 {
        let one = |j: usize, k: u64| if j == 0 && k >= 300 { constant(1.2) } else { 0.0 };
        let found = Arm::new(seed, 4, Law::Normal, 0.0).first_alarm(2000, &one);
        let Some((k, alarm)) = found.filter(|(k, _)| *k >= 300) else { continue };
        late += usize::from(k > 300 + 30);
        // After the bet on all come two for each joint.
        wrong += usize::from(!(1..=2).contains(&alarm.bet) || alarm.since.abs_diff(300) > 60);
        let several = |j: usize, k: u64| if k >= 300 { 0.8 * load(j, k) } else { 0.0 };
        let found = Arm::new(seed, 6, Law::Normal, 0.0).first_alarm(2000, &several);
        apart += usize::from(found.is_none_or(|(k, alarm)| k < 300 || alarm.bet != 0));
    }
    assert!(late <= 5 && wrong <= 8 && apart <= 12, "{late} {wrong} {apart}");
}

/// The factor of a bet, by hand: it knows the size of a change from the samples before only.
#[test]
fn capital_grows_by_what_was_put() {
    let term =
        |value: f64| [Term { innovation: Innovation { value, allowed: 0.1, friction: 0.0 }, columns: [2.0] }];
    let mut bet = Bet::<f64, 1>::default();
    bet.update(&term(3.0), 0);
    // Nothing was known: nothing was put.
    assert_eq!(bet.capital(), 0.0);
    // c = 2·3/(4 + 10·4), held as by ten usual samples; μ = 2·c; the share is (μ − 0.1)/(1 + μ²).
    let mean = 2.0 * 6.0 / 44.0;
    let share = (mean - 0.1) / (1.0 + mean * mean);
    // What is usual is held as by a thousand samples.
    let usual = 2.0 * 6.0 / (4.0 * 1001.0);
    // It begins with what may be lost as a share of the most.
    let begins = share * (LOSS + 0.1) / 0.9;
    let mut lost = bet;
    bet.update(&term(1.5), 1);
    approx::assert_relative_eq!(bet.capital(), begins * (1.0 + share * (1.4 - usual)), max_relative = 1e-4);
    // A loss counts up to two deviations.
    lost.update(&term(-7.0), 1);
    approx::assert_relative_eq!(lost.capital(), begins * (1.0 - share * (LOSS + 0.1)), max_relative = 1e-4);
}

#[test]
fn a_gap_is_no_innovation() {
    let mut joint = Joint::new(COLOUR, 0.0);
    (0..ORDER).for_each(|_| assert!(joint.update(0.0, 0.0).is_none()));
    let first = joint.update(3.0 * COLOUR.deviation, 0.0).unwrap();
    approx::assert_relative_eq!(first.value, 3.0, max_relative = 1e-12);
    assert!(joint.update(f64::NAN, 0.0).is_none());
    (0..ORDER).for_each(|_| assert!(joint.update(1.0, 1.0).is_none()));
    assert!(joint.update(1.0, 1.0).is_some());
}

#[test]
fn single_precision_sees_the_same() {
    let colour =
        Colour { coefficients: COLOUR.coefficients.map(|a| a as f32), deviation: 0.3f32, margin: 0.1 };
    let mut single = (Joint::new(colour, 0.1), Bet::<f32, 1>::default());
    let mut double = (Joint::new(Colour { margin: 0.1, ..COLOUR }, 0.1), Bet::<f64, 1>::default());
    let mut noise = Noise::new(7, Law::Normal);
    for k in 0..400 {
        let residual = noise.next() + if k > 100 { 4.0 } else { 0.0 };
        let shown = single.0.update(residual as f32, friction(k) as f32);
        if let Some(innovation) = shown {
            single.1.update(&[Term { innovation, columns: [1.0] }], k);
        }
        if let Some(innovation) = double.0.update(residual, friction(k)) {
            double.1.update(&[Term { innovation, columns: [1.0] }], k);
        }
    }
    assert!(double.1.capital() > 1e6 && single.1.capital() > 1e6);
    assert_eq!(single.1.since(), double.1.since());
}
