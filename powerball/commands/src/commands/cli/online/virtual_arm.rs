//! `powerball virtual-arm`: the virtual arm on a bus with others.

use super::Failure;
use super::output;
use chacha20::ChaCha8Rng;
use clap::Args;
use powerball_bus::transport::{self, BusUrl};
use powerball_virtual_arm::slave::Setup;
use powerball_virtual_arm::{PlantEffect, Undeclared, VirtualArm, lwa4p, slave};
use rand::SeedableRng;
use serde_json::json;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Put the virtual LWA 4P on a bus in real time: six CiA 402 drives, nodes 3 to 8, with the arm's dynamics
/// behind them.
///
/// Runs until Ctrl-C, or as long as `--for` says. The arm starts at rest with closed brakes.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball virtual-arm --bus udp:239.74.163.2:43113\n  \
    powerball virtual-arm --bus slcan:/dev/pts/7 --for 60\n\nFrom another terminal:\n  \
    powerball bus scan --bus udp:239.74.163.2:43113")]
pub(crate) struct VirtualArmCommand {
    /// The bus: socketcan:can0, slcan:/dev/ttyACM0 or udp:239.74.163.2:43113.
    #[arg(long, value_name = "URL")]
    bus: BusUrl,
    /// Leaves the bus after this many seconds.
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Joint positions at the start, rad, six of them with commas between.
    #[arg(long, value_name = "Q1,…", value_delimiter = ',', allow_negative_numbers = true)]
    start: Option<Vec<f64>>,
    /// The motors know their commutation already, as after a restart without loss of motor power.
    #[arg(long)]
    commutated: bool,
    /// The drives have the current mode that the bus profile knows, for `powerball follow` and `float`.
    #[arg(long)]
    current_mode: bool,
    /// An effect that no model knows about, by name; see `powerball demo`.
    #[arg(long, value_name = "NAME")]
    effect: Option<String>,
    /// The effect as a file: virtual_arm.json, as `powerball demo` writes it next to its logs.
    #[arg(long, value_name = "FILE", conflicts_with = "effect")]
    plant: Option<PathBuf>,
    /// Draws the effect's size and the sensors' noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print what was done as one JSON object on standard output, at the end.
    #[arg(long)]
    json: bool,
}

impl VirtualArmCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if self.bus == BusUrl::Virtual {
            return Err(Failure::Unusable(
                "--bus virtual exists within one program: other programs would not see the arm. Use \
                    udp:239.74.163.2:43113"
                    .to_string(),
            ));
        }
        if self.seconds.is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
            return Err(Failure::Unusable("--for needs a number of seconds".to_string()));
        }
        let mut arm = self.arm()?;
        let mut bus = transport::open(&self.bus).map_err(|e| Failure::Unusable(e.to_string()))?;
        let nodes: Vec<u8> = arm.nodes().iter().map(|node| node.id().raw()).collect();
        output::notice(&format!("powerball: the virtual arm is on {}, nodes {nodes:?}", self.bus));
        let started = Instant::now();
        let length = self.seconds.map(Duration::from_secs_f64);
        let stop = || length.is_some_and(|length| started.elapsed() >= length);
        let behind = slave::serve(&mut arm, &mut bus, stop).map_err(|e| Failure::Refused(e.to_string()))?;
        if behind > 0 {
            let seconds = behind as f64 * 1e-6;
            tracing::warn!("this machine was too slow at times: the arm is {seconds:.3} s behind");
        }
        if self.json {
            let result = json!({
                "bus": self.bus.to_string(), "nodes": nodes, "seconds": started.elapsed().as_secs_f64(),
                "position": arm.simulation().links(),
            });
            output::data(&result.to_string());
        }
        Ok(())
    }

    fn arm(&self) -> Result<VirtualArm, Failure> {
        let mut start = [0.0; 6];
        if let Some(given) = &self.start {
            if given.len() != start.len() || given.iter().any(|q| !q.is_finite()) {
                return Err(Failure::Unusable("--start needs six positions in rad".to_string()));
            }
            start.copy_from_slice(given);
        }
        let mut setup = match &self.plant {
            Some(file) => Undeclared::read(file)
                .map_err(Failure::Unusable)?
                .setup(start, self.seed)
                .map_err(|e| Failure::Refused(e.to_string()))?,
            None => setup(start, self.seed, self.effect.as_deref())?,
        };
        if self.current_mode {
            setup = lwa4p::with_current_mode(setup);
        }
        built(setup, self.commutated)
    }
}

/// The built-in arm with an effect by name.
pub(crate) fn virtual_arm(
    start: [f64; 6],
    seed: u64,
    effect: Option<&str>,
    commutated: bool,
) -> Result<VirtualArm, Failure> {
    built(setup(start, seed, effect)?, commutated)
}

fn broken(what: impl std::fmt::Display) -> Failure {
    Failure::Refused(format!("the built-in arm: {what}"))
}

/// An arm of its parts; where `commutated` the motors know their commutation already.
pub(crate) fn built(mut setup: Setup, commutated: bool) -> Result<VirtualArm, Failure> {
    setup.modules.iter_mut().for_each(|module| module.commutated = commutated);
    VirtualArm::new(setup).ok_or_else(|| broken("its parts do not fit"))
}

/// The parts of the built-in arm with an effect by name.
pub(crate) fn setup(start: [f64; 6], seed: u64, effect: Option<&str>) -> Result<Setup, Failure> {
    let mut setup = lwa4p::setup(start, seed).map_err(broken)?;
    if let Some(name) = effect {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let effect = lwa4p::draw_effect(name, &setup.plant, 100.0, 1.0..2.0, &mut rng).ok_or_else(|| {
            Failure::Unusable(format!(
                "no effect is called {name}; there are {}",
                PlantEffect::NAMES.join(", ")
            ))
        })?;
        setup.plant = setup.plant.with(effect);
    }
    Ok(setup)
}
