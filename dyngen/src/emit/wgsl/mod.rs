//! The emitted functions in WGSL, the language of WebGPU, from the statements that the file in Rust is
//! printed from; and entry points that call them for many states.

mod entry;

use super::angles::{all_inputs, shifted_docs, sum_docs, turns};
use super::lanes::used;
use super::names::Names;
use super::statement::{self, Form, is_matrix, is_number};
use super::syntax::Syntax;
use super::{Options, Parts, docs, fused, rounded};
use crate::arm::JointKind;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::graph::Input;
use crate::model::{Error, Model};

const SYNTAX: Syntax = Syntax { value: "let", field: ".", number, fused: "fma", root: "sqrt" };

/// A number: its digits are those of the file in Rust.
fn number(x: f64) -> String {
    format!("{x:?}f")
}

/// A generated module in WGSL, in single precision, which is all that the language has.
///
/// # Errors
/// As [`super::source`].
pub fn wgsl_source(model: &Model, options: &Options) -> Result<String, Error> {
    let parts = Parts::new(model, options)?;
    let names = Names::new(&model.arm().name);
    let mut items = vec![constants(&names, model, &parts, options), entry::bindings(&names, &parts)];
    if model.arm().joints.iter().any(|joint| joint.kind == JointKind::Revolute) {
        items.push(dyngen_verify::text::TRIGONOMETRY_WGSL.to_string());
    }
    items.push(trig(&names, model));
    if parts.takes_parameters() {
        items.push(prepare(&names, model, &parts));
    }
    for (frame, built) in parts.all() {
        let name = names.function(frame, built.function);
        items.extend(functions(&names, &name, frame, model, built, &parts));
        items.push(entry::point(&names, &name, built));
    }
    Ok(format!("{}\n{}", head(model, options, &rounded::lines(model, &parts)), items.join("\n")))
}

/// The comment at the head; `rounded` are the lines of constants.
fn head(model: &Model, options: &Options, rounded: &[String]) -> String {
    let needs = [
        "Needs: WGSL. Numbers are f32, since the language has no f64. A compiler may contract and reorder \
        sums, so",
        "results are close to those of the file in C with floats and need not have their bits.",
        "Every function is proven equal to the Lagrangian of the arm. Matrices are arrays, row by row.",
        "Entry points end in _batch: one invocation a state, in workgroups of 64, in a grid of one or two \
        dimensions.",
        "Arrays over count states are one behind the other: entry k of state s is at [k * count + s]. The \
        parameters",
        "are one array for all states. An entry point needs the bindings that its comment names and no \
        other.",
    ];
    comment(docs::head_lines(model, options, &needs, &fused::WGSL).iter().chain(rounded).map(String::as_str))
}

/// Lines as comments.
fn comment<'l>(lines: impl Iterator<Item = &'l str>) -> String {
    lines.map(|line| format!("// {line}").trim_end().to_string() + "\n").collect()
}

/// The documentation of an item, with what stands behind it in other languages' files.
fn documentation(text: &str) -> String {
    comment(text.replace("[`PARAMETER_NAMES`]", "the list above").lines())
}

/// Items of an array, one a line.
fn array(entries: impl ExactSizeIterator<Item = String>, indent: &str) -> String {
    let length = entries.len();
    let lines: String = entries.map(|entry| format!("{indent}    {entry},\n")).collect();
    format!("array<f32, {length}>(\n{lines}{indent})")
}

/// How many joints and parameters there are, their names, and values that are baked in.
fn constants(names: &Names, model: &Model, parts: &Parts<'_>, options: &Options) -> String {
    let Names { prefix, upper } = names;
    let arm = model.arm();
    let listed = |name: &str, of: Vec<String>| {
        let line =
            |(k, text): (usize, &String)| format!("{name}[{k}]: {}", text.replace(char::is_control, " "));
        comment(of.iter().enumerate().map(line).collect::<Vec<_>>().iter().map(String::as_str))
    };
    let joints = if arm.has_joint_names() { listed("joint_names", arm.joint_names()) } else { String::new() };
    let (count, angles) = (parts.set.parameters.len(), model.angles().taken().len());
    let values = options.values.as_ref().map_or(String::new(), |values| {
        let doc = documentation("The parameters' values that are baked into the functions, SI units.");
        let values = array(values.iter().map(|x| number(*x)), "");
        format!("\n{doc}const {prefix}_parameter_values = {values};\n")
    });
    format!(
        "// Number of joints.\n{joints}const {upper}_JOINTS: u32 = {}u;\n\n{}//\n\
         {}const {upper}_PARAMETERS: u32 = {count}u;\n\n\
         // Angles of a {prefix}_trig: those of the joints, then sums across parallel axes.\n\
         const {upper}_ANGLES: u32 = {angles}u;\n{values}",
        arm.dof(),
        documentation(&docs::parameters(parts.set)),
        listed("parameter_names", parts.set.names()),
    )
}

/// The struct of sines and cosines, and the function that computes it.
fn trig(names: &Names, model: &Model) -> String {
    let prefix = &names.prefix;
    let extra = shifted_docs(model).into_iter().chain(sum_docs(model));
    let doc: String = extra.map(|line| format!("\n{}", line.trim_start())).collect();
    let taken = || model.angles().taken().iter().enumerate();
    let computed: String = taken()
        .filter(|(_, sum)| turns(model, **sum))
        .map(|(k, sum)| format!("    let angle{} = sin_cos({});\n", k + 1, SYNTAX.angle(model, *sum)))
        .collect();
    let of_angles = |part: &str| {
        let entries = taken().map(|(k, sum)| match turns(model, *sum) {
            true => format!("angle{}.{part}", k + 1),
            false => number(0.0),
        });
        array(entries, "        ")
    };
    let read = all_inputs(model);
    let (angles, joints) = (taken().len(), model.arm().dof());
    let positions = (0..joints).map(|i| match read.contains(&Input::Position(i)) {
        true => format!("q[{i}]"),
        false => number(0.0),
    });
    format!(
        "{}struct {prefix}_trig {{
    // Sine of each angle; not read for prismatic joints.
    sin: array<f32, {angles}>,
    // Cosine of each angle; not read for prismatic joints.
    cos: array<f32, {angles}>,
    // Position of each prismatic joint, m; not read for revolute joints.
    position: array<f32, {joints}>,
}}

