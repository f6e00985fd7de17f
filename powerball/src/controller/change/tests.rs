use super::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// A colour with a long memory.
const COLOUR: Colour<f64> =
    Colour { coefficients: [1.1, -0.4, 0.15, 0.0, 0.05, -0.02], deviation: 0.3, margin: 0.0 };
const LEVEL: f64 = 500.0;
const RANGE: f64 = 0.1;

/// Residuals of a colour along a motion with friction, one joint.
struct Noise {
    rng: ChaCha8Rng,
    past: [f64; ORDER],
    heavy: bool,
}

impl Noise {
    fn new(seed: u64, heavy: bool) -> Noise {
        Noise { rng: ChaCha8Rng::seed_from_u64(seed), past: [0.0; ORDER], heavy }
    }

    fn innovation(&mut self) -> f64 {
        let e: f64 = StandardNormal.sample(&mut self.rng);
        if !self.heavy {
            return e;
        }
        // Of variance 1: mostly small, at times ten times as large.
        let large: f64 = StandardNormal.sample(&mut self.rng);
        if large > 2.2 { 6.0 * e } else { 0.7 * e }
    }

    fn next(&mut self) -> f64 {
        let told: f64 = COLOUR.coefficients.iter().zip(&self.past).map(|(a, x)| a * x).sum();
        let r = told + COLOUR.deviation * self.innovation();
        self.past.copy_within(..ORDER - 1, 1);
        self.past[0] = r;
        r
    }
}

fn columns(k: u64) -> [f64; COLUMNS] {
    let phase = TAU * k as f64 / 150.0;
    let friction = 4.0 * (5.0 * phase.cos()).tanh();
    [friction, 10.0 * phase.sin() + friction, 2.0 * phase.cos()]
}

/// The sample of the first alarm of `joints` equal joints, at most `most`; `more` is added to the first one's residual.
fn first_alarm(
    seed: u64,
    joints: u64,
    most: u64,
    heavy: bool,
    margin: f64,
    more: impl Fn(u64) -> f64,
) -> Option<(u64, Alarm<f64>)> {
    let colour = Colour { margin, ..COLOUR };
    let mut tests: Vec<JointTest<f64>> = (0..joints).map(|_| JointTest::new(colour, RANGE)).collect();
    let mut noise: Vec<Noise> = (0..joints).map(|j| Noise::new(1000 * seed + j, heavy)).collect();
    (0..most).find_map(|k| {
        for (j, (test, noise)) in tests.iter_mut().zip(&mut noise).enumerate() {
            let residual = noise.next() + if j == 0 { more(k) } else { 0.0 };
            test.update(Shown { residual, columns: columns(k) }, k);
        }
        Some((k, alarm(tests.iter().enumerate(), LEVEL)?))
    })
}

/// The mean time to a false alarm, where runs that last longer than `most` count as that long: too little.
fn mean_time(joints: u64, heavy: bool, margin: f64, more: impl Fn(u64) -> f64) -> f64 {
    let most = 4 * LEVEL as u64;
    let runs = 60;
    let time =
        |seed| first_alarm(seed, joints, most, heavy, margin, &more).map_or(most, |(k, _)| k + 1) as f64;
    (0..runs).map(time).sum::<f64>() / f64::from(runs as u32)
}

#[test]
fn the_mean_time_to_a_false_alarm_is_at_least_the_level() {
    for joints in [1, 6] {
        assert!(mean_time(joints, false, 0.0, |_| 0.0) >= LEVEL, "{joints}");
    }
    // Innovations that are far from normal: cutting them so moves their means by up to a tenth.
    assert!(mean_time(2, true, 0.1, |_| 0.0) >= LEVEL);
}

/// Friction at the end of its range, wandering there and back, is no change; twice as much of it is one.
#[test]
fn friction_may_wander_within_its_range() {
    let wander = |share: f64| move |k: u64| share * (TAU * k as f64 / 1500.0).sin() * columns(k)[0];
    assert!(mean_time(1, false, 0.0, wander(RANGE)) >= LEVEL);
    assert!(mean_time(1, false, 0.0, wander(-RANGE)) >= LEVEL);
    assert!(mean_time(1, false, 0.0, wander(6.0 * RANGE)) < LEVEL);
}

/// A constant error within the margin is none; beyond it is one, and it is known when it began and where.
#[test]
fn a_change_is_seen_where_and_when_it_is() {
    let whitened = 1.0 - COLOUR.coefficients.iter().sum::<f64>();
    let of = |mean: f64| mean * COLOUR.deviation / whitened;
    assert!(mean_time(1, false, 0.3, |_| of(0.29)) >= LEVEL);
    let (mut late, mut wrong) = (0, 0);
    for seed in 0..50 {
        let change = |k: u64| if k < 300 { 0.0 } else { of(1.2) };
        let found = first_alarm(seed, 4, 2000, false, 0.0, change);
        let Some((k, alarm)) = found.filter(|(k, _)| *k >= 300) else { continue };
        late += usize::from(k > 300 + 40);
        wrong += usize::from(alarm.joint != 0 || alarm.since.abs_diff(300) > 30);
    }
    assert!(late <= 5 && wrong <= 5, "{late} {wrong}");
}

/// The factor of one bet, by hand: after ORDER samples of nothing a residual of 3 σ is an innovation of 3.
#[test]
fn capital_grows_by_what_was_put() {
    let mut test = JointTest::new(COLOUR, 0.0);
    let shown = |residual: f64| Shown { residual, columns: [0.0; COLUMNS] };
    (0..ORDER as u64).for_each(|k| test.update(shown(0.0), k));
    assert_eq!(test.capital(), 0.0);
    test.update(shown(3.0 * COLOUR.deviation), 6);
    // For a constant: 1 ± λ·…, a loss cut at 2; on columns that are zero nothing is put.
    let won =
        CONSTANT.iter().map(|s| 2.0 + s * (3.0 - LEAST_MARGIN) + s * (-LOSS - LEAST_MARGIN)).sum::<f64>();
    let on_columns = 2.0 * (COLUMNS * SHARES.len()) as f64;
    approx::assert_relative_eq!(test.capital(), won + on_columns, max_relative = 1e-12);
    // A gap is no innovation.
    test.update(shown(f64::NAN), 7);
    let before = test.capital();
    test.update(shown(9.0), 8);
    assert_eq!(test.capital(), before);
}

#[test]
fn single_precision_sees_the_same() {
    let colour =
        Colour { coefficients: COLOUR.coefficients.map(|a| a as f32), deviation: 0.3f32, margin: 0.1 };
    let mut single = JointTest::new(colour, 0.1);
    let mut double = JointTest::new(Colour { margin: 0.1, ..COLOUR }, 0.1);
    let mut noise = Noise::new(7, false);
    for k in 0..400 {
        let residual = noise.next() + if k > 100 { 4.0 } else { 0.0 };
        single.update(Shown { residual: residual as f32, columns: columns(k).map(|c| c as f32) }, k);
        double.update(Shown { residual, columns: columns(k) }, k);
    }
    let alarms = (alarm([(0, &single)], 1e6f32).unwrap(), alarm([(0, &double)], 1e6).unwrap());
    assert_eq!((alarms.0.joint, alarms.0.since), (alarms.1.joint, alarms.1.since));
}
