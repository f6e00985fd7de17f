//! The sines and cosines of an arm's constant angles: exact where they are rational, symbols elsewhere.

use super::angle::Angle;
use super::prime::{Draws, Fp};
use super::rational;
use num_traits::Signed;

/// The sine or cosine of a constant angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trig {
    /// 0
    Zero,
    /// 1, or −1 where `negative`
    One {
        /// the sign
        negative: bool,
    },
    /// Plus or minus the sine or cosine of a symbol.
    Symbol {
        /// index into [`AngleSymbols::angles`]
        index: usize,
        /// the symbol's sine; else its cosine
        sine: bool,
        /// the sign
        negative: bool,
    },
}

impl Trig {
    fn negate(self, by: bool) -> Trig {
        match self {
            Trig::Zero => Trig::Zero,
            Trig::One { negative } => Trig::One { negative: negative != by },
            Trig::Symbol { index, sine, negative } => Trig::Symbol { index, sine, negative: negative != by },
        }
    }
}

/// The relations of a symbol's sine and cosine beyond s² + c² = 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymbolKind {
    /// Nothing.
    General,
    /// pi/4: s = c = √½.
    Eighth,
    /// pi/6: s = ½, c = √¾.
    Twelfth,
}

/// The distinct angles of an arm whose sine and cosine are not rationals, each between 0 and pi/4 where it is
/// a multiple of pi, and positive otherwise.
#[derive(Clone, Debug, Default)]
pub struct AngleSymbols {
    /// The angles, in order of first use.
    pub angles: Vec<Angle>,
}

impl AngleSymbols {
    /// The symbols among some angles.
    pub fn collect<'a>(angles: impl IntoIterator<Item = &'a Angle>) -> Self {
        let mut symbols = AngleSymbols::default();
        for angle in angles {
            symbols.intern(angle);
        }
        symbols
    }

    fn intern(&mut self, angle: &Angle) {
        if angle.quarter_turns().is_none() {
            let (base, ..) = canonical(angle);
            if !self.angles.contains(&base) {
                self.angles.push(base);
            }
        }
    }

    /// Sine and cosine of an angle that was collected.
    pub fn sin_cos(&self, angle: &Angle) -> (Trig, Trig) {
        let one = |negative| Trig::One { negative };
        match angle.quarter_turns() {
            Some(0) => (Trig::Zero, one(false)),
            Some(1) => (one(false), Trig::Zero),
            Some(2) => (Trig::Zero, one(true)),
            Some(_) => (one(true), Trig::Zero),
            None => {
                let (base, swapped, sin_negative, cos_negative) = canonical(angle);
                let index = self.angles.iter().position(|a| *a == base).unwrap_or(usize::MAX);
                let of = |sine| Trig::Symbol { index, sine, negative: false };
                (of(!swapped).negate(sin_negative), of(swapped).negate(cos_negative))
            }
        }
    }

    /// The relations of a symbol.
    pub fn kind(&self, index: usize) -> SymbolKind {
        match &self.angles[index] {
            Angle::PiMultiple(m) if *m == rational::ratio(1, 4) => SymbolKind::Eighth,
            Angle::PiMultiple(m) if *m == rational::ratio(1, 6) => SymbolKind::Twelfth,
            _ => SymbolKind::General,
        }
    }

    /// Sine and cosine of a symbol modulo the prime: the exact roots where they are algebraic and known, a
    /// random point of the circle where only s² + c² = 1 is.
    pub fn modular(&self, index: usize, draws: &mut Draws) -> (Fp, Fp) {
        let half = Fp::from_integer(2).inverse().unwrap_or(Fp::ONE);
        let root = |n: i64| Fp::from_integer(n).square_root().unwrap_or(Fp::ONE);
        match self.kind(index) {
            SymbolKind::Eighth => (root(2) * half, root(2) * half),
            SymbolKind::Twelfth => (half, root(3) * half),
            SymbolKind::General => draws.element().circle_point(),
        }
    }
}

/// The angle's representative, whether sine and cosine are swapped, and the signs of sine and cosine.
fn canonical(angle: &Angle) -> (Angle, bool, bool, bool) {
    match angle {
        Angle::Radians(value) => (Angle::Radians(value.abs()), false, value.is_negative(), false),
        Angle::PiMultiple(multiple) => {
            let (one, two) = (rational::integer(1), rational::integer(2));
            let mut m = multiple - (multiple / &two).floor() * &two;
            let sin_negative = m > one;
            if sin_negative {
                m = &two - m;
            }
            let cos_negative = &m * &two > one;
            if cos_negative {
                m = &one - m;
            }
            let swapped = &m * rational::integer(4) > one;
            if swapped {
                m = rational::ratio(1, 2) - m;
            }
            (Angle::PiMultiple(m), swapped, sin_negative, cos_negative)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_reproduce_the_angles() {
        let alphas = ["pi/4", "3*pi/4", "-pi/4", "5*pi/4", "pi/6", "pi/3", "-2*pi/3", "0.3", "-0.3"];
        let angles = alphas.map(|a| Angle::parse(a).unwrap());
        let symbols = AngleSymbols::collect(&angles);
        assert_eq!(symbols.angles.len(), 3);
        for angle in &angles {
            let (sin, cos) = symbols.sin_cos(angle);
            let value = |t: Trig| match t {
                Trig::Zero => 0.0,
                Trig::One { negative } => {
                    if negative {
                        -1.0
                    } else {
                        1.0
                    }
                }
                Trig::Symbol { index, sine, negative } => {
                    let (s, c) = symbols.angles[index].sin_cos();
                    let v = if sine { s } else { c };
                    if negative { -v } else { v }
                }
            };
            assert!((value(sin) - angle.radians().sin()).abs() < 1e-15);
            assert!((value(cos) - angle.radians().cos()).abs() < 1e-15);
        }
        let mut draws = Draws::new(3);
        for index in 0..3 {
            let (s, c) = symbols.modular(index, &mut draws);
            assert_eq!(s * s + c * c, Fp::ONE);
        }
    }
}
