//! How often `compare` calls equal arms different, and how often it sees what changed, on simulated pairs.

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
use rand_chacha::ChaCha8Rng;

/// How much is simulated.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Pairs of each kind
    #[arg(long, default_value_t = 100)]
    pairs: u64,
    /// Logs of 20 s a fit
    #[arg(long, default_value_t = 3)]
    logs: u64,
    /// In which share of comparisons equal arms may be called different
    #[arg(long, default_value_t = 0.01)]
    level: f64,
    /// Instead, fits of equal arms, each compared with every other one
    #[arg(long, value_name = "FITS")]
    equal: Option<u64>,
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
            parameters: found.parameters,
            friction: found.friction,
            uncertainty: Some(Uncertainty::of(self.body.names(), &solution, &errors)),
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

/// Prints how often each kind of pair was called different, and how often with the right cause alone.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = lwa4p::arm().map_err(|e| e.to_string())?;
    let bench = Bench { body: RigidArm::new(&arm).map_err(|e| e.to_string())?, logs: arguments.logs };
    let options = CompareOptions { level: arguments.level };
    let same = || viscous(0, 1.0);
    if let Some(fits) = arguments.equal {
        let fitted = (0..fits).map(|seed| bench.fitted(lwa4p::links(), same(), 100 * seed));
        return equal(&fitted.collect::<Result<Vec<_>, _>>()?, &options);
    }
    let mut rows = vec![("equal arms".to_string(), 0, 0)];
    rows.extend((1..=6).map(|joint| (format!("5 % more viscous friction on joint {joint}"), 0, 0)));
    rows.push(("a payload of 0.5 kg".to_string(), 0, 0));
    for pair in 0..arguments.pairs {
        let seed = 100 * pair;
        let a = bench.fitted(lwa4p::links(), same(), seed)?;
        for (kind, (_, differ, named)) in rows.iter_mut().enumerate() {
            let own = seed + 1 + kind as u64;
            let b = match kind {
                0 => bench.fitted(lwa4p::links(), same(), own),
                7 => bench.fitted(loaded(0.5), same(), own),
                joint => bench.fitted(lwa4p::links(), viscous(joint - 1, 1.05), own),
            }?;
            let compared = compare(&a, &b, &options).map_err(|e| e.to_string())?;
            let right = match (kind, compared.causes.as_slice()) {
                (0, []) => true,
                (7, [Cause::Payload { .. }]) => true,
                (own, [Cause::Friction { joint, .. }]) => own == *joint,
                _ => false,
            };
            *differ += u64::from(compared.differ);
            *named += u64::from(right);
            if !right {
                eprintln!("pair {pair}, {kind}: {}", compared.sentence);
            }
        }
    }
    println!("pairs of fits to {} logs of 20 s, level {} %", arguments.logs, 100.0 * arguments.level);
    for (kind, differ, named) in rows {
        println!("{kind}: different {differ} of {}, the right sentence {named}", arguments.pairs);
    }
    Ok(())
}

/// Every fit against every other: how often equal arms are called different. Pairs of one fit depend on each other, so
/// the fits that take part in a false alarm are counted too; the rate is that of independent pairs on average.
fn equal(fits: &[Side], options: &CompareOptions) -> Result<(), String> {
    let (mut pairs, mut differ) = (0u64, vec![0u64; fits.len()]);
    for (a, left) in fits.iter().enumerate() {
        for (b, right) in fits.iter().enumerate().skip(a + 1) {
            let compared = compare(left, right, options).map_err(|e| e.to_string())?;
            pairs += 1;
            if compared.differ {
                differ[a] += 1;
                differ[b] += 1;
                eprintln!("{} and {}: {}", left.name, right.name, compared.sentence);
            }
        }
    }
    let different: u64 = differ.iter().sum::<u64>() / 2;
    let alarmed = differ.iter().filter(|count| **count > 0).count();
    println!(
        "equal arms: different {different} of {pairs} pairs of {} fits ({:.2} %), {alarmed} fits among them",
        fits.len(),
        100.0 * different as f64 / pairs.max(1) as f64
    );
    Ok(())
}
