//! The test of a whole arm: the joints' innovations, and a bet on each change that has a name.

use super::JointColour;
use super::rows::{DELAY, FORCE, PAYLOAD, Shown};
use powerball_controller::change::{Alarm, Bet, Innovation, Joint, Standing, Term, Whitener, alarm};

/// Kinds of changes; each has the same share of all bets.
const KINDS: f64 = 6.0;

/// One joint's innovations and columns.
#[derive(Clone, Debug)]
struct Seen {
    joint: Joint<f64>,
    columns: Vec<Whitener<f64>>,
    constant: Whitener<f64>,
}

/// Bets on one joint's own changes.
#[derive(Clone, Copy, Debug, Default)]
struct Own {
    /// A constant torque: what has no other name.
    constant: Bet<f64, 1>,
    friction: Bet<f64, 1>,
    /// The joint's zero, which shows in the torques of all joints.
    zero: Bet<f64, 1>,
}

/// The test of an arm.
#[derive(Clone, Debug)]
pub struct Detector {
    seen: Vec<Option<Seen>>,
    payload: Bet<f64, PAYLOAD>,
    force: Bet<f64, FORCE>,
    delay: Bet<f64, DELAY>,
    own: Vec<Own>,
}

impl Detector {
    /// A test of joints with these colours; `range` is by how much of itself friction may wander.
    #[must_use]
    pub fn new(colours: &[Option<JointColour>], range: f64) -> Detector {
        let columns = PAYLOAD + FORCE + DELAY + colours.len();
        let seen = |colour: &JointColour| Seen {
            joint: Joint::new(colour.for_test(), range),
            columns: vec![Whitener::default(); columns],
            constant: Whitener::default(),
        };
        Detector {
            seen: colours.iter().map(|colour| colour.as_ref().map(seen)).collect(),
            payload: Bet::default(),
            force: Bet::default(),
            delay: Bet::default(),
            own: vec![Own::default(); colours.len()],
        }
    }

    /// A gap comes.
    pub fn interrupt(&mut self) {
        self.seen.iter_mut().flatten().for_each(Seen::interrupt);
    }

    /// Takes row `number` of all joints; returns whether one of them moves.
    pub fn update<'r>(&mut self, row: impl IntoIterator<Item = Option<&'r Shown>>, number: u64) -> bool {
        let says: Vec<(usize, Says)> = self
            .seen
            .iter_mut()
            .zip(row)
            .enumerate()
            .filter_map(|(j, (seen, shown))| Some((j, seen.as_mut()?.update(shown)?)))
            .collect();
        self.payload.update(&terms(&says, |_, says| Some(columns(says, 0))), number);
        self.force.update(&terms(&says, |_, says| Some(columns(says, PAYLOAD))), number);
        self.delay.update(&terms(&says, |_, says| Some(columns(says, PAYLOAD + FORCE))), number);
        for (j, own) in self.own.iter_mut().enumerate() {
            let zero = PAYLOAD + FORCE + DELAY + j;
            own.zero.update(&terms(&says, |_, says| Some(columns(says, zero))), number);
            let here = |k: usize, x: f64| (k == j).then_some([x]);
            own.constant.update(&terms(&says, |k, says| here(k, says.constant)), number);
            own.friction.update(&terms(&says, |k, says| here(k, says.innovation.friction)), number);
        }
        !says.is_empty()
    }

    /// The bets: those on a body, a force and a delay, then three a joint.
    fn standings(&self) -> impl Iterator<Item = Standing<f64>> + '_ {
        let all = 1.0 / KINDS;
        let each = all / self.own.len().max(1) as f64;
        let whole = [of(&self.payload, all), of(&self.force, all), of(&self.delay, all)];
        let own = self.own.iter();
        whole.into_iter().chain(
            own.flat_map(move |own| [of(&own.constant, each), of(&own.friction, each), of(&own.zero, each)]),
        )
    }

    /// The average capital.
    #[must_use]
    pub fn capital(&self) -> f64 {
        self.standings().map(|s| s.weight * s.capital).sum()
    }

    /// The alarm, where the average capital is at least `level`.
    #[must_use]
    pub fn alarm(&self, level: f64) -> Option<Alarm<f64>> {
        alarm(self.standings(), level)
    }

    /// The joint whose own bets say most.
    #[must_use]
    pub fn joint(&self) -> usize {
        let of = |own: &Own| own.constant.capital() + own.friction.capital() + own.zero.capital();
        let all = self.own.iter().map(of).enumerate();
        all.fold((0, 0.0), |best, (j, own)| if own > best.1 { (j, own) } else { best }).0
    }
}

/// The innovation of a joint at one row.
#[derive(Debug)]
struct Says {
    innovation: Innovation<f64>,
    columns: Vec<f64>,
    constant: f64,
}

impl Seen {
    fn interrupt(&mut self) {
        self.joint.interrupt();
        self.columns.iter_mut().for_each(Whitener::interrupt);
        self.constant.interrupt();
    }

    fn update(&mut self, shown: Option<&Shown>) -> Option<Says> {
        let Some(shown) = shown else {
            self.interrupt();
            return None;
        };
        let colour = *self.joint.colour();
        let columns: Vec<Option<f64>> =
            self.columns.iter_mut().zip(&shown.columns).map(|(w, x)| w.update(&colour, *x)).collect();
        let constant = self.constant.update(&colour, 1.0);
        let innovation = self.joint.update(shown.residual, shown.friction)?;
        let columns = columns.into_iter().collect::<Option<Vec<f64>>>()?;
        Some(Says { innovation, columns, constant: constant? })
    }
}

/// P columns from a place on.
fn columns<const P: usize>(says: &Says, from: usize) -> [f64; P] {
    std::array::from_fn(|k| says.columns.get(from + k).copied().unwrap_or(0.0))
}

/// The contributions to a bet of the joints on which it shows.
fn terms<const P: usize>(
    says: &[(usize, Says)],
    columns: impl Fn(usize, &Says) -> Option<[f64; P]>,
) -> Vec<Term<f64, P>> {
    let term =
        |(j, says): &(usize, Says)| Some(Term { innovation: says.innovation, columns: columns(*j, says)? });
    says.iter().filter_map(term).collect()
}

fn of<const P: usize>(bet: &Bet<f64, P>, weight: f64) -> Standing<f64> {
    Standing { weight, capital: bet.capital(), since: bet.since() }
}
