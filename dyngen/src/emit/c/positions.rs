//! The sines and cosines of joint positions for functions in C.

use super::{Item, Names, SYNTAX, documentation};
use crate::emit::angles::{all_inputs, shifted_docs, sum_docs, turns};
use crate::graph::Input;
use crate::model::Model;
use std::collections::BTreeSet;

/// The struct of sines and cosines, and the function that fills it.
pub(super) fn trig(names: &Names, model: &Model) -> [Item; 2] {
    let Names { prefix, upper } = names;
    let about = format!(
        "Joint positions with their sines and cosines: {prefix}_trig_of computes them once for any\n\
        number of calls."
    );
    let extra = shifted_docs(model).into_iter().chain(sum_docs(model)).collect::<Vec<_>>();
    let about = if extra.is_empty() {
        about
    } else {
        about + " Angle k, of joint k or as follows, has the index k - 1."
    };
    let doc = extra.into_iter().fold(about, |text, line| format!("{text}\n{}", line.trim_start()));
    let held = format!(
        "{}typedef struct {{
    /** Sine of each angle; not read for prismatic joints. */
    {prefix}_real sin[{upper}_ANGLES];
    /** Cosine of each angle; not read for prismatic joints. */
    {prefix}_real cos[{upper}_ANGLES];
    /** Position of each prismatic joint, m; not read for revolute joints. */
    {prefix}_real position[{upper}_JOINTS];
}} {prefix}_trig;
",
        documentation(&doc)
    );
    let all = all_inputs(model);
    let zeros = unread(model, &all).map(|place| format!("trig->{place} = (real)0.0;"));
    let computed = Item::Function {
        doc: "Sines and cosines of joint positions.\n\n* `q`: joint positions, rad (m where prismatic)"
            .to_string(),
        prototype: format!(
            "void {prefix}_trig_of(\n    const {prefix}_real q[{upper}_JOINTS],\n    {prefix}_trig *trig)"
        ),
        body: lines(model, &all, "trig->").into_iter().chain(zeros).collect(),
    };
    [Item::Declared(held), computed]
}

/// The lines that fill what is used of a struct; `trig` leads to its fields.
pub(super) fn lines(model: &Model, used: &BTreeSet<Input>, trig: &str) -> Vec<String> {
    let angles = model.angles().taken().iter().enumerate().filter(|(_, sum)| {
        turns(model, **sum) && [Input::Sin(**sum), Input::Cos(**sum)].iter().any(|input| used.contains(input))
    });
    let computed = angles.map(|(k, sum)| {
        let angle = SYNTAX.angle(model, *sum);
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
