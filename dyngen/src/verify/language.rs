//! The small language in which a generated file is understood, and its values in the prime field.
//!
//! Straight-line code: names that are bound once, sums, products and quotients, lists, records, calls. A
//! reader for each language of generated files lowers into it.

use crate::exact::prime::Fp;
use crate::exact::rational::Rational;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

/// An expression, and the line of the file where it stands.
#[derive(Clone, Debug)]
pub(super) struct Expr {
    pub(super) line: usize,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Number(Exact),
    Name(String),
    Negative(Box<Expr>),
    /// One of + - * /.
    Binary(char, Box<Expr>, Box<Expr>),
    List(Vec<Expr>),
    Record(Vec<(String, Expr)>),
    Field(Box<Expr>, String),
    Index(Box<Expr>, usize),
    Call(String, Vec<Expr>),
    /// Sines and cosines of an angle, or of a list of angles.
    SinCos(Box<Expr>),
    /// Marks a list as what was prepared of the parameters.
    AsPrepared(Box<Expr>),
    /// What was prepared of parameters: itself, or `prepare` of them.
    Prepared(Box<Expr>),
    Block(Vec<Let>, Box<Expr>),
}

/// What a constant of the file stands for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Exact {
    /// A number, and a multiple of pi added to it.
    Number(Rational, Rational),
    /// The sine (`true`) or cosine of one of the arm's angle symbols.
    Symbol(usize, bool),
}

#[derive(Clone, Debug)]
pub(super) struct Let {
    pub(super) pattern: Pattern,
    pub(super) value: Expr,
}

#[derive(Clone, Debug)]
pub(super) enum Pattern {
    Ignored,
    Name(String),
    List(Vec<Pattern>),
    AsPrepared(Box<Pattern>),
}

/// A function of the file.
#[derive(Clone, Debug)]
pub(super) struct Routine {
    pub(super) line: usize,
    pub(super) parameters: Vec<String>,
    pub(super) body: Expr,
}

/// The functions of a file by name; those of a module as `module::name`.
pub(super) type Routines = BTreeMap<String, Routine>;

/// A value of the language.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Number(Fp),
    List(Rc<Vec<Value>>),
    Record(Rc<Vec<(String, Value)>>),
    Prepared(Rc<Vec<Value>>),
}

impl Value {
    pub(super) fn list(values: Vec<Value>) -> Value {
        Value::List(Rc::new(values))
    }

    pub(super) fn numbers(values: impl IntoIterator<Item = Fp>) -> Value {
        Value::list(values.into_iter().map(Value::Number).collect())
    }
}

/// Why there is no value: where, and what is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Stop {
    pub(super) line: usize,
    pub(super) message: String,
}

/// Calls within calls beyond this are no generated code.
const DEEPEST: usize = 16;

/// What constants and angles are at a point.
pub(super) struct World<'a> {
    pub(super) routines: &'a Routines,
    pub(super) symbol: &'a dyn Fn(usize, bool) -> Fp,
    /// The element that stands for pi: as good as free of all others.
    pub(super) pi: Fp,
    /// Sine and cosine of the angles that the arm has, by the angle.
    pub(super) angles: &'a HashMap<Fp, (Fp, Fp)>,
}

type Names<'e> = Vec<HashMap<&'e str, Value>>;

impl<'a> World<'a> {
    /// The value of a call.
    pub(super) fn call(
        &self,
        line: usize,
        name: &str,
        arguments: Vec<Value>,
        depth: usize,
    ) -> Result<Value, Stop> {
        let stop = |message: String| Err(Stop { line, message });
        let Some(routine) = self.routines.get(name) else {
            return stop(format!("there is no function {name}"));
        };
        if routine.parameters.len() != arguments.len() || depth > DEEPEST {
            return stop(format!("{name} cannot be called like this"));
        }
        let names = routine.parameters.iter().map(String::as_str).zip(arguments).collect();
        self.value(&routine.body, &mut vec![names], depth)
    }

