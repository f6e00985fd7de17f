//! The reading under which one rigid arm fits best: one change after another, as long as each is clear.

use super::arm_file::{Change, Reading};
use super::asked::{Asked, Positions, factors, filed};
use super::fit::{Gravity, Judged, Rows, judge};
use super::physics::Energies;
use super::properties;
use super::result::GravityIs;
use dyngen::exact::rational::to_f64;
use powerball_logs::regression::DataError;

/// Held-out squared errors are compared after adding this share of the torque's: below 2 % no change is
/// searched.
const FLOOR: f64 = 4e-4;
/// A change is clear where it lowers squared errors to this share, both ways round.
const CLEAR: f64 = 0.5;
/// Gravity helps where squared errors grow at least this many times without it.
const HELPS: f64 = 1.2;
/// It does nothing where they grow to less than this.
const NO_WORSE: f64 = 1.05;
/// Largest factor by which a change may raise the error of the joints that it does not concern.
const WORSE: f64 = 1.5;
/// A joint with an error below this share of its torque fits.
const FITS: f64 = 0.1;
/// Two joints of three have held-out errors below this share of their torque, or the fit is too poor to tell.
const GOOD: f64 = 0.35;
/// A joint with an error above this may have a wrong position column.
pub(super) const POOR: f64 = 0.25;
/// Two changes whose gains differ by less are not distinguished.
const ALIKE: f64 = 0.7;
/// Changes that are looked for.
const MOST: usize = 5;
/// How hard parameters may be held back.
const RIDGES: [f64; 5] = [1e-6, 1e-4, 1e-3, 1e-2, 1e-1];

/// A change that was taken, with the errors before and after it by joint.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) change: Change,
    /// Another change that fits as well.
    pub(super) rival: Option<Change>,
    pub(super) before: Vec<f64>,
    pub(super) after: Vec<f64>,
}

/// The result of the search.
#[derive(Debug)]
pub(super) struct Found<'a> {
    pub(super) rows: Rows<'a>,
    pub(super) read: Reading,
    pub(super) judged: Judged,
    /// By part.
    pub(super) energies: [Energies; 2],
    /// The held-out error of the plain reading by joint.
    pub(super) plain: Vec<f64>,
    pub(super) steps: Vec<Step>,
    pub(super) ridge: f64,
}

impl Found<'_> {
    /// Whether the fit is good enough to judge by.
    pub(super) fn is_good(&self) -> bool {
        let shares: Vec<f64> = shares(&self.judged).into_iter().filter(|x| x.is_finite()).collect();
        !shares.is_empty() && 3 * shares.iter().filter(|x| **x < GOOD).count() >= 2 * shares.len()
    }
}

/// By how much the logarithm of held-out squared errors falls, summed over parts and joints.
fn gain(old: &Judged, new: &Judged) -> f64 {
    let pairs = old.left.iter().flatten().zip(new.left.iter().flatten());
    pairs.filter_map(|(old, new)| ratio(*old, *new)).map(|r| -r.ln()).sum()
}

fn ratio(old: f64, new: f64) -> Option<f64> {
    (old.is_finite() && new.is_finite()).then(|| (new + FLOOR) / (old + FLOOR))
}

/// Whether a change lowers the errors that it concerns clearly, both ways round, and raises no others.
fn is_clear(change: &Change, old: &Judged, new: &Judged) -> bool {
    let concerned = change.concerned();
    let part_is_clear = |part: usize| {
        let ratios = ratios(old, new, part);
        let is_own = |j: &usize| concerned.as_ref().is_none_or(|joints| joints.contains(j));
        let own: Vec<f64> = ratios.iter().filter(|(j, _)| is_own(j)).map(|(_, r)| *r).collect();
        let mean = own.iter().map(|r| r.ln()).sum::<f64>() / own.len().max(1) as f64;
        let halved = own.iter().filter(|r| **r < CLEAR).count();
        let enough = match &concerned {
            Some(_) => mean < CLEAR.ln() && own.iter().all(|r| *r < 1.1),
            None => 3 * halved >= own.len() && halved >= own.len().min(2) && mean < 0.35 * CLEAR.ln(),
        };
        // Read from the tip every joint is another one: it may fit a little worse than what fitted by chance.
        let fits = |j: usize| *change == Change::FromTip && new.share(j) < FITS;
        !own.is_empty() && enough && ratios.iter().all(|(j, r)| *r < WORSE || fits(*j))
    };
    part_is_clear(0) && part_is_clear(1)
}

