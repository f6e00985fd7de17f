//! The files of an identification; its page is the one that a lab prints.

use crate::report::sections;
use crate::report::{Figure, Files, Ink, JOINTS, Page, Panel, Series, Table, Tone, band_of, number};
use dyngen::Arm;
use dyngen::arm::JointKind;
use dyngen::exact::rational::to_f64;
use powerball_controller::JointNumber;
use powerball_controller::friction::TanhFriction;
use powerball_explanation::torque_model::Additions;
use powerball_identification::estimate::TorqueCurve;
use powerball_identification::{Along, Identified, JointAlong};
use powerball_logs::signal::motion::Turns;
use serde::Serialize;

/// Within this share of its torque a joint is well predicted.
const GOOD: f64 = 0.1;

/// identified.json, with what was known already.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    identified: &'a Identified,
    /// As in model.json, where a model was given.
    #[serde(flatten)]
    known: Option<&'a Additions>,
}

/// identified.json, covariance.json, consistent.json and report.html; `known` is what was known already.
///
/// # Errors
/// A result that is no JSON.
pub fn files(identified: &Identified, known: Option<&Additions>) -> Result<Files, String> {
    let uncertainty = serde_json::to_vec(&identified.uncertainty).unwrap_or_default();
    let files = Files::default()
        .json("identified.json", &Written { identified, known })?
        .with("covariance.json", uncertainty)
        .json("consistent.json", &identified.consistent.parameters)?;
    Ok(files.with("report.html", page(identified).to_html()))
}

/// The page; what is shown is of the held-out logs where there are any, else of the fitted ones.
#[must_use]
pub fn page(result: &Identified) -> Page {
    let (arm, shown, held_out) = (&result.described, &result.along, result.validate.is_some());
    let mut page = Page::new(format!("Torque model of {}", result.arm));
    let [_, high] = result.band;
    page.lead(&format!(
        "Minimal inertial set and friction of two tanh steps and a viscous part (Eq. 16), weighted least \
            squares, each joint in a band of its own up to {high} Hz. Standard errors hold for residuals \
            that depend on each other within blocks of two seconds."
    ));
    if let Some(conventions) = &result.conventions {
        sections::add_conventions(&mut page, conventions);
    }
    verdict(&mut page, result);
    page.paragraph(&format!("The {}.", result.band_reason));
    page.heading("Errors");
    let mut table = Table::new([
        "joint",
        "fit [N·m]",
        "of the torque",
        "held out [N·m]",
        "of the torque",
        "noise alone [N·m]",
        "band [Hz]",
    ]);
    for j in 0..result.fit.rms.len() {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let held = result.validate.as_ref();
        table.push([
            JointNumber::from_index(j).to_string(),
            number(result.fit.rms[j]),
            percent(result.fit.relative[j]),
            held.map_or(String::new(), |s| number(s.rms[j])),
            held.map_or(String::new(), |s| percent(s.relative[j])),
            shown.noise_floor.get(j).map_or(String::new(), |f| number(*f)),
            band_of(result.fit.band[j]),
        ]);
    }
    page.table(&table);
    if let Some(joints) = &result.transmission {
        sections::add_transmissions(&mut page, joints);
    }
    mountings(&mut page, result, shown);
    of_arm(&mut page, arm);
    of_logs(&mut page, result, shown, held_out);
    page.heading(if held_out { "Torques on the held-out logs" } else { "Torques on the fitted logs" });
    for (joint, curve) in shown.curves.iter().enumerate().filter(|(_, c)| !c.t.is_empty()) {
        page.figure(&torque_figure(joint, curve), "");
    }
    spectra(&mut page, arm, shown);
    parameters(&mut page, result);
    friction(&mut page, result, shown);
    page.words(&WORDS);
    page
}

