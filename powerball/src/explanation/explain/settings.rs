//! Settings of accepted effects (speeds, ways, orders, time constants, powers, ends of windows) once
//! everything is in the model: when an effect was looked for, friction had bent to it, others were missing,
//! and the search was coarse.

use super::forward::Session;
use super::screen::Screen;
use crate::explanation::effects::{Candidate, Context, Effect, Window};
use crate::logs::parallel;

/// Each round looks nearer than the one before it.
const ROUNDS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Moves of a setting in one round at most.
const MOVES: usize = 6;
/// How far an end of a window is moved in the first round, s: blocks in which a payload's start is looked for
/// are 2 s long.
const ENDS: [f64; 3] = [0.4, 0.8, 1.6];
/// A setting is moved for more than chance gains by one more coefficient, in units of χ².
const LEAST: f64 = 1.0;

impl Session<'_> {
    /// Moves the settings to where all data fit best. Names, joints and logs stay.
    pub(super) fn improve_settings(&mut self) {
        for nearer in ROUNDS {
            let moved = self.moved_settings(nearer);
            if moved.is_empty() {
                continue;
            }
            let weights = self.fit.weights.clone();
            let error = |session: &Session<'_>| -> f64 {
                let square = |r: &Vec<f64>| r.iter().map(|e| e * e).sum::<f64>();
                session.fit.residual.iter().zip(&weights).map(|(r, w)| w * square(r)).sum()
            };
            let before = error(self);
            let old: Vec<(Candidate, usize)> =
                self.accepted.iter().map(|a| (a.candidate.clone(), a.columns)).collect();
            for (k, candidate, columns) in moved {
                (self.accepted[k].candidate, self.accepted[k].columns) = (candidate, columns);
            }
            self.refit();
            // Moved together they may disturb each other.
            if error(self) > before {
                for (a, (candidate, columns)) in self.accepted.iter_mut().zip(old) {
                    (a.candidate, a.columns) = (candidate, columns);
                }
                self.refit();
            }
        }
    }

    /// Accepted effects that fit better elsewhere: which, with what settings and columns.
    fn moved_settings(&self, nearer: f64) -> Vec<(usize, Candidate, usize)> {
        let mut moved = Vec::new();
        let mut first = 0;
        for ((k, a), coefficients) in self.accepted.iter().enumerate().zip(self.coefficients()) {
            let own = self.fit.design.extra(first)..self.fit.design.extra(first) + a.columns;
            first += a.columns;
            let effect = self.effects[a.effect].as_ref();
            let mut without = self.fit.residual.clone();
            let columns =
                effect.columns(&Context::new(&self.data, &self.fit, &self.fit.residual), &a.candidate);
            columns.iter().zip(&coefficients).for_each(|(column, c)| column.add_to(&mut without, *c));
            let context = Context::new(&self.data, &self.fit, &without);
            let screen = Screen::without(&context, own);
            let Some(mut best) = screen.try_candidate(effect, &a.candidate) else { continue };
            let mut candidate = a.candidate.clone();
            let refines = effect.refined(&candidate, &coefficients).is_some();
            for _ in 0..MOVES {
                let fitted = |w: &Window| self.data.logs.contains(&w.log);
                let mut others: Vec<Candidate> = moved_ends(&candidate.windows, fitted, nearer)
                    .map(|windows| Candidate { windows, ..candidate.clone() })
                    .collect();
                // What takes its setting from its own coefficient, or lies in some logs, is where it belongs
                // but for its ends.
                if !refines && candidate.windows.is_empty() {
                    others.extend(self.other_settings(&context, a.effect, &candidate, nearer));
                }
                let trials = parallel::map(&others, |c| screen.try_candidate(effect, c));
                let tried = others.into_iter().zip(trials).filter_map(|(c, t)| Some((c, t?)));
                match tried.max_by(|a, b| a.1.score.total_cmp(&b.1.score)) {
                    Some((c, trial)) if trial.score > best.score + LEAST => (candidate, best) = (c, trial),
                    _ => break,
                }
            }
            if candidate != a.candidate {
                moved.push((k, candidate, best.columns.len()));
            }
        }
        moved
    }

    /// The same effect with other settings: those near by, in the first round all.
    fn other_settings(
        &self,
        context: &Context<'_>,
        effect: usize,
        candidate: &Candidate,
        nearer: f64,
    ) -> Vec<Candidate> {
        let own: &dyn Effect = self.effects[effect].as_ref();
        let mut others: Vec<Candidate> = Vec::new();
        for mut near in own.neighbours(candidate) {
            for (value, from) in near.values.iter_mut().zip(&candidate.values) {
                *value = from + nearer * (*value - from);
            }
            others.push(near);
        }
        if nearer == ROUNDS[0] {
            let alike = |c: &Candidate| c.joints == candidate.joints && self.same(effect, c, candidate);
            others.extend(own.candidates(context).into_iter().filter(alike));
        }
        for other in &mut others {
            other.searched = candidate.searched;
        }
        others
    }
}

/// Windows of which one of those that may move has one end elsewhere.
fn moved_ends<'w>(
    windows: &'w [Window],
    may: impl Fn(&Window) -> bool + 'w,
    nearer: f64,
) -> impl Iterator<Item = Vec<Window>> + 'w {
    let ways = ENDS.iter().flat_map(move |way| [way * nearer, -way * nearer]);
    let free = (0..windows.len()).filter(move |w| may(&windows[*w]));
    let ends = free.flat_map(|w| [(w, true), (w, false)]);
    ends.flat_map(move |end| ways.clone().map(move |way| (end, way))).filter_map(|((w, start), way)| {
        let mut moved = windows.to_vec();
        let end = if start { &mut moved[w].from } else { &mut moved[w].to };
        *end += way;
        (end.is_finite() && moved[w].from < moved[w].to).then_some(moved)
    })
}
