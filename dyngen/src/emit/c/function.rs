//! One function in C: straight-line code, one `const` for each node.

use super::{Item, Names, SYNTAX, positions};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::{Argument, Size};
use crate::emit::docs;
use crate::emit::lanes::used;
use crate::emit::statement::{self, Form, is_matrix, is_number};
use crate::graph::{Input, Preparation};
use crate::model::Model;
use std::collections::BTreeSet;

/// A function's items: one that takes q and the parameters, and one that takes what was made of them. At a
/// frame its name stands between the prefix and the function's name. `prepared` values are made of the
/// parameters.
pub(super) fn items(
    names: &Names,
    frame: Option<&str>,
    model: &Model,
    built: &FunctionGraph,
    prepared: usize,
) -> [Item; 2] {
    let needed = built.graph.needed(&built.outputs);
    let used = used(built, &needed);
    let name = names.function(frame, built.function);
    let at =
        frame.map(|frame| format!("At the frame `{frame}` of the arm file, in place of the tool's.\n\n"));
    let doc = at.unwrap_or_default() + &doc(names, built);
    let returned = returned(names, built);
    let type_of = if is_number(built) { format!("{}_real", names.prefix) } else { "void".to_string() };
    let item = |doc: String, name: &str, arguments: Vec<String>, body: Vec<String>| {
        let arguments = arguments.into_iter().chain(returned.clone()).collect::<Vec<_>>().join(",\n    ");
        Item::Function { doc, prototype: format!("{type_of} {name}(\n    {arguments})"), body }
    };
    let others: Vec<Argument> = built.arguments().filter(|a| *a != Argument::Positions).collect();
    let plain = [Argument::Positions].iter().chain(&others).map(|a| names.array(*a));
    let called = called(names, &name, model, built, &others, &used);
    let with = [format!("const {}_trig *trig", names.prefix)].into_iter();
    let with = with.chain(others.iter().map(|a| match a {
        Argument::Parameters => format!("const {}_prepared *prepared", names.prefix),
        other => names.array(*other),
    }));
    let doc_with = format!(
        "{name} with the sines and cosines{}\npassed in, so that several calls can share them.",
        if others.contains(&Argument::Parameters) { " and the prepared parameters" } else { "" }
    );
    let name_with = format!("{name}_with");
    [
        // First what the other one calls.
        item(doc_with, &name_with, with.collect(), computed(model, built, prepared, &needed, &used)),
        item(doc, &name, plain.collect(), called),
    ]
}

/// The documentation of a function.
fn doc(names: &Names, built: &FunctionGraph) -> String {
    let text = names.words(&docs::function(built));
    if is_number(built) {
        return text;
    }
    let by_row = if is_matrix(built) { ", row by row" } else { "" };
    text.replacen("\n\nReturns ", &format!("\n* `result`{by_row}: "), 1)
}

/// The argument that takes the result; none where it is a number, which is returned.
fn returned(names: &Names, built: &FunctionGraph) -> Option<String> {
    let (rows, columns) = built.function.size();
    let (n, m) = (names.size(rows), names.size(columns));
    let size = match (rows, columns) {
        _ if is_number(built) => return None,
        (Size::Fixed(1), _) => format!("[{m}]"),
        (_, Size::Fixed(1)) => format!("[{n}]"),
        _ => format!("[{n}][{m}]"),
    };
    Some(format!("{}_real result{size}", names.prefix))
}