{}fn {prefix}_trig_of(q: array<f32, {joints}>) -> {prefix}_trig {{
{computed}    return {prefix}_trig(
        {},
        {},
        {},
    );
}}
",
        documentation(&format!(
            "Joint positions with their sines and cosines. Angle k has the index k - 1.{doc}"
        )),
        documentation(
            "Sines and cosines of joint positions.\n\n* `q`: joint positions, rad (m where prismatic)"
        ),
        of_angles("x"),
        of_angles("y"),
        array(positions, "        ")
    )
}

/// What functions need of the parameters alone: the struct that holds it, and the function that prepares it.
fn prepare(names: &Names, model: &Model, parts: &Parts<'_>) -> String {
    let prefix = &names.prefix;
    let preparation = &parts.preparation;
    let graph = preparation.graph();
    let needed = graph.needed(preparation.values());
    let form = Form::plain(&graph);
    let lines = [SYNTAX.of_parameters(&graph, &needed), SYNTAX.statements(model, &graph, &needed, &form)];
    let body: String = lines.concat().iter().map(|line| format!("    {line}\n")).collect();
    let mut values: Vec<String> =
        preparation.values().iter().map(|e| statement::value_name(&graph, e.node())).collect();
    if values.is_empty() {
        // There is no array without elements.
        values = vec![number(0.0)];
    }
    let count = values.len();
    format!(
        "{}struct {prefix}_prepared {{
    values: array<f32, {count}>,
}}

{}fn {prefix}_prepare(parameters: array<f32, {}>) -> {prefix}_prepared {{
{body}    return {prefix}_prepared({});
}}
",
        documentation("Sums of the parameters as the functions use them."),
        documentation(&format!(
            "What the functions need of the parameters alone.\n\n* `parameters`: {}",
            Argument::Parameters.meaning()
        )),
        parts.set.parameters.len(),
        array(values.into_iter(), "    ")
    )
}

/// A function's items: one that takes what was made of q and of the parameters, and one that takes those.
fn functions(
    names: &Names,
    name: &str,
    frame: Option<&str>,
    model: &Model,
    built: &FunctionGraph,
    parts: &Parts<'_>,
) -> [String; 2] {
    let prefix = &names.prefix;
    let needed = built.graph.needed(&built.outputs);
    let used = used(built, &needed);
    let others: Vec<Argument> = built.arguments().filter(|a| *a != Argument::Positions).collect();
    let result = result(built);
    let length = |a: &Argument| a.length(built.joints, parts.set.parameters.len());
    let typed = |a: &Argument| format!("{}: array<f32, {}>", a.name(), length(a));
    let with = others.iter().map(|a| match a {
        Argument::Parameters => format!("prepared: {prefix}_prepared"),
        other => typed(other),
    });
    let with: Vec<String> = std::iter::once(format!("trig: {prefix}_trig")).chain(with).collect();
    let plain: Vec<String> = [Argument::Positions].iter().chain(&others).map(typed).collect();
    let form = Form::of(built, &needed);
    let mut body = SYNTAX.of_trig(model, &used);
    for argument in &others {
        body.extend(SYNTAX.of_argument(built, *argument, parts.preparation.values().len(), &used));
    }
    body.extend(SYNTAX.statements(model, &built.graph, &needed, &form));
    let body: String = body.iter().map(|line| format!("    {line}\n")).collect();
    let passed = others.iter().map(|a| match a {
        Argument::Parameters => format!(", {prefix}_prepare(parameters)"),
        other => format!(", {}", other.name()),
    });
    [
        format!(
            "{}fn {name}_with({}) -> {result} {{\n{body}    return {};\n}}\n",
            documentation(&format!("{name} of what was made of its arguments once.")),
            with.join(", "),
            value(built, &form)
        ),
        format!(
            "{}fn {name}({}) -> {result} {{\n    return {name}_with({prefix}_trig_of(q){});\n}}\n",
            documentation(&doc(built, frame)),
            plain.join(", "),
            passed.collect::<String>()
        ),
    ]
}

/// The documentation of a function.
fn doc(built: &FunctionGraph, frame: Option<&str>) -> String {
    let at =
        frame.map(|frame| format!("At the frame `{frame}` of the arm file, in place of the tool's.\n\n"));
    let by_row = if is_matrix(built) { "Returns row by row: " } else { "Returns " };
    at.unwrap_or_default() + &docs::function(built).replacen("\n\nReturns ", &format!("\n\n{by_row}"), 1)
}

/// The type of a function's result.
fn result(built: &FunctionGraph) -> String {
    if is_number(built) { "f32".to_string() } else { format!("array<f32, {}>", built.outputs.len()) }
}

/// A function's result.
fn value(built: &FunctionGraph, form: &Form) -> String {
    let mut entries = (0..built.outputs.len()).map(|entry| {
        let (is_negative, name) = statement::result(built, form, entry);
        if is_negative { format!("-{name}") } else { name }
    });
    match is_number(built) {
        true => entries.next().unwrap_or_default(),
        false => array(entries, "    "),
    }
}
