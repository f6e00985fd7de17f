//! Reads the module `batch` of a generated file in Rust: each function as that of one sample, and once more
//! the way that it takes where an angle is large.

use super::rust::{Reader, formatted, line, pattern, plain};
use crate::language::{Exact, Expr, Kind, Let, ONE_BY_ONE, Pattern, Routine};
use crate::{Checked, wrong};
use dyngen_arm::exact::rational::{parse_rational, to_f64};

/// What functions are generic over.
const SCALAR: &str = "< T : SimdRealField + Copy , const LANES : usize > ";

/// The function that says whether angles are small, as it must be; S stands for a number.
const NEAR: &str = "fn are_near<T: SimdRealField + Copy>(angles: &[T]) -> bool {
    let limit = trigonometry::limit::<T>() * nalgebra::convert(S);
    angles.iter().fold(true, |near, angle| { near & nalgebra::SimdBool::all(angle.simd_abs().simd_le(limit)) })
}";

/// The smallest limit of `trigonometry::near`, that of `f32`, rad.
const LIMIT: f64 = 800.0;

/// A function of the module while it is read.
struct Batch {
    name: String,
    at: usize,
    parameters: Vec<String>,
    /// What stands before the loop.
    lets: Vec<Let>,
    /// The names of the arrays of the result, by columns.
    cells: Vec<Vec<String>>,
    /// How the result is written where samples are taken one by one.
    copied: &'static str,
    /// Angles that must not be large.
    angles: Vec<Expr>,
    /// The arrays of the positions.
    positions: Vec<String>,
}

/// The names that a pattern binds.
fn bound(pattern: &Pattern) -> Vec<&str> {
    match pattern {
        Pattern::Ignored => Vec::new(),
        Pattern::Name(name) => vec![name],
        Pattern::List(patterns) => patterns.iter().flat_map(bound).collect(),
        Pattern::AsPrepared(inner) => bound(inner),
    }
}

fn text_of(code: &str) -> String {
    code.parse().map_or(String::new(), |tokens: proc_macro2::TokenStream| plain(tokens))
}

