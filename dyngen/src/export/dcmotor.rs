//! Named effects in the form of MuJoCo: cogging and LuGre's friction of a `<dcmotor>` (MuJoCo 4, XML
//! reference, actuator/dcmotor and its technical note), and springs.
//!
//! A `<dcmotor>` without input and without motor constant is passive: only these two remain. Its torque acts
//! on the joint; a term is the torque that the motor must supply against it, of the opposite sign.

use super::edit::shortest;
use super::known::Friction;
use super::term::{Law, Term};
use crate::arm::JointKind;
use std::f64::consts::FRAC_PI_2;

/// Deflection of LuGre's bristles before they slide, rad and m, if no log gives it: far below what an
/// encoder's user sees, far above what a simulation's step of 2 ms cannot follow.
const BRISTLES: [f64; 2] = [1e-3, 1e-4];

/// The effects of one joint.
#[derive(Debug, Default)]
pub(super) struct Motors {
    pub(super) motors: Vec<Motor>,
    /// Whether the joint's constant friction is among them, in the place of `frictionloss`.
    pub(super) has_coulomb: bool,
    /// Torque that grows with the position.
    pub(super) spring: Option<Spring>,
    /// Terms for which MuJoCo has no law, in words.
    pub(super) left_out: Vec<String>,
}

/// A spring of a joint or a tendon: stiffness·(q − rest) is the torque that the motor must supply.
#[derive(Debug)]
pub(super) struct Spring {
    /// N·m/rad or N/m; positive.
    pub(super) stiffness: f64,
    /// rad or m.
    pub(super) rest: f64,
    pub(super) words: String,
}

/// A passive `<dcmotor>`.
#[derive(Debug)]
pub(super) struct Motor {
    /// The motor's attributes in addition to those that make it passive.
    pub(super) attributes: String,
    /// Description of the effect, and how exact its form is.
    pub(super) words: String,
    /// Whether it has a state, MuJoCo's `act`.
    pub(super) has_state: bool,
}

/// The motors of the terms of one joint.
pub(super) fn motors(kind: JointKind, friction: Option<Friction>, terms: &[&Term]) -> Motors {
    let mut all = Motors::default();
    let mut orders: Vec<f64> = Vec::new();
    all.spring = spring(terms);
    for term in terms {
        let (effect, c) = (&term.effect, term.coefficient);
        if all.spring.is_some() && is_of_spring(terms, term) {
            continue;
        }
        let mut left_out = |why: &str| all.left_out.push(format!("{effect}: {why}"));
        match &term.law {
            Law::Cosine { order } | Law::Sine { order } => {
                if !orders.contains(order) {
                    orders.push(*order);
                    all.motors.push(cogging(effect, *order, terms));
                }
            }
            Law::Presliding { .. } if c <= 0.0 => {
                left_out("a negative level, which is impossible for bristles")
            }
            Law::Presliding { distance } => all.motors.push(Motor {
                attributes: lugre(c / distance, c, c, 1.0),
                words: format!(
                    "{effect}: Dahl's presliding friction of {} within {}, exactly",
                    with_error(&[term]),
                    shortest(*distance)
                ),
                has_state: true,
            }),
            Law::Stribeck { velocity } => {
                let coulomb = friction.map_or(0.0, |friction| friction.coulomb);
                if coulomb <= 0.0 || coulomb + c <= 0.0 {
                    left_out("LuGre's friction has it only together with constant friction");
                } else if all.has_coulomb {
                    left_out("LuGre's friction has one velocity");
                } else {
                    let bristles = BRISTLES[usize::from(kind == JointKind::Prismatic)];
                    all.has_coulomb = true;
                    all.motors.push(Motor {
                        attributes: lugre(coulomb / bristles, coulomb, coulomb + c, *velocity),
                        words: format!(
                            "{effect}: in place of frictionloss, {} + {} exp(-(v/{})^2) in steady sliding; \
                             not from a log: that bristles of {} hold it at rest",
                            shortest(coulomb),
                            with_error(&[term]),
                            shortest(*velocity),
                            shortest(bristles)
                        ),
                        has_state: true,
                    });
                }
            }
            Law::Position => left_out("a torque that falls with the position, which is not a spring"),
            Law::Constant => left_out("MuJoCo has no constant torque without an actuator"),
            Law::Other(law) => left_out(&format!("MuJoCo has no law '{law}'")),
        }
    }
    all
}

