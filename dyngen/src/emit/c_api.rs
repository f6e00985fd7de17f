//! Functions of a generated file for callers in C and C++: `extern "C"` functions over pointers, and their
//! header.
//!
//! Nothing is computed here: each calls the function in Rust next to it.

use crate::dynamics::Function;
use crate::dynamics::function::Argument;
use std::fmt::Write;

/// An array that a C function reads or writes.
#[derive(Clone, Debug)]
pub struct CArray {
    /// In the header.
    pub name: String,
    /// How many numbers.
    pub length: usize,
    /// What it is, with its unit.
    pub meaning: String,
}

/// A function of an arm's state, of arrays of numbers.
#[derive(Clone, Debug)]
pub struct CFunction {
    /// After the prefix.
    pub name: String,
    /// What it computes.
    pub what: String,
    /// What it reads.
    pub inputs: Vec<CArray>,
    /// What it writes.
    pub output: CArray,
    /// The result as an array of `output.length` numbers, in Rust, with the inputs as `SVector`s of their
    /// names.
    pub result: String,
}

/// What is emitted for callers in C.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CApi {
    /// The module `c`, to be put behind the functions.
    pub module: String,
    /// The header.
    pub header: String,
}

impl CFunction {
    /// A function of a generated file with values baked in, for n joints and p parameters; `path` leads to
    /// the file's module.
    #[must_use]
    pub fn of(function: Function, path: &str, n: usize, p: usize) -> CFunction {
        let name = function.name();
        let arguments = || function.arguments().iter().filter(|a| **a != Argument::Parameters);
        let inputs = arguments().map(|a| CArray {
            name: a.name().to_string(),
            length: a.length(n, p),
            meaning: a.meaning().to_string(),
        });
        let (rows, columns) = function.shape(n, p);
        let (what, returns) = function.meaning();
        let passed: Vec<String> = arguments().map(|a| format!("&{}", a.name())).collect();
        let call = format!("{path}::{name}({})", passed.join(", "));
        let number = matches!(function, Function::KineticEnergy | Function::PotentialEnergy);
        let columns_of = if columns > 1 { ", column by column" } else { "" };
        let returns = returns.trim_start_matches("Returns ").trim_end_matches('.');
        CFunction {
            name: name.to_string(),
            what: what.replace("[`PARAMETER_NAMES`]", "PARAMETER_NAMES"),
            inputs: inputs.collect(),
            output: CArray {
                name: "result".to_string(),
                length: rows * columns,
                meaning: format!("{returns}{columns_of}"),
            },
            result: if number { format!("[{call}]") } else { format!("flat({call}.as_slice())") },
        }
    }
}

/// Whether a name may be the prefix of functions in C.
///
/// # Errors
/// What is wrong with it.
pub fn checked_prefix(name: &str) -> Result<&str, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if name.chars().all(plain) && name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return Ok(name);
    }
    Err(format!(
        "'{name}' cannot be the beginning of names in C, as a header's name is: take letters, digits and _, \
         a lowercase letter first"
    ))
}

/// A comment of the header, wrapped.
fn comment(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        if !lines[last].is_empty() && lines[last].len() + word.len() > 96 {
            lines.push(word.to_string());
            continue;
        }
        if !lines[last].is_empty() {
            lines[last].push(' ');
        }
        lines[last].push_str(word);
    }
    format!("/* {} */\n", lines.join("\n * "))
}

/// A prototype's arrays, in C.
#[must_use]
pub fn in_c(prefix: &str, inputs: &[CArray], output: &CArray) -> String {
    let inputs = inputs.iter().map(|a| format!("const {prefix}_real {}[{}], ", a.name, a.length));
    format!("{}{prefix}_real {}[{}]", inputs.collect::<String>(), output.name, output.length)
}

/// What arrays mean, as a sentence.
fn arrays(inputs: &[CArray], output: &CArray) -> String {
    let of = |a: &CArray| format!("{}: {}", a.name, a.meaning);
    inputs.iter().chain([output]).map(of).collect::<Vec<_>>().join("; ")
}

/// A comment and a prototype of the header.
#[must_use]
pub fn declared(what: &str, inputs: &[CArray], output: &CArray, prototype: &str) -> String {
    format!("{}{prototype};\n\n", comment(&format!("{what} {}.", arrays(inputs, output))))
}

/// Lines in Rust that read arrays as vectors.
#[must_use]
pub fn read(inputs: &[CArray]) -> String {
    let mut text = String::new();
    for CArray { name, length, .. } in inputs {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "        // SAFETY: the caller's promise; it is not null.\n        \
             let {name} = SVector::from(unsafe {{ {name}.cast::<[Real; {length}]>().read() }});"
        );
    }
    text
}

