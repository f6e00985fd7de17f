//! Reads a generated file in C, or in CUDA, as its sister reads Rust: whatever it does not know is an error.

mod cuda;

use crate::language::{Exact, Expr, Kind, Let, Pattern, Routine};
use crate::read::cursor::{Cursor, Dialect};
use crate::read::head::Literals;
use crate::read::kernel::MOST;
use crate::text::root_in_c;
use crate::{Checked, Source, wrong};
use dyngen_arm::Function;
use dyngen_arm::exact::rational::integer;
use dyngen_arm::function::Size;
use num_traits::Zero;
use std::collections::BTreeMap;

/// What is wrong where the text before the functions is another one.
const OTHER: &str = "before the functions something else than this version of dyngen writes";

/// What stands before the functions.
const BEFORE: &str = r#"
#include <float.h>
#include <math.h>
#include <stdint.h>
#ifdef __FAST_MATH__
#error "sums must be rounded as they are written: compile without -ffast-math"
#endif
#ifdef FLT_EVAL_METHOD
#if (FLT_EVAL_METHOD != 0) && (FLT_EVAL_METHOD != 16)
#error "numbers must be rounded to their own type: with 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
"#;
/// On which targets a file with contraction compiles.
const CONDITION: &str = r#"
#ifndef NAME_FMA
#ifdef NAME_FLOAT
#if !(defined(__FP_FAST_FMAF) || defined(__FMA__) || defined(__ARM_FEATURE_FMA))
#error "generated with --contract, and the target has no fused multiply-add: compile with -march=native or -mfma"
#endif
#elif !(defined(__FP_FAST_FMA) || defined(__FMA__) || defined(__aarch64__))
#error "generated with --contract, and the target has no fused multiply-add: compile with -march=native or -mfma"
#endif
#endif
"#;
/// What gives x·y + z there.
const FUSED: &str = "
#undef fused
#ifdef NAME_FLOAT
#define fused(x, y, z) fmaf(x, y, z)
#else
#define fused(x, y, z) fma(x, y, z)
#endif
";
/// The sign that Coulomb's friction takes, behind its name.
const SIGN: &str =
    "(real x) { return (x > (real)0.0) ? (real)1.0 : ((x < (real)0.0) ? (real)-1.0 : (real)0.0); }";
/// The hyperbolic tangent of the file's numbers, behind its name.
const TANGENT: &str = "(real x)
{
#ifdef NAME_FLOAT
    return tanhf(x);
#else
    return tanh(x);
#endif
}";
/// Sines and cosines, tested where they are written.
const TRIGONOMETRY: &str = crate::text::TRIGONOMETRY_C;

/// Numbers are cast: `(real)0.5`.
const DIALECT: Dialect = Dialect { comment: ("/*", "*/"), field: "->", number: ("real", "") };

/// Reads a file in C, or in CUDA; `frames` are those of the arm.
pub(crate) fn read(text: &str, is_cuda: bool, literals: &Literals, frames: &[String]) -> Checked<Source> {
    // Lines that go on in the next one, and breaks that not every compiler takes for the end of a line.
    let odd = |line: &str| line.trim_end().ends_with('\\') || line.contains("??/") || line.contains('\r');
    if let Some(line) = text.lines().position(odd) {
        return wrong(line + 1, "an end of a line that dyngen does not write");
    }
    let mut reader = Reader {
        text: Cursor::new(text, &DIALECT, literals),
        is_cuda,
        frames,
        prefix: String::new(),
        values: None,
        source: Source::default(),
    };
    if is_cuda {
        reader.before_cuda()?
    } else {
        reader.before()?
    }
    while reader.text.peek().is_some() {
        reader.item()?;
    }
    Ok(Source { unexplained: reader.text.unexplained, ..reader.source })
}

struct Reader<'a> {
    text: Cursor<'a>,
    /// Whether functions are those of a GPU's threads.
    is_cuda: bool,
    frames: &'a [String],
    /// `name_` of the arm.
    prefix: String,
    /// How many values are prepared, in CUDA; in C the header says it.
    values: Option<usize>,
    source: Source,
}

