//! The small language in which a generated file is understood, and its values in the prime field.
//!
//! Straight-line code: names that are bound once, sums, products and quotients, lists, records, calls. A
//! reader for each language of generated files lowers into it.

use crate::angles::Affine;
use crate::point::Point;
use dyngen_arm::exact::prime::{Draws, Fp};
use dyngen_arm::exact::rational::{Rational, integer};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;

/// An expression, and the line of the file where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Expr {
    pub(crate) line: usize,
    pub(crate) kind: Kind,
}

#[derive(Clone, Debug)]
pub(crate) enum Kind {
    Number(Exact),
    Name(String),
    Negative(Box<Expr>),
    /// One of + - * /.
    Binary(char, Box<Expr>, Box<Expr>),
    /// A square root.
    Root(Box<Expr>),
    List(Vec<Expr>),
    Record(Vec<(String, Expr)>),
    Field(Box<Expr>, String),
    Index(Box<Expr>, usize),
    Call(String, Vec<Expr>),
    /// Sines and cosines of an angle, or of a list of angles.
    SinCos(Box<Expr>),
    /// A function of a number of which nothing is known but its name.
    Free(&'static str, Box<Expr>),
    /// The sum of each row of a matrix times another one, entry by entry.
    RowSums(Box<Expr>, Box<Expr>),
    /// Marks a list as what was prepared of the parameters.
    AsPrepared(Box<Expr>),
    /// What was prepared of parameters: itself, or `prepare` of them.
    Prepared(Box<Expr>),
    Block(Vec<Let>, Box<Expr>),
}

/// What a constant of the file stands for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Exact {
    /// A number, and a multiple of pi added to it.
    Number(Rational, Rational),
    /// The sine (`true`) or cosine of one of the arm's angle symbols.
    Symbol(usize, bool),
}

#[derive(Clone, Debug)]
pub(crate) struct Let {
    pub(crate) pattern: Pattern,
    pub(crate) value: Expr,
}

#[derive(Clone, Debug)]
pub(crate) enum Pattern {
    Ignored,
    Name(String),
    List(Vec<Pattern>),
    AsPrepared(Box<Pattern>),
}

/// A function of the file.
#[derive(Clone, Debug)]
pub(crate) struct Routine {
    pub(crate) line: usize,
    pub(crate) parameters: Vec<String>,
    pub(crate) body: Expr,
}

/// What the name of a batch form ends in where its samples are taken one by one.
pub(crate) const ONE_BY_ONE: &str = " one by one";

/// The functions of a file by name; those of a module as `module::name`.
pub(crate) type Routines = BTreeMap<String, Routine>;

/// A value of the language.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Number(Number),
    List(Rc<Vec<Value>>),
    Record(Rc<Vec<(String, Value)>>),
    Prepared(Rc<Vec<Value>>),
}

/// A number modulo the prime, and what it is as an angle, where it is a sum of multiples of coordinates and
/// constants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Number {
    pub(crate) value: Fp,
    angle: Option<Rc<Affine>>,
}

impl From<Fp> for Number {
    fn from(value: Fp) -> Number {
        Number { value, angle: None }
    }
}

impl Number {
    fn negative(&self) -> Number {
        let angle = self.angle.as_ref().map(|x| Rc::new(Affine::default().plus(&integer(-1), x)));
        Number { value: -self.value, angle }
    }

    /// One of + - * /; nothing where it divides by zero.
    fn combined(&self, operation: char, other: &Number) -> Option<Number> {
        let value = match operation {
            '+' => self.value + other.value,
            '-' => self.value - other.value,
            '*' => self.value * other.value,
            _ => self.value * other.value.inverse()?,
        };
        let angle = match (&self.angle, &other.angle) {
            (Some(x), Some(y)) => match operation {
                '+' => Some(x.plus(&integer(1), y)),
                '-' => Some(x.plus(&integer(-1), y)),
                '*' => match (x.as_number(), y.as_number()) {
                    (Some(factor), _) => Some(Affine::default().plus(factor, y)),
                    (_, Some(factor)) => Some(Affine::default().plus(factor, x)),
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        };
        Some(Number { value, angle: angle.map(Rc::new) })
    }
}

impl Value {
    pub(crate) fn list(values: Vec<Value>) -> Value {
        Value::List(Rc::new(values))
    }

    pub(crate) fn numbers(values: impl IntoIterator<Item = Fp>) -> Value {
        Value::list(values.into_iter().map(|x| Value::Number(x.into())).collect())
    }

    /// The coordinates, of which angles are made.
    pub(crate) fn positions(q: &[Fp]) -> Value {
        let of = |(i, value): (usize, &Fp)| {
            Value::Number(Number { value: *value, angle: Some(Rc::new(Affine::coordinate(i))) })
        };
        Value::list(q.iter().enumerate().map(of).collect())
    }

    pub(crate) fn as_number(&self) -> Option<Fp> {
        if let Value::Number(x) = self { Some(x.value) } else { None }
    }

    pub(crate) fn as_list(&self) -> Option<&[Value]> {
        if let Value::List(values) = self { Some(values) } else { None }
    }
}

/// Why there is no value: where, and what is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stop {
    pub(crate) line: usize,
    pub(crate) message: String,
}

/// Calls within calls beyond this are no generated code.
const DEEPEST: usize = 16;

/// The names of functions that were called.
pub(crate) type Called = RefCell<BTreeSet<String>>;

/// A file at a point.
pub(crate) struct World<'a> {
    pub(crate) routines: &'a Routines,
    pub(crate) point: &'a Point<'a>,
    pub(crate) called: &'a Called,
}

