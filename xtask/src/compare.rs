//! How often `compare` calls equal arms different, and how often it sees what changed, on simulated pairs.

use chacha20::ChaCha8Rng;
use powerball::comparison::{Cause, CompareOptions, Side, compare};
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::identification::estimate::{
    FrictionKind, Uncertainty, estimates, reduce_in_bands, solve_in_band, standard_errors,
};
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::logs::regression::{DataOptions, RigidArm};
use powerball::logs::summary::Bands;
use powerball::virtual_arm::{Body, Dynamics, Plant, lwa4p};
use rand::{RngExt, SeedableRng};

/// How much is simulated.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Fits of each kind of arm; each fit is compared with every fit of the unchanged arm
    #[arg(long, default_value_t = 20)]
    fits: u64,
    /// Logs of 20 s a fit
    #[arg(long, default_value_t = 3)]
    logs: u64,
    /// In which share of comparisons equal arms may be called different
    #[arg(long, default_value_t = 0.01)]
    level: f64,
    /// Draws paths and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The unchanged arm alone
    #[arg(long)]
    equal: bool,
}

/// The virtual arm, recorded and fitted.
struct Bench {
    body: RigidArm,
    logs: u64,
}

impl Bench {
    fn fitted(&self, links: Vec<Body>, friction: Vec<TanhFriction<f64>>, seed: u64) -> Result<Side, String> {
        let chain = Chain::new(&lwa4p::arm().map_err(|e| e.to_string())?);
        let sensors = lwa4p::plant().map_err(|e| e.to_string())?.sensors().clone();
        let dynamics = Dynamics::new(chain, links).ok_or("the virtual arm needs a body for each joint")?;
        let plant = Plant::new(dynamics, friction, sensors);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let options = DataOptions::default();
        let mut bands = Bands::new(&self.body, &options);
        for log in 0..self.logs {
            let mut draw = || (0..5).map(|_| 0.25 * rng.random_range(-1.0..1.0)).collect();
            let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
            let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods: 2, ramp: 1.0, joints };
            let recording = plant.record(&path.sample(plant.sensors().rate), 0.0, 1000 * seed + log);
            let (one, _) = reduce_in_bands(&self.body, &recording.log("virtual"), &options)
                .map_err(|e| e.to_string())?;
            bands.merge(&one).map_err(|e| e.to_string())?;
        }
        let solution = solve_in_band(&bands, FrictionKind::Symmetric).solution;
        let errors = standard_errors(&solution);
        let found = estimates(self.body.names(), &solution, &errors);
        Ok(Side {
            name: format!("seed {seed}"),
            arm: "virtual".into(),
            bars: Vec::new(),
            parameters: found.parameters,
            friction: found.friction,
            uncertainty: Some(Uncertainty::of(self.body.names(), &solution, &errors)),
            strokes: Vec::new(),
            unusable: Vec::new(),
        })
    }
}

/// Table 2 with the viscous part of a joint `factor` times as large.
fn viscous(joint: usize, factor: f64) -> Vec<TanhFriction<f64>> {
    let mut table = TABLE_2;
    table[joint][4] *= factor;
    table.map(TanhFriction::new).to_vec()
}

/// The last link with a payload.
fn loaded(mass: f64) -> Vec<Body> {
    let mut links = lwa4p::links();
    if let Some(last) = links.last_mut() {
        let load = Body::even_box(mass, [0.02, 0.0, 0.1], [0.05; 3], 0.0);
        (last.mass, last.moment, last.inertia) =
            (last.mass + load.mass, last.moment + load.moment, last.inertia + load.inertia);
    }
    links
}

/// What is different about an arm.
#[derive(Clone, Copy, PartialEq)]
enum Change {
    Nothing,
    /// 5 % more viscous friction on a joint, from 1.
    Viscous(usize),
    /// 0.5 kg on the last link.
    Payload,
}

impl Change {
    fn says(self) -> String {
        match self {
            Change::Nothing => "equal arms".into(),
            Change::Viscous(joint) => format!("5 % more viscous friction on joint {joint}"),
            Change::Payload => "a payload of 0.5 kg".into(),
        }
    }

    /// Whether these causes are this change and no other.
    fn is(self, causes: &[Cause]) -> bool {
        match (self, causes) {
            (Change::Nothing, []) | (Change::Payload, [Cause::Payload { .. }]) => true,
            (Change::Viscous(own), [Cause::Friction { joint, .. }]) => own == *joint,
            _ => false,
        }
    }
}