/// The words that a reader may not know, in the order of the page.
const WORDS: [(&str, &str); 7] = [
    (
        "minimal inertial set",
        "The fewest combinations of masses, first moments and inertias that the torques depend on (base \
        parameters). What is no part of it no motion can show.",
    ),
    (
        "Eq. 16",
        "Friction as γ1 tanh(γ2 q̇) + γ3 tanh(γ4 q̇) + γ5 q̇: two smooth steps where the velocity turns, and \
        a viscous part.",
    ),
    ("held out", "Of logs that took no part in the fit."),
    ("of the torque", "The rms of the error over the rms of the joint's measured torque."),
    ("noise alone", "What white noise of the measurement would leave in the band of the fit."),
    (
        "standard error",
        "The standard deviation that the fitted value would have over many such logs; 95 of 100 times the \
        true value is within 1.96 of them.",
    ),
    ("relative", "The standard error over the value. Above some 30 % the logs say little of the parameter."),
];

/// The fit by mounting of the base, where it was not always as filed.
fn mountings(page: &mut Page, result: &Identified, shown: &Along) {
    if result.mountings.is_empty() {
        return;
    }
    let mut table = Table::new(["base of the fitted logs", "logs", "error by joint [N·m]"]);
    for mounted in &result.mountings {
        let each = mounted.fit.rms.iter().zip(&mounted.fit.band);
        let errors: Vec<String> =
            each.map(|(error, band)| format!("{} ({} Hz)", number(*error), band_of(*band))).collect();
        table.push([mounted.mounting.clone(), mounted.logs.len().to_string(), errors.join(", ")]);
    }
    page.table(&table);
    page.paragraph(&format!(
        "One set of parameters for all of them: what these mountings determine together. Figures are of logs \
            with the base {}.",
        shown.mounting
    ));
}

/// What to think of the model, first.
fn verdict(page: &mut Page, result: &Identified) {
    let judged = result.validate.as_ref().unwrap_or(&result.fit);
    let where_to = if result.validate.is_some() {
        "logs that took no part in the fit"
    } else {
        "the fitted logs themselves"
    };
    let worst = judged.relative.iter().fold(0.0f64, |m, r| m.max(*r));
    let beyond: Vec<String> = (1..=judged.relative.len())
        .filter(|j| judged.relative[j - 1] > GOOD)
        .map(|j| j.to_string())
        .collect();
    match beyond.is_empty() {
        true => page.note(
            if result.validate.is_some() { Tone::Good } else { Tone::Plain },
            &format!("On {where_to} every joint's error is within {:.1} % of its torque.", 100.0 * worst),
        ),
        false => page.note(
            Tone::Bad,
            &format!(
                "On {where_to} the error of joint {} is more than {:.0} % of its torque: the model lacks \
                    something there, which powerball explain looks for.",
                beyond.join(", "),
                100.0 * GOOD
            ),
        ),
    }
    let undetermined = result.parameters.iter().filter(|p| p.std.is_none()).count();
    if undetermined > 0 {
        page.note(
            Tone::Bad,
            &format!(
                "{undetermined} of {} parameters are not determined by these logs.",
                result.parameters.len()
            ),
        );
    }
    if !result.physically_consistent {
        page.note(
            Tone::Bad,
            "No real arm can have these values: see the notes below. They predict torques \
            near these logs; to simulate forward take consistent.json.",
        );
    }
}