/// Whether a term is one of the joint's spring: grows with the position, or moves where that is zero.
fn is_of_spring(terms: &[&Term], term: &Term) -> bool {
    let grows = |other: &&Term| other.law == Law::Position && other.effect == term.effect;
    term.law == Law::Position || term.law == Law::Constant && terms.iter().any(grows)
}

fn spring(terms: &[&Term]) -> Option<Spring> {
    let of = |law: Law| -> Vec<&Term> {
        terms.iter().copied().filter(|term| term.law == law && is_of_spring(terms, term)).collect()
    };
    let sum = |terms: &[&Term]| terms.iter().map(|term| term.coefficient).sum::<f64>();
    let (grows, constant) = (of(Law::Position), of(Law::Constant));
    let (stiffness, offset) = (sum(&grows), sum(&constant));
    (stiffness > 0.0).then(|| Spring {
        stiffness,
        rest: -offset / stiffness,
        words: format!(
            "{}: the motor must supply {} q + {}, exactly",
            grows[0].effect,
            with_error(&grows),
            with_error(&constant)
        ),
    })
}

/// The sum of some terms' coefficients with its standard error, under the assumption that those of the terms
/// are independent.
fn with_error(terms: &[&Term]) -> String {
    let value = shortest(terms.iter().map(|term| term.coefficient).sum());
    let square: Option<f64> = terms.iter().map(|term| term.std.map(|std| std * std)).sum();
    match square {
        _ if terms.is_empty() => value,
        Some(square) => format!("({value} ± {:.3e})", square.sqrt()),
        None => format!("({value}, standard error unknown)"),
    }
}

/// σ0, σ1 = 0, Coulomb's and static level, Stribeck's velocity. Without σ1 nothing is added to steady
/// sliding, and with equal levels this is Dahl's model.
fn lugre(stiffness: f64, coulomb: f64, breakaway: f64, velocity: f64) -> String {
    let numbers = [stiffness, 0.0, coulomb, breakaway, velocity].map(shortest);
    format!("gear=\"1\" lugre=\"{}\"", numbers.join(" "))
}

/// All terms of one order: −(a cos kq + b sin kq) = amplitude·sin(kq + phase).
fn cogging(effect: &str, order: f64, terms: &[&Term]) -> Motor {
    let of = |law: Law| -> Vec<&Term> { terms.iter().copied().filter(|term| term.law == law).collect() };
    let [sines, cosines] = [of(Law::Sine { order }), of(Law::Cosine { order })];
    let [sine, cosine] = [&sines, &cosines].map(|all| all.iter().map(|term| term.coefficient).sum::<f64>());
    let amplitude = f64::hypot(cosine, sine);
    let phase = if sine == 0.0 { -FRAC_PI_2.copysign(cosine) } else { f64::atan2(-cosine, -sine) };
    // The number of poles is an integer. What turns k times as fast with one pole has k times its torque at
    // the joint.
    let whole = order.fract() == 0.0;
    let (gear, poles, amplitude) =
        if whole { (1.0, order, amplitude) } else { (order, 1.0, amplitude / order) };
    let [gear, amplitude, poles, phase] = [gear, amplitude, poles, phase].map(shortest);
    Motor {
        attributes: format!("gear=\"{gear}\" cogging=\"{amplitude} {poles} {phase}\""),
        words: format!(
            "{effect}: the motor must supply {} cos({order} q) + {} sin({order} q), exactly",
            with_error(&cosines),
            with_error(&sines)
        ),
        has_state: false,
    }
}