/// Prints how often each kind of pair was called different, and how often with the right cause alone.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = lwa4p::arm().map_err(|e| e.to_string())?;
    let bench = Bench { body: RigidArm::new(&arm).map_err(|e| e.to_string())?, logs: arguments.logs };
    let options = CompareOptions { level: arguments.level };
    let mut changes = vec![Change::Nothing];
    if !arguments.equal {
        changes.extend((1..=6).map(Change::Viscous));
        changes.push(Change::Payload);
    }
    println!("fits of {} logs of 20 s, level {} %", arguments.logs, 100.0 * arguments.level);
    let mut equal: Vec<Side> = Vec::new();
    for (kind, change) in changes.into_iter().enumerate() {
        let (links, friction) = match change {
            Change::Nothing => (lwa4p::links(), viscous(0, 1.0)),
            Change::Viscous(joint) => (lwa4p::links(), viscous(joint - 1, 1.05)),
            Change::Payload => (loaded(0.5), viscous(0, 1.0)),
        };
        let seeds = (0..arguments.fits).map(|fit| (1000 * arguments.seed + kind as u64) * 1000 + fit);
        let fits: Vec<Side> = seeds
            .map(|seed| bench.fitted(links.clone(), friction.clone(), seed))
            .collect::<Result<_, _>>()?;
        if change == Change::Nothing {
            equal.clone_from(&fits);
        }
        // Whether each pair differs; none of a fit with itself.
        let mut differ: Vec<Vec<Option<bool>>> = vec![vec![None; fits.len()]; equal.len()];
        let mut right = 0;
        let (mut numbers, mut missed) = (0, 0);
        for (i, a) in equal.iter().enumerate() {
            for (k, b) in fits.iter().enumerate().filter(|(k, _)| change != Change::Nothing || *k > i) {
                let compared = compare(a, b, &options).map_err(|e| e.to_string())?;
                differ[i][k] = Some(compared.differ);
                numbers += compared.parameters.len();
                missed += compared.parameters.iter().filter(|p| p.p_value < 0.05).count();
                if change.is(&compared.causes) {
                    right += 1;
                } else {
                    eprintln!("{}: {}, {}: {}", change.says(), a.name, b.name, compared.sentence);
                }
            }
        }
        let (pairs, different, error) = share(&differ);
        println!(
            "{}: different {different} of {pairs} pairs ({:.2} %, standard error {:.2} %), the right \
            sentence {right}",
            change.says(),
            100.0 * different as f64 / pairs as f64,
            100.0 * error
        );
        if change == Change::Nothing {
            let share = 100.0 * missed as f64 / numbers as f64;
            println!(
                "  of the parameters one by one {share:.1} % differ at 5 %: right standard errors make it 5"
            );
        }
    }
    Ok(())
}

/// Pairs, those that differ, and the standard error of their share: pairs of one fit depend on each other, so
/// what varies is the share of each fit.
fn share(differ: &[Vec<Option<bool>>]) -> (usize, usize, f64) {
    let all: Vec<bool> = differ.iter().flatten().copied().flatten().collect();
    let (pairs, different) = (all.len().max(1), all.iter().filter(|d| **d).count());
    let mean = different as f64 / pairs as f64;
    let count = differ.first().map_or(0, Vec::len);
    let same = differ.len() == count && (0..count).all(|i| differ[i][i].is_none());
    let variance = |of: &dyn Fn(usize) -> Vec<bool>, count: usize| {
        let shares: Vec<f64> = (0..count)
            .map(of)
            .filter(|d| !d.is_empty())
            .map(|d| d.iter().filter(|d| **d).count() as f64 / d.len() as f64)
            .collect();
        let n = shares.len().max(2) as f64;
        shares.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))
    };
    let row = |i: usize| differ[i].iter().copied().flatten().collect::<Vec<_>>();
    let column = |k: usize| differ.iter().filter_map(|row| row[k]).collect::<Vec<_>>();
    let error = if same {
        // Every fit is on both sides.
        let both = |i: usize| [row(i), column(i)].concat();
        4.0 * variance(&both, count)
    } else {
        variance(&row, differ.len()) + variance(&column, count)
    };
    (pairs, different, error.sqrt())
}
