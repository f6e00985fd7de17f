//! Effects that a draw puts into one of two measured logs, and pairs of logs in which nothing is.

use super::Logs;
use chacha20::ChaCha8Rng;
use dyngen::arm::ParameterKind;
use powerball::logs::log::Log;
use powerball::logs::regression::{Recording, RigidArm};
use rand::{RngExt, SeedableRng};
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

/// Logs in which nothing was put, two of which are asked.
const CLEAN: [(&str, &[&str]); 4] = [
    ("ur10e", &["fourier_12a", "fourier_7", "fourier_8", "fourier_5", "fourier_14"]),
    ("ur5_pushes", &["no6", "no7", "no8", "no9"]),
    ("psm_masses", &["clean", "other"]),
    ("tx40", &["fit", "validate"]),
];

/// What is put into a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Mass,
    Push,
    Friction,
    Zero,
    Delay,
}

const KINDS: [Kind; 5] = [Kind::Mass, Kind::Push, Kind::Friction, Kind::Zero, Kind::Delay];

impl Kind {
    /// What it is called in results.
    fn name(self) -> &'static str {
        match self {
            Kind::Mass => "payload",
            Kind::Push => "contact_wrench",
            Kind::Friction => "temperature",
            Kind::Zero => "asymmetry",
            Kind::Delay => "time_delay",
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Kind::Mass => "a mass on any link",
            Kind::Push => "a push of 0.6 to 1.5 s",
            Kind::Friction => "friction of one joint, 15 to 40 % of its torque's deviation",
            Kind::Zero => "a zero of one joint's torque, 10 to 40 % of its deviation",
            Kind::Delay => "torques that are 15 to 40 ms late",
        }
    }
}

/// Counts of one kind of effect.
#[derive(Clone, Copy, Default)]
struct Score {
    asked: u32,
    named: u32,
    /// With another name in the table of logs.
    false_names: u32,
}

pub(super) fn write(page: &mut String, data: &Path, draws: u64, pairs: u64) -> Result<(), String> {
    let mut scores = [Score::default(); KINDS.len()];
    for draw in 0..draws {
        let mut rng = ChaCha8Rng::seed_from_u64(draw);
        let which = draw as usize % KINDS.len();
        let (folder, names) = CLEAN[rng.random_range(0..CLEAN.len())];
        let [a, b] = two(&mut rng, names.len());
        let mut logs = Logs::read(data, folder, &[names[a], names[b]])?;
        let body = logs.body()?;
        let place = rng.random_range(0..2);
        put_in(&mut rng, KINDS[which], &body, &mut logs.logs[place])?;
        let explained = logs.explained(1)?;
        let score = &mut scores[which];
        score.asked += 1;
        let here =
            explained.logs.iter().flat_map(|log| log.differs.iter().map(move |d| (&log.log, &d.effect)));
        // Of two logs a change of friction, say, may be in either; a body and a push are in one.
        let event = matches!(KINDS[which], Kind::Mass | Kind::Push);
        let right = |(log, effect): &(&String, &String)| {
            *effect == KINDS[which].name() && (!event || **log == logs.logs[place].file)
        };
        let (right, wrong): (Vec<_>, Vec<_>) = here.partition(right);
        score.named += u32::from(!right.is_empty());
        score.false_names += u32::from(!wrong.is_empty());
        eprintln!(
            "draw {draw} {:?} {folder} in {}: {right:?}, else {wrong:?}",
            KINDS[which], logs.logs[place].file
        );
    }
    page.push_str(
        "\n## What a draw put in\n\n\
        Of two clean logs one is fitted and the other one judges; into one of them a seeded draw puts \
        something. Named: the log's entry says it. Else: an entry says something else as well or instead.\n\n\
        | put in | asked | named | else |\n|---|---|---|---|\n",
    );
    for (kind, score) in KINDS.iter().zip(&scores) {
        let Score { asked, named, false_names } = score;
        let _ =
            writeln!(page, "| {} (`{}`) | {asked} | {named} | {false_names} |", kind.in_words(), kind.name());
    }
    let mut different = Vec::new();
    for pair in 0..pairs {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + pair);
        let (folder, names) = CLEAN[pair as usize % CLEAN.len()];
        let name = names[rng.random_range(0..names.len())];
        let mut logs = Logs::read(data, folder, &[name])?;
        logs.logs = logs.logs[0].halves().into();
        let explained = logs.explained(1)?;
        let odd = explained.logs.iter().filter(|log| !log.like_the_others);
        different.extend(odd.map(|log| log.sentence()));
        eprintln!("pair {pair} {folder} {name}: {} differ so far", different.len());
    }
    let _ = writeln!(
        page,
        "\n## Clean pairs\n\n\
        The first half of a clean log against its second one, {pairs} pairs: {} logs are reported to differ.",
        different.len()
    );
    for sentence in different {
        let _ = writeln!(page, "\n* {sentence}");
    }
    Ok(())
}

fn two(rng: &mut ChaCha8Rng, count: usize) -> [usize; 2] {
    let a = rng.random_range(0..count);
    [a, (a + rng.random_range(1..count)) % count]
}