impl Reader<'_> {
    fn before(&mut self) -> Checked<()> {
        let line = self.text.line();
        let header = self.text.next();
        let inside = header.strip_prefix("#include \"").and_then(|text| text.strip_suffix(".h\""));
        let Some(header) = inside.filter(|name| !name.contains('"')) else {
            return wrong(line, "the file's header is to be included first");
        };
        self.source.not_checked.push(format!("{header}.h"));
        self.text.text(BEFORE, OTHER)?;
        self.text.expect("typedef")?;
        self.prefix = self.text.next().trim_end_matches("real").to_string();
        self.text.expect("real ;")?;
        let upper = self.upper();
        if self.text.peek().is_some_and(|token| token == format!("#ifndef {upper}_FMA")) {
            self.text.text(&CONDITION.replace("NAME", &upper), OTHER)?;
        }
        self.fused()?;
        self.root()?;
        // An arm whose joints all slide has no sines.
        if self.text.peek().is_some_and(|token| token.starts_with('#')) {
            self.text.text(&TRIGONOMETRY.replace("NAME", &self.upper()), OTHER)?;
        }
        Ok(())
    }

    /// The function that gives x·y + z, where the file has it.
    fn fused(&mut self) -> Checked<()> {
        if self.text.peek() == Some("#undef fused") {
            self.text.text(&FUSED.replace("NAME", &self.upper()), OTHER)?;
            self.text.fused = "fused";
        }
        Ok(())
    }

    /// The function that gives a square root, where the file has it.
    fn root(&mut self) -> Checked<()> {
        if self.text.peek() == Some("#undef root") {
            self.text.text(&root_in_c(self.is_cuda).replace("NAME", &self.upper()), OTHER)?;
            self.text.root = "root";
        }
        Ok(())
    }

    /// What begins the names of macros.
    fn upper(&self) -> String {
        self.prefix.trim_end_matches('_').to_uppercase()
    }

    fn item(&mut self) -> Checked<()> {
        let line = self.text.line();
        let words = self.text.until("([=;{#");
        let name = words.last().cloned().unwrap_or_default();
        let name = name.strip_prefix(&self.prefix).unwrap_or(&name).to_string();
        let kind = words[..words.len().saturating_sub(1)].join(" ");
        let kind = match self.is_cuda {
            true => match self.of_cuda(line, &kind, &name)? {
                Some(kind) => kind,
                None => return Ok(()),
            },
            false => kind,
        };
        match (kind.as_str(), name.as_str()) {
            ("static real", "sign") => self.text.text(SIGN, OTHER),
            ("static real", "tangent") => self.text.text(&TANGENT.replace("NAME", &self.upper()), OTHER),
            ("const double", "motor_velocities") => self.motor_velocities(line),
            ("const char * const", "joint_names" | "parameter_names")
            | ("const double", "parameter_values") => self.constant(line, name.to_uppercase()),
            (kind, _) if kind == "void" || kind == format!("{}real", self.prefix) => {
                self.function(line, &name)
            }
            _ => wrong(line, "an item that dyngen does not write"),
        }
    }

    /// The numbers of a matrix, row by row.
    fn motor_velocities(&mut self, line: usize) -> Checked<()> {
        self.text.until("=");
        let mut entries = vec![String::new()];
        while self.text.peek().is_some_and(|token| token != ";") {
            match self.text.next().as_str() {
                "," => entries.push(String::new()),
                "=" | "{" | "}" => {}
                part => entries.last_mut().into_iter().for_each(|entry| *entry += part),
            }
        }
        self.text.expect(";")?;
        self.source.constants.insert("MOTOR_VELOCITIES".to_string(), (line, entries));
        Ok(())
    }

    fn constant(&mut self, line: usize, name: String) -> Checked<()> {
        let length = if name == "JOINT_NAMES" { "JOINTS" } else { "PARAMETERS" };
        self.text.expect(&format!("[ {}_{length} ] = {{", self.upper()))?;
        let mut entries = Vec::new();
        loop {
            let sign = if self.text.takes("-") { "-" } else { "" };
            let text = self.text.next();
            let inside = text.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
            let plain =
                inside.map(|text| text.replace("\\\"", "\"").replace("\\?", "?").replace("\\\\", "\\"));
            entries.push(plain.unwrap_or(format!("{sign}{text}")));
            if !self.text.takes(",") {
                break;
            }
        }
        self.text.expect("} ;")?;
        self.source.constants.insert(name, (line, entries));
        Ok(())
    }

    /// The name that a function has in the language.
    fn routine(&self, name: &str) -> Option<String> {
        crate::routine(name, self.frames)
    }

    fn function(&mut self, line: usize, name: &str) -> Checked<()> {
        let Some(name) = self.routine(name) else {
            return wrong(line, &format!("dyngen writes no function {name}"));
        };
        let parameters = self.parameters(&name)?;
        self.text.place = name.clone();
        let mut body = Body { lets: Vec::new(), slots: BTreeMap::new(), results: Vec::new(), called: None };
        self.text.expect("{")?;
        while self.text.peek().is_some_and(|token| token != "}") {
            self.statement(&mut body)?;
        }
        let end = self.text.line();
        self.text.expect("}")?;
        let result = match (name.as_str(), body.called.take()) {
            (_, Some(call)) => call,
            ("Trig::new", None) => body.trig(end),
            ("prepare", None) => {
                let list = Expr { line: end, kind: Kind::List(self.prepared(end, body.results)?) };
                Expr { line: end, kind: Kind::AsPrepared(Box::new(list)) }
            }
            (name, None) => matrix(name, end, body.results)?,
        };
        let body = Expr { line: end, kind: Kind::Block(body.lets, Box::new(result)) };
        match self.source.routines.insert(name, Routine { line, parameters, body }) {
            None => Ok(()),
            Some(_) => wrong(line, "a second function of this name"),
        }
    }

    /// What is prepared; every value must be written once, in order, and as many as the struct has where it
    /// is known.
    fn prepared(&self, end: usize, results: Vec<(Vec<usize>, Expr)>) -> Checked<Vec<Expr>> {
        if self.values.is_some_and(|count| count != results.len()) {
            return wrong(end, "other values than the struct has");
        }
        let value = |(k, (at, value)): (usize, (Vec<usize>, Expr))| match at == [k] {
            true => Ok(value),
            false => wrong(value.line, "a prepared value that is not the next one"),
        };
        results.into_iter().enumerate().map(value).collect()
    }

    /// The names of what a function reads.
    fn parameters(&mut self, name: &str) -> Checked<Vec<String>> {
        let mut read = Vec::new();
        self.text.expect("(")?;
        loop {
            let line = self.text.line();
            let words = self.text.until(",)");
            let text = words.join(" ").replace(&self.prefix, "").replace(&self.prefix.to_uppercase(), "");
            let parts: Vec<&str> = text.split(' ').collect();
            match parts[..] {
                ["const", "trig", "*", name @ "trig"] | ["const", "prepared", "*", name @ "prepared"] => {
                    read.push(name.to_string());
                }
                ["const", "real", name @ "f", "[", "6", "]"]
                | ["const", "real", name @ "payload", "[", "10", "]"] => read.push(name.to_string()),
                ["const", "real", "coefficients", "[", "JOINTS", "]", "[", "FRICTION_TERMS", "]"] => {
                    read.push("coefficients".to_string());
                }
                ["const", "real", "parameters", "[", "PARAMETERS", "]"] => {
                    read.push("parameters".to_string())
                }
                ["const", "real", name, "[", "JOINTS", "]"] => read.push(name.to_string()),
                // The place of the result is the last parameter.
                ["trig", "*", "trig"] if name == "Trig::new" => break,
                ["prepared", "*", "prepared"] if name == "prepare" => break,
                ["real", "result", ..] if text == result_of(name) => break,
                _ => return wrong(line, "a parameter that dyngen does not write"),
            }
            if !self.text.takes(",") {
                break;
            }
        }
        self.text.expect(")")?;
        Ok(read)
    }

    fn statement(&mut self, body: &mut Body) -> Checked<()> {
        let line = self.text.line();
        let first = self.text.next();
        let own = first.strip_prefix(&self.prefix).map(str::to_string);
        let done = body.called.is_some() || !body.results.is_empty();
        match (first.as_str(), own.as_deref()) {
            ("const", _) if self.text.takes("real") && !done => {
                body.lets.push(self.text.named()?);
                Ok(())
            }
            ("const", _) if !done => {
                // Nothing of it is read.
                self.text.next();
                self.text.expect("trig =")?;
                let zeros = ["{", "(", "real", ")", "0.0", ",", "}"];
                while self.text.peek().is_some_and(|token| zeros.contains(&token)) {
                    self.text.next();
                }
                self.text.expect(";")
            }
            ("(", _) => {
                self.text.expect("void )")?;
                self.text.next();
                self.text.expect(";")
            }
            (_, Some("real")) if !done => {
                let upper = self.upper();
                self.text.expect(&format!("columns [ {upper}_JOINTS ] [ {upper}_FRICTION_TERMS ] ;"))
            }
            (_, Some("friction_columns")) if !done => {
                self.text.expect("( dq , columns ) ;")?;
                let dq = Expr { line, kind: Kind::Name("dq".to_string()) };
                let value = Expr { line, kind: Kind::Call("friction_columns".to_string(), vec![dq]) };
                body.lets.push(Let { pattern: Pattern::Name("columns".to_string()), value });
                Ok(())
            }
            (_, Some("trig")) => self.text.expect("trig ;"),
            (_, Some("prepared")) => self.text.expect("prepared ;"),
            ("sin_cos", _) if !done => {
                self.text.expect("(")?;
                let angle = self.text.sum()?;
                self.text.expect(", &")?;
                let sine = self.slot(body, "sin")?;
                self.text.expect(", &")?;
                let cosine = self.slot(body, "cos")?;
                self.text.expect(") ;")?;
                let value = Expr { line, kind: Kind::SinCos(Box::new(angle)) };
                body.lets.push(Let { pattern: Pattern::List(vec![sine, cosine]), value });
                Ok(())
            }
            ("trig", _) if !done => {
                let pattern = self.slot_after(body, line, &["sin", "cos", "position"])?;
                self.text.expect("=")?;
                let value = self.text.sum()?;
                body.lets.push(Let { pattern, value });
                self.text.expect(";")
            }
            (_, Some("prepare")) if !done => {
                self.text.expect("( parameters , & prepared ) ;")?;
                let parameters = Expr { line, kind: Kind::Name("parameters".to_string()) };
                let value = Expr { line, kind: Kind::Prepared(Box::new(parameters)) };
                body.lets.push(Let { pattern: Pattern::Name("prepared".to_string()), value });
                Ok(())
            }
            ("result", _) | ("prepared", _) if body.called.is_none() => {
                if first == "prepared" {
                    self.text.expect("-> values")?;
                }
                let mut at = Vec::new();
                while self.text.peek() == Some("[") {
                    at.push(self.text.index()?);
                }
                self.text.expect("=")?;
                let value = self.text.sum()?;
                body.results.push((at, value));
                self.text.expect(";")
            }
            ("return", _) if !done => {
                let prefix = self.prefix.clone();
                if let Some(name) =
                    self.text.peek().and_then(|token| token.strip_prefix(&prefix)).map(str::to_string)
                {
                    self.text.next();
                    return self.call(body, line, &name);
                }
                let value = self.text.sum()?;
                body.results.push((vec![0], value));
                self.text.expect(";")
            }
            (_, Some(name)) if !done => self.call(body, line, name),
            _ => wrong(line, "a statement that dyngen does not write here"),
        }
    }

    /// `(&trig, dq, &prepared, result);`
    fn call(&mut self, body: &mut Body, line: usize, name: &str) -> Checked<()> {
        let Some(name) = self.routine(name).filter(|name| name.ends_with("_with")) else {
            return wrong(line, "a call that dyngen does not write");
        };
        self.text.expect("( & trig")?;
        let mut arguments = vec![body.trig(line)];
        while self.text.takes(",") {
            let by_address = self.text.takes("&");
            let name = self.text.next();
            if by_address != (name == "prepared") {
                return wrong(line, "an argument that dyngen does not pass like this");
            }
            if name == "result" {
                break;
            }
            arguments.push(Expr { line, kind: Kind::Name(name) });
        }
        body.called = Some(Expr { line, kind: Kind::Call(name, arguments) });
        self.text.expect(") ;")
    }

    /// A place of the struct of sines and cosines, as the name of its value.
    fn slot(&mut self, body: &mut Body, field: &str) -> Checked<Pattern> {
        let line = self.text.line();
        self.text.expect("trig")?;
        self.slot_after(body, line, &[field])
    }

    fn slot_after(&mut self, body: &mut Body, line: usize, fields: &[&str]) -> Checked<Pattern> {
        let (access, field) = (self.text.next(), self.text.next());
        if !["->", "."].contains(&access.as_str()) || !fields.contains(&field.as_str()) {
            return wrong(line, "another place than dyngen fills here");
        }
        let index = self.text.index()?;
        if index > MOST {
            return wrong(line, "a place behind those of every arm");
        }
        let name = format!("trig.{field}[{index}]");
        match body.slots.insert((field, index), name.clone()) {
            None => Ok(Pattern::Name(name)),
            Some(_) => wrong(line, "a place that is filled twice"),
        }
    }
}

