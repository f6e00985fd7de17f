//! What was accepted and does not stay: names that turn out not to be told apart or not to be there, terms
//! that later ones made unneeded.

use super::forward::{Accepted, Session};
use super::leftover::leftover;
use super::open::Question;
use super::rule;
use crate::identification::estimate::{Solver, noise_floor, spread};

impl Session<'_> {
    /// Takes back what, now that everything that fits is in the model, is not what it is called: an effect
    /// that is missing at some pace; or one that is not told apart from its rivals and beside which much is
    /// left, so that something else is there. It stays as a rival of what comes. Returns its name and why.
    pub(super) fn withhold(&mut self) -> Option<(&'static str, &'static str)> {
        let (taken, why) = if let Some(a) = self.inconstant() {
            (vec![self.accepted.remove(a)], "what it says of some pace of motion is not there")
        } else {
            let weak = self.steps.iter().rev().find(|s| {
                s.comparison.apart < rule::LEAST_MARGIN
                    && self.accepted.iter().any(|a| a.step == s.number)
                    && self.share_left(&s.square_before, &s.comparison.joints) > rule::MUCH_LEFT
            })?;
            let step = weak.number;
            (
                self.accepted.extract_if(.., |a| a.step == step).collect(),
                "others fit as well and much is left",
            )
        };
        let Accepted { effect, step, .. } = *taken.first()?;
        // What was found beside it on its joints may be there because of it, and is asked again.
        let joints: Vec<usize> = taken.iter().flat_map(|a| a.candidate.joints.clone()).collect();
        self.accepted.retain(|a| a.step <= step || !a.candidate.joints.iter().any(|j| joints.contains(j)));
        self.given_up.extend(taken.into_iter().map(|a| (a.effect, a.candidate)));
        let accepted = &self.accepted;
        let gone = self.steps.extract_if(.., |s| !accepted.iter().any(|a| a.step == s.number));
        self.questions.extend(gone.filter_map(|s| s.question).map(Question::withheld));
        self.refit();
        Some((self.effects[effect].name(), why))
    }

    /// The share of the excess over the noise floor that stayed on some joints, each counting alike, given
    /// the squared errors before: a name must explain every joint that it is given on.
    fn share_left(&self, before: &[f64], joints: &[usize]) -> f64 {
        let rms = |j: usize, square: f64| (square / self.data.joints[j].len().max(1) as f64).sqrt();
        let before: Vec<f64> = before.iter().enumerate().map(|(j, s)| rms(j, *s)).collect();
        let after = spread(&self.data, &self.fit.residual).rms;
        let floor = noise_floor(&self.data);
        let shares: f64 = joints.iter().map(|j| leftover(&before, &after, &floor, &[*j])).sum();
        shares / joints.len().max(1) as f64
    }

    /// Takes out what later additions made unneeded.
    pub(super) fn prune(&mut self) {
        loop {
            let (gram, right, square) = self.fit.gram.sum(&self.fit.weights, |_| true);
            let error = |without: &dyn Fn(usize) -> bool| {
                let theta = Solver::new(&gram, |c| self.fit.free[c] && !without(c)).solve(&right);
                square - theta.iter().zip(&right).map(|(x, r)| x * r).sum::<f64>()
            };
            let full = error(&|_| false);
            let mut first = 0;
            let mut weakest: Option<(usize, f64)> = None;
            for (k, a) in self.accepted.iter().enumerate() {
                let columns = self.fit.design.extra(first)..self.fit.design.extra(first) + a.columns;
                first += a.columns;
                let penalty =
                    rule::PER_COEFFICIENT * a.columns as f64 + 2.0 * a.candidate.searched.max(1.0).ln();
                let score = error(&|c| columns.contains(&c)) - full - penalty;
                if score < rule::LEAST_SCORE && weakest.is_none_or(|(_, w)| score < w) {
                    weakest = Some((k, score));
                }
            }
            let Some((k, _)) = weakest else { return };
            self.accepted.remove(k);
            self.refit();
        }
    }
}
