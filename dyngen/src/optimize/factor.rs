//! Takes common factors out of sums: a·b + a·c becomes a·(b + c).

use super::cheaper;
use super::flat::{Flat, Kind, uses};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::graph::{Builder, Expr, Graph};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// A factor without sign, and whether it depends on the state.
type Factor = (Expr, bool);

/// A term of a sum: a product with its sign.
#[derive(Clone, Debug)]
struct Term {
    factors: Vec<Factor>,
    negative: bool,
}

/// The pass.
pub(super) fn factor(graph: &Graph, outputs: &[Expr], _: &ConstantField) -> (Graph, Vec<Expr>) {
    let (sums, products) = (Flat::of(graph, outputs, Kind::Sum), Flat::of(graph, outputs, Kind::Product));
    let uses = uses(graph, outputs);
    let b = Builder::new();
    let mut copied = vec![Expr::ZERO; graph.nodes().len()];
    let holds = graph.holds();
    for node in graph.needed(outputs) {
        if let Some(leaves) = sums.leaves.get(&node) {
            let terms = leaves.iter().map(|(leaf, negative)| {
                // A product that is needed elsewhere too costs nothing here.
                let own = products.leaves.get(leaf).filter(|_| uses[*leaf] == 1);
                let own = own.map_or(vec![*leaf], |own| own.iter().map(|(n, _)| *n).collect());
                unsigned(own.into_iter().map(|n| (copied[n], holds[n].state)).collect(), *negative)
            });
            copied[node] = sum(&b, terms.collect());
        } else if !sums.is_part[node] {
            copied[node] = b.copy_node(graph, node, &copied);
        }
    }
    let sign = |e: &Expr| if e.is_negative() { -copied[e.node()] } else { copied[e.node()] };
    let factored: Vec<Expr> = outputs.iter().map(sign).collect();
    cheaper((graph.clone(), outputs.to_vec()), (b.finish(), factored))
}

/// A term whose factors have no signs.
fn unsigned(factors: Vec<Factor>, negative: bool) -> Term {
    let negative = factors.iter().fold(negative, |sign, (factor, _)| sign != factor.is_negative());
    Term {
        factors: factors.into_iter().map(|(factor, state)| (factor.positive(), state)).collect(),
        negative,
    }
}

/// The sum of terms; the factor that most of them share is taken out first.
fn sum(b: &Builder, mut terms: Vec<Term>) -> Expr {
    while let Some((factor, sharing)) = most_shared(&terms) {
        let inner = sharing.iter().map(|k| {
            let mut term = terms[*k].clone();
            if let Some(place) = term.factors.iter().position(|(f, _)| *f == factor.0) {
                term.factors.remove(place);
            }
            term
        });
        let inner = sum(b, inner.collect());
        terms[sharing[0]] = unsigned(vec![factor, (inner, true)], false);
        let mut k = 0;
        terms.retain(|_| {
            k += 1;
            !sharing[1..].contains(&(k - 1))
        });
    }
    terms.iter().fold(Expr::ZERO, |total, term| {
        let product = term.factors.iter().fold(Expr::ONE, |product, (factor, _)| b.mul(&product, factor));
        b.add(&total, &if term.negative { -product } else { product })
    })
}

/// The factor of most products with the terms that share it, where two do; of equals the first. All remaining
/// terms but one depend on the state: otherwise further sums of parameters would have to be prepared.
fn most_shared(terms: &[Term]) -> Option<(Factor, Vec<usize>)> {
    let mut sharing: BTreeMap<Expr, (bool, Vec<usize>, bool)> = BTreeMap::new();
    for (k, term) in terms.iter().enumerate().filter(|(_, term)| term.factors.len() > 1) {
        for (i, (factor, state)) in term.factors.iter().enumerate() {
            let (_, own, prepared) = sharing.entry(*factor).or_insert((*state, Vec::new(), false));
            let rest = term.factors.iter().enumerate().any(|(j, (_, state))| j != i && *state);
            // A square has its factor twice.
            if own.last() != Some(&k) && (rest || !*prepared) {
                own.push(k);
                *prepared |= !rest;
            }
        }
    }
    let (factor, (state, own, _)) =
        sharing.into_iter().min_by_key(|(factor, (_, own, _))| (Reverse(own.len()), *factor))?;
    (own.len() > 1).then_some(((factor, state), own))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::prime::Draws;
    use crate::exact::symbols::AngleSymbols;
    use crate::graph::Input;

    #[test]
    fn a_common_factor_is_multiplied_once() {
        let field = ConstantField::new(&AngleSymbols::default(), 0, &mut Draws::new(1));
        let b = Builder::new();
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| b.input(Input::Velocity(i)));
        let [p, r] = [0, 1].map(|i| b.input(Input::Parameter(i)));
        let product = |e: &[Expr]| e.iter().fold(Expr::ONE, |all, x| b.mul(&all, x));
        let shared = b.mul(&y, &y);
        let outputs = [
            // x·(y·z − w·(z + y))
            b.sub(&b.sub(&product(&[y, z, x]), &product(&[z, w, x])), &product(&[w, y, x])),
            // Nothing more is prepared.
            b.add(&b.mul(&p, &z), &b.mul(&r, &z)),
            // y² is needed anyway.
            b.add(&shared, &b.mul(&y, &p)),
            shared,
        ];
        let graph = b.finish();
        let before = graph.operations_when_prepared(&outputs);
        assert_eq!((before.mul, before.add), (10, 4));
        let (graph, factored) = factor(&graph, &outputs, &field);
        let after = graph.operations_when_prepared(&factored);
        assert_eq!((after.mul, after.add), (7, 4));
    }
}