/// What was read of a function.
struct Body {
    lets: Vec<Let>,
    /// Filled places of the struct of sines and cosines, by field and index.
    slots: BTreeMap<(String, usize), String>,
    /// Written results with their indices.
    results: Vec<(Vec<usize>, Expr)>,
    /// The call that gives the result.
    called: Option<Expr>,
}

impl Body {
    /// The struct of sines and cosines; what is not filled is as good as free, so that no proof takes it for
    /// anything else.
    fn trig(&self, line: usize) -> Expr {
        let list = |field: &'static str| {
            let of = || self.slots.iter().filter(|((f, _), _)| f == field);
            let length = of().map(|((_, index), _)| index + 1).max().unwrap_or(0);
            let entry = |k: usize| match of().find(|((_, index), _)| *index == k) {
                Some((_, name)) => Kind::Name(name.clone()),
                None => {
                    let number = Kind::Number(Exact::Number(integer(k as i64), Zero::zero()));
                    Kind::Free(field, Box::new(Expr { line, kind: number }))
                }
            };
            let entries = (0..length).map(|k| Expr { line, kind: entry(k) }).collect();
            (field.to_string(), Expr { line, kind: Kind::List(entries) })
        };
        Expr { line, kind: Kind::Record(["sin", "cos", "position"].map(list).into()) }
    }
}

