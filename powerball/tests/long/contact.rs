//! How soon `follow --stop-at-contact` sees a push on the virtual arm, over the bus at 200 Hz, and how often
//! it is wrong; with a constant threshold for comparison. The study of docs/control.md is the ignored test.

use chacha20::ChaCha8Rng;
use dyngen::{Arm, SetKind};
use nalgebra::{SVector, Vector3};
use powerball::bus::driver::Driver;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::transport::{Master, Memory};
use powerball::commands::{demo, model_arm};
use powerball::controller::laws::{ComputedTorque, ContactDetector};
use powerball::identification::excite::{self, ExcitationSettings};
use powerball::logs::Progress;
use powerball::procedure::Envelope;
use powerball::procedure::follow::{Law, Path, Run, Track};
use powerball::virtual_arm::{PlantEffect, VirtualArm, lwa4p};
use rand::{RngExt, SeedableRng};
use std::path::PathBuf;

/// A push that is not seen within this is missed, s.
const PATIENCE: f64 = 0.5;

/// Share of the velocities that the limits allow.
const PACE: f64 = 0.8;

/// One run: what came of it, and the plant's time at its end, s.
struct Ran {
    track: Track<6>,
    ended: f64,
}

/// A push: force at the wrist in base axes, N, and the plant's time at which it begins, s.
type Push = ([f64; 3], f64);

struct Study {
    demo: demo::Demo,
    model: model_arm::ModelArm,
    detector: ContactDetector<f64, 6>,
}

/// What came of pushes.
#[derive(Debug, Default)]
struct Outcome {
    false_alarms: usize,
    /// Seconds without contact.
    calm: f64,
    /// Delays, s; infinite where a push was missed.
    delays: Vec<f64>,
    /// Delays with a constant threshold: the largest external torque without contact.
    constant: Vec<f64>,
    early: usize,
    right: usize,
}

