//! The functions in C once more as functions of a GPU's threads in CUDA, each with a kernel that calls it for
//! many states.

use super::{Item, Names, comment, documentation, helpers, items};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::emit::statement::{is_matrix, is_number};
use crate::emit::{Options, Parts, docs, fused, rounded};
use crate::model::{Error, Model};
use dyngen_verify::text::BEFORE_CUDA;

/// A generated file in CUDA. Compiled without contraction its results are those of the file in C to the bit.
///
/// # Errors
/// As [`crate::emit::source`].
pub fn cuda_source(model: &Model, options: &Options) -> Result<String, Error> {
    let parts = Parts::new(model, options)?;
    let names = Names::new(&model.arm().name);
    let items = items(&names, model, options, &parts, Some(kernel));
    let items: Vec<String> = items.iter().map(text).collect();
    Ok(format!(
        "{}{BEFORE_CUDA}
/** The numbers: double, or float where {}_FLOAT is defined (as by -D{}_FLOAT). */
{}
typedef {}_real real;

{}{}",
        head(&names, model, options, &rounded::lines(model, &parts)),
        names.upper,
        names.upper,
        names.numbers(),
        names.prefix,
        helpers(&names, model, options, true).replace("\nstatic ", "\nstatic __device__ "),
        items.join("\n")
    ))
}

/// The comment at the head; `rounded` are the lines of constants.
fn head(names: &Names, model: &Model, options: &Options, rounded: &[String]) -> String {
    let needs = [
        "Needs: CUDA (nvcc or NVRTC) with --fmad=false, which gives the bits of the file in C. Without it \
        products",
        "and sums are contracted, and results differ in their last digits.",
        "Every function is proven equal to the Lagrangian of the arm; none allocates. Matrices are arrays of \
        rows:",
        "result[i][j].",
        "Kernels end in _batch: one thread a state, in a grid of one dimension. Arrays over count states are \
        one",
        "behind the other: entry k of state s is at [k * count + s], entries of matrices row by row. The \
        parameters",
        "are one array for all states. A result may be written over an argument of the same length.",
    ];
    let lines = docs::head_lines(model, options, &needs, &fused::CUDA);
    let sizes = format!("Arrays have the lengths that {0}_JOINTS and {0}_PARAMETERS say.", names.upper);
    comment("/*", lines.iter().chain([&sizes]).chain(rounded)) + "\n"
}

/// An item in a file without a header; inline, because not all of them are called or read.
fn text(item: &Item) -> String {
    let (doc, qualifier) = match item {
        Item::Declared(text) => return text.clone(),
        Item::Constants { doc, .. } => (doc, "inline"),
        Item::Function { doc, .. } => (doc, "inline __device__"),
    };
    format!("{}{qualifier} {}", documentation(doc), item.definition().unwrap_or_default())
}

/// The kernel of a function.
fn kernel(names: &Names, name: &str, built: &FunctionGraph) -> Item {
    let arguments: Vec<Argument> = built.arguments().collect();
    let taken = arguments.iter().map(|a| format!("    const {}_real *{},\n", names.prefix, a.name()));
    let of_state = |a: &&Argument| **a != Argument::Parameters;
    let read = arguments.iter().filter(of_state).map(|a| {
        let (name, length) = (a.name(), a.length(built.joints, built.parameters));
        let entries: String =
            (0..length).map(|k| format!("            {name}[{k} * count + state],\n")).collect();
        format!("        const real {name}_of[{length}] = {{\n{entries}        }};\n")
    });
    let passed: Vec<String> = arguments
        .iter()
        .map(|a| if of_state(&a) { format!("{}_of", a.name()) } else { a.name().to_string() })
        .collect();
    Item::Declared(format!(
        "{}extern \"C\" __global__ void {name}_batch(
    size_t count,
{}    {}_real *result)
{{
    const size_t state = (size_t)blockIdx.x * blockDim.x + threadIdx.x;
    if (state < count) {{
{}{}    }}
}}
",
        documentation(&format!("{name} of `count` states, one thread each.")),
        taken.collect::<String>(),
        names.prefix,
        read.collect::<String>(),
        written(name, built, &passed.join(", "))
    ))
}

/// The lines of a kernel that call the function and write its result.
fn written(name: &str, built: &FunctionGraph, passed: &str) -> String {
    let (rows, columns) = built.shape;
    let entry = |k: usize| match is_matrix(built) {
        true => format!("[{}][{}]", k / columns, k % columns),
        false => format!("[{k}]"),
    };
    let shape =
        if is_matrix(built) { format!("[{rows}][{columns}]") } else { format!("[{}]", rows * columns) };
    if is_number(built) {
        return format!("        result[state] = {name}({passed});\n");
    }
    let stores = (0..rows * columns)
        .map(|k| format!("        result[{k} * count + state] = result_of{};\n", entry(k)));
    format!(
        "        real result_of{shape};\n        {name}({passed}, result_of);\n{}",
        stores.collect::<String>()
    )
}
