//! A smooth torque of two joints that is not an effect of the library: a formula in place of a name.
//!
//! A hose over two joints, a counterweight linkage, a cable that is wound up by two joints at once: there is
//! no name for each, and names that fit a part of them are false. The torque of such a part is a smooth
//! function of two positions, or of the joint's own velocity and another one's, and the first terms of its
//! series describe it.

use super::words::Words;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_identification::estimate::{noise_floor, residual_stats};
use powerball_logs::regression::Data;
use serde::Serialize;

/// On joint i one [`Form`] of the positions of two joints, or of its own velocity and another joint's.
pub(super) struct UnnamedLaw;

/// Which terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The terms of the series.
    pub form: Form,
    /// Whether it contains a part that a constant torque or a spring of its joint could explain.
    pub whole: bool,
}

/// The terms of a series, each with a coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// qᵢ·qₖ, qᵢ, qₖ and 1: (qᵢ − a)·(qₖ − b).
    Product([JointNumber; 2]),
    /// cos and sin of a·qᵢ + b·qₖ, and 1.
    Wave([JointNumber; 2], [f64; 2]),
    /// cos and sin of a·qᵢ + b·qₖ and of a·qᵢ − b·qₖ, and 1: a wave of one that is as large as a wave of the
    /// other.
    Waves([JointNumber; 2], [f64; 2]),
    /// cos and sin of qᵢ and of qₖ, and 1.
    Sum([JointNumber; 2]),
    /// Waves of both positions up to order 3, and 1: any smooth function of them.
    Surface([JointNumber; 2]),
    /// q̇·q̇ₖ and q̇·|q̇ₖ|: losses with both velocities.
    Velocities(JointNumber),
}

/// The orders of a surface in one position, 1/rad: two waves over a travel of 4 rad.
const SURFACE: [f64; 2] = [1.5, 3.0];

/// a and b that are tried.
const ORDERS: [[f64; 2]; 4] = [[1.0, 1.0], [1.0, 2.0], [2.0, 1.0], [2.0, 2.0]];

/// Figures of this effect in a result, one entry per law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The formulas.
    pub formulas: Vec<Formula>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, _: &Words<'_>) -> String {
        self.formulas.iter().map(|f| f.formula.clone()).collect::<Vec<_>>().join("; ")
    }
}

/// The torque of a joint in words of mathematics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Formula {
    /// The joint that feels it.
    pub joint: JointNumber,
    /// The law as text: `tau2 = c1·q2·q3 + …`, N·m.
    pub formula: String,
    /// The formula for LaTeX.
    pub latex: String,
    /// The unit of each coefficient.
    pub units: Vec<&'static str>,
}

impl Effect for UnnamedLaw {
    fn name(&self) -> &'static str {
        "law"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn has_name(&self) -> bool {
        false
    }

    fn is_function_of_path(&self, candidate: &Candidate, _: &Data<'_>, _: &Rule) -> bool {
        !matches!(form(candidate), Some(Form::Velocities(_)))
    }

    /// A joint may need several terms.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.joints == b.joints && a.settings == b.settings
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    /// On the joints where more than noise is left.
    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let (rms, floor) = (residual_stats(context.data, context.residual).rms, noise_floor(context.data));
        let joints: Vec<JointNumber> = context.moving_joints().collect();
        let is_left = |j: &&JointNumber| {
            let (rule, j) = (context.rule, j.index());
            rms[j] > rule.above_floor * floor[j] && context.fit.inflation[j] > rule.unlike
        };
        let mut candidates = Vec::new();
        for &joint in joints.iter().filter(is_left) {
            let mut tried: Vec<Settings> = Vec::new();
            for (n, &i) in joints.iter().enumerate() {
                joints[n + 1..].iter().for_each(|&k| tried.extend(of_two([i, k])));
                tried.extend(
                    [1.0, 2.0].into_iter().flat_map(|a| with_and_without(Form::Wave([i, i], [a, 0.0]))),
                );
                if i != joint {
                    tried.push(Settings { form: Form::Velocities(i), whole: false });
                }
            }
            let count = tried.len();
            candidates.extend(tried.into_iter().map(|settings| Candidate::on(joint, settings, count)));
        }
        candidates
    }

    /// The other series of the same joints: which fits best is seen only once the torque is in the model and
    /// the noise is known.
    fn neighbours(&self, candidate: &Candidate, _share: f64) -> Vec<Candidate> {
        let others = match form(candidate) {
            Some(
                Form::Product(joints)
                | Form::Wave(joints, _)
                | Form::Waves(joints, _)
                | Form::Sum(joints)
                | Form::Surface(joints),
            ) if joints[0] != joints[1] => {
                of_two(joints).into_iter().chain(with_and_without(Form::Surface(joints))).collect()
            }
            _ => Vec::new(),
        };
        others.into_iter().map(|settings| candidate.with(settings)).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let Some(Settings { form, whole }) = Settings::of(candidate).copied() else { return Vec::new() };
        let on = candidate.joints[0];
        let position = |joint: JointNumber| match joint == on {
            true => Law::Position,
            false => Law::OtherPosition { other: joint.index() },
        };
        let wave = |[i, k]: [JointNumber; 2], orders: [f64; 2]| {
            let joints = [i.index(), k.index()];
            [Law::CosineOfTwo { joints, orders }, Law::SineOfTwo { joints, orders }]
        };
        let mut laws = match form {
            Form::Product([i, k]) => {
                let joints = [i.index(), k.index()];
                vec![Law::PositionProduct { joints }, position(i), position(k), Law::Constant]
            }
            Form::Wave(joints, orders) => [wave(joints, orders).as_slice(), &[Law::Constant]].concat(),
            Form::Waves(joints, [a, b]) => {
                [wave(joints, [a, b]).as_slice(), &wave(joints, [a, -b]), &[Law::Constant]].concat()
            }
            Form::Sum([i, k]) => {
                let alone = |joint| wave([joint, joint], [1.0, 0.0]);
                [alone(i).as_slice(), &alone(k), &[Law::Constant]].concat()
            }
            Form::Surface(joints) => {
                let alone = SURFACE.iter().map(|b| [0.0, *b]);
                let of_both =
                    |a: f64| [-SURFACE[1], -SURFACE[0], 0.0, SURFACE[0], SURFACE[1]].map(|b| [a, b]);
                let all = alone.chain(SURFACE.into_iter().flat_map(of_both));
                all.flat_map(|orders| wave(joints, orders)).chain([Law::Constant]).collect()
            }
            Form::Velocities(other) => {
                let other = other.index();
                vec![Law::VelocityProduct { other }, Law::VelocityByMagnitude { other }]
            }
        };
        if !whole {
            laws.retain(|law| !matches!(law, Law::Constant | Law::Position));
        }
        laws
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let formulas = found.iter().map(|f| formula(f.candidate.joints[0], &self.laws(context, f.candidate)));
        Figures { formulas: formulas.collect() }.into()
    }
}

