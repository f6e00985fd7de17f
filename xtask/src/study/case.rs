//! The cases of a study: what is in the plant, how large, under what noise.

use super::alike::PAIRS;
use super::law::Outside;
use super::measured::{SOURCES, UR10E};
use chacha20::ChaCha8Rng;
use clap::ValueEnum;
use powerball::virtual_arm::PlantEffect as Effect;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::ops::Range;

/// The tables of a study; a new one stands last, since its place is in the seeds of its cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Table {
    /// One effect of size 0.3 to 1.5
    Single,
    /// One effect of size 0.15 to 0.3
    Small,
    /// Two effects, each of size 0.3 to 1.5
    Pairs,
    /// One effect where friction follows other laws than Eq. 16
    Friction,
    /// One effect in addition to a smooth misfit of 0.3 σ on all joints
    Misfit,
    /// No effect, white noise
    Clean,
    /// No effect, coloured noise
    Coloured,
    /// One effect in coloured noise
    ColouredEffect,
    /// Something that no effect of the library is
    Outside,
    /// One effect of a pair that is easily confused, and the experiment that tells it from the other
    Alike,
    /// An effect put into the measured logs of a UR10e, size 1
    Measured,
    /// An effect put into the measured logs of a UR10e, size 0.6
    MeasuredSmall,
    /// One effect on an arm that was drawn by lot
    Arms,
    /// No effect, on arms that were drawn by lot
    CleanArms,
    /// Two effects, half of them on one joint, on arms, friction, logs and sensors that were drawn by lot
    Drawn,
    /// Arms, friction, logs and sensors as of the drawn pairs, without an effect
    CleanDrawn,
    /// One effect of size 0.3 to 1.5 put into measured logs of each arm that has two or more
    MeasuredArms,
}

impl Table {
    pub(super) fn all() -> Vec<Table> {
        Table::value_variants().to_vec()
    }

    /// Whether it needs measured logs.
    pub(super) fn measured(self) -> bool {
        matches!(self, Table::Measured | Table::MeasuredSmall | Table::MeasuredArms)
    }

    /// Whether every case has an arm of its own.
    pub(super) fn draws_arms(self) -> bool {
        matches!(self, Table::Arms | Table::CleanArms) || self.draws_logs()
    }

    /// Whether friction's law, the torques' zeros, noise, and rate, number and length of the logs are drawn
    /// too.
    pub(super) fn draws_logs(self) -> bool {
        matches!(self, Table::Drawn | Table::CleanDrawn)
    }

    /// The name in results and on the command line.
    pub(super) fn name(self) -> String {
        self.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default()
    }

    /// What it holds, in words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Table::Single => "one effect of size 0.3 to 1.5, white noise",
            Table::Small => "one effect of size 0.15 to 0.3, white noise",
            Table::Pairs => "two effects of sizes 0.3 to 1.5, white noise",
            Table::Friction => "one effect of size 0.3 to 1.5, friction of other laws",
            Table::Misfit => {
                "one effect of size 0.3 to 1.5 in addition to a smooth misfit of 0.3 σ on all joints"
            }
            Table::Clean => "no effect, white noise",
            Table::Coloured => "no effect, coloured noise",
            Table::ColouredEffect => "one effect of size 0.3 to 1.5, coloured noise",
            Table::Outside => "something outside the library, size 0.3 to 1.5",
            Table::Alike => {
                "one effect of size 0.3 to 1.5 that is easily taken for another, logged on paths that use 30 \
                    % of the ranges"
            }
            Table::Measured => "one effect of size 1 put into the measured UR10e logs",
            Table::MeasuredSmall => "one effect of size 0.6 put into the measured UR10e logs",
            Table::MeasuredArms => "one effect of size 0.3 to 1.5 put into measured logs of several arms",
            Table::Arms => "one effect of size 0.3 to 1.5 on arms drawn by lot, white noise",
            Table::CleanArms => "no effect, arms drawn by lot, white noise",
            Table::Drawn => {
                "two effects as they were drawn, of size 0.5 and more, half of them on one joint; arms and \
                logs drawn by lot"
            }
            Table::CleanDrawn => "no effect, arms and logs drawn by lot",
        }
    }

    /// Seeds of each kind where the caller names none.
    fn seeds(self) -> u64 {
        match self {
            Table::Clean => 300,
            Table::Coloured => 100,
            Table::Pairs => 60,
            Table::Outside => 20,
            Table::Single | Table::Small => 10,
            Table::Friction | Table::Misfit | Table::ColouredEffect | Table::Alike => 5,
            Table::Measured | Table::MeasuredSmall => 3,
            Table::Arms => 5,
            Table::MeasuredArms => 15,
            Table::CleanArms | Table::Drawn | Table::CleanDrawn => 50,
        }
    }

    fn sizes(self) -> Range<f64> {
        match self {
            Table::Small => 0.15..0.3,
            Table::Drawn => 0.5..0.500_001,
            Table::Measured => 1.0..1.000_001,
            Table::MeasuredSmall => 0.6..0.600_001,
            _ => 0.3..1.5,
        }
    }
}