/// The parameter that a function's result is written to.
fn result_of(name: &str) -> String {
    let of = name.rsplit("::").next().unwrap_or(name).trim_end_matches("_with");
    let length = |size: Size| match size {
        Size::Joints => "[ JOINTS ]".to_string(),
        Size::Parameters => "[ PARAMETERS ]".to_string(),
        Size::Fixed(length) => format!("[ {length} ]"),
    };
    let shape = match (of, Function::parse(of).map(Function::size)) {
        ("friction", _) => length(Size::Joints),
        ("friction_columns", _) => "[ JOINTS ] [ FRICTION_TERMS ]".to_string(),
        (_, Some((Size::Fixed(1), size) | (size, Size::Fixed(1)))) => length(size),
        (_, Some((rows, columns))) => format!("{} {}", length(rows), length(columns)),
        _ => String::new(),
    };
    format!("real result {shape}")
}

/// A result as a list of columns; every entry must be written once, in order.
fn matrix(name: &str, end: usize, results: Vec<(Vec<usize>, Expr)>) -> Checked<Expr> {
    let of = name.rsplit("::").next().unwrap_or(name).trim_end_matches("_with");
    let is_row = Function::parse(of).is_some_and(|f| f.size().0 == Size::Fixed(1));
    let width = results.iter().filter(|(at, _)| at.len() == 2 && at[0] == 0).count();
    let (is_matrix, mut columns) =
        (width > 0, vec![Vec::new(); if is_row { results.len() } else { width.max(1) }]);
    let count = columns.len();
    for (k, (at, value)) in results.into_iter().enumerate() {
        let right = if is_matrix { vec![k / count, k % count] } else { vec![k] };
        if at != right {
            return wrong(value.line, "an entry of the result that is not the next one");
        }
        columns[k % count].push(value);
    }
    let column = |entries: Vec<Expr>| Expr { line: end, kind: Kind::List(entries) };
    Ok(Expr { line: end, kind: Kind::List(columns.into_iter().map(column).collect()) })
}
