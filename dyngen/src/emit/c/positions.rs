//! What functions in C take of joint positions: their sines and cosines.

use super::{Item, Names, documentation, number};
use crate::arm::JointKind;
use crate::emit::angles::{Term, all_inputs, shifted_docs, sum_docs, terms};
use crate::graph::{Input, JointSum};
use crate::model::Model;
use std::collections::BTreeSet;

/// The struct of sines and cosines, and the function that fills it.
pub(super) fn trig(names: &Names, model: &Model) -> Item {
    let Names { prefix, upper } = names;
    let about = format!(
        "Joint positions with their sines and cosines: {prefix}_trig_of computes them once for any\nnumber of calls."
    );
    let extra = shifted_docs(model).into_iter().chain(sum_docs(model)).collect::<Vec<_>>();
    let about = if extra.is_empty() {
        about
    } else {
        about + " Angle k, of joint k or as follows, has the index k - 1."
    };
    let doc = extra.into_iter().fold(about, |text, line| format!("{text}\n{}", line.trim_start()));
    let prototype = format!(
        "void {prefix}_trig_of(\n    const {prefix}_real q[{upper}_JOINTS],\n    {prefix}_trig *trig)"
    );
    let of = documentation(
        "Sines and cosines of joint positions.\n\n* `q`: joint positions, rad (m where prismatic)",
    );
    let all = all_inputs(model);
    let zeros = unread(model, &all).map(|place| format!("trig->{place} = (real)0.0;"));
    let lines = lines(model, &all, "trig->").into_iter().chain(zeros);
    let body: String = lines.map(|line| format!("    {line}\n")).collect();
    Item {
        declaration: format!(
            "{}typedef struct {{
    /** Sine of each angle; not read for prismatic joints. */
    {prefix}_real sin[{upper}_ANGLES];
    /** Cosine of each angle; not read for prismatic joints. */
    {prefix}_real cos[{upper}_ANGLES];
    /** Position of each prismatic joint, m; not read for revolute joints. */
    {prefix}_real position[{upper}_JOINTS];
}} {prefix}_trig;

{of}{prototype};
",
            documentation(&doc)
        ),
        definition: format!("{prototype}\n{{\n{body}}}\n"),
    }
}

/// Whether the angle is one: of joints that turn.
fn turns(model: &Model, sum: JointSum) -> bool {
    sum.joints().all(|(joint, _)| model.arm().joints[joint].kind == JointKind::Revolute)
}

/// The lines that fill what is used of a struct; `trig` leads to its fields.
pub(super) fn lines(model: &Model, used: &BTreeSet<Input>, trig: &str) -> Vec<String> {
    let angles = model.angles().taken().iter().enumerate().filter(|(_, sum)| {
        turns(model, **sum) && [Input::Sin(**sum), Input::Cos(**sum)].iter().any(|input| used.contains(input))
    });
    let computed = angles.map(|(k, sum)| {
        let angle = angle(model, *sum);
        format!("sin_cos({angle}, &{trig}sin[{k}], &{trig}cos[{k}]);")
    });
    let places = (0..model.arm().dof()).filter(|i| used.contains(&Input::Position(*i)));
    computed.chain(places.map(|i| format!("{trig}position[{i}] = q[{i}];"))).collect()
}

/// The places of a struct that [`lines`] does not fill.
fn unread(model: &Model, used: &BTreeSet<Input>) -> impl Iterator<Item = String> {
    let angles = model.angles().taken().iter().enumerate().filter(|(_, sum)| !turns(model, **sum));
    let angles: Vec<String> = angles.flat_map(|(k, _)| [format!("sin[{k}]"), format!("cos[{k}]")]).collect();
    let places = (0..model.arm().dof()).filter(|i| !used.contains(&Input::Position(*i)));
    let places: Vec<String> = places.map(|i| format!("position[{i}]")).collect();
    angles.into_iter().chain(places)
}

/// An angle of the joints' positions.
fn angle(model: &Model, sum: JointSum) -> String {
    let (terms, offset) = terms(model.angles(), sum);
    let mut text = String::new();
    for (k, Term { negative, ratio, coordinate }) in terms.into_iter().enumerate() {
        text += match (k, negative) {
            (0, _) => "",
            (_, false) => " + ",
            (_, true) => " - ",
        };
        text += &match ratio {
            Some(ratio) => format!("({} * q[{coordinate}])", number(ratio)),
            None => format!("q[{coordinate}]"),
        };
    }
    offset.map_or(text.clone(), |offset| format!("{text} + {}", number(offset)))
}

/// The lines that name what a function reads of the struct.
pub(super) fn taken(model: &Model, used: &BTreeSet<Input>) -> Vec<String> {
    let sums = || model.angles().taken().iter().copied().enumerate();
    let sines = sums().map(|(k, sum)| ("sin", k, Input::Sin(sum)));
    let cosines = sums().map(|(k, sum)| ("cos", k, Input::Cos(sum)));
    let places = (0..model.arm().dof()).map(|i| ("position", i, Input::Position(i)));
    sines
        .chain(cosines)
        .chain(places)
        .filter(|(.., input)| used.contains(input))
        .map(|(field, k, input)| format!("const real {input} = trig->{field}[{k}];"))
        .collect()
}
