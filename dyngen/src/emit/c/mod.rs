//! Generated functions as C99, a source file and its header, from the statements that the file in Rust is
//! printed from; and with kernels around them as CUDA.

mod cuda;
mod friction;
mod function;
mod positions;

pub use cuda::cuda_source;

use super::names::Names;
use super::syntax::Syntax;
use super::{Options, Parts, docs, fused, rounded};
use crate::arm::JointKind;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::{Argument, Size};
use crate::graph::Preparation;
use crate::model::{Error, Model};
use std::fmt::Display;

/// A source file in C and its header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CFiles {
    /// The text of the `.h`.
    pub header: String,
    /// The text of the `.c`.
    pub source: String,
}

/// A generated file in C; `header` is the name by which it includes its header. Its results are those of the
/// file in Rust to the bit.
///
/// # Errors
/// As [`super::source`].
pub fn c_files(model: &Model, options: &Options, header: &str) -> Result<CFiles, Error> {
    let parts = Parts::new(model, options)?;
    let names = Names::new(&model.arm().name);
    let items = items(&names, model, options, &parts, None);
    let condition = if options.contract { fused::CONDITION } else { "" };
    let head = |rounded: &[String]| head(&names, model, options, rounded);
    Ok(CFiles {
        header: names.header(&head(&[]), &items),
        source: names.source(
            &head(&rounded::lines(model, &parts)),
            &(condition.to_string() + &helpers(&names, model, options, false)),
            header,
            &items,
        ),
    })
}

/// What is written behind a function, of its name and its graph.
type Behind = fn(&Names, &str, &FunctionGraph) -> Item;

/// What a file holds, in its order.
fn items(
    names: &Names,
    model: &Model,
    options: &Options,
    parts: &Parts<'_>,
    behind: Option<Behind>,
) -> Vec<Item> {
    let mut items = constants(names, model, parts, options);
    items.extend(positions::trig(names, model));
    if parts.takes_parameters() {
        items.extend(preparation(names, model, &parts.preparation));
    }
    let prepared = parts.preparation.values().len();
    for (frame, built) in parts.all() {
        items.extend(function::items(names, frame, model, built, prepared));
        items.extend(behind.map(|item| item(names, &names.function(frame, built.function), built)));
    }
    items.extend(friction::items(names, &options.friction, model.arm()));
    items
}

/// A thing in C.
enum Item {
    /// Macros and types, with their documentation.
    Declared(String),
    /// An array of constants.
    Constants {
        doc: String,
        declared: String,
        values: Vec<String>,
    },
    Function {
        doc: String,
        prototype: String,
        body: Vec<String>,
    },
}

impl Item {
    /// What the header says of it.
    fn declaration(&self) -> String {
        match self {
            Item::Declared(text) => text.clone(),
            Item::Constants { doc, declared, .. } => format!("{}extern {declared};\n", documentation(doc)),
            Item::Function { doc, prototype, .. } => format!("{}{prototype};\n", documentation(doc)),
        }
    }

    /// What stands in the source file.
    fn definition(&self) -> Option<String> {
        match self {
            Item::Declared(_) => None,
            Item::Constants { declared, values, .. } => {
                Some(format!("{declared} = {{\n    {}\n}};\n", values.join(",\n    ")))
            }
            Item::Function { prototype, body, .. } => {
                let body: String = body.iter().map(|line| format!("    {line}\n")).collect();
                Some(format!("{prototype}\n{{\n{body}}}\n"))
            }
        }
    }
}

impl Names {
    fn size(&self, size: Size) -> String {
        match size {
            Size::Joints => format!("{}_JOINTS", self.upper),
            Size::Parameters => format!("{}_PARAMETERS", self.upper),
            Size::Fixed(length) => length.to_string(),
        }
    }

    /// `const NAME_real q[NAME_JOINTS]`
    fn array(&self, argument: Argument) -> String {
        format!("const {}_real {}[{}]", self.prefix, argument.name(), self.size(argument.size()))
    }

    fn header(&self, head: &str, items: &[Item]) -> String {
        let upper = &self.upper;
        let declarations: String = items.iter().map(|item| format!("{}\n", item.declaration())).collect();
        format!(
            "{head}#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern \"C\" {{
#endif

/** The numbers: double, or float where {upper}_FLOAT is defined (as by -D{upper}_FLOAT), for the source file
 * and for every file that includes this one.
 */
{}
{declarations}#ifdef __cplusplus
}}
#endif

#endif
",
            self.numbers()
        )
    }

    /// The type of the numbers.
    fn numbers(&self) -> String {
        let Names { prefix, upper } = self;
        format!(
            "#ifdef {upper}_FLOAT
typedef float {prefix}_real;
#else
typedef double {prefix}_real;
#endif
"
        )
    }

    fn source(&self, head: &str, helpers: &str, header: &str, items: &[Item]) -> String {
        let Names { prefix, upper } = self;
        let definitions: Vec<String> = items.iter().filter_map(Item::definition).collect();
        format!(
            "{head}#include \"{header}\"

#include <float.h>
#include <math.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error \"sums must be rounded as they are written: compile without -ffast-math\"
#endif
#ifdef FLT_EVAL_METHOD
#if (FLT_EVAL_METHOD != 0) && (FLT_EVAL_METHOD != 16)
#error \"numbers must be rounded to their own type: with 32-bit x86 compile with -msse2 -mfpmath=sse\"
#endif
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

typedef {prefix}_real real;

{}{}",
            helpers.replace("NAME", upper),
            definitions.join("\n")
        )
    }
}