fn of_arm(page: &mut Page, arm: &Arm) {
    page.heading("Arm");
    let gravity: Vec<String> = arm.gravity.iter().map(|g| number(to_f64(g))).collect();
    page.paragraph(&format!(
        "{}, {:?} Denavit–Hartenberg convention, gravity ({}) m/s² in the base frame.",
        arm.name,
        arm.convention,
        gravity.join(", ")
    ));
    let mut table = Table::new([
        "joint",
        "kind",
        if arm.joints.iter().any(|joint| to_f64(&joint.b) != 0.0) { "a, b [m]" } else { "a [m]" },
        "alpha [rad]",
        "d [m]",
        "theta [rad]",
        "gear ratio",
        "range",
        "velocity",
        "torque",
    ]);
    for (j, joint) in arm.joints.iter().enumerate() {
        let given = |x: Option<f64>| x.map_or("–".to_string(), number);
        table.push([
            JointNumber::from_index(j).to_string(),
            if joint.kind == JointKind::Revolute { "revolute" } else { "prismatic" }.to_string(),
            match to_f64(&joint.b) {
                0.0 => number(to_f64(&joint.a)),
                b => format!("{}, {}", number(to_f64(&joint.a)), number(b)),
            },
            number(joint.alpha.radians()),
            number(to_f64(&joint.d)),
            number(joint.theta.radians()),
            given(joint.rotor_ratio.as_ref().map(to_f64)),
            joint.position.map_or("–".to_string(), |[l, h]| format!("{} … {}", number(l), number(h))),
            given(joint.velocity),
            given(joint.torque),
        ]);
    }
    page.table(&table);
}

fn of_logs(page: &mut Page, result: &Identified, shown: &Along, held_out: bool) {
    page.heading(if held_out { "Trajectory and data: the held-out logs" } else { "Trajectory and data" });
    if !shown.logs.is_empty() {
        let mut table = Table::new(["log", "duration [s]", "samples", "rate [Hz]", "pieces"]);
        for log in &shown.logs {
            table.push([
                log.name.clone(),
                format!("{:.1}", log.seconds),
                log.samples.to_string(),
                format!("{:.1}", log.rate),
                log.pieces.to_string(),
            ]);
        }
        page.table(&table);
        let panel = |label: &str, of: fn(&JointAlong) -> &Vec<(f64, f64)>, named: bool| {
            shown.joints.iter().enumerate().fold(Panel::new(label), |panel, (j, joint)| {
                let name =
                    if named { format!("joint {}", JointNumber::from_index(j)) } else { String::new() };
                panel.line(name, JOINTS[j % JOINTS.len()], of(joint).clone())
            })
        };
        page.figure(
            &Figure::new("Motion", "time along the logs [s]")
                .panel(panel("position [rad]", |j| &j.position, true))
                .panel(panel("velocity [rad/s]", |j| &j.velocity, false)),
            "Positions as logged and smoothed, velocities computed from them.",
        );
    }
    if !result.warnings.is_empty() {
        let mut table = Table::new(["found in the logs, the arm file and the fit"]);
        result.warnings.iter().for_each(|w| table.push([w.clone()]));
        page.table(&table);
    }
}

/// The points of a joint's curve.
type Points<'a> = dyn Fn(usize, &JointAlong) -> Vec<(f64, f64)> + 'a;

/// What repeats with the joints' and the motors' positions.
fn spectra(page: &mut Page, arm: &Arm, shown: &Along) {
    let figure = |title: &str, label: &str, of: &Points<'_>| {
        let panels = shown
            .joints
            .iter()
            .enumerate()
            .map(|(j, joint)| (j, of(j, joint)))
            .filter(|(_, p)| !p.is_empty());
        let mut count = 0;
        let figure = panels.fold(Figure::new(title, label), |figure, (j, points)| {
            count += 1;
            figure.panel(Panel::new(format!("{} [N·m]", JointNumber::from_index(j))).height(0.6).line(
                "",
                JOINTS[j % JOINTS.len()],
                points,
            ))
        });
        (count > 0).then_some(figure)
    };
    let pairs = |turns: &Turns, unit: f64| -> Vec<(f64, f64)> {
        turns.orders.iter().map(|order| order / unit).zip(turns.amplitudes.iter().copied()).collect()
    };
    let by_joint = figure(
        "Residual by joint position, joints from top to bottom",
        "cycles a joint turn",
        &|_, joint| pairs(&joint.by_joint, 1.0),
    );
    let by_motor = figure(
        "Residual by motor position, joints from top to bottom",
        "cycles a motor turn",
        &|j, joint| {
            let ratio = arm.joints[j].rotor_ratio.as_ref().map_or(1.0, to_f64);
            pairs(&joint.by_motor, ratio)
        },
    );
    if by_joint.is_none() && by_motor.is_none() {
        return;
    }
    page.heading("Spectra against position");
    if let Some(figure) = by_joint {
        page.figure(
            &figure,
            "Amplitude of the residual at each number of cycles a turn of the joint; a \
            ripple of the joint stands out as a peak as narrow as the range of its positions allows.",
        );
    }
    if let Some(figure) = by_motor {
        page.figure(
            &figure,
            "The same by turns of the motor (the file's gear ratio). A harmonic drive's \
            ripple stands near 2, a motor's cogging and unbalance near whole numbers. Ripple that was passed \
            too fast lies beyond the band and is not seen.",
        );
    }
}