impl Reader<'_> {
    /// All items of the module.
    pub(super) fn batch(&mut self, items: &[syn::Item]) -> Checked<()> {
        let mut share = None;
        for item in items {
            // The one number in it.
            let text = formatted(item);
            let number = text.split("nalgebra :: convert ( ").nth(1).and_then(|rest| rest.split(' ').next());
            let right =
                |n: &&str| syn::parse_str(&NEAR.replace("(S)", &format!("({n})"))).map(|f| formatted(&f));
            let number = number.filter(|n| right(n).is_ok_and(|right| right == text));
            if let Some(number) = number {
                share = parse_rational(number).ok().map(|x| to_f64(&x));
            }
        }
        for item in items {
            match item {
                syn::Item::Fn(f) if f.sig.ident == "are_near" && share.is_some() => {}
                syn::Item::Fn(f) => self.batch_function(f, share)?,
                syn::Item::Use(_) if plain(item) == "use super :: * ; " => {}
                other => return wrong(line(other), "an item that dyngen does not write"),
            }
        }
        Ok(())
    }

    fn batch_function(&mut self, f: &syn::ItemFn, share: Option<f64>) -> Checked<()> {
        let at = line(f);
        let name = f.sig.ident.to_string();
        if dyngen_arm::Function::parse(&name).is_none()
            || plain(&f.sig.generics).replace(", > ", "> ") != SCALAR
        {
            return wrong(at, &format!("dyngen writes no function {name}"));
        }
        let name = format!("{}batch::{name}", self.module);
        self.place = name.clone();
        let mut parameters = Vec::new();
        for input in &f.sig.inputs {
            let syn::FnArg::Typed(input) = input else { return wrong(at, "a method") };
            parameters.push(plain(&input.pat).trim().to_string());
        }
        if parameters.pop().as_deref() != Some("out") {
            return wrong(at, "a batch form without a place for its results");
        }
        let mut batch = Batch {
            name,
            at,
            parameters,
            lets: Vec::new(),
            cells: Vec::new(),
            copied: "",
            angles: Vec::new(),
            positions: Vec::new(),
        };
        self.lanes.clear();
        let mut loops = 0;
        for statement in &f.block.stmts {
            let at = line(statement);
            match statement {
                syn::Stmt::Local(local) if loops == 0 => self.before_loop(local, &mut batch)?,
                syn::Stmt::Expr(syn::Expr::ForLoop(each), None) if loops == 0 => {
                    loops = 1;
                    self.samples(each, &mut batch)?;
                }
                syn::Stmt::Expr(syn::Expr::If(far), None) if loops == 1 => {
                    loops = 2;
                    self.far(far, &batch, share)?;
                }
                _ => return wrong(at, "a statement that dyngen does not write here"),
            }
        }
        // Without another way every angle would have to be small.
        match (loops, batch.angles.is_empty()) {
            (2, _) | (1, true) => Ok(()),
            _ => wrong(at, "a batch form that does not see whether its angles are large"),
        }
    }

    /// `let [q1, q2] = q;` and the like, and the names of the places of the result.
    fn before_loop(&mut self, local: &syn::Local, batch: &mut Batch) -> Checked<()> {
        let at = line(local);
        let Some(init) = &local.init else { return wrong(at, "a name without a value") };
        let found = pattern(&local.pat)?;
        let is_result = plain(&init.expr) == "& mut * out ";
        if !is_result {
            let value = self.expression(&init.expr)?;
            let is_parameter = |name: &String| batch.parameters.contains(name);
            let opens_parameters = match (&found, &value.kind) {
                (Pattern::List(_), Kind::Name(name)) if is_parameter(name) => false,
                (Pattern::Name(to), Kind::Prepared(of)) if to == "parameters" => {
                    matches!(&of.kind, Kind::Name(name) if name == to)
                }
                _ => return wrong(at, "a value that dyngen does not name so"),
            };
            if matches!(&value.kind, Kind::Name(name) if name == "q") {
                batch.positions = bound(&found).into_iter().map(str::to_string).collect();
            }
            batch.lets.push(Let { pattern: found.clone(), value });
            if opens_parameters {
                return Ok(());
            }
        }
        // A name that stands for two arrays could be read as the wrong one.
        for name in bound(&found) {
            if batch.parameters.iter().any(|p| p == name) || !self.lanes.insert(name.to_string()) {
                return wrong(at, &format!("{name} is bound twice"));
            }
        }
        if !is_result {
            return Ok(());
        }
        let names = |patterns: &[Pattern]| {
            let name = |p: &Pattern| if let Pattern::Name(name) = p { Some(name.clone()) } else { None };
            patterns.iter().map(name).collect::<Option<Vec<_>>>()
        };
        let columns = match &found {
            Pattern::Name(name) => {
                batch.copied = "core::iter::once(&mut *out).zip(core::iter::once(&result))";
                Some(vec![vec![name.clone()]])
            }
            Pattern::List(cells) if names(cells).is_some() => {
                batch.copied = "out.iter_mut().zip(result.iter())";
                names(cells).map(|cells| vec![cells])
            }
            Pattern::List(columns) => {
                batch.copied = "out.iter_mut().flatten().zip(result.iter())";
                let column = |p: &Pattern| if let Pattern::List(cells) = p { names(cells) } else { None };
                columns.iter().map(column).collect()
            }
            _ => None,
        };
        match columns {
            Some(columns) if batch.cells.is_empty() => batch.cells = columns,
            _ => return wrong(at, "places of the result that dyngen does not name so"),
        }
        Ok(())
    }

    /// The loop over samples, without a branch.
    fn samples(&mut self, each: &syn::ExprForLoop, batch: &mut Batch) -> Checked<()> {
        is_over_lanes(each)?;
        let mut lets = batch.lets.clone();
        let mut stored: Vec<(String, Expr)> = Vec::new();
        for statement in &each.body.stmts {
            let at = line(statement);
            match statement {
                syn::Stmt::Local(local) if stored.is_empty() => {
                    lets.push(match angle_of(local) {
                        Some(angle) => {
                            let angle = self.expression(angle)?;
                            batch.angles.push(angle.clone());
                            let value = Expr { line: at, kind: Kind::SinCos(Box::new(angle)) };
                            Let { pattern: self.lane_pattern(local)?, value }
                        }
                        None => self.of_lane(local)?,
                    });
                }
                syn::Stmt::Expr(syn::Expr::Assign(assign), Some(_)) => {
                    let place = plain(&assign.left);
                    let Some(name) = place.strip_suffix(" [ lane ] ") else {
                        return wrong(at, "a place that is no sample's");
                    };
                    stored.push((name.to_string(), self.expression(&assign.right)?));
                }
                _ => return wrong(at, "a statement that dyngen does not write here"),
            }
        }
        let at = line(each);
        let mut columns = Vec::new();
        for column in &batch.cells {
            let mut entries = Vec::new();
            for cell in column {
                let mut of = stored.iter().filter(|(name, _)| name == cell);
                let (Some((_, value)), None) = (of.next(), of.next()) else {
                    return wrong(at, &format!("{cell} is not written once"));
                };
                entries.push(value.clone());
            }
            columns.push(Expr { line: at, kind: Kind::List(entries) });
        }
        if stored.len() != batch.cells.iter().map(Vec::len).sum::<usize>() {
            return wrong(at, "more is written than the result has");
        }
        let result = Expr { line: at, kind: Kind::List(columns) };
        self.insert(batch, batch.name.clone(), lets, result)
    }

    /// `if ![q1, q2]…all near… { for lane in 0..LANES { … } }`
    fn far(&mut self, far: &syn::ExprIf, batch: &Batch, share: Option<f64>) -> Checked<()> {
        let at = line(far);
        let condition = plain(&far.cond);
        let names = condition.strip_prefix("! [ ").and_then(|rest| rest.split(" ] ").next());
        let names = names.unwrap_or_default().to_string();
        let right =
            text_of(&format!("![{names}].into_iter().fold(true, |near, angles| near & are_near(angles))"));
        let small: Vec<&str> = names.split(" , ").collect();
        let fits =
            |angle: &Expr| share.and_then(|s| size(angle, &small, s * LIMIT)).is_some_and(|x| x <= LIMIT);
        let are_positions = small.iter().all(|name| batch.positions.iter().any(|of| of == name));
        if condition != right || !are_positions || far.else_branch.is_some() || !batch.angles.iter().all(fits)
        {
            return wrong(at, "a batch form that does not see whether its angles are large");
        }
        let [syn::Stmt::Expr(syn::Expr::ForLoop(each), None)] = &far.then_branch.stmts[..] else {
            return wrong(at, "a loop over the samples is expected here");
        };
        is_over_lanes(each)?;
        let Some((last, lets)) = each.body.stmts.split_last() else { return wrong(at, "an empty loop") };
        let written = format!("for (cells, value) in {} {{ cells[lane] = *value; }}", batch.copied);
        if plain(last) != text_of(&written) {
            return wrong(line(last), "results that are not written in their order");
        }
        let mut all = batch.lets.clone();
        for statement in lets {
            let syn::Stmt::Local(local) = statement else {
                return wrong(line(statement), "a statement that dyngen does not write here");
            };
            all.push(self.of_lane(local)?);
        }
        let result = Expr { line: at, kind: Kind::Name("result".to_string()) };
        self.insert(batch, format!("{}{ONE_BY_ONE}", batch.name), all, result)
    }

    /// `let NAME = VALUE;` of one sample.
    fn of_lane(&mut self, local: &syn::Local) -> Checked<Let> {
        let at = line(local);
        let Some(init) = local.init.as_ref().filter(|init| init.diverge.is_none() && local.attrs.is_empty())
        else {
            return wrong(at, "only 'let NAME = VALUE;' is read here");
        };
        Ok(Let { pattern: self.lane_pattern(local)?, value: self.expression(&init.expr)? })
    }

    /// The names of values of one sample, none of which may hide an array over the samples.
    fn lane_pattern(&self, local: &syn::Local) -> Checked<Pattern> {
        let found = pattern(&local.pat)?;
        match bound(&found).into_iter().find(|name| self.lanes.contains(*name)) {
            Some(name) => wrong(line(local), &format!("{name} is bound twice")),
            None => Ok(found),
        }
    }

    fn insert(&mut self, batch: &Batch, name: String, lets: Vec<Let>, result: Expr) -> Checked<()> {
        let body = Expr { line: batch.at, kind: Kind::Block(lets, Box::new(result)) };
        let routine = Routine { line: batch.at, parameters: batch.parameters.clone(), body };
        match self.source.routines.insert(name, routine) {
            None => Ok(()),
            Some(_) => wrong(batch.at, "a second function of this name"),
        }
    }
}

