//! An excitation as JSON and as a page: the motion of the arm, and how it keeps its limits.

use crate::report::{Figure, Ink, JOINTS, Page, Panel, Series, Table, number};
use powerball_identification::excite::{Conditioning, Excited, Fourier, Trajectory};
use powerball_logs::motion::Motion;
use serde_json::{Value, json};

/// The page.
#[must_use]
pub fn page(excited: &Excited) -> Page {
    let mut page = Page::new(format!("Exciting trajectory of {}", excited.arm));
    let (good, usual) = (&excited.found.figures, &excited.found.usual);
    page.lead(
        "Finite Fourier series (Eq. 18 to 20) from rest to rest, searched for a well conditioned regressor.",
    );
    page.facts([
        ("parameters", excited.parameters.0.to_string()),
        ("condition number, raw", number(excited.conditions.raw)),
        ("with normalised columns", number(excited.conditions.normalised)),
        ("as optimised", format!("{} (a random path: {})", number(good.condition), number(usual.condition))),
    ]);
    for trajectory in &excited.trajectories {
        page.heading(&format!("Base {}", trajectory.mounting));
        page.figure(&motion(trajectory), "Positions, velocities and accelerations of all joints.");
        if let Some(figure) = torques(trajectory) {
            page.figure(
                &figure,
                "Torque expected from the model or estimate below, as a share of the usable part of each \
                    limit.",
            );
        }
        if let Some(figure) = distances(trajectory) {
            page.figure(&figure, "Distance of the nearest capsules, or of a capsule and the floor.");
        }
    }
    page.heading("Assumed");
    let mut table = Table::new(["what the arm file does not give"]);
    excited.assumed.iter().for_each(|line| table.push([line.clone()]));
    page.table(&table);
    page
}

fn motion(trajectory: &Trajectory) -> Figure {
    let motion = &trajectory.motion;
    let panel = |label: &str, pick: usize| {
        (0..motion.dof()).fold(Panel::new(label), |panel, i| {
            let name = if pick == 0 { format!("joint {}", i + 1) } else { String::new() };
            let points = motion.samples().enumerate().map(|(k, s)| (k as f64 * motion.period, s[pick][i]));
            panel.line(name, JOINTS[i % JOINTS.len()], points.collect())
        })
    };
    Figure::new("Motion", "time [s]")
        .panel(panel("position [rad]", 0))
        .panel(panel("velocity [rad/s]", 1))
        .panel(panel("acceleration [rad/s²]", 2))
}

fn torques(trajectory: &Trajectory) -> Option<Figure> {
    let (motion, load) = (&trajectory.motion, trajectory.constraints.load.as_ref()?);
    let torques = load.torques(&motion.q, &motion.dq, &motion.ddq);
    let n = motion.dof();
    let share = |k: usize, i: usize| torques[k * n + i] / load.limits()[i];
    let panel =
        (0..n).filter(|i| load.limits()[*i].is_finite()).fold(Panel::new("share of limit"), |panel, i| {
            let points = (0..motion.len()).map(|k| (k as f64 * motion.period, share(k, i)));
            panel.line(format!("joint {}", i + 1), JOINTS[i % JOINTS.len()], points.collect())
        });
    Some(Figure::new("Torque", "time [s]").panel(panel))
}

fn distances(trajectory: &Trajectory) -> Option<Figure> {
    let (motion, space) = (&trajectory.motion, trajectory.constraints.space.as_ref()?);
    let near = |(k, [q, ..]): (usize, [&[f64]; 3])| {
        let near = space.shape.nearest(q, space.floor.as_ref())?;
        Some((k as f64 * motion.period, near.distance))
    };
    let points: Vec<(f64, f64)> = motion.samples().enumerate().filter_map(near).collect();
    let end = motion.duration();
    let panel = Panel::new("distance [m]").line("nearest", Ink::Blue, points).series(Series::dashed(
        "clearance",
        Ink::Grey,
        vec![(0.0, space.clearance), (end, space.clearance)],
    ));
    Some(Figure::new("Room", "time [s]").panel(panel))
}

/// One JSON object of all that is reported; the list `trajectories` where there are several.
#[must_use]
pub fn json(excited: &Excited) -> Value {
    let figures = |f: &Conditioning| json!({"condition": f.condition, "least_singular_value": f.least, "mean_singular_value": f.mean});
    let trajectory = |(trajectory, path): (&Trajectory, &Fourier)| {
        let torque = trajectory.tightest.torque.as_ref();
        let joints: Vec<Value> = peaks(&trajectory.motion)
            .iter()
            .zip(&path.joints)
            .enumerate()
            .map(|(i, ([low, high, velocity, acceleration], series))| {
                json!({"position": [low, high], "velocity": velocity, "acceleration": acceleration,
                    "torque": torque.map(|t| t[i]),
                    "middle": series.middle, "a": series.a, "b": series.b})
            })
            .collect();
        let nearest = trajectory.tightest.nearest.map(
            |(near, time)| json!({"distance": near.distance, "between": near.contact.to_string(), "time": time}),
        );
        json!({"mounting": trajectory.mounting.to_string(), "samples": trajectory.motion.len(),
            "duration": trajectory.motion.duration(), "fundamental": path.fundamental, "nearest": nearest, "joints": joints})
    };
    let mut object = json!({
        "parameters": excited.parameters.0, "rank": excited.parameters.1,
        "figures": figures(&excited.found.figures), "random_start": figures(&excited.found.usual),
        "conditions": {"raw": excited.conditions.raw, "normalised": excited.conditions.normalised},
        "assumed": excited.assumed,
    });
    let mut list: Vec<Value> =
        excited.trajectories.iter().zip(&excited.found.paths).map(trajectory).collect();
    if let ([Value::Object(only)], Value::Object(object)) = (list.as_mut_slice(), &mut object) {
        object.append(only);
    } else {
        object["trajectories"] = list.into();
    }
    object
}

/// Lowest and highest position, largest velocity and acceleration of each joint.
#[must_use]
pub fn peaks(motion: &Motion) -> Vec<[f64; 4]> {
    let mut peaks = vec![[f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]; motion.dof()];
    for [q, dq, ddq] in motion.samples() {
        for (i, [low, high, velocity, acceleration]) in peaks.iter_mut().enumerate() {
            *low = low.min(q[i]);
            *high = high.max(q[i]);
            *velocity = velocity.max(dq[i].abs());
            *acceleration = acceleration.max(ddq[i].abs());
        }
    }
    peaks
}