type Names<'e> = Vec<HashMap<&'e str, Value>>;

impl World<'_> {
    /// The value of a call.
    pub(crate) fn call(
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
        self.called.borrow_mut().insert(name.to_string());
        if routine.parameters.len() != arguments.len() || depth > DEEPEST {
            return stop(format!("{name} cannot be called like this"));
        }
        let names = routine.parameters.iter().map(String::as_str).zip(arguments).collect();
        self.value(&routine.body, &mut vec![names], depth)
    }

    fn value<'e>(&self, e: &'e Expr, names: &mut Names<'e>, depth: usize) -> Result<Value, Stop> {
        let stop = |message: String| Err(Stop { line: e.line, message });
        Ok(match &e.kind {
            Kind::Number(exact) => self.constant(e.line, exact)?,
            Kind::Name(name) => match names.iter().rev().find_map(|scope| scope.get(name.as_str())) {
                Some(value) => value.clone(),
                None => return stop(format!("{name} has no value")),
            },
            Kind::Negative(x) => Value::Number(self.number(x, names, depth)?.negative()),
            Kind::Binary(operation, x, y) => {
                let (x, y) = (self.number(x, names, depth)?, self.number(y, names, depth)?);
                match x.combined(*operation, &y) {
                    Some(x) => Value::Number(x),
                    None => return stop("a division by zero".to_string()),
                }
            }
            Kind::Root(x) => {
                let square = self.number(x, names, depth)?.value;
                // Of no other number: √(25·S) need not be 5·√S modulo the prime.
                match square.square_root().filter(|_| self.point.squares().contains(&square)) {
                    Some(root) => Value::Number(root.into()),
                    None => return stop("a root that none of the arm's loops has".to_string()),
                }
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
            Kind::Free(name, of) => Value::Number(free(name, self.number(of, names, depth)?.value).into()),
            Kind::RowSums(a, b) => {
                let (a, b) = (self.value(a, names, depth)?, self.value(b, names, depth)?);
                match row_sums(&a, &b) {
                    Some(sums) => sums,
                    None => return stop("no two matrices of one shape".to_string()),
                }
            }
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

    fn number<'e>(&self, e: &'e Expr, names: &mut Names<'e>, depth: usize) -> Result<Number, Stop> {
        match self.value(e, names, depth)? {
            Value::Number(x) => Ok(x),
            _ => Err(Stop { line: e.line, message: "no number".to_string() }),
        }
    }

    fn constant(&self, line: usize, exact: &Exact) -> Result<Value, Stop> {
        let stop = |message: &str| Stop { line, message: message.to_string() };
        let residue =
            |x: &Rational| Fp::from_rational(x).ok_or(stop("a number with the prime in its denominator"));
        Ok(Value::Number(match exact {
            Exact::Number(number, turns) => Number {
                value: residue(number)? + residue(turns)? * self.point.pi,
                angle: Some(Rc::new(Affine::constant(number.clone(), turns.clone()))),
            },
            Exact::Symbol(index, sine) => {
                self.point.circle.constant(*index, *sine).ok_or(stop("an angle that the arm has not"))?.into()
            }
        }))
    }

    /// A pair for an angle, a pair of lists for a list.
    fn sine_and_cosine(&self, line: usize, angle: &Value) -> Result<Value, Stop> {
        let of = |angle: &Value| {
            let angle = if let Value::Number(x) = angle { x.angle.as_ref() } else { None };
            let message = "an angle that is no sum of the arm's".to_string();
            angle.and_then(|x| self.point.circle.sine_and_cosine(x)).ok_or(Stop { line, message })
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

/// The numbers of a matrix of columns, row by row; a number is a matrix of one.
pub(crate) fn by_rows(value: &Value, rows: usize, columns: usize) -> Option<Vec<Fp>> {
    let list = |value: &Value, length: usize| {
        value.as_list().filter(|values| values.len() == length).map(<[Value]>::to_vec)
    };
    if (rows, columns) == (1, 1)
        && let Some(x) = value.as_number()
    {
        return Some(vec![x]);
    }
    let matrix = list(value, columns)?;
    let matrix: Vec<_> = matrix.iter().map(|column| list(column, rows)).collect::<Option<_>>()?;
    (0..rows * columns).map(|k| matrix[k % columns][k / columns].as_number()).collect()
}

/// A function of which nothing is known: the same for the same number, as good as free for others.
pub(crate) fn free(name: &str, of: Fp) -> Fp {
    let step = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
    Draws::new(name.bytes().chain(of.residue().to_le_bytes()).fold(0, step)).element()
}

/// Both are lists of columns; the result is a list of one.
fn row_sums(a: &Value, b: &Value) -> Option<Value> {
    let (a, b) = (a.as_list()?, b.as_list()?);
    let mut sums = vec![Fp::ZERO; a.first()?.as_list()?.len()];
    if a.len() != b.len() {
        return None;
    }
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x.as_list()?, y.as_list()?);
        if x.len() != sums.len() || y.len() != sums.len() {
            return None;
        }
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum = *sum + x.as_number()? * y.as_number()?;
        }
    }
    Some(Value::list(vec![Value::numbers(sums)]))
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
    pub(crate) fn fused(line: usize, [x, y, z]: [Expr; 3]) -> Expr {
        let product = Expr { line, kind: Kind::Binary('*', Box::new(x), Box::new(y)) };
        Expr { line, kind: Kind::Binary('+', Box::new(product), Box::new(z)) }
    }

    /// The line of the statement that gives entry (row, column) of a result of columns; the expression's own
    /// where it is not found.
    pub(crate) fn line_of_entry(&self, row: usize, column: usize) -> usize {
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
