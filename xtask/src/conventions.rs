//! What the columns of logs are taken to be: as they are, and after one thing was made wrong with them.

use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::arm::Convention;
use dyngen::exact::angle::Angle;
use dyngen::exact::rational::{Rational, integer, to_f64};
use powerball::identification::conventions::{Conventions, conventions};
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::logs::log::{Log, read_logs};
use powerball::logs::regression::RigidArm;
use powerball::virtual_arm::lwa4p;
use powerball::{IdentifyOptions, identify};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Which logs.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The arm file; the built-in virtual arm where there is none
    #[arg(long, requires = "log")]
    arm: Option<PathBuf>,
    /// The logs
    #[arg(long, num_args = 1.., requires = "arm")]
    log: Vec<PathBuf>,
    /// Logs of another path
    #[arg(long, num_args = 1.., requires = "arm")]
    validate: Vec<PathBuf>,
    /// The logs as they are, and nothing else
    #[arg(long)]
    plain: bool,
}

/// N·m/A of motors as an arm of this size has them.
const CONSTANTS: [f64; 7] = [24.0, 24.0, 18.0, 12.0, 9.0, 9.0, 7.0];

type Spoil<'a> = Box<dyn Fn(&mut Log) + 'a>;

/// Prints a table: what was made wrong, what is reported, and the column map.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let (arm, logs, validate) = match &arguments.arm {
        Some(file) => {
            let arm = Arm::read(file).map_err(|e| e.to_string())?;
            let read = |files: &[PathBuf]| read_logs(files, &arm).map_err(|e| e.to_string());
            let (logs, validate) = (read(&arguments.log)?.0, read(&arguments.validate)?.0);
            (arm, logs, validate)
        }
        None => virtual_logs()?,
    };
    let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
    let weight = if arguments.plain { Vec::new() } else { parameters(&arm, &logs)? };
    println!("| made wrong | reported | column map | s |\n|---|---|---|---|");
    let spoils = if arguments.plain { Vec::new() } else { spoils(&arm, &body, &weight) };
    let nothing: (String, Spoil<'_>) = ("nothing".into(), Box::new(|_| ()));
    for (name, spoil) in std::iter::once(nothing).chain(spoils) {
        let spoiled = |log: &Log| {
            let mut log = log.clone();
            spoil(&mut log);
            log
        };
        let logs: Vec<Log> = logs.iter().map(spoiled).collect();
        let validate: Vec<Log> = validate.iter().map(spoiled).collect();
        let start = std::time::Instant::now();
        let asked = conventions(&body, &logs, &validate);
        let map =
            asked.suggested_map.as_deref().map_or(String::new(), |m| format!("`{}`", m.replace('\n', "` `")));
        println!("| {name} | {} | {map} | {:.2} |", words(&asked), start.elapsed().as_secs_f64());
    }
    if arguments.plain { Ok(()) } else { of_arm_files(&arm, &logs, &validate) }
}

/// Prints a table: what was made wrong with the arm file, the line that is reported, and what else fits as
/// well.
fn of_arm_files(arm: &Arm, logs: &[Log], validate: &[Log]) -> Result<(), String> {
    println!("\n| wrong in the arm file | reported | or | s |\n|---|---|---|---|");
    for (name, wrong) in wrong_files(arm) {
        let body = RigidArm::new(&wrong).map_err(|e| e.to_string())?;
        let start = std::time::Instant::now();
        let asked = conventions(&body, logs, validate);
        let time = start.elapsed().as_secs_f64();
        let answer = asked.answers.iter().find(|a| a.question == "arm file");
        let or = answer.and_then(|a| a.sentence.split_once("do not tell it from: ")).map_or("", |(_, or)| or);
        println!(
            "| {name} | {} | {or} | {time:.2} |",
            asked.arm_file.clone().unwrap_or_else(|| words(&asked))
        );
    }
    Ok(())
}

/// Arm files with one thing wrong.
fn wrong_files(arm: &Arm) -> Vec<(String, Arm)> {
    let mut all = Vec::new();
    let mut push = |name: String, spoil: &dyn Fn(&mut Arm)| {
        let mut wrong = arm.clone();
        spoil(&mut wrong);
        all.push((name, wrong));
    };
    push("convention".into(), &|arm| {
        arm.convention = match arm.convention {
            Convention::Standard => Convention::Modified,
            Convention::Modified => Convention::Standard,
        };
    });
    let minus = |x: &Rational| x * integer(-1);
    for (k, joint) in arm.joints.iter().enumerate() {
        let name = k + 1;
        let (a, d) = (to_f64(&joint.a), to_f64(&joint.d));
        if a != 0.0 {
            push(format!("a = {} of joint {name}", -a), &|arm| arm.joints[k].a = minus(&joint.a));
        }
        if d != 0.0 {
            push(format!("d = {} of joint {name}", -d), &|arm| arm.joints[k].d = minus(&joint.d));
        }
        let turned = |by: Angle| Angle::sum(&[(joint.theta.clone(), integer(1)), (by, integer(1))]);
        if joint.alpha.sin_cos().0 != 0.0 {
            let other = Angle::sum(&[(joint.alpha.clone(), integer(-1))]);
            push(format!("alpha of joint {name} with the other sign"), &|arm| {
                arm.joints[k].alpha = other.clone()
            });
        }
        let quarter = Angle::PiMultiple(integer(1) / integer(2));
        push(format!("theta of joint {name} a quarter turn further"), &|arm| {
            arm.joints[k].theta = turned(quarter.clone());
        });
    }
    push("gravity upwards".into(), &|arm| arm.gravity.iter_mut().for_each(|g| *g *= integer(-1)));
    push("gravity from the side".into(), &|arm| arm.gravity.rotate_right(1));
    push("millimetres".into(), &|arm| {
        for joint in &mut arm.joints {
            joint.a = &joint.a * integer(1000);
            joint.d = &joint.d * integer(1000);
        }
    });
    all
}