/// The held-out squared errors of a part over those before, by joint that moves.
pub(super) fn ratios(old: &Judged, new: &Judged, part: usize) -> Vec<(usize, f64)> {
    let (old, new) = (&old.left[part], &new.left[part]);
    (0..old.len()).filter_map(|j| Some((j, ratio(old[j], new[j])?))).collect()
}

/// By part: the mean over joints of the logarithm of held-out squared errors over those before.
pub(super) fn falls(old: &Judged, new: &Judged) -> [f64; 2] {
    [0, 1].map(|part| {
        let ratios = ratios(old, new, part);
        ratios.iter().map(|(_, r)| r.ln()).sum::<f64>() / ratios.len().max(1) as f64
    })
}

/// The reading under which the logs fit best, reached by clear changes alone.
///
/// # Errors
/// Where the logs hold too little to be judged.
pub(super) fn search<'a>(asked: &Asked<'a>) -> Result<Found<'a>, DataError> {
    let read = Reading::plain(asked.body.dof());
    let rows = asked.rows(&read.positions, read.gravity)?;
    let (ridge, judged) = with_best_ridge(&rows, &read);
    let plain = shares(&judged);
    let energies = [0, 1].map(|part| Energies::new(&rows, part));
    let mut found = Found { rows, read, judged, energies, plain, steps: Vec::new(), ridge };
    while found.steps.len() < MOST {
        let Some(next) = next(asked, &found)? else { break };
        found = next;
    }
    // A search that ends in a poor fit is not a reading.
    if !found.steps.is_empty() && !found.is_good() {
        let read = Reading::plain(asked.body.dof());
        let rows = asked.rows(&read.positions, read.gravity)?;
        let (ridge, judged) = with_best_ridge(&rows, &read);
        let energies = [0, 1].map(|part| Energies::new(&rows, part));
        return Ok(Found { rows, read, judged, energies, steps: Vec::new(), ridge, ..found });
    }
    Ok(found)
}

/// The reading after the best of all clear changes; `None` where there is none.
fn next<'a>(asked: &Asked<'a>, found: &Found<'a>) -> Result<Option<Found<'a>>, DataError> {
    let Found { rows, read, judged, energies, ridge, .. } = found;
    let n = asked.body.dof();
    let driven = properties::driven_by_friction(rows, &read.torques, energies);
    let mut tried = of_torques(rows, read, judged, *ridge);
    if driven.len() > 1 {
        tried.extend(Tried::asked(Change::TorqueReversed(driven.clone()), rows, read, judged, *ridge));
    }
    let poor: Vec<usize> = (0..n).filter(|j| judged.share(*j) > POOR).collect();
    let (few, old) =
        Few::new(asked, read, *ridge).map_or((None, None), |few| (Some(few.rows), Some(few.judged)));
    if let (Some(few), Some(old)) = (&few, &old) {
        let mut reversed: Vec<usize> = poor.iter().chain(&driven).copied().collect();
        for change in tried.iter().map(|t| &t.change) {
            if let Change::TorqueReversed(joints) = change {
                reversed.extend(joints);
            }
        }
        reversed.sort_unstable();
        reversed.dedup();
        let others = of_positions(asked, (few, old), read, (&poor, &reversed), &driven, *ridge);
        // All are compared on the same rows.
        for one in &mut tried {
            one.gain = gain(old, &judge(few, &read.with(&one.change).torques, *ridge));
        }
        for joint in &driven {
            let change = Change::TorqueReversed(vec![*joint]);
            if !tried.iter().any(|t| t.change == change) {
                let new = judge(few, &read.with(&change).torques, *ridge);
                tried.extend(not_worse(old, &new).then(|| Tried { gain: gain(old, &new), change }));
            }
        }
        tried.extend(others);
    }
    tried.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    for k in 0..tried.len() {
        let change = &tried[k].change;
        let read = read.with(change);
        let rows = asked.rows(&read.positions, read.gravity)?;
        let (ridge, new) = with_best_ridge(&rows, &read);
        let by_friction = change.reverses().is_some_and(|j| driven.contains(&j)) && not_worse(judged, &new);
        if !(is_clear(change, judged, &new) || by_friction) {
            continue;
        }
        let as_well = |t: &&Tried| {
            t.change.reverses().is_some()
                && t.change.reverses() == change.reverses()
                && t.gain > tried[k].gain - ALIKE
        };
        let rival = tried[k + 1..].iter().find(as_well).map(|t| t.change.clone());
        let mut steps = found.steps.clone();
        steps.push(Step { change: change.clone(), rival, before: shares(judged), after: shares(&new) });
        let energies = [0, 1].map(|part| Energies::new(&rows, part));
        return Ok(Some(Found {
            rows,
            read,
            judged: new,
            energies,
            plain: found.plain.clone(),
            steps,
            ridge,
        }));
    }
    Ok(None)
}

