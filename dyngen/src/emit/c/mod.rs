//! Generated functions as C99: a source file and its header, from the statements that the file in Rust is
//! printed from.

mod friction;
mod function;
mod positions;

use super::{Options, Parts, docs, rounded};
use crate::arm::JointKind;
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

/// A generated file in C; `header` is the name by which it includes its header. Its results are those of the file in
/// Rust to the bit.
///
/// # Errors
/// As [`super::source`].
pub fn c_files(model: &Model, options: &Options, header: &str) -> Result<CFiles, Error> {
    let parts = Parts::new(model, options)?;
    let names = Names::new(&model.arm().name);
    let mut items = constants(&names, model, &parts, options);
    items.push(positions::trig(&names, model));
    if parts.takes_parameters() {
        items.extend(preparation(&names, model, &parts.preparation));
    }
    let prepared = parts.preparation.values().len();
    let own = parts.functions.iter().map(|built| (None, built));
    let at =
        parts.frames.iter().flat_map(|(frame, f)| f.iter().map(move |built| (Some(frame.as_str()), built)));
    for (frame, built) in own.chain(at) {
        items.extend(function::items(&names, frame, model, built, prepared));
    }
    items.extend(friction::items(&names, &options.friction, model.arm()));
    let head = |rounded: &[String]| head(&names, model, options, rounded);
    Ok(CFiles {
        header: names.header(&head(&[]), &items),
        source: names.source(
            &head(&rounded::lines(model, &parts)),
            &helpers(&names, model, options),
            header,
            &items,
        ),
    })
}

/// A thing in C: its declaration in the header, and its definition in the source file.
struct Item {
    declaration: String,
    definition: String,
}

/// How an arm's things are called.
struct Names {
    /// Before every name.
    prefix: String,
    /// Before every macro.
    upper: String,
}

impl Names {
    /// The arm's name in lowercase letters, digits and `_`; `arm_` before a digit.
    fn new(arm: &str) -> Names {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' };
        let text: String = arm.chars().map(plain).collect();
        let mut prefix = text.split_whitespace().collect::<Vec<_>>().join("_");
        if !prefix.starts_with(|c: char| c.is_ascii_lowercase()) {
            prefix = format!("arm_{prefix}").trim_end_matches('_').to_string();
        }
        Names { upper: prefix.to_uppercase(), prefix }
    }

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

    /// What the documentation in Rust says, with the names in C.
    fn words(&self, text: &str) -> String {
        let names = [
            ("[`PARAMETER_NAMES`]", "`NAME_parameter_names`"),
            ("[`friction_columns`]", "`NAME_friction_columns`"),
            ("`MOTOR_VELOCITIES[", "`NAME_motor_velocities["),
        ];
        names
            .iter()
            .fold(text.to_string(), |text, (rust, c)| text.replace(rust, &c.replace("NAME", &self.prefix)))
    }

    fn header(&self, head: &str, items: &[Item]) -> String {
        let Names { prefix, upper } = self;
        let declarations: String = items.iter().map(|item| format!("{}\n", item.declaration)).collect();
        format!(
            "{head}#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern \"C\" {{
#endif

/** The numbers: double, or float where {upper}_FLOAT is defined (as by -D{upper}_FLOAT), for the source file
 * and for every file that includes this one.
 */
#ifdef {upper}_FLOAT
typedef float {prefix}_real;
#else
typedef double {prefix}_real;
#endif

{declarations}#ifdef __cplusplus
}}
#endif

#endif
"
        )
    }

    fn source(&self, head: &str, helpers: &str, header: &str, items: &[Item]) -> String {
        let Names { prefix, upper } = self;
        let definitions: Vec<&str> =
            items.iter().map(|item| item.definition.as_str()).filter(|text| !text.is_empty()).collect();
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
        "Needs: C99 (or C++) and <math.h>. -ffp-contract=off gives the same bits on every machine, and those of the",
        "file in Rust.",
        "Every function is proven equal to the Lagrangian of the arm; none allocates. A result may be written over an",
        "argument. Matrices are arrays of rows: result[i][j].",
    ];
    let lines = docs::head_lines(model, options, &needs);
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
fn helpers(names: &Names, model: &Model, options: &Options) -> String {
    let turns = model.arm().joints.iter().any(|joint| joint.kind == JointKind::Revolute);
    let trigonometry = if turns { include_str!("trigonometry.c") } else { "" };
    let friction = friction::helpers(&options.friction);
    let parts = [trigonometry, &friction]
        .map(|text| if text.is_empty() { String::new() } else { format!("{text}\n") });
    parts.concat().replace("NAME", &names.upper)
}

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
    let mut items = vec![Item {
        declaration: format!(
            "/** Number of joints. */\n#define {upper}_JOINTS {joints}\n/** Number of parameters. */\n\
             #define {upper}_PARAMETERS {parameters}\n"
        ) + &format!(
            "/** Angles of a {prefix}_trig: those of the joints, then sums across parallel axes. */\n\
             #define {upper}_ANGLES {angles}\n"
        ),
        definition: String::new(),
    }];
    let mut array = |kind: &str, name: &str, length: &str, doc: &str, values: Vec<String>| {
        let declared = format!("{kind}{prefix}_{name}[{upper}_{length}]");
        let lines: String = values.iter().map(|value| format!("    {value},\n")).collect();
        items.push(Item {
            declaration: format!("{}extern {declared};\n", documentation(doc)),
            definition: format!("{declared} = {{\n{}\n}};\n", lines.trim_end_matches(",\n")),
        });
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
        "Sums of the parameters as the functions use them; {prefix}_prepare makes them once for any\nnumber of calls."
    ));
    let prepared = Item {
        declaration: format!(
            "{doc}typedef struct {{\n    {prefix}_real values[{count}];\n}} {prefix}_prepared;\n"
        ),
        definition: String::new(),
    };
    [prepared, function::prepare(names, model, preparation)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_begin_with_the_arm_s() {
        let prefix = |arm: &str| Names::new(arm).prefix;
        assert_eq!(prefix("Schunk Powerball LWA 4P"), "schunk_powerball_lwa_4p");
        assert_eq!(prefix("2R (planar)"), "arm_2r_planar");
        assert_eq!((prefix("ärm-7"), prefix("腕")), ("rm_7".to_string(), "arm".to_string()));
    }

    #[test]
    fn no_name_ends_a_text_or_a_comment() {
        assert_eq!(quoted("a\"b\\c\n??/"), r#""a\"b\\c\012\?\?/""#);
        assert_eq!(documentation("a */ b /* c"), "/** a * / b / * c */\n");
    }
}