fn study(draws: usize, calm_paths: u64, seed: u64) -> Outcome {
    let study = Study::new(seed);
    let (mut result, mut largest) = (Outcome::default(), SVector::<f64, 6>::zeros());
    for k in 0..calm_paths {
        let path = study.path(1000 + k);
        let ran = study.follow(&path, None, None);
        for sample in &ran.track.samples {
            let external = sample.external.unwrap_or_else(SVector::zeros);
            largest = largest.zip_map(&external, |a, b| a.max(b.abs()));
        }
        result.calm += ran.track.samples.len() as f64 * LWA4P.period_seconds();
        let stopped = study.follow(&path, None, Some(study.detector));
        stopped.track.contact.inspect(|contact| println!("without a push: {contact:?}"));
        result.false_alarms += usize::from(stopped.track.contact.is_some());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for k in 0..draws {
        let path = study.path(2000 + k as u64);
        let size: f64 = rng.random_range(10.0..50.0);
        let force = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize() * size;
        let calm = study.follow(&path, None, None);
        // The end of the run is rest and the brakes; before them the arm moves.
        let push = (force.into(), calm.ended - rng.random_range(2.0..5.0));
        let going_on = study.follow(&path, Some(push), None);
        // All is the same until the push begins: where the runs part it has, a cycle before at most.
        let mut pairs = calm.track.samples.iter().zip(&going_on.track.samples);
        let parted = pairs.find(|(a, b)| a.q != b.q).expect("the push is within the path").0.t;
        let begins = parted - LWA4P.period_seconds();
        let above = |r: SVector<f64, 6>| r.iter().zip(&largest).any(|(r, most)| r.abs() > *most);
        let mut after = going_on.track.samples.iter().filter(|s| s.t >= begins && s.t < begins + PATIENCE);
        let seen = after.find(|s| s.external.is_some_and(above));
        result.constant.push(seen.map_or(f64::INFINITY, |s| s.t - begins));
        match study.follow(&path, Some(push), Some(study.detector)).track {
            Track { contact: Some(contact), .. } if contact.t < begins => {
                println!("before the push at {begins:.2} s: {contact:?}");
                result.early += 1;
            }
            Track { contact: Some(contact), samples, .. } if contact.t < begins + PATIENCE => {
                result.delays.push(contact.t - begins);
                result.right +=
                    usize::from(study.is_right(&samples.last().unwrap().q, force, contact.joint - 1));
            }
            _ => result.delays.push(f64::INFINITY),
        }
    }
    result
}

fn missed(delays: &[f64]) -> usize {
    delays.iter().filter(|d| !d.is_finite()).count()
}

#[test]
fn a_push_stops_the_arm_soon_and_at_its_joint() {
    let result = study(6, 2, 21);
    assert_eq!((result.false_alarms, result.early), (0, 0), "{result:?}");
    assert!(median(&result.delays) < 0.05 && result.right >= 5, "{result:?}");
}

#[test]
#[ignore = "a study of minutes"]
fn a_hundred_pushes() {
    let result = study(100, 20, 22);
    println!(
        "{:.0} s without contact: {} false alarms; {} before a push",
        result.calm, result.false_alarms, result.early
    );
    for (name, delays) in [("by the motion", &result.delays), ("constant threshold", &result.constant)] {
        println!(
            "{name}: median {:.0} ms, {} missed of {}",
            1e3 * median(delays),
            missed(delays),
            delays.len()
        );
    }
    println!("joint right: {}", result.right);
}

fn median(list: &[f64]) -> f64 {
    let mut list = list.to_vec();
    list.sort_by(f64::total_cmp);
    list[list.len() / 2]
}

impl Study {
    fn new(seed: u64) -> Study {
        let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("contact_{seed}"));
        std::fs::create_dir_all(&out).unwrap();
        let demo = demo::run(&out, seed, Some("asymmetry"), false, Progress::default()).unwrap();
        let arm = Arm::read(&demo.session.arm_file).unwrap();
        let model = model_arm::read(&arm, &out.join("model.json"), true).unwrap();
        let detector = model_arm::contact_detector(&model).unwrap();
        Study { demo, model, detector }
    }

    /// A path of five seconds, slower than the limits.
    fn path(&self, seed: u64) -> Path<6> {
        let model = self.model.body.model();
        for attempt in 0..8 {
            let settings = ExcitationSettings {
                harmonics: 3,
                fundamental: std::f64::consts::TAU / 5.0,
                evaluations: 30,
                seed: (self.demo.session.undeclared.age as u64) << 32 | (seed << 8) | attempt,
                ..ExcitationSettings::default()
            };
            let found = excite::optimise(model, SetKind::Minimal, &settings).unwrap();
            let rate = self.demo.session.plant.sensors().rate;
            let motion = found.paths[0].sample(rate / PACE).slower(PACE);
            let path = Path::clear(&motion, &Envelope::new(|_| None), &LWA4P).unwrap();
            if model_arm::parts(&self.model, &path, self.demo.session.undeclared.age).is_ok() {
                return path;
            }
        }
        panic!("no path is within the joints' torques")
    }

    fn follow(&self, path: &Path<6>, push: Option<Push>, contact: Option<ContactDetector<f64, 6>>) -> Ran {
        let undeclared = &self.demo.session.undeclared;
        let mut setup = undeclared.setup(path.start().into(), 7).unwrap();
        if let Some((force, start)) = push {
            setup.plant =
                setup.plant.with(PlantEffect::ContactWrench { force, start, length: 2.0, every: 1e6 });
        }
        let arm = VirtualArm::new(lwa4p::with_current_mode(setup)).unwrap();
        let driver = Driver::new(LWA4P).unwrap();
        let parts = model_arm::parts(&self.model, path, undeclared.age).unwrap();
        let law = Law::Torque(ComputedTorque::for_period(LWA4P.period_seconds()));
        let run = Run {
            path,
            arm: &self.model.numeric,
            parts: Some(&parts),
            best: &parts,
            // The pushes are what is studied: the driver lets them be.
            give: 1.0,
            guard: None,
            law,
            contact,
            accept_unverified: true,
        };
        let master = Master::new(driver, Memory::new(arm, LWA4P.bitrate));
        let (master, track, _) = run.follow(master, Envelope::new(|_| None), None, |_, _| ()).unwrap();
        Ran { track, ended: master.bus().peer().simulation().time() }
    }

    /// Whether a joint feels at least half as much of a push at the wrist as the one that feels most.
    fn is_right(&self, q: &SVector<f64, 6>, force: Vector3<f64>, joint: usize) -> bool {
        let (dynamics, zero) = (self.demo.session.plant.dynamics(), [0.0; 6]);
        let with = dynamics.inverse_in_contact(q.as_slice(), &zero, &zero, force.into(), [0.0; 3]);
        let felt: Vec<f64> = with.iter().zip(dynamics.gravity(q.as_slice())).map(|(a, b)| a - b).collect();
        let most = felt.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        felt.get(joint).is_some_and(|x| x.abs() >= 0.5 * most)
    }
}