/// The comment at the head of both files; `rounded` are the lines of constants.
fn head(names: &Names, model: &Model, options: &Options, rounded: &[String]) -> String {
    let upper = &names.upper;
    let needs = [
        "Needs: C99 (or C++) and <math.h>. -ffp-contract=off gives the same bits on every machine, and those \
        of the",
        "file in Rust.",
        "Every function is proven equal to the Lagrangian of the arm; none allocates. A result may be \
        written over an",
        "argument. Matrices are arrays of rows: result[i][j].",
    ];
    let contracted = fused::C.map(|line| line.replace("NAME", upper));
    let lines = docs::head_lines(model, options, &needs, &contracted.each_ref().map(String::as_str));
    let sizes = format!("Arrays have the lengths that {upper}_JOINTS and {upper}_PARAMETERS say.");
    comment(
        "/*",
        lines.iter().map(String::as_str).chain([sizes.as_str()]).chain(rounded.iter().map(String::as_str)),
    ) + "\n"
}

/// Lines as a comment.
fn comment(open: &str, lines: impl Iterator<Item = impl Display>) -> String {
    let lines: Vec<String> =
        lines.map(|line| line.to_string().replace("*/", "* /").replace("/*", "/ *")).collect();
    let end = if lines.len() > 1 { "\n */" } else { " */" };
    let text = lines.join("\n * ").replace(" * \n", " *\n");
    format!("{open} {text}{end}\n")
}

/// A text as a comment for the documentation; lists with the dash of comments in C.
fn documentation(text: &str) -> String {
    comment("/**", text.replace("\n* ", "\n- ").lines())
}

/// What functions of the source file call.
fn helpers(names: &Names, model: &Model, options: &Options, is_cuda: bool) -> String {
    let turns = model.arm().joints.iter().any(|joint| joint.kind == JointKind::Revolute);
    let trigonometry = if turns { dyngen_verify::text::TRIGONOMETRY_C } else { "" };
    let friction = friction::helpers(&options.friction);
    let parts = [trigonometry, &friction]
        .map(|text| if text.is_empty() { String::new() } else { format!("{text}\n") });
    let fused = if options.contract { fused::IN_C } else { "" };
    let has_roots = model.arm().linkages().next().is_some();
    let root = if has_roots { dyngen_verify::text::root_in_c(is_cuda) } else { String::new() };
    (fused.to_string() + &root + &parts.concat()).replace("NAME", &names.upper)
}

const SYNTAX: Syntax = Syntax { value: "const real", field: "->", number, fused: "fused", root: "root" };

/// A number: rounded to double, then to the file's numbers, as in Rust.
fn number(x: f64) -> String {
    format!("(real){x:?}")
}

/// Text between quotes. Two question marks in a row would begin a trigraph.
fn quoted(text: &str) -> String {
    let escaped = |c: char| match c {
        '"' | '\\' | '?' => format!("\\{c}"),
        c if c.is_ascii_control() => format!("\\{:03o}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// How many joints and parameters there are, their names, and values that are baked in.
fn constants(names: &Names, model: &Model, parts: &Parts<'_>, options: &Options) -> Vec<Item> {
    let Names { prefix, upper } = names;
    let (joints, parameters) = (model.arm().dof(), parts.set.parameters.len());
    let angles = model.angles().taken().len();
    let mut items = vec![Item::Declared(format!(
        "/** Number of joints. */
#define {upper}_JOINTS {joints}
/** Number of parameters. */
#define {upper}_PARAMETERS {parameters}
/** Angles of a {prefix}_trig: those of the joints, then sums across parallel axes. */
#define {upper}_ANGLES {angles}
"
    ))];
    let mut array = |kind: &str, name: &str, length: &str, doc: &str, values: Vec<String>| {
        let declared = format!("{kind}{prefix}_{name}[{upper}_{length}]");
        items.push(Item::Constants { doc: doc.to_string(), declared, values });
    };
    let text = |names: Vec<String>| names.iter().map(|name| quoted(name)).collect::<Vec<_>>();
    if model.arm().has_joint_names() {
        let doc =
            "The joints' names, in the order of q; where the arm file gives none, the joint's number from 1.";
        array("const char *const ", "joint_names", "JOINTS", doc, text(model.arm().joint_names()));
    }
    let doc = docs::parameters(parts.set);
    array("const char *const ", "parameter_names", "PARAMETERS", &doc, text(parts.set.names()));
    if let Some(values) = &options.values {
        let doc = "The parameters' values that are baked into the functions, SI units.";
        let values = values.iter().map(|x| format!("{x:?}")).collect();
        array("const double ", "parameter_values", "PARAMETERS", doc, values);
    }
    items
}

/// What functions need of the parameters alone: the struct that holds it, and the function that prepares it.
fn preparation(names: &Names, model: &Model, preparation: &Preparation) -> [Item; 2] {
    let Names { prefix, .. } = names;
    // There is no array without elements.
    let count = preparation.values().len().max(1);
    let doc = documentation(&format!(
        "Sums of the parameters as the functions use them; {prefix}_prepare makes them once for any\n\
        number of calls."
    ));
    let prepared = Item::Declared(format!(
        "{doc}typedef struct {{\n    {prefix}_real values[{count}];\n}} {prefix}_prepared;\n"
    ));
    [prepared, function::prepare(names, model, preparation)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_ends_a_text_or_a_comment() {
        assert_eq!(quoted("a\"b\\c\n??/"), r#""a\"b\\c\012\?\?/""#);
        assert_eq!(documentation("a */ b /* c"), "/** a * / b / * c */\n");
    }
}
