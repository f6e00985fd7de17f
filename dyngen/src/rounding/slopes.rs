//! Derivatives of the last operation by each, as further operations: from the output backwards.

use super::interval::Interval;
use super::program::Operation;

/// A part of a derivative: an operation or minus it.
#[derive(Clone, Copy)]
struct Term {
    place: usize,
    negative: bool,
}

/// Appends the derivatives; of each operation the place of its own, up to its sign; `None` where it is zero.
pub(super) fn append(operations: &mut Vec<Operation>) -> Vec<Option<usize>> {
    let emitted = operations.len();
    let mut terms: Vec<Vec<Term>> = vec![Vec::new(); emitted];
    let mut slopes = vec![None; emitted];
    let one = push(operations, Operation::Constant(Interval::point(1.0), [0.0; 2]));
    if let Some(last) = terms.last_mut() {
        last.push(Term { place: one, negative: false });
    }
    for k in (0..emitted).rev() {
        let Some(slope) = sum(operations, &terms[k]) else { continue };
        slopes[k] = Some(slope.place);
        let times = |operations: &mut Vec<Operation>, other: usize| {
            let place =
                if slope.place == one { other } else { push(operations, Operation::Mul(slope.place, other)) };
            Term { place, ..slope }
        };
        match operations[k] {
            Operation::Add(a, b, negative) => {
                terms[a].push(slope);
                terms[b].push(Term { negative: negative != slope.negative, ..slope });
            }
            Operation::Mul(a, b) => {
                terms[a].push(times(operations, b));
                terms[b].push(times(operations, a));
            }
            // x/y: 1/y, and −(x/y)/y.
            Operation::Div(a, b) => {
                let by_a = push(operations, Operation::Div(slope.place, b));
                terms[a].push(Term { place: by_a, ..slope });
                let by_b = push(operations, Operation::Mul(by_a, k));
                terms[b].push(Term { place: by_b, negative: !slope.negative });
            }
            _ => {}
        }
    }
    slopes
}

fn push(operations: &mut Vec<Operation>, operation: Operation) -> usize {
    operations.push(operation);
    operations.len() - 1
}

/// The sum of terms; its sign is that of the first.
fn sum(operations: &mut Vec<Operation>, terms: &[Term]) -> Option<Term> {
    let (first, rest) = terms.split_first()?;
    let add = |all: Term, term: &Term| {
        let place = push(operations, Operation::Add(all.place, term.place, term.negative != all.negative));
        Term { place, ..all }
    };
    Some(rest.iter().fold(*first, add))
}
