//! Sines and cosines of several angles at once, by additions and multiplications alone.
//!
//! Within 1 ulp for |angle| ≤ 10⁵ in `f64` and for every angle in `f32`; the same bits on every machine, in
//! every lane, and next to whatever other angles. `f32` calls no operation on `f64`. Other scalars, such as
//! dual numbers, bring their own sine and cosine.
// Digits as they were published.
#![allow(clippy::excessive_precision)]

use core::any::{Any, TypeId};
use nalgebra::{SimdBool, SimdRealField, convert};

/// Sines and cosines of the angles that `angles` makes of joint positions, in their order.
///
/// Positions and not angles are handed over, because a processor that reads in one piece what was just
/// written in several waits until that is done.
#[inline(always)]
pub(super) fn sin_cos<T: SimdRealField + Copy, Q, const N: usize>(
    q: &Q,
    angles: impl Fn(&Q) -> [T; N],
) -> ([T; N], [T; N]) {
    // Lanes are inlined into what was compiled for their vectors.
    if T::LANES == 1 {
        let [sines, cosines] = once(q, angles);
        (sines.0, cosines.0)
    } else {
        all(angles(q))
    }
}

/// The sine and cosine of one angle up to [`limit`], without a branch.
#[inline(always)]
pub(super) fn near<T: SimdRealField + Copy>(angle: T) -> (T, T) {
    let element = TypeId::of::<T::Element>();
    if element == TypeId::of::<f64>() {
        of_parts(angle, WHOLE, PARTS, SINE, COSINE)
    } else if element == TypeId::of::<f32>() {
        of_parts(angle, WHOLE_SINGLE, PARTS_SINGLE, SINE_SINGLE, COSINE_SINGLE)
    } else {
        angle.simd_sin_cos()
    }
}

/// The largest angle that [`near`] takes.
#[inline(always)]
pub(super) fn limit<T: SimdRealField + Copy>() -> T {
    let element = TypeId::of::<T::Element>();
    if element == TypeId::of::<f64>() {
        convert(LIMIT)
    } else if element == TypeId::of::<f32>() {
        convert(LIMIT_SINGLE)
    } else {
        convert(f64::MAX)
    }
}

/// Sines or cosines. No vector of them crosses a line of the cache: what does cannot be read before it is
/// written there.
#[cfg_attr(target_arch = "x86_64", repr(align(16)))]
struct Row<T, const N: usize>([T; N]);

#[inline(never)]
fn once<T: SimdRealField + Copy, Q, const N: usize>(q: &Q, angles: impl Fn(&Q) -> [T; N]) -> [Row<T, N>; 2] {
    let (sines, cosines) = all(angles(q));
    [Row(sines), Row(cosines)]
}

#[inline(always)]
fn all<T: SimdRealField + Copy, const N: usize>(angles: [T; N]) -> ([T; N], [T; N]) {
    let (mut sines, mut cosines) = (angles, angles);
    // An even number of angles, which a compiler puts into vectors, and what is over.
    for i in 0..N & !1 {
        (sines[i], cosines[i]) = near(angles[i]);
    }
    for i in N & !1..N {
        (sines[i], cosines[i]) = near(angles[i]);
    }
    // A sum that is not below the limit may have a term beyond it.
    let size = angles.iter().fold(T::zero(), |sum, angle| sum + angle.simd_abs());
    if !size.simd_le(limit()).all() {
        for i in 0..N {
            let beyond = angles[i].simd_abs().simd_gt(limit());
            if beyond.any() {
                let (sine, cosine) = far(angles[i]);
                sines[i] = sine.select(beyond, sines[i]);
                cosines[i] = cosine.select(beyond, cosines[i]);
            }
        }
    }
    (sines, cosines)
}

/// Up to here a double's quarter turns fit in the 16 bits that [`PARTS`] leave to them.
const LIMIT: f64 = 1e5;

/// Up to here a single's quarter turns fit in the 9 bits that [`PARTS_SINGLE`] leave to them.
const LIMIT_SINGLE: f64 = 800.0;

/// π/2 = 37 + 37 + 53 bits: products of the first two with 16 bits are exact (Cody and Waite).
const PARTS: [f64; 3] = [1.5707963267923333, 2.5633441515839558e-12, 1.0562999066987428e-23];

/// π/2 = 15 + 15 + 24 bits.
const PARTS_SINGLE: [f64; 3] = [1.57080078125, -4.4545158743858337402e-6, 6.0771006282767103812e-11];

/// Added and taken away again, 3·2⁵¹ leaves a double's nearest whole number, and 3·2⁵³ its nearest multiple
/// of four.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// 3·2²² and 3·2²⁴ do so in single precision.
const WHOLE_SINGLE: f64 = 12_582_912.0;

/// Coefficients of sin r = r + r³·(…) and cos r = 1 − r²/2 + r⁴·(…) for |r| ≤ π/4 in double precision (Sun's
/// fdlibm).
const SINE: [f64; 6] = [
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
];
const COSINE: [f64; 6] = [
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
];

/// Coefficients of the sine in single precision, interpolated at Chebyshev points.
const SINE_SINGLE: [f64; 4] =
    [-0.1666666716337204, 0.008333331905305386, -0.00019840082677546889, 2.7249313916399842e-06];
const COSINE_SINGLE: [f64; 3] = [0.0416666641831398, -0.0013888300163671374, 2.4547436623834074e-05];