/// The series in the positions of two joints.
fn of_two(joints: [JointNumber; 2]) -> Vec<Settings> {
    let waves = |[a, b]: [f64; 2]| {
        [Form::Wave(joints, [a, b]), Form::Wave(joints, [a, -b]), Form::Waves(joints, [a, b])]
    };
    let forms =
        [Form::Product(joints), Form::Sum(joints)].into_iter().chain(ORDERS.into_iter().flat_map(waves));
    forms.flat_map(with_and_without).collect()
}

/// A form with the part of its own that a name could have, and without it.
fn with_and_without(form: Form) -> [Settings; 2] {
    [true, false].map(|whole| Settings { form, whole })
}

fn form(candidate: &Candidate) -> Option<Form> {
    Settings::of(candidate).map(|settings| settings.form)
}

/// The sum of laws at a joint.
fn formula(joint: JointNumber, laws: &[Law<f64>]) -> Formula {
    let parts: Vec<[String; 2]> = laws.iter().map(|law| in_words(joint, law)).collect();
    let sum = |n: usize, times: &str, name: &dyn Fn(usize) -> String| -> String {
        let term = |(k, part): (usize, &[String; 2])| match part[n].as_str() {
            "" => name(k + 1),
            part => format!("{}{times}{part}", name(k + 1)),
        };
        parts.iter().enumerate().map(term).collect::<Vec<_>>().join(" + ")
    };
    Formula {
        joint,
        formula: format!("tau{joint} = {}", sum(0, "·", &|k| format!("c{k}"))),
        latex: format!("\\tau_{{{joint}}} = {}", sum(1, "\\,", &|k| format!("c_{{{k}}}"))),
        units: laws.iter().map(unit).collect(),
    }
}

/// A law's function as text and as LaTeX; nothing for a constant.
fn in_words(joint: JointNumber, law: &Law<f64>) -> [String; 2] {
    let number = |k: usize| JointNumber::from_index(k).to_string();
    let (own, of) = (joint.to_string(), |what: &str, j: &str| [format!("{what}{j}"), format!("q_{{{j}}}")]);
    let both = |[a, b]: [String; 2], [c, d]: [String; 2]| [format!("{a}·{c}"), format!("{b}\\,{d}")];
    let wave = |function: &str, [i, k]: [usize; 2], orders: [f64; 2]| {
        let [text, latex] = angle([number(i), number(k)], orders);
        [format!("{function}({text})"), format!("\\{function}({latex})")]
    };
    let dot = |j: &str| [format!("dq{j}"), format!("\\dot q_{{{j}}}")];
    match *law {
        Law::Position => of("q", &own),
        Law::OtherPosition { other } => of("q", &number(other)),
        Law::PositionProduct { joints: [i, k] } => both(of("q", &number(i)), of("q", &number(k))),
        Law::CosineOfTwo { joints, orders } => wave("cos", joints, orders),
        Law::SineOfTwo { joints, orders } => wave("sin", joints, orders),
        Law::VelocityProduct { other } => both(dot(&own), dot(&number(other))),
        Law::VelocityByMagnitude { other } => {
            both(dot(&own), dot(&number(other)).map(|velocity| format!("|{velocity}|")))
        }
        _ => [String::new(), String::new()],
    }
}

/// a·qᵢ + b·qₖ as text and as LaTeX.
fn angle(joints: [String; 2], orders: [f64; 2]) -> [String; 2] {
    let mut out = [String::new(), String::new()];
    for (joint, order) in joints.iter().zip(orders).filter(|(_, order)| *order != 0.0) {
        let size = if order.abs() == 1.0 { String::new() } else { format!("{}", order.abs()) };
        let sign = match (out[0].is_empty(), order < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        let times = if size.is_empty() { "" } else { "·" };
        out[0].push_str(&format!("{sign}{size}{times}q{joint}"));
        out[1].push_str(&format!("{sign}{size} q_{{{joint}}}"));
    }
    out
}

fn unit(law: &Law<f64>) -> &'static str {
    match law {
        Law::PositionProduct { .. } => "N·m/rad²",
        Law::Position | Law::OtherPosition { .. } => "N·m/rad",
        Law::VelocityProduct { .. } | Law::VelocityByMagnitude { .. } => "N·m·s²/rad²",
        _ => "N·m",
    }
}
