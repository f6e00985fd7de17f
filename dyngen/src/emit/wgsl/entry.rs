//! Entry points, one a function, and the buffers that they share.

use super::documentation;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::emit::Parts;
use crate::emit::names::Names;
use crate::emit::statement::is_number;
use std::collections::BTreeMap;

/// Invocations of a workgroup.
const WORKGROUP: usize = 64;

/// Where an argument is bound, from 1: at the same place for every function, in the order of the arguments.
fn binding(argument: Argument) -> usize {
    argument as usize + 1
}

/// Where results are bound: behind every argument.
const RESULT: usize = Argument::Parameters as usize + 2;

/// The variables that are bound to buffers: how many states there are, what functions take, and the result.
pub(super) fn bindings(names: &Names, parts: &Parts<'_>) -> String {
    let prefix = &names.prefix;
    let taken: BTreeMap<usize, Argument> =
        parts.all().flat_map(|(_, built)| built.arguments()).map(|a| (binding(a), a)).collect();
    let parameters = parts.set.parameters.len();
    let inputs = taken.iter().map(|(at, argument)| {
        let length = match argument {
            Argument::Parameters => format!(", {parameters}"),
            _ => String::new(),
        };
        let meaning = documentation(&format!("`{}`: {}", argument.name(), argument.meaning()));
        let name = argument.name();
        format!("{meaning}@group(0) @binding({at}) var<storage, read> {prefix}_{name}: array<f32{length}>;\n")
    });
    format!(
        "// How many states there are.\n@group(0) @binding(0) var<uniform> {prefix}_count: u32;\n\
         {}// The result of whichever function is called.\n\
         @group(0) @binding({RESULT}) var<storage, read_write> {prefix}_result: array<f32>;\n",
        inputs.collect::<String>()
    )
}

/// The entry point of a function.
pub(super) fn point(names: &Names, name: &str, built: &FunctionGraph) -> String {
    let prefix = &names.prefix;
    let arguments: Vec<Argument> = built.arguments().collect();
    let bound: Vec<String> = arguments.iter().map(|a| format!("{} {}", binding(*a), a.name())).collect();
    let passed = arguments.iter().map(|argument| {
        let name = argument.name();
        if *argument == Argument::Parameters {
            return format!("            {prefix}_{name},\n");
        }
        let length = argument.length(built.joints, built.parameters);
        let entries = (0..length).map(|k| format!("{prefix}_{name}[{k}u * count + state]"));
        format!("            {},\n", super::array(entries, "            "))
    });
    let passed: String = passed.collect();
    let stores: String = match is_number(built) {
        true => format!("        {prefix}_result[state] = result;\n"),
        false => (0..built.outputs.len())
            .map(|k| format!("        {prefix}_result[{k}u * count + state] = result[{k}];\n"))
            .collect(),
    };
    format!(
        "{}@compute @workgroup_size({WORKGROUP})
fn {name}_batch(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {{
    let count = {prefix}_count;
    let state = id.y * groups.x * {WORKGROUP}u + id.x;
    if (state < count) {{
        let result = {name}(
{passed}        );
{stores}    }}
}}
",
        documentation(&format!(
            "{name} of many states. Bindings: 0 count, {}, {RESULT} result.",
            bound.join(", ")
        ))
    )
}