fn deviation(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// Adds what is drawn to the torques of a log.
fn put_in(rng: &mut ChaCha8Rng, kind: Kind, body: &RigidArm, log: &mut Log) -> Result<(), String> {
    let n = log.q.len();
    let (joint, sign) = (rng.random_range(0..n), if rng.random_bool(0.5) { 1.0 } else { -1.0 });
    let size = deviation(&log.torque[joint]);
    let more: Vec<Vec<f64>> = match kind {
        Kind::Zero => {
            let by = sign * size * rng.random_range(0.1..0.4);
            (0..n).map(|j| vec![if j == joint { by } else { 0.0 }; log.t.len()]).collect()
        }
        Kind::Delay => {
            let by = rng.random_range(0.015..0.04);
            let late = |torque: &Vec<f64>| {
                let at = |k: usize| torque[log.t.partition_point(|t| *t < log.t[k] - by).min(k)] - torque[k];
                (0..torque.len()).map(at).collect()
            };
            log.torque.iter().map(late).collect()
        }
        Kind::Friction => {
            let [level, viscous] = [0.8, 0.2].map(|share| share * size * rng.random_range(0.15..0.4));
            along(log, n, |r| {
                let top = r.velocity(joint).fold(0.0, |top: f64, v| top.max(v.abs()));
                let of = |v: f64| level * (30.0 * v / top).tanh() + viscous * v / top;
                (0..n)
                    .map(|j| r.velocity(j).map(|v| if j == joint { of(v) } else { 0.0 }).collect())
                    .collect()
            })?
        }
        Kind::Mass => {
            let link = rng.random_range(n.min(2) - 1..n);
            let first = 11 * link;
            let [x, y, z] = [(); 3].map(|()| rng.random_range(-0.1..0.1));
            // A point mass: mass, first moments and inertias about the link's frame.
            let [xx, xy, xz, yy, yz, zz] =
                [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y];
            let point = [1.0, x, y, z, xx, xy, xz, yy, yz, zz];
            let chosen: Vec<usize> = (first..first + point.len()).collect();
            let unit = along(log, n, |r| {
                let columns = body.parameter_columns(&chosen, &r.q, &r.v, &r.a).unwrap_or_default();
                let torque = |k: usize| {
                    columns[k * point.len()..][..point.len()].iter().zip(point).map(|(c, p)| c * p).sum()
                };
                (0..n).map(|j| (0..r.len()).map(|k| torque(k * n + j)).collect()).collect()
            })?;
            scaled(unit, &log.torque, rng.random_range(0.3..0.8))
        }
        Kind::Push => {
            let lasts = rng.random_range(0.6..1.5);
            let (from, to) = (log.t[0] + 2.0, log.t[log.t.len() - 1] - 2.0 - lasts);
            let begins = rng.random_range(from..to.max(from + 0.1));
            let direction = [(); 3].map(|()| rng.random_range(-1.0..1.0));
            let mass = [body.last_link(ParameterKind::M)];
            let unit = along(log, n, |r| {
                let mut torque = vec![vec![0.0; r.len()]; n];
                for (axis, share) in direction.iter().enumerate() {
                    let lever = body.gravity_columns(axis, &mass, &r.q).unwrap_or_default();
                    for (k, l) in lever.iter().enumerate() {
                        let t = (r.start + (k / n) as f64 / r.rate - begins) / lasts;
                        let wave = if (0.0..1.0).contains(&t) { (PI * t).sin() } else { 0.0 };
                        torque[k % n][k / n] += share * wave * l;
                    }
                }
                torque
            })?;
            let largest = rng.random_range(0.8..2.0);
            let ratio = |(own, torque): (&Vec<f64>, &Vec<f64>)| {
                own.iter().fold(0.0, |top: f64, v| top.max(v.abs())) / deviation(torque).max(1e-9)
            };
            let top = unit.iter().zip(&log.torque).map(ratio).fold(1e-9, f64::max);
            unit.into_iter().map(|own| own.into_iter().map(|v| v * largest / top).collect()).collect()
        }
    };
    for (torque, more) in log.torque.iter_mut().zip(more) {
        torque.iter_mut().zip(more).for_each(|(torque, more)| *torque += more);
    }
    Ok(())
}

/// A multiple of `unit` whose largest deviation is this share of the joint's own.
fn scaled(unit: Vec<Vec<f64>>, torque: &[Vec<f64>], share: f64) -> Vec<Vec<f64>> {
    let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let ratios = unit.iter().zip(torque).map(|(own, torque)| rms(own) / deviation(torque).max(1e-9));
    let most = ratios.fold(1e-9, f64::max);
    unit.into_iter().map(|own| own.into_iter().map(|v| v * share / most).collect()).collect()
}

/// A torque along the smoothed motion of a log, by joint, at the log's own times.
fn along(log: &Log, n: usize, of: impl Fn(&Recording) -> Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, String> {
    let step = (log.t[log.t.len() - 1] - log.t[0]) / (log.t.len() - 1) as f64;
    let mut torque = vec![vec![0.0; log.t.len()]; n];
    for piece in &log.pieces {
        let recording = Recording::new(log, 0, piece.clone(), step, 24.0)
            .ok_or_else(|| format!("{}: a piece is too short", log.file))?;
        let own = of(&recording);
        for k in piece.clone() {
            let at = ((log.t[k] - recording.start) / step).max(0.0);
            let low = (at as usize).min(recording.len() - 1);
            let high = (low + 1).min(recording.len() - 1);
            for j in 0..n {
                torque[j][k] = own[j][low] + (at - low as f64) * (own[j][high] - own[j][low]);
            }
        }
    }
    Ok(torque)
}