fn parameters(page: &mut Page, result: &Identified) {
    page.heading("Inertial parameters");
    let mut table =
        Table::new(["parameter", "value (SI units)", "standard error", "95 % interval", "relative"]);
    for p in &result.parameters {
        let interval = |std: f64| {
            format!("{}\u{a0}…\u{a0}{}", number(p.value - 1.96 * std), number(p.value + 1.96 * std))
        };
        table.push([
            p.name.clone(),
            number(p.value),
            p.std.map_or("not determined".into(), number),
            p.std.map_or(String::new(), interval),
            p.relative_std.map_or(String::new(), |r| format!("{:.1} %", 100.0 * r)),
        ]);
    }
    page.table(&table);
}

fn friction(page: &mut Page, result: &Identified, shown: &Along) {
    page.heading("Friction: γ1 tanh(γ2 q̇) + γ3 tanh(γ4 q̇) + γ5 q̇");
    let mut table =
        Table::new(["joint", "γ1 [N·m]", "γ2 [s/rad]", "γ3 [N·m]", "γ4 [s/rad]", "γ5 [N·m·s/rad]"]);
    for f in &result.friction {
        let gamma = f.gamma();
        let cell = |k: usize| match f.std[k] {
            Some(std) => format!("{} ± {}", number(gamma[k]), number(std)),
            None => number(gamma[k]),
        };
        table.push([f.joint.to_string(), cell(0), cell(1), cell(2), cell(3), cell(4)]);
    }
    page.table(&table);
    for (f, joint) in
        result.friction.iter().zip(&shown.joints).filter(|(_, joint)| !joint.friction.is_empty())
    {
        let law = TanhFriction::new(f.gamma());
        let top = joint.friction.iter().fold(0.0f64, |m, (v, _)| m.max(v.abs()));
        let curve = (-200..=200).map(|k| f64::from(k) / 200.0 * top).map(|v| (v, law.torque(v))).collect();
        let panel = Panel::new("torque [N·m]")
            .series(Series::points(
                "measured, less the rigid arm's torque",
                Ink::Blue,
                joint.friction.clone(),
            ))
            .line("tanh friction (Eq. 16)", Ink::Orange, curve);
        page.figure(
            &Figure::new(format!("Friction of joint {}", f.joint), "velocity [rad/s]").panel(panel),
            "",
        );
    }
}

/// Measured against predicted torque of a joint, and the error below.
pub(super) fn torque_figure(joint: usize, curve: &TorqueCurve) -> Figure {
    let torque = Panel::new("torque [N·m]")
        .line("measured", Ink::Blue, curve.points(|k| curve.measured[k]))
        .series(Series::line("predicted", Ink::Orange, curve.points(|k| curve.measured[k] - curve.after[k])));
    let error = Panel::new("error [N·m]").height(0.75).line(
        "measured − predicted",
        Ink::Grey,
        curve.points(|k| curve.after[k]),
    );
    Figure::new(format!("Joint {}", JointNumber::from_index(joint)), "time along the logs [s]")
        .panel(torque)
        .panel(error)
}
