//! The emitted sines and cosines against integer arithmetic of hundreds of bits.

#![allow(clippy::unwrap_used)]

use super::trigonometry;
use chacha20::ChaCha8Rng;
use dashu_int::IBig;
use nalgebra::SimdRealField;
use num_traits::{Signed, ToPrimitive, Zero};
use rand::{RngExt, SeedableRng};

fn sin_cos<T: SimdRealField + Copy, const N: usize>(angles: [T; N]) -> ([T; N], [T; N]) {
    trigonometry::sin_cos(&angles, |angles| *angles)
}

/// Bits after the point.
const BITS: usize = 320;

/// π·2^BITS by Machin's formula.
fn pi() -> IBig {
    let arctangent = |inverse: i64| {
        let (mut power, mut sum, mut k) = ((IBig::from(1) << BITS) / inverse, IBig::zero(), 1i64);
        while !power.is_zero() {
            sum += if k % 4 == 1 { &power / k } else { -(&power / k) };
            power /= inverse * inverse;
            k += 2;
        }
        sum
    };
    (arctangent(5) * 4 - arctangent(239)) * 4
}

/// x·2^BITS, exactly.
fn fixed(x: f64) -> IBig {
    let exponent = ((x.to_bits() >> 52) & 0x7ff) as i64;
    assert!((700..1300).contains(&exponent) || x == 0.0, "{x}");
    let mantissa = IBig::from((x.to_bits() & ((1 << 52) - 1)) | (1 << 52));
    let shift = exponent - 1075 + BITS as i64;
    let size = if x == 0.0 {
        IBig::zero()
    } else if shift >= 0 {
        mantissa << shift as usize
    } else {
        mantissa >> (-shift) as usize
    };
    if x < 0.0 { -size } else { size }
}

/// sin x·2^BITS and cos x·2^BITS.
fn reference(x: f64, pi: &IBig) -> [IBig; 2] {
    let half: IBig = pi >> 1;
    let x = fixed(x);
    let nearest: IBig = &x * 2 + &half;
    let turns = floor_of(&nearest, &(&half << 1));
    let r = x - &turns * &half;
    let square = (&r * &r) >> BITS;
    let series = |first: IBig, mut k: i64| {
        let (mut term, mut sum) = (first, IBig::zero());
        while !term.is_zero() && term != IBig::from(-1) {
            sum += &term;
            term = -((term * &square) >> BITS) / (k * (k + 1));
            k += 2;
        }
        sum
    };
    let (s, c) = (series(r, 2), series(IBig::from(1) << BITS, 1));
    match (turns % 4i64).to_i64().unwrap().rem_euclid(4) {
        0 => [s, c],
        1 => [c, -s],
        2 => [-s, -c],
        _ => [-c, s],
    }
}

/// ⌊a/b⌋
fn floor_of(a: &IBig, b: &IBig) -> IBig {
    let quotient = a / b;
    if (a - &quotient * b).is_negative() { quotient - 1 } else { quotient }
}

/// How far `x` is from the true value, in units of its last place.
fn ulps(x: f64, truth: &IBig) -> f64 {
    let error = (fixed(x) - truth).to_f64().value() / 2f64.powi(BITS as i32);
    let ulp = (x.abs().next_up() - x.abs()).max(f64::MIN_POSITIVE);
    error.abs() / ulp
}

fn worst(angles: impl Iterator<Item = f64>) -> f64 {
    let pi = pi();
    let mut worst: f64 = 0.0;
    for x in angles {
        let ([s], [c]) = sin_cos([x]);
        let [sine, cosine] = reference(x, &pi);
        worst = worst.max(ulps(s, &sine)).max(ulps(c, &cosine));
        assert!(worst < 1.0, "{worst} at {x:e}");
    }
    worst
}

#[test]
fn a_double_is_within_one_unit_of_the_last_place() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw = |limit: f64| rng.random_range(-limit..limit);
    let random: Vec<f64> =
        [0.8, 3.2, 10.0, 1e3, 1e5].into_iter().flat_map(|x| [x; 4000]).map(&mut draw).collect();
    let error = worst(random.into_iter());
    assert!(error > 0.5, "the reference is no reference: {error}");
}

/// The doubles next to multiples of π/2 lose most when these are taken off.
#[test]
fn a_double_next_to_a_zero_is_within_one_unit_of_the_last_place() {
    let half: IBig = pi() >> 1;
    let multiples = (1..63_662i64).filter(|k| *k < 1000 || k % 29 == 0);
    worst(multiples.flat_map(|k| {
        let multiple: IBig = &half * k;
        let near = multiple.to_f64().value() / 2f64.powi(BITS as i32);
        [near, near.next_down(), -near.next_up()]
    }));
}

#[test]
fn a_double_beyond_the_limit_is_right_and_disturbs_no_other() {
    let angles = [0.3, 1.000_001e5, -2.5, 1e22, -1e15];
    let (s, c) = sin_cos(angles);
    for (k, x) in angles.into_iter().enumerate() {
        let [sine, cosine] = reference(x, &pi());
        assert!(ulps(s[k], &sine) < 1.0 && ulps(c[k], &cosine) < 1.0, "{x}");
    }
    assert_eq!(sin_cos([0.3, -2.5]), ([s[0], s[2]], [c[0], c[2]]));
    let (s, c) = sin_cos([f64::NAN, f64::INFINITY, 1.0]);
    assert!(s[0].is_nan() && s[1].is_nan() && c[1].is_nan());
    assert_eq!((s[2], c[2]), (sin_cos([1.0]).0[0], sin_cos([1.0]).1[0]));
}

/// Every 499th number of all, and those next to multiples of π/2: an `f64` knows their sine well enough to
/// judge.
#[test]
fn a_single_is_within_one_unit_of_the_last_place_wherever_it_is() {
    let all = (0..0x7f80_0000u32).step_by(499).map(f32::from_bits);
    let zeros = (1..63_662u32).map(|k| (f64::from(k) * core::f64::consts::FRAC_PI_2) as f32);
    for x in all.chain(zeros) {
        for x in [x, -x] {
            let ([s], [c]) = sin_cos([x]);
            for (found, truth) in [(s, f64::from(x).sin()), (c, f64::from(x).cos())] {
                let ulp = f64::from((truth as f32).abs().next_up() - (truth as f32).abs());
                assert!((f64::from(found) - truth).abs() < ulp, "{x:e}: {found:e} {truth:e}");
            }
        }
    }
    let ([s, t], _) = sin_cos([f32::NAN, f32::INFINITY]);
    assert!(s.is_nan() && t.is_nan());
}

/// What bounds of rounding rest on: the error in units of 2⁻²⁴, of every angle up to 1000 rad.
#[test]
#[ignore = "minutes: cargo test --release -p dyngen-verify --lib every_single -- --ignored"]
fn every_single_up_to_a_thousand_radians_is_within_0_85_units() {
    let unit = 0.85 * f64::from(f32::EPSILON) / 2.0;
    for bits in 0..=1000f32.to_bits() {
        for x in [f32::from_bits(bits), -f32::from_bits(bits)] {
            let ([s], [c]) = sin_cos([x]);
            let (sine, cosine) = f64::from(x).sin_cos();
            assert!((f64::from(s) - sine).abs() < unit && (f64::from(c) - cosine).abs() < unit, "{x:e}");
        }
    }
}
