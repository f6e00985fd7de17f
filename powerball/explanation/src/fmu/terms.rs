//! The terms of a model as statements in C: the laws of [`powerball_controller::correction`], which they are
//! tested against.

use crate::torque_model::NamedTerm;
use powerball_controller::correction::Law;
use std::fmt::Write;

/// The function that adds the torque of every term.
pub(super) fn effects(text: &mut String, terms: &[NamedTerm]) -> std::fmt::Result {
    writeln!(
        text,
        "void model_effects(const struct instant *now, struct memory *memory, double torque[JOINTS])\n{{"
    )?;
    writeln!(text, "    const double *q = now->q, *dq = now->dq, *ddq = now->ddq, *rigid = now->rigid;")?;
    writeln!(text, "    const double *friction = now->friction, running = now->running;")?;
    writeln!(
        text,
        "    (void)q, (void)dq, (void)ddq, (void)rigid, (void)friction, (void)running, (void)memory;"
    )?;
    writeln!(text, "    (void)torque;")?;
    for (k, t) in terms.iter().enumerate() {
        let joint = t.term.joint;
        if let Some(value) = value(t.term.law, joint, k) {
            let effect = t.effect.replace("*/", "* /");
            writeln!(
                text,
                "    /* {effect} */\n    torque[{joint}] += {:?} * ({value});",
                t.term.coefficient
            )?;
        }
    }
    writeln!(text, "}}")
}

/// A law's torque for a coefficient of 1 at a joint; the term's memory is the k-th. `None` where it needs
/// what an FMU has not: a temperature, or a link that gives way.
fn value(law: Law<f64>, j: usize, k: usize) -> Option<String> {
    let side = |steepness: f64| format!("tanh({steepness:?} * dq[{j}])");
    let torque = format!("(rigid[{j}] + friction[{j}])");
    let two = |[i, k]: [usize; 2], [a, b]: [f64; 2]| format!("{a:?} * q[{i}] + {b:?} * q[{k}]");
    let sum = |own: f64, theirs: f64, other: usize, x: &str| {
        format!("({own:?} * {x}[{j}] + {theirs:?} * {x}[{other}])")
    };
    Some(match law {
        Law::Constant => "1.0".to_string(),
        Law::VelocityMagnitude => format!("fabs(dq[{j}])"),
        Law::Load { steepness } => format!("fabs(rigid[{j}]) * {}", side(steepness)),
        Law::Stribeck { steepness, velocity } => {
            let x = format!("(dq[{j}] / {velocity:?})");
            format!("{} * exp(-({x} * {x}))", side(steepness))
        }
        Law::Power { steepness, power } => format!("{} * pow(fabs(dq[{j}]), {power:?})", side(steepness)),
        Law::Presliding { distance } => format!("wind(&memory[{k}], q[{j}], {distance:?})"),
        Law::Position => format!("q[{j}]"),
        Law::Cosine { order } => format!("cos({order:?} * q[{j}])"),
        Law::Sine { order } => format!("sin({order:?} * q[{j}])"),
        Law::DirectionCosine { order, steepness } => format!("{} * cos({order:?} * q[{j}])", side(steepness)),
        Law::DirectionSine { order, steepness } => format!("{} * sin({order:?} * q[{j}])", side(steepness)),
        Law::CoolFriction { time_constant } => format!("friction[{j}] * exp(-running / {time_constant:?})"),
        Law::CoolVelocity { time_constant } => format!("dq[{j}] * exp(-running / {time_constant:?})"),
        Law::OtherDirection { other, steepness } => format!("tanh({steepness:?} * dq[{other}])"),
        Law::OtherVelocity { other } => format!("dq[{other}]"),
        Law::OtherAcceleration { other } => format!("ddq[{other}]"),
        Law::SumDirection { other, own, theirs, steepness } => {
            format!("tanh({steepness:?} * {})", sum(own, theirs, other, "dq"))
        }
        Law::SumVelocity { other, own, theirs } => sum(own, theirs, other, "dq"),
        Law::SumAcceleration { other, own, theirs } => sum(own, theirs, other, "ddq"),
        Law::OtherPosition { other } => format!("q[{other}]"),
        Law::PositionProduct { joints: [i, k] } => format!("q[{i}] * q[{k}]"),
        Law::CosineOfTwo { joints, orders } => format!("cos({})", two(joints, orders)),
        Law::SineOfTwo { joints, orders } => format!("sin({})", two(joints, orders)),
        Law::VelocityProduct { other } => format!("dq[{j}] * dq[{other}]"),
        Law::VelocityByMagnitude { other } => format!("dq[{j}] * fabs(dq[{other}])"),
        Law::Torque => torque,
        Law::TorqueMagnitude { scale } => format!("{torque} * fabs({torque}) / {scale:?}"),
        Law::TorqueSquare { scale } => {
            format!("{torque} * (({torque} / {scale:?}) * ({torque} / {scale:?}))")
        }
        Law::Gap { gap } => format!("crosses(&memory[{k}], q[{j}], {gap:?}) ? -rigid[{j}] : 0.0"),
        Law::Flight { reach } => format!("fly(&memory[{k}], rigid[{j}], {reach:?}, running)"),
        Law::HotFriction { .. } | Law::HotVelocity { .. } => return None,
        Law::Compliance | Law::HangingBack { .. } => return None,
    })
}