/// Without a branch, by π/2 in three parts.
#[inline(always)]
fn of_parts<T: SimdRealField + Copy, const K: usize, const M: usize>(
    angle: T,
    whole: f64,
    parts: [f64; 3],
    sines: [f64; K],
    cosines: [f64; M],
) -> (T, T) {
    let (whole, fours): (T, T) = (convert(whole), convert(4.0 * whole));
    let [first, second, third] = parts.map(convert::<f64, T>);
    let turns = angle * convert(core::f64::consts::FRAC_2_PI) + whole - whole;
    // Exact, but for what the tail takes.
    let near = angle - turns * first;
    let part = turns * second;
    let r = near - part;
    let tail = near - r - part - turns * third;
    // Without whole turns: −2 … 2.
    let turns = turns - (turns + fours - fours);
    turned(turns, sine(r, tail, sines.map(convert)), cosine(r, tail, cosines.map(convert)))
}

/// Beyond the limit: the scalar's own functions in double precision, integers in single precision.
#[inline(always)]
fn far<T: SimdRealField + Copy>(angle: T) -> (T, T) {
    if TypeId::of::<T::Element>() != TypeId::of::<f32>() {
        return angle.simd_sin_cos();
    }
    let part = |which: usize| {
        angle.map_lanes(|mut x| {
            if let Some(x) = (&mut x as &mut dyn Any).downcast_mut::<f32>() {
                *x = reduced(*x)[which];
            }
            x
        })
    };
    let (turns, r, tail) = (part(0), part(1), part(2));
    turned(turns, sine(r, tail, SINE_SINGLE.map(convert)), cosine(r, tail, COSINE_SINGLE.map(convert)))
}

/// The sine of r + tail, |r| ≤ π/4.
#[inline(always)]
fn sine<T: SimdRealField + Copy, const K: usize>(r: T, tail: T, coefficients: [T; K]) -> T {
    let z = r * r;
    let slope = T::one() - convert::<f64, T>(0.5) * z;
    r + (tail * slope + z * r * polynomial(z, coefficients))
}

/// The cosine of r + tail, |r| ≤ π/4.
#[inline(always)]
fn cosine<T: SimdRealField + Copy, const K: usize>(r: T, tail: T, coefficients: [T; K]) -> T {
    let one = T::one();
    let z = r * r;
    let half: T = convert::<f64, T>(0.5) * z;
    let near = one - half;
    near + (one - near - half + (z * z * polynomial(z, coefficients) - r * tail))
}

/// Σ coefficientₖ·zᵏ in pairs, which wait less for each other than Horner's form does.
#[inline(always)]
fn polynomial<T: SimdRealField + Copy, const K: usize>(z: T, coefficients: [T; K]) -> T {
    let square = z * z;
    let pair = |k: usize| if k + 1 < K { coefficients[k] + z * coefficients[k + 1] } else { coefficients[k] };
    let last = (K - 1) & !1;
    let mut sum = pair(last);
    for k in (0..last).step_by(2).rev() {
        sum = pair(k) + square * sum;
    }
    sum
}

/// Sine and cosine after whole quarter turns, −2 … 2, of which products and sums are exact.
#[inline(always)]
fn turned<T: SimdRealField + Copy>(turns: T, sine: T, cosine: T) -> (T, T) {
    let along = T::one() - turns.simd_abs();
    let across = turns + turns * along;
    (sine * along + cosine * across, cosine * along - sine * across)
}

/// 2/π in binary, after a word of zeros.
const TWO_OVER_PI: [u32; 8] =
    [0, 0xa2f9_836e, 0x4e44_1529, 0xfc27_57d1, 0xf534_ddc0, 0xdb62_9599, 0x3c43_9041, 0xfe51_63ab];

/// Quarter turns, −2 … 1, and what is left of an angle from π/4 on in two parts, by integers: exact for every
/// `f32` (Payne and Hanek).
#[inline(always)]
fn reduced(angle: f32) -> [f32; 3] {
    let bits = angle.to_bits();
    let size = bits & 0x7fff_ffff;
    if !(0x3f49_0fdb..0x7f80_0000).contains(&size) {
        return [0.0, f32::NAN, 0.0];
    }
    // angle = mantissa·2^(exponent − 150): 96 bits of 2/π from the first on that matters modulo four.
    let mantissa = u64::from((bits & 0x007f_ffff) | 0x0080_0000);
    let exponent = size >> 23;
    let (word, shift) = (((exponent - 120) >> 5) as usize, (exponent - 120) & 31);
    let at = |k: usize| u64::from(TWO_OVER_PI[(word + k) & 7]);
    let window = |k: usize| (((at(k) << 32) | at(k + 1)) << shift) >> 32;
    // Two bits of quarter turns, 62 of their fraction.
    let product = ((mantissa * window(0)) << 32)
        .wrapping_add(mantissa * window(1))
        .wrapping_add((mantissa * window(2)) >> 32);
    let turns = product.wrapping_add(1 << 61) >> 62;
    let fraction = product.wrapping_sub(turns << 62) as i64;
    let turns = ((turns as i32 + 1) & 3) - 1;
    // Times π/2, with 32 bits of each: 24 bits for r, the next 32 for its tail.
    let zeros = fraction.unsigned_abs().leading_zeros();
    let leading = fraction.unsigned_abs().wrapping_shl(zeros) >> 32;
    let rest = leading * 0xc90f_daa2;
    let unit = f32::from_bits((106 - zeros) << 23);
    let (r, tail) = ((rest >> 40) as u32 as f32 * unit, (rest >> 8) as u32 as f32 * (unit * 2.328_306_4e-10));
    let sign = if angle < 0.0 { -1.0 } else { 1.0 };
    let side = if fraction < 0 { -sign } else { sign };
    // Named: a product among an array's elements looks like a missing comma to clippy.
    let (turns, r, tail) = (turns as f32 * sign, r * side, tail * side);
    [turns, r, tail]
}