/// One case.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub(super) table: Table,
    /// What is in the plant: names of effects or of laws outside the library.
    pub(super) kinds: Vec<String>,
    /// How large each is to be: RMS left after the base is refitted over the RMS of the noise, worst joint.
    pub(super) sizes: Vec<f64>,
    /// The folder of the measured logs; empty on simulated arms.
    pub(super) folder: &'static str,
    pub(super) seed: u64,
}

impl Case {
    /// All cases of a table, seed after seed, so that a stopped study has seen every kind.
    pub(super) fn all(table: Table, seeds: Option<Range<u64>>) -> Vec<Case> {
        let mut cases = Vec::new();
        for seed in seeds.unwrap_or(0..table.seeds()) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1000) + table as u64);
            let size = |rng: &mut ChaCha8Rng| {
                let range = table.sizes();
                f64::exp(rng.random_range(range.start.ln()..range.end.ln()))
            };
            let folder = if table.measured() { UR10E.folder } else { "" };
            let mut add =
                |kinds: Vec<String>, sizes: Vec<f64>| cases.push(Case { table, kinds, sizes, folder, seed });
            match table {
                Table::Clean | Table::Coloured | Table::CleanArms | Table::CleanDrawn => {
                    add(Vec::new(), Vec::new())
                }
                Table::Outside => {
                    for law in Outside::ALL {
                        add(vec![law.name().to_string()], vec![size(&mut rng)]);
                    }
                }
                Table::Alike => {
                    for name in PAIRS.into_iter().flatten() {
                        add(vec![name.to_string()], vec![size(&mut rng)]);
                    }
                }
                Table::MeasuredArms => {
                    for source in &SOURCES {
                        let size = vec![size(&mut rng)];
                        let kind = Effect::chosen_by_seed().choose(&mut rng).map(|n| (*n).to_string());
                        let kinds = kind.into_iter().collect();
                        cases.push(Case { table, kinds, sizes: size, folder: source.folder, seed });
                    }
                }
                Table::Pairs | Table::Drawn => {
                    let sizes = vec![size(&mut rng), size(&mut rng)];
                    let two: Vec<String> =
                        Effect::chosen_by_seed().sample(&mut rng, 2).map(|n| (*n).to_string()).collect();
                    add(two, sizes);
                }
                _ => {
                    for name in Effect::NAMES {
                        add(vec![name.to_string()], vec![size(&mut rng)]);
                    }
                }
            }
        }
        cases
    }

    /// Its table, its kinds, its measured arm if there are several, and its seed.
    pub(super) fn name(&self) -> String {
        let (table, kinds) = (self.table.name(), self.kinds.join("+"));
        match self.table {
            Table::MeasuredArms => format!("{table}/{kinds}/{}/{}", self.folder, self.seed),
            _ => format!("{table}/{kinds}/{}", self.seed),
        }
    }

    /// A generator of its own.
    pub(super) fn rng(&self) -> ChaCha8Rng {
        let text = self.name();
        ChaCha8Rng::seed_from_u64(text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        }))
    }
}
