//! What turns of vectors do not change: their length.
//!
//! Intervals of c·a + s·b and c·b − s·a grow by √2 with each turn, as if a and b were at their largest
//! together with c and s. But the squares of the two sum up to a² + b². Followed back from joint to joint, a
//! turned vector is bounded by the length of what was turned first; and any sum of two products by the
//! lengths of two vectors (Cauchy and Schwarz).

use super::interval::Interval;
use super::program::{Errors, Operation};

/// A bound of an operation's size.
#[derive(Clone, Debug)]
pub(super) enum Norm {
    /// The operation is an entry of a vector.
    Turned(Vec<Length>),
    /// The operation is the product of two vectors, and rounds.
    Product(Vec<Length>, Vec<Length>, [usize; 3]),
}

/// A bound of a vector's length: the length of another, the sizes of others, and what was rounded in between.
#[derive(Clone, Debug, Default)]
pub(super) struct Length {
    entries: Vec<usize>,
    /// Entries that are one.
    ones: usize,
    added: Vec<usize>,
    rounded: Vec<usize>,
    /// How many turns of two entries were taken off.
    turns: usize,
}

/// ±cos·a ± sin·b
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turned {
    angle: usize,
    of_cosine: usize,
    of_sine: usize,
    /// Whether the two have different signs.
    opposed: bool,
    products: [usize; 2],
}

/// For each operation its bound, where lengths give one.
pub(super) fn of(operations: &[Operation]) -> Vec<Option<Norm>> {
    let form = Form { operations, turned: (0..operations.len()).map(|k| turned(operations, k)).collect() };
    let of = |k: usize| match form.turned[k] {
        Some(_) => Some(Norm::Turned(form.lengths([k]))),
        None => form.product(k),
    };
    (0..operations.len()).map(of).collect()
}

impl Norm {
    /// The size of the operation at most, by the values so far.
    pub(super) fn bound(&self, values: &[Interval], errors: &[Errors]) -> f64 {
        // Of a turned operation its own value is not there yet, nor what it rounds.
        let least = |lengths: &[Length]| {
            lengths
                .iter()
                .map(|length| length.bound(values, errors))
                .fold(f64::INFINITY, |a, b| if b < a { b } else { a })
        };
        match self {
            Norm::Turned(lengths) => least(lengths),
            Norm::Product(a, b, rounded) => {
                let rounded: f64 = rounded.iter().map(|k| errors[*k][0]).sum();
                (least(a) * least(b) + rounded) * LONGER
            }
        }
    }
}

impl Length {
    fn bound(&self, values: &[Interval], errors: &[Errors]) -> f64 {
        let square: f64 = self.entries.iter().map(|k| values[*k].magnitude().powi(2)).sum();
        let added: f64 = self.added.iter().map(|k| values[*k].magnitude()).sum();
        let rounded: f64 = self.rounded.iter().map(|k| errors[*k][0]).sum();
        ((square + self.ones as f64).sqrt() + added + rounded) * LONGER
    }

    /// Takes sine and cosine of one angle together.
    fn pair_up(&mut self, operations: &[Operation]) {
        let find = |k: &usize| matches!(operations[*k], Operation::Sine(_) | Operation::Cosine(_));
        let pair = |this: &Length| {
            let turning: Vec<usize> = this.entries.iter().copied().filter(find).collect();
            turning.iter().find_map(|k| {
                let other = turning.iter().find(|other| are_of_one_angle(operations, *k, **other))?;
                Some([*k, *other])
            })
        };
        while let Some(found) = pair(self) {
            for k in found {
                self.remove(k);
            }
            self.ones += 1;
            self.turns += 1;
        }
    }

    /// Removes one entry, of which there may be several.
    fn remove(&mut self, entry: usize) {
        if let Some(at) = self.entries.iter().position(|k| *k == entry) {
            self.entries.remove(at);
        }
    }
}

/// Whether one is the sine and the other the cosine of an angle.
fn are_of_one_angle(operations: &[Operation], a: usize, b: usize) -> bool {
    match (operations[a], operations[b]) {
        (Operation::Sine(i), Operation::Cosine(j)) | (Operation::Cosine(i), Operation::Sine(j)) => i == j,
        _ => false,
    }
}

/// The factors of a product, either first.
fn factors(operations: &[Operation], k: usize) -> Option<[(usize, usize); 2]> {
    match operations[k] {
        Operation::Mul(a, b) => Some([(a, b), (b, a)]),
        _ => None,
    }
}

/// An operation as a turned one.
fn turned(operations: &[Operation], k: usize) -> Option<Turned> {
    let Operation::Add(x, y, opposed) = operations[k] else { return None };
    for (first, of_first) in factors(operations, x)? {
        for (second, of_second) in factors(operations, y)? {
            let (angle, of_cosine, of_sine) = match (operations[first], operations[second]) {
                (Operation::Cosine(i), Operation::Sine(j)) if i == j => (i, of_first, of_second),
                (Operation::Sine(i), Operation::Cosine(j)) if i == j => (i, of_second, of_first),
                _ => continue,
            };
            return Some(Turned { angle, of_cosine, of_sine, opposed, products: [x, y] });
        }
    }
    None
}