/// Whether one of these is null, in Rust.
#[must_use]
pub fn any_null<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("{name}.is_null()")).collect::<Vec<_>>().join(" || ")
}

fn function(prefix: &str, f: &CFunction) -> String {
    let CFunction { name, what, inputs, output, result } = f;
    let arguments: String = inputs.iter().map(|a| format!("        {}: *const Real,\n", a.name)).collect();
    let (out, length) = (&output.name, output.length);
    let null = any_null(inputs.iter().chain([output]).map(|a| a.name.as_str()));
    let read = read(inputs);
    format!(
        "
    /// {what}
    ///
    /// # Safety
    /// Each pointer is null or has as many numbers as the header says.
    #[unsafe(no_mangle)]
    pub unsafe extern \"C\" fn {prefix}_{name}(
{arguments}        {out}: *mut Real,
    ) -> i32 {{
        if {null} {{
            return NULL;
        }}
{read}        let values: [Real; {length}] = {result};
        // SAFETY: the caller's promise; it is not null.
        unsafe {{ {out}.cast::<[Real; {length}]>().write(values) }};
        OK
    }}
"
    )
}

/// The C API: `first` stands before the functions in the module and in the header, `scalar` is f32 or f64,
/// and `about` says in the header what all of it is.
#[must_use]
pub fn api(
    prefix: &str,
    scalar: &str,
    joints: usize,
    about: &str,
    first: &CApi,
    functions: &[CFunction],
) -> CApi {
    CApi {
        module: module(prefix, &first.module, functions),
        header: header(prefix, scalar, joints, about, &first.header, functions),
    }
}

/// The module `c`, in Rust.
fn module(prefix: &str, first: &str, functions: &[CFunction]) -> String {
    let flat = if functions.iter().any(|f| f.result.starts_with("flat(")) { FLAT } else { "" };
    let functions: String = functions.iter().map(|f| function(prefix, f)).collect();
    format!(
        "
/// The API for callers in C: `{prefix}.h` says what each function does.
#[allow(unsafe_code)]
pub mod c {{
    use super::*;

    /// The call is done.
    const OK: i32 = 0;
    /// A pointer is null: nothing was written.
    const NULL: i32 = 1;
{flat}{first}{functions}}}
"
    )
}

/// What the results of functions that give a matrix are read with.
const FLAT: &str = "
    /// Numbers of a matrix, column by column.
    fn flat<const N: usize>(values: &[Real]) -> [Real; N] {
        let mut numbers = [0.0; N];
        numbers.iter_mut().zip(values).for_each(|(to, from)| *to = *from);
        numbers
    }
";

/// The header, in C.
fn header(
    prefix: &str,
    scalar: &str,
    joints: usize,
    about: &str,
    first: &str,
    functions: &[CFunction],
) -> String {
    let guard = prefix.to_uppercase();
    let real = if scalar == "f32" { "float" } else { "double" };
    let about = comment(about);
    let of = |f: &CFunction| {
        let prototype = format!("int {prefix}_{}({})", f.name, in_c(prefix, &f.inputs, &f.output));
        declared(&f.what, &f.inputs, &f.output, &prototype)
    };
    let functions: String = functions.iter().map(of).collect();
    format!(
        "{about}#ifndef {guard}_H
#define {guard}_H

#include <stdint.h>

#ifdef __cplusplus
extern \"C\" {{
#endif

#define {guard}_JOINTS {joints}
typedef {real} {prefix}_real;

/* What every function returns: done; a pointer is null; the model was not started. After the last two nothing \
was written. */
#define {guard}_OK 0
#define {guard}_NULL 1
#define {guard}_NOT_STARTED 2

{first}{functions}#ifdef __cplusplus
}}
#endif

#endif
"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shapes and arguments are those of the table; parameters are baked in and therefore not among them.
    #[test]
    fn arrays_have_the_lengths_of_the_table() {
        let f = CFunction::of(Function::MassMatrix, "rigid", 3, 9);
        assert_eq!((f.inputs.len(), f.inputs[0].length, f.output.length), (1, 3, 9));
        let f = CFunction::of(Function::Regressor, "rigid", 3, 9);
        assert_eq!((f.inputs.len(), f.output.length), (3, 27));
        let f = CFunction::of(Function::KineticEnergy, "rigid", 3, 9);
        assert_eq!((f.output.length, f.result.as_str()), (1, "[rigid::kinetic_energy(&q, &dq)]"));
    }

    #[test]
    fn a_prefix_is_a_name_in_c() {
        assert_eq!(checked_prefix("my_arm2"), Ok("my_arm2"));
        for wrong in ["", "2arm", "my-arm", "_arm", "Arm", "ärm"] {
            assert!(checked_prefix(wrong).is_err(), "{wrong}");
        }
    }
}
