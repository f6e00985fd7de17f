//! The exact numbers of a file's rounded constants, as lines of its head: `dyngen verify` computes with the
//! exact numbers.

use super::Parts;
use crate::dynamics::FunctionGraph;
use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational, parse_rational, to_f64};
use crate::graph::{Graph, JointSum, Node};
use crate::model::Model;
use num_traits::Zero;
use std::collections::BTreeMap;

/// For each literal, by its bits, what it stands for, and where: a function and a name in it.
type Meanings = BTreeMap<u64, BTreeMap<String, Vec<Option<String>>>>;

/// One line for each literal that is not the number which its digits say.
pub(super) fn lines(model: &Model, parts: &Parts<'_>) -> Vec<String> {
    let mut meanings = Meanings::new();
    let mut of = |graph: &Graph, needed: &[usize], function: &str| {
        for node in needed {
            if let Some((literal, text)) = constant(model, graph, *node) {
                note(&mut meanings, literal, text, Some(format!("{function} x{node}")));
            }
        }
    };
    let preparation = parts.preparation.graph();
    of(&preparation, &preparation.needed(parts.preparation.values()), "prepare");
    let mut of_function = |module: &str, built: &FunctionGraph| {
        let name = format!("{module}{}_with", built.function);
        of(&built.graph, &built.graph.needed(&built.outputs), &name);
    };
    parts.functions.iter().for_each(|built| of_function("", built));
    for (frame, functions) in &parts.frames {
        functions.iter().for_each(|built| of_function(&format!("{frame}::"), built));
    }
    for (literal, text) in model.angles().taken().iter().flat_map(|sum| of_angle(model, *sum)) {
        note(&mut meanings, literal, text, None);
    }
    meanings.iter().flat_map(|(bits, texts)| written(f64::from_bits(*bits), texts)).collect()
}

fn note(meanings: &mut Meanings, literal: f64, text: String, place: Option<String>) {
    meanings.entry(literal.abs().to_bits()).or_default().entry(text).or_default().push(place);
}

/// The lines of a literal; where it stands for several numbers, one for each place.
fn written(literal: f64, texts: &BTreeMap<String, Vec<Option<String>>>) -> Vec<String> {
    let one = texts.len() == 1;
    let mut lines = Vec::new();
    for (text, places) in texts.iter().filter(|(text, _)| !text.is_empty()) {
        let line = format!("Rounded: {literal:?} is {text}");
        let placed = places.iter().flatten().filter(|_| !one);
        lines.extend(placed.map(|place| format!("{line} in {place}")));
        if one || places.contains(&None) {
            lines.push(line);
        }
    }
    lines
}

/// A constant's literal and what it stands for; nothing where that is what its digits say.
fn constant(model: &Model, graph: &Graph, node: usize) -> Option<(f64, String)> {
    match graph.nodes()[node] {
        Node::Constant(index) => {
            let exact = graph.constant(index);
            Some((to_f64(exact), number(to_f64(exact), exact)))
        }
        Node::Symbol(index, sine) => {
            let angle = &model.symbols().angles[index as usize];
            let (s, c) = angle.sin_cos();
            Some(if sine { (s, format!("sin({angle})")) } else { (c, format!("cos({angle})")) })
        }
        _ => None,
    }
}

/// Nothing where the digits say the number.
fn number(literal: f64, exact: &Rational) -> String {
    if parse_rational(&literal.to_string()).as_ref() == Ok(exact) {
        return String::new();
    }
    match rational::from_f64(literal).as_ref() == Some(exact) {
        true => "this f64".to_string(),
        false => rational::to_text(exact),
    }
}

/// The constants in a sum of angles.
fn of_angle(model: &Model, sum: JointSum) -> Vec<(f64, String)> {
    let drives = model.arm().drives();
    let (mut plain, mut turns) = (Rational::zero(), Rational::zero());
    let mut constants = Vec::new();
    for (joint, minus) in sum.joints() {
        let sign = rational::integer(if minus { -1 } else { 1 });
        plain += &sign * &drives[joint].offset;
        match model.arm().joints[joint].theta_in_angle() {
            Angle::PiMultiple(x) => turns += &sign * x,
            Angle::Radians(x) => plain += &sign * x,
        }
        if let Some(ratio) = model.angles().joint(joint).ratio {
            constants.push((ratio, number(ratio.abs(), &num_traits::abs(drives[joint].ratio.clone()))));
        }
    }
    let offset = model.angles().offset(sum);
    if offset < 0.0 {
        (plain, turns) = (-plain, -turns);
    }
    let exact = turns.is_zero() && number(offset.abs(), &plain).is_empty();
    let [plain, turns] = [plain, turns].map(|x| rational::to_text(&x));
    let text = match turns.as_str() {
        "0" => format!("the angle {plain}"),
        _ => format!("the angle {plain} + {turns}*pi"),
    };
    constants.push((offset, if exact { String::new() } else { text }));
    constants
}