/// The angle of `let (s1, c1) = trigonometry::near(ANGLE);`
fn angle_of(local: &syn::Local) -> Option<&syn::Expr> {
    let init = local.init.as_ref().filter(|init| init.diverge.is_none() && local.attrs.is_empty())?;
    let syn::Expr::Call(call) = &*init.expr else { return None };
    let is_near = plain(&call.func) == "trigonometry :: near " && call.args.len() == 1;
    call.args.first().filter(|_| is_near && matches!(local.pat, syn::Pat::Tuple(_)))
}

fn is_over_lanes(each: &syn::ExprForLoop) -> Checked<()> {
    match (plain(&each.pat).as_str(), plain(&each.expr).as_str(), &each.label) {
        ("lane ", "0 .. LANES ", None) => Ok(()),
        _ => wrong(line(each), "a loop over the samples is expected here"),
    }
}

/// The largest size of an angle where those of some names are at most `limit`; nothing where another name is
/// in it.
fn size(angle: &Expr, small: &[&str], limit: f64) -> Option<f64> {
    match &angle.kind {
        Kind::Name(name) => small.contains(&name.as_str()).then_some(limit),
        Kind::Number(Exact::Number(number, turns)) => {
            Some(to_f64(number).abs() + to_f64(turns).abs() * std::f64::consts::PI)
        }
        Kind::Negative(x) => size(x, small, limit),
        Kind::Binary(operation, x, y) => {
            let (x, y) = (size(x, small, limit)?, size(y, small, limit)?);
            match operation {
                '+' | '-' => Some(x + y),
                '*' => Some(x * y),
                _ => None,
            }
        }
        _ => None,
    }
}
