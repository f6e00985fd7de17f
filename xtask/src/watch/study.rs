//! The virtual arm, in the middle of whose run something changes.

use super::draw::{Changed, KINDS, changed};
use super::{Arguments, events, explained, noise};
use chacha20::ChaCha8Rng;
use dyngen::{Model, SetKind};
use powerball::controller::change::Whitener;
use powerball::explanation::torque_model::{Rows, TorqueModel};
use powerball::explanation::watch::WatchOptions;
use powerball::identification::excite::{ExcitationSettings, optimise};
use powerball::identification::motion::Motion;
use powerball::logs::log::Log;
use powerball::logs::regression::{DataOptions, Recording, RigidArm};
use powerball::virtual_arm::lwa4p;
use rand::SeedableRng;
use std::collections::BTreeMap;

const RATE: f64 = 200.0;
/// A change is to be seen within this, s.
const SOON: f64 = 2.0;

/// What became of the changes of one kind.
#[derive(Default)]
struct Tally {
    draws: usize,
    /// Seen within [`SOON`]: by one who knows the change and when it begins, and by the watch.
    possible: usize,
    soon: usize,
    seen: usize,
    right: usize,
    /// Events before the change.
    early: usize,
    delays: Vec<f64>,
}

/// Prints how soon changes are seen, and false alarms in noise.
pub(super) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = lwa4p::arm().map_err(|e| e.to_string())?;
    let plant = lwa4p::plant().map_err(|e| e.to_string())?;
    let derived = Model::derive(arm.clone()).map_err(|e| e.to_string())?;
    let motion = |k: u64| -> Result<Motion, String> {
        let settings = ExcitationSettings {
            evaluations: 200,
            seed: 97 * arguments.seed + k,
            ..ExcitationSettings::default()
        };
        let found = optimise(&derived, SetKind::Minimal, &settings).map_err(|e| e.to_string())?;
        Ok(found.paths[0].sample(RATE))
    };
    let motions: Vec<Motion> = (0..8).map(motion).collect::<Result<_, _>>()?;
    let recorded: Vec<Log> =
        (0..5).map(|k| plant.record(&motions[k], 0.0, k as u64).log(format!("{k}"))).collect();
    let (body, model) = explained(&arm, &recorded[..3], &recorded[3..])?;
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.seed);
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    for kind in KINDS {
        for draw in 0..arguments.draws {
            let motion = &motions[5 + draw % 3];
            let change = changed(&plant, motion, kind, arguments.size, &mut rng);
            count(tallies.entry(kind).or_default(), kind, &change, &body, &model);
        }
    }
    println!(
        "draws; within {SOON} s for one who knows the change; within {SOON} s; seen; named right; events \
        before"
    );
    for (kind, tally) in &mut tallies {
        let Tally { draws, possible, soon, seen, right, early, delays } = tally;
        delays.sort_by(f64::total_cmp);
        let median = delays.get(delays.len() / 2).unwrap_or(&f64::NAN);
        println!(
            "{kind}: {draws}; {possible}; {soon}; {seen}; {right}; {early}; median of those seen {median:.2} \
            s"
        );
    }
    noise::run(arguments, &body, &model, &recorded[3]);
    Ok(())
}

/// Watches one change.
fn count(tally: &mut Tally, kind: &str, change: &Changed, body: &RigidArm, model: &TorqueModel) {
    let options = WatchOptions::default();
    let Changed { log, at, joint, .. } = change;
    tally.draws += 1;
    tally.possible +=
        usize::from(oracle(change, body, model, options.level(RATE)).is_some_and(|t| t <= SOON));
    let found = events(body, model, &options, log);
    tally.early += found.iter().filter(|e| e.time < *at).count();
    let mut after = found.iter().filter(|e| e.time >= *at);
    let Some(event) = after.next() else {
        println!("  {kind} on {joint} at {at:.2}: not seen");
        return;
    };
    let delay = event.time - at;
    tally.delays.push(delay);
    tally.seen += 1;
    tally.soon += usize::from(delay <= SOON);
    tally.right += usize::from(event.what == kind);
    if event.what != kind {
        let (rivals, left) = (&event.evidence.rivals, event.evidence.left);
        println!(
            "  {kind} on {joint} at {at:.2}: {} rivals {rivals:?} left {left:.2}",
            event.sentence(body.arm())
        );
    }
    after.for_each(|more| println!("  {kind} on {joint} at {at:.2}: then {}", more.sentence(body.arm())));
}

/// How long it takes one who knows the change, when it begins and that the noise is normal: the likelihood
/// ratio of the innovations with the change and without exceeds the level. No test with the same rate of
/// false alarms is sooner on average.
fn oracle(change: &Changed, body: &RigidArm, model: &TorqueModel, level: f64) -> Option<f64> {
    let colour = model.colour.as_ref()?;
    let rows = |log: &Log| {
        let smoothing = DataOptions::default().smoothing;
        let recording = Recording::new(log, 0, 0..log.t.len(), 1.0 / colour.rate, smoothing)?;
        Some(Rows::new(model, body, &recording, &model.torque(body, &recording, &|_| false)))
    };
    let (with, without) = (rows(&change.log)?, rows(&change.clean)?);
    let mut seen = vec![[Whitener::<f64>::default(); 2]; colour.joints.len()];
    let mut ratio = 0.0;
    for k in 0..with.t.len() {
        for ((j, own), (a, b)) in colour.joints.iter().enumerate().zip(with.row(k).zip(without.row(k))) {
            let (Some(own), Some(a), Some(b)) = (own, a, b) else {
                seen[j].iter_mut().for_each(Whitener::interrupt);
                continue;
            };
            let [residual, clean] = &mut seen[j];
            let own = own.for_test();
            let both = (residual.update(&own, a.residual), clean.update(&own, b.residual));
            let (Some(z), Some(noise)) = both else { continue };
            ratio += (z - noise) * (z - 0.5 * (z - noise));
        }
        if ratio > level.ln() {
            // Rows end before samples do, as those of a watch.
            let ahead = change.log.t.last()? - with.t.last()?;
            return Some(with.t[k] - change.at + ahead);
        }
    }
    None
}
