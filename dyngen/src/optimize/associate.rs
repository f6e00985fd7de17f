//! Regroups sums and products so that more of them share a part.
//!
//! A sum of sums that are used nowhere else is one sum of many terms, and likewise a product. The factors of
//! a product that depend on parameters alone are multiplied first: their product is prepared once. Then the
//! pair of terms, or of factors, that occurs in most places becomes a node of its own, as long as one occurs
//! twice.

use super::cheaper;
use super::flat::{Flat, Kind, Leaf};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::graph::{Builder, Expr, Graph};
use std::collections::BTreeMap;

/// The pass.
pub(super) fn associate(graph: &Graph, outputs: &[Expr], _: &ConstantField) -> (Graph, Vec<Expr>) {
    [Kind::Product, Kind::Sum].into_iter().fold((graph.clone(), outputs.to_vec()), |form, kind| {
        let regrouped = regroup(&form.0, &form.1, kind);
        cheaper(form, regrouped)
    })
}

fn regroup(graph: &Graph, outputs: &[Expr], kind: Kind) -> (Graph, Vec<Expr>) {
    let needed = graph.needed(outputs);
    let holds = graph.holds();
    let nodes = graph.nodes();
    let Flat { mut leaves, is_part } = Flat::of(graph, outputs, kind);
    let b = Builder::new();
    let mut copied = vec![Expr::ZERO; nodes.len()];
    let mut fixed: BTreeMap<usize, Vec<Leaf>> = BTreeMap::new();
    if kind == Kind::Product {
        for own in leaves.values_mut() {
            let (parameters, rest): (Vec<Leaf>, Vec<Leaf>) =
                std::mem::take(own).into_iter().partition(|(n, _)| !holds[*n].state);
            if parameters.iter().any(|(n, _)| holds[*n].parameters) && parameters.len() > 1 {
                // Their product is prepared; it replaces them under its own number.
                let place = nodes.len() + fixed.len();
                fixed.insert(place, parameters);
                *own = rest;
                own.push((place, false));
            } else {
                *own = parameters.into_iter().chain(rest).collect();
            }
        }
    }
    let mut pairs: Vec<(Leaf, Leaf)> = Vec::new();
    let first_pair = nodes.len() + fixed.len();
    while let Some((first, second)) = most_frequent_pair(leaves.values()) {
        let place = first_pair + pairs.len();
        pairs.push((first, second));
        for own in leaves.values_mut() {
            replace_pair(own, first, second, place);
        }
    }
    // Leaves come before what they are part of, and pairs before what uses them: build on demand.
    let mut build = Rebuild { b: &b, kind, fixed: &fixed, pairs: &pairs, first_pair, extra: BTreeMap::new() };
    for node in needed {
        if leaves.contains_key(&node) {
            copied[node] = build.combine(&leaves[&node], &copied);
        } else if !is_part[node] {
            copied[node] = b.copy_node(graph, node, &copied);
        }
    }
    let outputs =
        outputs.iter().map(|e| if e.is_negative() { -copied[e.node()] } else { copied[e.node()] }).collect();
    (b.finish(), outputs)
}

struct Rebuild<'a> {
    b: &'a Builder,
    kind: Kind,
    fixed: &'a BTreeMap<usize, Vec<Leaf>>,
    pairs: &'a [(Leaf, Leaf)],
    first_pair: usize,
    extra: BTreeMap<usize, Expr>,
}

impl Rebuild<'_> {
    fn combine(&mut self, own: &[Leaf], copied: &[Expr]) -> Expr {
        let mut terms = own.iter().copied();
        // A sum or product has a leaf.
        let Some(first) = terms.next() else { return Expr::ZERO };
        let mut total = self.leaf(first, copied);
        for leaf in terms {
            let value = self.leaf(leaf, copied);
            total = match self.kind {
                Kind::Sum => self.b.add(&total, &value),
                Kind::Product => self.b.mul(&total, &value),
            };
        }
        total
    }

    fn leaf(&mut self, (place, negative): Leaf, copied: &[Expr]) -> Expr {
        let value = match copied.get(place) {
            Some(value) => *value,
            None => match self.extra.get(&place) {
                Some(value) => *value,
                None => {
                    let value = match self.fixed.get(&place) {
                        Some(parameters) => self.combine(&parameters.clone(), copied),
                        None => {
                            let (first, second) = self.pairs[place - self.first_pair];
                            self.combine(&[first, second], copied)
                        }
                    };
                    self.extra.insert(place, value);
                    value
                }
            },
        };
        if negative { -value } else { value }
    }
}

/// The pair with its first leaf positive that occurs most often, where one occurs twice; of equals the first.
fn most_frequent_pair<'a>(all: impl Iterator<Item = &'a Vec<Leaf>>) -> Option<(Leaf, Leaf)> {
    let mut counts: BTreeMap<(usize, usize, bool), usize> = BTreeMap::new();
    for own in all {
        let mut seen: Vec<(usize, usize, bool)> = Vec::new();
        for (i, a) in own.iter().enumerate() {
            for b in &own[i + 1..] {
                let key = (a.0.min(b.0), a.0.max(b.0), a.1 != b.1);
                if !seen.contains(&key) {
                    seen.push(key);
                }
            }
        }
        for key in seen {
            *counts.entry(key).or_default() += 1;
        }
    }
    let (key, count) = counts.into_iter().min_by_key(|(key, count)| (std::cmp::Reverse(*count), *key))?;
    (count > 1).then_some(((key.0, false), (key.1, key.2)))
}

fn replace_pair(own: &mut Vec<Leaf>, first: Leaf, second: Leaf, place: usize) {
    for i in 0..own.len() {
        if own[i].0 != first.0 {
            continue;
        }
        let negative = own[i].1;
        let partner = (0..own.len()).find(|j| *j != i && own[*j] == (second.0, second.1 != negative));
        if let Some(j) = partner {
            own[i] = (place, negative);
            own.remove(j);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::prime::Draws;
    use crate::exact::symbols::AngleSymbols;
    use crate::graph::Input;

    #[test]
    fn sums_and_products_share_their_parts() {
        let field = ConstantField::new(&AngleSymbols::default(), 0, &mut Draws::new(1));
        let b = Builder::new();
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| b.input(Input::Velocity(i)));
        let [p, r] = [0, 1].map(|i| b.input(Input::Parameter(i)));
        // x − z is in both sums; p·r is prepared.
        let outputs = [
            b.sub(&b.add(&x, &y), &z),
            b.sub(&b.add(&z, &w), &x),
            b.mul(&b.mul(&p, &x), &r),
            b.mul(&b.mul(&p, &y), &r),
        ];
        let (graph, regrouped) = associate(&b.finish(), &outputs, &field);
        let count = graph.operations_when_prepared(&regrouped);
        assert_eq!((count.mul, count.add), (2, 3));
    }
}