    fn value<'e>(&self, e: &'e Expr, names: &mut Names<'e>, depth: usize) -> Result<Value, Stop> {
        let stop = |message: String| Err(Stop { line: e.line, message });
        Ok(match &e.kind {
            Kind::Number(exact) => Value::Number(self.constant(e.line, exact)?),
            Kind::Name(name) => match names.iter().rev().find_map(|scope| scope.get(name.as_str())) {
                Some(value) => value.clone(),
                None => return stop(format!("{name} has no value")),
            },
            Kind::Negative(x) => Value::Number(-self.number(x, names, depth)?),
            Kind::Binary(operation, x, y) => {
                let (x, y) = (self.number(x, names, depth)?, self.number(y, names, depth)?);
                Value::Number(match operation {
                    '+' => x + y,
                    '-' => x - y,
                    '*' => x * y,
                    _ => match y.inverse() {
                        Some(inverse) => x * inverse,
                        None => return stop("a division by zero".to_string()),
                    },
                })
            }
            Kind::List(items) => Value::list(self.values(items, names, depth)?),
            Kind::Record(fields) => {
                let field = |(name, e): &'e (String, Expr)| Ok((name.clone(), self.value(e, names, depth)?));
                Value::Record(Rc::new(fields.iter().map(field).collect::<Result<_, Stop>>()?))
            }
            Kind::Field(of, field) => match self.value(of, names, depth)? {
                Value::Record(fields) => match fields.iter().find(|(name, _)| name == field) {
                    Some((_, value)) => value.clone(),
                    None => return stop(format!("there is no field {field}")),
                },
                _ => return stop(format!("there is no field {field}")),
            },
            Kind::Index(of, index) => match self.value(of, names, depth)? {
                Value::List(values) | Value::Prepared(values) if *index < values.len() => {
                    values[*index].clone()
                }
                _ => return stop(format!("there is no entry {index}")),
            },
            Kind::Call(name, arguments) => {
                let arguments = self.values(arguments, names, depth)?;
                self.call(e.line, name, arguments, depth + 1)?
            }
            Kind::SinCos(angle) => self.sine_and_cosine(e.line, &self.value(angle, names, depth)?)?,
            Kind::AsPrepared(list) => match self.value(list, names, depth)? {
                Value::List(values) => Value::Prepared(values),
                _ => return stop("nothing that could be prepared".to_string()),
            },
            Kind::Prepared(of) => match self.value(of, names, depth)? {
                prepared @ Value::Prepared(_) => prepared,
                parameters => self.call(e.line, "prepare", vec![parameters], depth + 1)?,
            },
            Kind::Block(lets, result) => {
                names.push(HashMap::new());
                for Let { pattern, value } in lets {
                    let bound = self.value(value, names, depth)?;
                    bind(value.line, pattern, bound, names)?;
                }
                let result = self.value(result, names, depth)?;
                names.pop();
                result
            }
        })
    }

    fn values<'e>(&self, of: &'e [Expr], names: &mut Names<'e>, depth: usize) -> Result<Vec<Value>, Stop> {
        of.iter().map(|e| self.value(e, names, depth)).collect()
    }

    fn number<'e>(&self, e: &'e Expr, names: &mut Names<'e>, depth: usize) -> Result<Fp, Stop> {
        match self.value(e, names, depth)? {
            Value::Number(x) => Ok(x),
            _ => Err(Stop { line: e.line, message: "no number".to_string() }),
        }
    }

    fn constant(&self, line: usize, exact: &Exact) -> Result<Fp, Stop> {
        let residue = |x: &Rational| {
            let message = "a number with the prime in its denominator".to_string();
            Fp::from_rational(x).ok_or(Stop { line, message })
        };
        match exact {
            Exact::Number(number, turns) => Ok(residue(number)? + residue(turns)? * self.pi),
            Exact::Symbol(index, sine) => Ok((self.symbol)(*index, *sine)),
        }
    }

    /// A pair for an angle, a pair of lists for a list.
    fn sine_and_cosine(&self, line: usize, angle: &Value) -> Result<Value, Stop> {
        let of = |angle: &Value| {
            let found = if let Value::Number(x) = angle { self.angles.get(x) } else { None };
            let message = "an angle that is no sum of the arm's".to_string();
            found.copied().ok_or(Stop { line, message })
        };
        if let Value::List(angles) = angle {
            let pairs = angles.iter().map(of).collect::<Result<Vec<_>, _>>()?;
            let (sines, cosines): (Vec<Fp>, Vec<Fp>) = pairs.into_iter().unzip();
            return Ok(Value::list(vec![Value::numbers(sines), Value::numbers(cosines)]));
        }
        let (sine, cosine) = of(angle)?;
        Ok(Value::numbers([sine, cosine]))
    }
}

fn bind<'e>(line: usize, pattern: &'e Pattern, value: Value, names: &mut Names<'e>) -> Result<(), Stop> {
    match (pattern, value) {
        (Pattern::Ignored, _) => {}
        (Pattern::Name(name), value) => {
            if let Some(scope) = names.last_mut() {
                scope.insert(name, value);
            }
        }
        (Pattern::List(patterns), Value::List(values)) if patterns.len() == values.len() => {
            for (pattern, value) in patterns.iter().zip(values.iter()) {
                bind(line, pattern, value.clone(), names)?;
            }
        }
        (Pattern::AsPrepared(inner), Value::Prepared(values)) => {
            bind(line, inner, Value::List(values), names)?;
        }
        _ => return Err(Stop { line, message: "a pattern that does not fit its value".to_string() }),
    }
    Ok(())
}

impl Expr {
    /// x·y + z
    pub(super) fn fused(line: usize, [x, y, z]: [Expr; 3]) -> Expr {
        let product = Expr { line, kind: Kind::Binary('*', Box::new(x), Box::new(y)) };
        Expr { line, kind: Kind::Binary('+', Box::new(product), Box::new(z)) }
    }

    /// The line of the statement that gives entry (row, column) of a result of columns; the expression's own
    /// where it is not found.
    pub(super) fn line_of_entry(&self, row: usize, column: usize) -> usize {
        let Kind::Block(lets, result) = &self.kind else { return self.line };
        let entry = match &result.kind {
            Kind::List(columns) => columns.get(column).and_then(|c| match &c.kind {
                Kind::List(rows) => rows.get(row),
                _ => None,
            }),
            _ => Some(&**result),
        };
        let Some(entry) = entry else { return result.line };
        let mut inner = entry;
        while let Kind::Negative(x) = &inner.kind {
            inner = x;
        }
        let Kind::Name(name) = &inner.kind else { return entry.line };
        line_of(lets, name).unwrap_or(entry.line)
    }
}

/// The line of the expression that a name is bound to.
fn line_of(lets: &[Let], name: &str) -> Option<usize> {
    lets.iter().rev().find_map(|Let { pattern, value }| match pattern {
        Pattern::Name(bound) if bound == name => Some(value.line),
        _ => match &value.kind {
            Kind::Block(inner, _) => line_of(inner, name),
            _ => None,
        },
    })
}
