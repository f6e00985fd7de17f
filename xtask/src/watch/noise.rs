//! False alarms: noise of the model's colour along the rows of a log, again and again, with friction that
//! wanders.

use super::Arguments;
use chacha20::ChaCha8Rng;
use powerball::controller::change::ORDER;
use powerball::explanation::torque_model::{Colour, Detector, Rows, Shown, TorqueModel, rows_a_second};
use powerball::explanation::watch::WatchOptions;
use powerball::logs::log::Log;
use powerball::logs::regression::{DataOptions, Recording, RigidArm};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Prints how many there are.
pub(super) fn run(arguments: &Arguments, body: &RigidArm, model: &TorqueModel, log: &Log) {
    let Some(colour) = &model.colour else { return };
    let options = WatchOptions::default();
    let recording =
        Recording::new(log, 0, 0..log.t.len(), 1.0 / colour.rate, DataOptions::default().smoothing);
    let Some(recording) = recording else { return };
    let rows = Rows::new(model, body, &recording, &model.torque(body, &recording, &|_| false));
    for range in [0.0, options.friction_range] {
        let noise = Noise { colour, rng: ChaCha8Rng::seed_from_u64(arguments.seed ^ 0x5eed), range };
        let alarms = noise.alarms(&rows, arguments.hours, &options);
        println!(
            "{alarms} alarms in {} h of noise of the model's colour, friction wandering by {:.0} % of itself",
            arguments.hours,
            100.0 * range
        );
    }
}

/// Noise of a model's colour, with friction that wanders by a share of itself within ten minutes.
struct Noise<'a> {
    colour: &'a Colour,
    rng: ChaCha8Rng,
    range: f64,
}

impl Noise<'_> {
    fn alarms(mut self, rows: &Rows, hours: f64, options: &WatchOptions) -> usize {
        let a_second = rows_a_second(self.colour.rate);
        let level = options.level(self.colour.rate);
        let fresh = || Detector::new(&self.colour.joints, options.friction_range);
        let (mut detector, mut alarms) = (fresh(), 0);
        let mut past = vec![[0.0; ORDER]; self.colour.joints.len()];
        for number in 0..(hours * 3600.0 * a_second) as u64 {
            let k = (number % rows.t.len() as u64) as usize;
            let wander = self.range * (number as f64 / a_second / 600.0 * std::f64::consts::TAU).sin();
            let mut row: Vec<Option<Shown>> = rows.row(k).map(Option::<&Shown>::cloned).collect();
            for (j, shown) in row.iter_mut().enumerate() {
                let Some(own) = &self.colour.joints[j] else { continue };
                let e: f64 = StandardNormal.sample(&mut self.rng);
                let predicted: f64 = own.coefficients.iter().zip(&past[j]).map(|(a, x)| a * x).sum();
                let noise = predicted + own.deviation * e;
                past[j].copy_within(..ORDER - 1, 1);
                past[j][0] = noise;
                if let Some(shown) = shown {
                    shown.residual = noise + wander * shown.friction;
                }
            }
            detector.update(row.iter().map(Option::as_ref), number);
            if detector.alarm(level).is_some() {
                alarms += 1;
                detector = fresh();
            }
        }
        alarms
    }
}