/// The held-out error by joint, a share of its torque.
pub(super) fn shares(judged: &Judged) -> Vec<f64> {
    (0..judged.left[0].len()).map(|j| judged.share(j)).collect()
}

/// Parameters are held back as hard as is best for the plain reading.
fn with_best_ridge(rows: &Rows<'_>, read: &Reading) -> (f64, Judged) {
    let of = |ridge: f64| {
        let judged = judge(rows, &read.torques, ridge);
        let left = judged.left.iter().flatten().filter(|x| x.is_finite());
        (left.map(|x| (x + FLOOR).ln()).sum::<f64>(), ridge, judged)
    };
    let first = of(RIDGES[0]);
    let best = RIDGES[1..].iter().map(|r| of(*r)).fold(first, |a, b| if b.0 < a.0 { b } else { a });
    (best.1, best.2)
}

/// A change that was tried.
struct Tried {
    change: Change,
    gain: f64,
}

impl Tried {
    /// A change that the rows at hand can judge, where it is clear.
    fn asked(change: Change, rows: &Rows<'_>, read: &Reading, old: &Judged, ridge: f64) -> Option<Tried> {
        let new = judge(rows, &read.with(&change).torques, ridge);
        is_clear(&change, old, &new).then(|| Tried { gain: gain(old, &new), change })
    }
}

/// Whether a change raises no joint's error much.
pub(super) fn not_worse(old: &Judged, new: &Judged) -> bool {
    [0, 1].iter().all(|part| ratios(old, new, *part).iter().all(|(_, r)| *r < WORSE))
}

/// Few rows of the reading so far.
struct Few<'a> {
    judged: Judged,
    rows: Rows<'a>,
}

