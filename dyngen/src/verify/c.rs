//! Reads a generated file in C, as its sister reads Rust: whatever it does not know is an error.

use super::head::Literals;
use super::language::{Exact, Expr, Kind, Let, Pattern, Routine};
use super::{Checked, Source, wrong};
use crate::dynamics::Function;
use crate::dynamics::function::Size;
use crate::exact::rational::integer;
use num_traits::Zero;
use std::collections::BTreeMap;

/// What stands before the functions, with the arm's name for NAME.
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
/// Sines and cosines, tested where they are written.
const TRIGONOMETRY: &str = include_str!("../emit/c/trigonometry.c");

/// Words, numbers, strings, lines of the preprocessor and single characters (`->` is one), each with its line.
fn tokens(text: &str) -> Vec<(usize, String)> {
    let (mut found, mut rest, mut line) = (Vec::new(), text, 1);
    while let Some(first) = rest.chars().next() {
        let until =
            |end: &str, from: usize| rest[from..].find(end).map_or(rest.len(), |k| k + from + end.len());
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.' && first.is_ascii_digit();
        let length = match first {
            _ if rest.starts_with("/*") => until("*/", 2),
            '#' => until("\n", 0),
            '"' => {
                let mut escaped = false;
                let end = rest[1..].find(|c| {
                    let ends = c == '"' && !escaped;
                    escaped = c == '\\' && !escaped;
                    ends
                });
                end.map_or(rest.len(), |k| k + 2)
            }
            _ if word(first) => {
                // A number's exponent may have a sign.
                let exponent =
                    |k: usize| first.is_ascii_digit() && !rest.starts_with("0x") && rest[..k].ends_with('e');
                let ends = |(k, c): (usize, char)| !(word(c) || c == '-' && exponent(k));
                rest.char_indices().position(ends).unwrap_or(rest.len())
            }
            _ if rest.starts_with("->") => 2,
            other => other.len_utf8(),
        };
        let (token, after) = rest.split_at(length);
        if !first.is_whitespace() && !token.starts_with("/*") {
            found.push((line, token.trim_end().to_string()));
        }
        line += token.matches('\n').count();
        rest = after;
    }
    found
}

/// Reads a file; `frames` are those of the arm.
pub(super) fn read(text: &str, literals: &Literals, frames: &[String]) -> Checked<Source> {
    let all = tokens(text);
    let mut reader = Reader {
        literals,
        frames,
        last: all.last().map_or(1, |token| token.0),
        tokens: all.into_iter().peekable(),
        prefix: String::new(),
        place: String::new(),
        source: Source { has_header: true, ..Source::default() },
    };
    reader.before()?;
    while reader.peek().is_some() {
        reader.item()?;
    }
    Ok(reader.source)
}

struct Reader<'a> {
    literals: &'a Literals,
    frames: &'a [String],
    tokens: std::iter::Peekable<std::vec::IntoIter<(usize, String)>>,
    last: usize,
    /// `name_` of the arm.
    prefix: String,
    /// Where literals stand: the function, then a space and the name of a value.
    place: String,
    source: Source,
}