/// What differs from what is declared; otherwise what is not determined.
fn words(asked: &Conventions) -> String {
    let of = |said: Option<bool>| asked.answers.iter().filter(move |a| a.as_said == said);
    if asked.differ() {
        return of(Some(false)).map(|a| a.sentence.as_str()).collect::<Vec<_>>().join(" ");
    }
    if asked.is_remarkable() {
        return asked.verdict();
    }
    let open: Vec<&str> = of(None).map(|a| a.question).collect();
    match open.is_empty() {
        true => "as said".into(),
        false => format!("as said; not determined: {}", open.join(", ")),
    }
}

/// The inertial parameters of the logs, for the weight that is taken out of torques.
fn parameters(arm: &Arm, logs: &[Log]) -> Result<Vec<f64>, String> {
    let fitted = identify(arm, logs, [], &IdentifyOptions::default()).map_err(|e| e.to_string())?;
    Ok(fitted.parameters.iter().map(|p| p.value).collect())
}

fn virtual_logs() -> Result<(Arm, Vec<Log>, Vec<Log>), String> {
    let arm = lwa4p::arm().map_err(|e| e.to_string())?;
    let plant = lwa4p::plant().map_err(|e| e.to_string())?;
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let log = |k: u64| {
        let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
        let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(0.25), b: draw(0.25) }).collect();
        let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints };
        plant.record(&path.sample(plant.sensors().rate), 0.0, k).log(format!("log {k}"))
    };
    let mut logs: Vec<Log> = (0..7).map(log).collect();
    let validate = logs.split_off(5);
    Ok((arm, logs, validate))
}

/// All that is made wrong, one thing at a time.
fn spoils<'a>(arm: &'a Arm, body: &'a RigidArm, parameters: &'a [f64]) -> Vec<(String, Spoil<'a>)> {
    let n = arm.dof();
    let mut all: Vec<(String, Spoil<'a>)> = vec![
        ("all signs".into(), Box::new(|log| times(&mut log.torque, -1.0))),
        ("mN·m".into(), Box::new(|log| times(&mut log.torque, 1000.0))),
        (
            "A".into(),
            Box::new(|log| {
                for (x, k) in log.torque.iter_mut().zip(CONSTANTS) {
                    x.iter_mut().for_each(|x| *x /= k);
                }
            }),
        ),
        (
            "before the gear".into(),
            Box::new(|log| {
                for (x, joint) in log.torque.iter_mut().zip(&arm.joints) {
                    let ratio = joint.rotor_ratio.as_ref().map_or(100.0, to_f64);
                    x.iter_mut().for_each(|x| *x /= ratio);
                }
            }),
        ),
        (
            "gravity taken out".into(),
            Box::new(move |log| {
                let still = vec![0.0; n];
                for k in 0..log.t.len() {
                    let q: Vec<f64> = log.q.iter().map(|q| q[k]).collect();
                    let weight = body.torque(&q, &still, &still, parameters);
                    log.torque.iter_mut().zip(weight).for_each(|(x, g)| x[k] -= g);
                }
            }),
        ),
        ("degrees".into(), Box::new(|log| times(&mut log.q, 1f64.to_degrees()))),
    ];
    for joint in 0..n {
        let name = joint + 1;
        all.push((
            format!("sign of tau{name}"),
            Box::new(move |log| times(&mut log.torque[joint..=joint], -1.0)),
        ));
        all.push((format!("sign of q{name}"), Box::new(move |log| times(&mut log.q[joint..=joint], -1.0))));
    }
    for joint in 1..n {
        let (a, b) = (joint, joint + 1);
        all.push((
            format!("tau{a} and tau{b} exchanged"),
            Box::new(move |log| log.torque.swap(a - 1, b - 1)),
        ));
        all.push((format!("q{a} and q{b} exchanged"), Box::new(move |log| log.q.swap(a - 1, b - 1))));
    }
    all.push((
        "joints counted from the tip".into(),
        Box::new(|log| {
            log.q.reverse();
            log.torque.reverse();
        }),
    ));
    for by in [0.03, 0.08, 0.15] {
        all.push((format!("torques {:.0} ms late", 1000.0 * by), Box::new(move |log| late(log, by))));
    }
    all
}

fn times(columns: &mut [Vec<f64>], by: f64) {
    columns.iter_mut().flatten().for_each(|x| *x *= by);
}

/// Delays the torques, by straight lines between samples.
fn late(log: &mut Log, by: f64) {
    let t = &log.t;
    for x in &mut log.torque {
        let at = |time: f64| {
            let k = t.partition_point(|t| *t < time).clamp(1, t.len() - 1);
            let share = ((time - t[k - 1]) / (t[k] - t[k - 1])).clamp(0.0, 1.0);
            x[k - 1] + share * (x[k] - x[k - 1])
        };
        *x = t.iter().map(|t| at(t - by)).collect();
    }
}