impl<'a> Few<'a> {
    fn new(asked: &Asked<'a>, read: &Reading, ridge: f64) -> Option<Few<'a>> {
        let rows = asked.few(&read.positions, read.gravity).ok()?;
        Some(Few { judged: judge(&rows, &read.torques, ridge), rows })
    }
}

/// Everything that the rows at hand can judge.
fn of_torques(rows: &Rows<'_>, read: &Reading, old: &Judged, ridge: f64) -> Vec<Tried> {
    let moving: Vec<usize> = (0..rows.dof()).filter(|j| rows.moves(*j)).collect();
    let mut changes: Vec<Change> = moving.iter().map(|j| Change::TorqueReversed(vec![*j])).collect();
    for (k, a) in moving.iter().enumerate() {
        changes.extend(moving[..k].iter().map(|b| Change::TorquesExchanged(*b, *a)));
    }
    if !read.torques.is_scaled() {
        let joints = &rows.data.body.arm().joints;
        let ratios = filed(joints.iter().map(|j| j.rotor_ratio.as_ref().map(to_f64)));
        let constants = filed(joints.iter().map(|j| j.torque_constant));
        let free = [0, 1].into_iter().filter_map(|part| factors(rows, &read.torques, part, ridge));
        changes.extend(ratios.into_iter().chain(constants).chain(free).map(Change::Factors));
    }
    changes.extend(properties::common_delay(rows, &read.torques, ridge).map(Change::Late));
    changes.into_iter().filter_map(|change| Tried::asked(change, rows, read, old, ridge)).collect()
}

/// Everything that needs other rows: positions of joints that fit poorly or that friction seems to drive, and
/// gravity.
fn of_positions(
    asked: &Asked<'_>,
    (rows, old): (&Rows<'_>, &Judged),
    read: &Reading,
    (poor, reversed): (&[usize], &[usize]),
    driven: &[usize],
    ridge: f64,
) -> Vec<Tried> {
    let mut tried = Vec::new();
    let mut ask = |other: &Rows<'_>, changes: Vec<Change>| {
        for change in changes {
            let new = judge(other, &read.with(&change).torques, ridge);
            let by_friction = change.reverses().is_some_and(|j| driven.contains(&j)) && not_worse(old, &new);
            if is_clear(&change, old, &new) || by_friction {
                tried.push(Tried { gain: gain(old, &new), change });
            }
        }
    };
    if read.gravity == Gravity::Included
        && asked.body.gravity().iter().any(|g| *g != 0.0)
        && let Ok(other) = asked.few(&read.positions, Gravity::TakenOut)
    {
        let new = judge(&other, &read.torques, ridge);
        let joints = properties::acts_on(&other, &new.fits[0].theta, &new.power);
        ask(&other, vec![Change::GravityOut(joints)]);
    }
    let of = |positions: &Positions| asked.few(positions, read.gravity).ok();
    for a in (0..asked.body.dof()).filter(|j| rows.moves(*j)) {
        if reversed.contains(&a)
            && let Some(other) = of(&read.positions.reversed(a))
        {
            ask(&other, vec![Change::PositionReversed(a), Change::AxisReversed(a)]);
        }
        for b in (0..a).filter(|b| poor.contains(&a) && poor.contains(b)) {
            if let Some(other) = of(&read.positions.exchanged(a, b)) {
                ask(&other, vec![Change::PositionsExchanged(b, a), Change::JointsExchanged(b, a)]);
            }
        }
    }
    if !poor.is_empty()
        && read.positions.scale == 1.0
        && let Some(other) = of(&read.with(&Change::Degrees).positions)
    {
        ask(&other, vec![Change::Degrees]);
    }
    // Of two joints it is an exchange.
    if asked.body.dof() > 2
        && let Some(other) = of(&read.with(&Change::FromTip).positions)
    {
        ask(&other, vec![Change::FromTip]);
    }
    tried
}

/// Whether torques hold gravity: determined where the other reading fits clearly worse.
pub(super) fn gravity_is(asked: &Asked<'_>, found: &Found<'_>) -> Option<GravityIs> {
    if found.read.gravity == Gravity::TakenOut || asked.body.gravity().iter().all(|g| *g == 0.0) {
        return Some(GravityIs::TakenOut);
    }
    let (with, without) = with_and_without_gravity(asked, found)?;
    let worse = |part: usize| ratios(&with, &without, part).iter().any(|(_, r)| *r > 1.0 / CLEAR);
    (worse(0) && worse(1) && gain(&without, &with) > 0.0).then_some(GravityIs::Included)
}

/// Whether torques with hardly any weight contain gravity: this is determined if the fit without gravity's
/// columns is worse, as the mean over joints, both ways round; or not worse, both ways round. Between these
/// cases a balanced arm may carry a body in one part of the logs.
pub(super) fn little_gravity_is(asked: &Asked<'_>, found: &Found<'_>) -> Option<GravityIs> {
    let Some((with, without)) = with_and_without_gravity(asked, found) else {
        return Some(GravityIs::TakenOut);
    };
    match falls(&with, &without).map(f64::exp) {
        [a, b] if a > HELPS && b > HELPS => Some(GravityIs::Included),
        [a, b] if a < NO_WORSE && b < NO_WORSE => Some(GravityIs::TakenOut),
        _ => None,
    }
}

fn with_and_without_gravity(asked: &Asked<'_>, found: &Found<'_>) -> Option<(Judged, Judged)> {
    let few = |gravity: Gravity| asked.few(&found.read.positions, gravity).ok();
    let of = |gravity: Gravity| Some(judge(&few(gravity)?, &found.read.torques, found.ridge));
    Some((of(Gravity::Included)?, of(Gravity::TakenOut)?))
}