impl Reader<'_> {
    fn peek(&mut self) -> Option<&str> {
        self.tokens.peek().map(|token| token.1.as_str())
    }

    fn line(&mut self) -> usize {
        self.tokens.peek().map_or(self.last, |token| token.0)
    }

    fn next(&mut self) -> String {
        self.tokens.next().map_or(String::new(), |token| token.1)
    }

    fn takes(&mut self, wanted: &str) -> bool {
        self.peek() == Some(wanted) && self.tokens.next().is_some()
    }

    /// The next tokens must be these, separated by spaces.
    fn expect(&mut self, wanted: &str) -> Checked<()> {
        for token in wanted.split(' ') {
            let line = self.line();
            if !self.takes(token) {
                return wrong(line, &format!("'{token}' is expected here"));
            }
        }
        Ok(())
    }

    fn before(&mut self) -> Checked<()> {
        let line = self.line();
        let header = self.next();
        let Some(header) = header.strip_prefix("#include \"").and_then(|text| text.strip_suffix(".h\""))
        else {
            return wrong(line, "the file's header is to be included first");
        };
        self.source.not_checked.push(format!("{header}.h"));
        self.text(BEFORE, "")?;
        self.expect("typedef")?;
        self.prefix = self.next().trim_end_matches("real").to_string();
        self.expect("real ;")?;
        if self.peek().is_some_and(|token| token.starts_with('#')) {
            let upper = self.prefix.trim_end_matches('_').to_uppercase();
            self.text(TRIGONOMETRY, &upper)?;
        }
        Ok(())
    }

    /// Text that must be what this version of dyngen writes.
    fn text(&mut self, wanted: &str, name: &str) -> Checked<()> {
        for (_, token) in tokens(&wanted.replace("NAME", name)) {
            let line = self.line();
            if !self.takes(&token) {
                return wrong(line, "before the functions something else than this version of dyngen writes");
            }
        }
        Ok(())
    }

    fn item(&mut self) -> Checked<()> {
        let line = self.line();
        let mut words = Vec::new();
        while self.peek().is_some_and(|token| !"([=;{#".contains(&token[..1])) {
            words.push(self.next());
        }
        let name = words.last().cloned().unwrap_or_default();
        let name = name.strip_prefix(&self.prefix).unwrap_or(&name).to_string();
        let kind = words[..words.len().saturating_sub(1)].join(" ");
        match (kind.as_str(), name.as_str()) {
            ("static real", "sign" | "tangent") | ("void", "friction" | "friction_columns") => {
                self.skip(name, "}")
            }
            ("const double", "motor_velocities") => self.skip(name, ";"),
            ("const char * const", "joint_names" | "parameter_names")
            | ("const double", "parameter_values") => self.constant(line, name.to_uppercase()),
            (kind, _) if kind == "void" || kind == format!("{}real", self.prefix) => {
                self.function(line, &name)
            }
            _ => wrong(line, "an item that dyngen does not write"),
        }
    }

    /// An item that is not looked into.
    fn skip(&mut self, name: String, end: &str) -> Checked<()> {
        let mut depth = 0;
        for (_, token) in self.tokens.by_ref() {
            depth += i32::from(token == "{") - i32::from(token == "}");
            if depth == 0 && token == end {
                break;
            }
        }
        self.source.not_checked.push(name);
        Ok(())
    }

    fn constant(&mut self, line: usize, name: String) -> Checked<()> {
        while self.peek().is_some_and(|token| token != "{") {
            self.next();
        }
        let mut entries = Vec::new();
        while self.peek().is_some_and(|token| token != "}") {
            self.next();
            let sign = if self.takes("-") { "-" } else { "" };
            let text = self.next();
            let inside = text.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
            let plain =
                inside.map(|text| text.replace("\\\"", "\"").replace("\\?", "?").replace("\\\\", "\\"));
            entries.push(plain.unwrap_or(format!("{sign}{text}")));
        }
        self.expect("} ;")?;
        self.source.constants.insert(name, (line, entries));
        Ok(())
    }

    /// The name that a function has in the language.
    fn routine(&self, name: &str) -> Option<String> {
        let is_known = |name: &str| Function::parse(name.strip_suffix("_with").unwrap_or(name)).is_some();
        match name {
            "trig_of" => return Some("Trig::new".to_string()),
            name if name == "prepare" || is_known(name) => return Some(name.to_string()),
            _ => {}
        }
        let inside = |frame: &String| {
            let rest = name.strip_prefix(frame.as_str())?.strip_prefix('_')?;
            is_known(rest).then(|| format!("{frame}::{rest}"))
        };
        self.frames.iter().find_map(inside)
    }

    fn function(&mut self, line: usize, name: &str) -> Checked<()> {
        let Some(name) = self.routine(name) else {
            return wrong(line, &format!("dyngen writes no function {name}"));
        };
        let parameters = self.parameters()?;
        self.place = name.clone();
        let mut body = Body { lets: Vec::new(), slots: BTreeMap::new(), results: Vec::new(), called: None };
        self.expect("{")?;
        while self.peek().is_some_and(|token| token != "}") {
            self.statement(&mut body)?;
        }
        let end = self.line();
        self.expect("}")?;
        let result = match (name.as_str(), body.called.take()) {
            (_, Some(call)) => call,
            ("Trig::new", None) => body.trig(end),
            ("prepare", None) => {
                let values = body.results.into_iter().map(|(_, value)| value).collect();
                let list = Expr { line: end, kind: Kind::List(values) };
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

    /// The names of what a function reads.
    fn parameters(&mut self) -> Checked<Vec<String>> {
        let mut read = Vec::new();
        self.expect("(")?;
        loop {
            let line = self.line();
            let mut words = Vec::new();
            while self.peek().is_some_and(|token| token != "," && token != ")") {
                words.push(self.next());
            }
            let text = words.join(" ").replace(&self.prefix, "").replace(&self.prefix.to_uppercase(), "");
            let parts: Vec<&str> = text.split(' ').collect();
            match parts[..] {
                ["const", "trig", "*", name @ "trig"] | ["const", "prepared", "*", name @ "prepared"] => {
                    read.push(name.to_string());
                }
                ["const", "real", name @ "f", "[", "6", "]"]
                | ["const", "real", name @ "payload", "[", "10", "]"] => read.push(name.to_string()),
                ["const", "real", "parameters", "[", "PARAMETERS", "]"] => {
                    read.push("parameters".to_string())
                }
                ["const", "real", name, "[", "JOINTS", "]"] => read.push(name.to_string()),
                ["trig", "*", "trig"] | ["prepared", "*", "prepared"] | ["real", "result", ..] => {}
                _ => return wrong(line, "a parameter that dyngen does not write"),
            }
            if !self.takes(",") {
                break;
            }
        }
        self.expect(")")?;
        Ok(read)
    }

    fn statement(&mut self, body: &mut Body) -> Checked<()> {
        let line = self.line();
        let first = self.next();
        let own = first.strip_prefix(&self.prefix).map(str::to_string);
        let done = body.called.is_some() || !body.results.is_empty();
        match (first.as_str(), own.as_deref()) {
            ("const", _) if self.takes("real") && !done => {
                let name = self.next();
                let outside = std::mem::take(&mut self.place);
                self.place = format!("{outside} {name}");
                self.expect("=")?;
                let value = self.sum()?;
                self.place = outside;
                body.lets.push(Let { pattern: Pattern::Name(name), value });
                self.expect(";")
            }
            ("const", _) if !done => {
                // Nothing of it is read.
                self.next();
                self.expect("trig =")?;
                let zeros = ["{", "(", "real", ")", "0.0", ",", "}"];
                while self.peek().is_some_and(|token| zeros.contains(&token)) {
                    self.next();
                }
                self.expect(";")
            }
            ("(", _) => {
                self.expect("void )")?;
                self.next();
                self.expect(";")
            }
            (_, Some("trig")) => self.expect("trig ;"),
            (_, Some("prepared")) => self.expect("prepared ;"),
            ("sin_cos", _) if !done => {
                self.expect("(")?;
                let angle = self.sum()?;
                self.expect(", &")?;
                let sine = self.slot(body, "sin")?;
                self.expect(", &")?;
                let cosine = self.slot(body, "cos")?;
                self.expect(") ;")?;
                let value = Expr { line, kind: Kind::SinCos(Box::new(angle)) };
                body.lets.push(Let { pattern: Pattern::List(vec![sine, cosine]), value });
                Ok(())
            }
            ("trig", _) if !done => {
                let pattern = self.slot_after(body, line, &["sin", "cos", "position"])?;
                self.expect("=")?;
                let value = self.sum()?;
                body.lets.push(Let { pattern, value });
                self.expect(";")
            }
            (_, Some("prepare")) if !done => {
                self.expect("( parameters , & prepared ) ;")?;
                let parameters = Expr { line, kind: Kind::Name("parameters".to_string()) };
                let value = Expr { line, kind: Kind::Prepared(Box::new(parameters)) };
                body.lets.push(Let { pattern: Pattern::Name("prepared".to_string()), value });
                Ok(())
            }
            ("result", _) | ("prepared", _) if body.called.is_none() => {
                if first == "prepared" {
                    self.expect("-> values")?;
                }
                let mut at = Vec::new();
                while self.peek() == Some("[") {
                    at.push(self.index()?);
                }
                self.expect("=")?;
                let value = self.sum()?;
                body.results.push((at, value));
                self.expect(";")
            }
            ("return", _) if !done => {
                let prefix = self.prefix.clone();
                if let Some(name) =
                    self.peek().and_then(|token| token.strip_prefix(&prefix)).map(str::to_string)
                {
                    self.next();
                    return self.call(body, line, &name);
                }
                let value = self.sum()?;
                body.results.push((vec![0], value));
                self.expect(";")
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
        self.expect("( & trig")?;
        let mut arguments = vec![body.trig(line)];
        while self.takes(",") {
            self.takes("&");
            let name = self.next();
            if name != "result" {
                arguments.push(Expr { line, kind: Kind::Name(name) });
            }
        }
        body.called = Some(Expr { line, kind: Kind::Call(name, arguments) });
        self.expect(") ;")
    }

    /// A place of the struct of sines and cosines, as the name of its value.
    fn slot(&mut self, body: &mut Body, field: &str) -> Checked<Pattern> {
        let line = self.line();
        self.expect("trig")?;
        self.slot_after(body, line, &[field])
    }

    fn slot_after(&mut self, body: &mut Body, line: usize, fields: &[&str]) -> Checked<Pattern> {
        let (access, field) = (self.next(), self.next());
        if !["->", "."].contains(&access.as_str()) || !fields.contains(&field.as_str()) {
            return wrong(line, "another place than dyngen fills here");
        }
        let index = self.index()?;
        let name = format!("trig.{field}[{index}]");
        match body.slots.insert((field, index), name.clone()) {
            None => Ok(Pattern::Name(name)),
            Some(_) => wrong(line, "a place that is filled twice"),
        }
    }

    fn index(&mut self) -> Checked<usize> {
        self.expect("[")?;
        let line = self.line();
        let Ok(index) = self.next().parse() else { return wrong(line, "a number is expected here") };
        self.expect("]")?;
        Ok(index)
    }

    fn sum(&mut self) -> Checked<Expr> {
        self.operations(&["+", "-"])
    }

    fn operations(&mut self, of: &[&str]) -> Checked<Expr> {
        let line = self.line();
        let mut value = self.operand(of)?;
        while let Some(operation) =
            self.peek().filter(|token| of.contains(token)).and_then(|t| t.chars().next())
        {
            self.next();
            let other = self.operand(of)?;
            value = Expr { line, kind: Kind::Binary(operation, Box::new(value), Box::new(other)) };
        }
        Ok(value)
    }

    fn operand(&mut self, of: &[&str]) -> Checked<Expr> {
        if of == ["+", "-"] { self.operations(&["*", "/"]) } else { self.atom() }
    }

    fn atom(&mut self) -> Checked<Expr> {
        let line = self.line();
        let kind = match self.next().as_str() {
            "-" => Kind::Negative(Box::new(self.atom()?)),
            "(" if self.takes("real") => {
                self.expect(")")?;
                let negative = self.takes("-");
                let number = Expr { line, kind: self.literal(line)? };
                if negative { Kind::Negative(Box::new(number)) } else { return Ok(number) }
            }
            "(" => {
                let value = self.sum()?;
                self.expect(")")?;
                return Ok(value);
            }
            word if word.starts_with(|c: char| c.is_ascii_lowercase()) => {
                let name = Expr { line, kind: Kind::Name(word.to_string()) };
                if self.takes("->") {
                    let field = self.next();
                    let list = match field.as_str() {
                        "values" => name,
                        _ => Expr { line, kind: Kind::Field(Box::new(name), field) },
                    };
                    Kind::Index(Box::new(list), self.index()?)
                } else if self.peek() == Some("[") {
                    // A vector is the one column of a matrix.
                    let column = Expr { line, kind: Kind::Index(Box::new(name), 0) };
                    Kind::Index(Box::new(column), self.index()?)
                } else {
                    return Ok(name);
                }
            }
            _ => return wrong(line, "an expression that dyngen does not write"),
        };
        Ok(Expr { line, kind })
    }

    fn literal(&mut self, line: usize) -> Checked<Kind> {
        let digits = self.next();
        if self.literals.is_unexplained(&digits) {
            self.source.unexplained.push((line, digits.clone()));
        }
        match self.literals.exact(&digits, &self.place) {
            Some(exact) => Ok(Kind::Number(exact)),
            None => wrong(line, &format!("{digits} is no number that dyngen writes")),
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
    /// The struct of sines and cosines; what is not filled is zero, which no proof takes for anything else.
    fn trig(&self, line: usize) -> Expr {
        let list = |field: &str| {
            let of = || self.slots.iter().filter(|((f, _), _)| f == field);
            let length = of().map(|((_, index), _)| index + 1).max().unwrap_or(0);
            let entry = |k: usize| match of().find(|((_, index), _)| *index == k) {
                Some((_, name)) => Kind::Name(name.clone()),
                None => Kind::Number(Exact::Number(integer(0), Zero::zero())),
            };
            let entries = (0..length).map(|k| Expr { line, kind: entry(k) }).collect();
            (field.to_string(), Expr { line, kind: Kind::List(entries) })
        };
        Expr { line, kind: Kind::Record(["sin", "cos", "position"].map(list).into()) }
    }
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