/// The body of the function that takes q and the parameters.
fn called(
    names: &Names,
    name: &str,
    model: &Model,
    built: &FunctionGraph,
    others: &[Argument],
    used: &BTreeSet<Input>,
) -> Vec<String> {
    let prefix = &names.prefix;
    let lines = positions::lines(model, used, "trig.");
    let mut body = Vec::new();
    if lines.is_empty() {
        // Nothing of it is read.
        let zeros = |count: usize| vec!["(real)0.0"; count].join(", ");
        let (angles, joints) = (zeros(model.angles().taken().len()), zeros(model.arm().dof()));
        body.push(format!(
            "const {prefix}_trig trig = {{ {{ {angles} }}, {{ {angles} }}, {{ {joints} }} }};"
        ));
    } else {
        body.push(format!("{prefix}_trig trig;"));
    }
    let takes_parameters = others.contains(&Argument::Parameters);
    if takes_parameters {
        body.push(format!("{prefix}_prepared prepared;"));
    }
    if lines.is_empty() {
        body.push("(void)q;".to_string());
    }
    body.extend(lines);
    if takes_parameters {
        body.push(format!("{prefix}_prepare(parameters, &prepared);"));
    }
    let passed = others.iter().map(|a| match a {
        Argument::Parameters => ", &prepared".to_string(),
        other => format!(", {}", other.name()),
    });
    let passed: String = passed.collect();
    body.push(match is_number(built) {
        true => format!("return {name}_with(&trig{passed});"),
        false => format!("{name}_with(&trig{passed}, result);"),
    });
    body
}

/// The body of the function that computes.
fn computed(
    model: &Model,
    built: &FunctionGraph,
    prepared: usize,
    needed: &[usize],
    used: &BTreeSet<Input>,
) -> Vec<String> {
    let mut body = SYNTAX.of_trig(model, used);
    if body.is_empty() {
        body.push("(void)trig;".to_string());
    }
    for argument in built.arguments().filter(|a| *a != Argument::Positions) {
        let read = SYNTAX.of_argument(built, argument, prepared, used);
        if read.is_empty() {
            let name = if argument == Argument::Parameters { "prepared" } else { argument.name() };
            body.push(format!("(void){name};"));
        }
        body.extend(read);
    }
    let form = Form::of(built, needed);
    body.extend(SYNTAX.statements(model, &built.graph, needed, &form));
    body.extend(results(built, &form));
    body
}

/// The lines that write the result.
fn results(built: &FunctionGraph, form: &Form) -> Vec<String> {
    let columns = built.shape.1;
    let line = |entry: usize| {
        let (is_negative, name) = statement::result(built, form, entry);
        let sign = if is_negative { "-" } else { "" };
        let (i, j) = (entry / columns, entry % columns);
        match () {
            () if is_number(built) => format!("return {sign}{name};"),
            () if is_matrix(built) => format!("result[{i}][{j}] = {sign}{name};"),
            () => format!("result[{entry}] = {sign}{name};"),
        }
    };
    (0..built.outputs.len()).map(line).collect()
}

/// The function that makes of the parameters what the functions need of them alone.
pub(super) fn prepare(names: &Names, model: &Model, preparation: &Preparation) -> Item {
    let prefix = &names.prefix;
    let graph = preparation.graph();
    let needed = graph.needed(preparation.values());
    let mut body = SYNTAX.of_parameters(&graph, &needed);
    body.extend(SYNTAX.statements(model, &graph, &needed, &Form::plain(&graph)));
    let values = preparation.values().iter().enumerate();
    body.extend(
        values.map(|(k, e)| format!("prepared->values[{k}] = {};", statement::value_name(&graph, e.node()))),
    );
    if body.is_empty() {
        body = vec!["(void)parameters;".to_string(), "prepared->values[0] = (real)0.0;".to_string()];
    }
    let operations = preparation.operations();
    let doc = format!(
        "What the functions need of the parameters alone: for those that end in `_with`.\n\n\
        * `parameters`: {}\n\nOperations: {} multiplications, {} additions.",
        names.words(Argument::Parameters.meaning()),
        operations.mul,
        operations.add
    );
    let prototype = format!(
        "void {prefix}_prepare(\n    {},\n    {prefix}_prepared *prepared)",
        names.array(Argument::Parameters)
    );
    Item::Function { doc, prototype, body }
}