/// The operations, and which of them are turned ones.
struct Form<'a> {
    operations: &'a [Operation],
    turned: Vec<Option<Turned>>,
}

impl Form<'_> {
    /// A sum of two products as a product of vectors, where one of them is turned.
    fn product(&self, k: usize) -> Option<Norm> {
        let Operation::Add(x, y, _) = self.operations[k] else { return None };
        let [(a, b), _] = factors(self.operations, x)?;
        let of = |(c, d): (usize, usize)| {
            let (first, second) = (self.lengths([a, c]), self.lengths([b, d]));
            let turns = |lengths: &[Length]| lengths.last().map_or(0, |length| length.turns);
            (turns(&first) + turns(&second), first, second)
        };
        let best = factors(self.operations, y)?.map(of).into_iter().max_by_key(|(turns, ..)| *turns);
        best.filter(|(turns, ..)| *turns > 0)
            .map(|(_, first, second)| Norm::Product(first, second, [k, x, y]))
    }

    /// Bounds of the length of a vector, one after each turn that is taken off.
    fn lengths<const N: usize>(&self, entries: [usize; N]) -> Vec<Length> {
        let mut length = Length { entries: entries.to_vec(), ..Length::default() };
        length.pair_up(self.operations);
        let mut all = if N > 1 { vec![length.clone()] } else { Vec::new() };
        for _ in 0..MOST_STEPS {
            let turns = length.turns;
            if !self.back(&mut length) {
                break;
            }
            length.pair_up(self.operations);
            // Other steps only lengthen.
            if length.turns > turns {
                all.push(length.clone());
            }
        }
        all
    }

    /// Replaces the last entry that can be by what it was made of; `false` where none can.
    fn back(&self, length: &mut Length) -> bool {
        let can =
            |k: usize| self.turned[k].is_some() || self.sum(k).is_some() || self.part(k, length).is_some();
        let Some(last) = length.entries.iter().copied().filter(|k| can(*k)).max() else { return false };
        if let Some(turn) = self.turned[last] {
            self.turn_back(length, last, turn);
        } else if let Some((kept, added)) = self.sum(last) {
            length.remove(last);
            length.rounded.push(last);
            length.entries.push(kept);
            length.added.push(added);
        } else if let Some((kept, other)) = self.part(last, length) {
            length.remove(last);
            length.rounded.push(last);
            if let Some(other) = other {
                length.remove(other);
                length.rounded.push(other);
                length.turns += 1;
            }
            length.entries.push(kept);
        }
        true
    }

    /// From c·a + s·b, with c·b − s·a where that is an entry too, to a and b.
    fn turn_back(&self, length: &mut Length, entry: usize, turn: Turned) {
        length.remove(entry);
        length.rounded.push(entry);
        length.rounded.extend(turn.products);
        let across = |k: &usize| {
            self.turned[*k].is_some_and(|other| {
                (other.angle, other.of_cosine, other.of_sine) == (turn.angle, turn.of_sine, turn.of_cosine)
                    && other.opposed != turn.opposed
            })
        };
        if let Some(other) = length.entries.iter().copied().find(across) {
            length.remove(other);
            length.rounded.push(other);
            length.rounded.extend(self.turned[other].iter().flat_map(|t| t.products));
        }
        length.turns += 1;
        length.entries.extend([turn.of_cosine, turn.of_sine]);
    }

    /// A sum of which one part is a turned one, and the other part.
    fn sum(&self, k: usize) -> Option<(usize, usize)> {
        let Operation::Add(a, b, _) = self.operations[k] else { return None };
        match (self.turned[a].is_some(), self.turned[b].is_some()) {
            (true, false) => Some((a, b)),
            (false, true) => Some((b, a)),
            _ => None,
        }
    }

    /// Of a product with a sine or cosine the other factor, which is not smaller; with the entry that is the
    /// same factor's product with the cosine or sine, where there is one.
    fn part(&self, k: usize, length: &Length) -> Option<(usize, Option<usize>)> {
        let ways = factors(self.operations, k)?;
        let turns = |t: usize| matches!(self.operations[t], Operation::Sine(_) | Operation::Cosine(_));
        let ways = || ways.into_iter().filter(|(t, _)| turns(*t));
        let paired = ways().find_map(|(t, x)| {
            let across = |other: &usize| {
                let of = |(u, y): (usize, usize)| y == x && are_of_one_angle(self.operations, t, u);
                factors(self.operations, *other).is_some_and(|ways| ways.into_iter().any(of))
            };
            Some((x, Some(length.entries.iter().copied().find(across)?)))
        });
        // One whose sine or cosine is there already, if possible.
        let joins =
            |x: usize| length.entries.iter().any(|other| are_of_one_angle(self.operations, x, *other));
        let single = || ways().find(|(_, x)| joins(*x)).or_else(|| ways().next());
        paired.or_else(|| single().map(|(_, x)| (x, None)))
    }
}

/// Steps back from one operation: some for each joint.
const MOST_STEPS: usize = 16;

/// By how much the emitted sine and cosine of `f32` may be longer than one, √2 units for each step back, and
/// what computing the bound rounds.
const LONGER: f64 = 1.0 + 1e-5;
