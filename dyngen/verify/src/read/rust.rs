//! Reads a generated file in Rust. Whatever it does not know is an error: nothing in the file stays unlooked
//! at.

use super::head::Literals;
use crate::language::{Exact, Expr, Kind, Let, Pattern, Routine};
use crate::text;
use crate::{Checked, Source, wrong};
use dyngen_arm::Function;
use num_traits::Zero;
use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::BTreeSet;
use std::sync::OnceLock;
use syn::spanned::Spanned;

/// The items around the functions, as they must be; N stands for a number.
const AROUND: &str = "
    use nalgebra::{ArrayStorage, SMatrix, SVector, SimdRealField};
    use super::*;
    pub struct Trig<T> { pub sin: [T; ANGLES], pub cos: [T; ANGLES], pub position: [T; JOINTS] }
    pub struct Prepared<T>([T; N]);
    pub trait Parameters<T> { fn prepared(&self) -> Prepared<T>; }
    impl<T: SimdRealField + Copy> Parameters<T> for SVector<T, PARAMETERS> {
        fn prepared(&self) -> Prepared<T> { prepare(self) }
    }
    impl<T: Copy> Parameters<T> for Prepared<T> { fn prepared(&self) -> Prepared<T> { *self } }
    fn fused<T: SimdRealField + Copy>(x: T, y: T, z: T) -> T { x.simd_mul_add(y, z) }
    fn sign<T: SimdRealField + Copy>(x: T) -> T {
        let (zero, one) = (T::zero(), T::one());
        one.select(x.simd_gt(zero), (-one).select(x.simd_lt(zero), zero))
    }
";
/// Sines and cosines, tested where they are written.
const TRIGONOMETRY: &str = text::TRIGONOMETRY;
/// The one condition among attributes, in the module of sines and cosines.
const ALIGNED: &str = "cfg_attr ( target_arch = \"x86_64\" , repr ( align ( 16 ) ) ) ";
/// The function that gives x·y + z.
const FUSED: &str = "fused";

/// Tokens as text, without attributes and without commas before a closing bracket.
pub(super) fn plain(tokens: impl ToTokens) -> String {
    fn write(tokens: TokenStream, text: &mut String) {
        let mut tokens = tokens.into_iter().peekable();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Group(group) => {
                    let [open, close] = match group.delimiter() {
                        proc_macro2::Delimiter::Parenthesis => ["( ", ") "],
                        proc_macro2::Delimiter::Brace => ["{ ", "} "],
                        proc_macro2::Delimiter::Bracket => ["[ ", "] "],
                        proc_macro2::Delimiter::None => ["", ""],
                    };
                    text.push_str(open);
                    write(group.stream(), text);
                    text.push_str(close);
                }
                TokenTree::Punct(p) if p.as_char() == '#' => {
                    // `#[…]` or `#![…]`
                    if !matches!(tokens.next(), Some(TokenTree::Group(_))) {
                        tokens.next();
                    }
                }
                TokenTree::Punct(p) if p.as_char() == ',' && tokens.peek().is_none() => {}
                TokenTree::Punct(p) if p.spacing() == proc_macro2::Spacing::Joint => text.push(p.as_char()),
                token => text.push_str(&format!("{token} ")),
            }
        }
    }
    let mut text = String::new();
    write(tokens.to_token_stream(), &mut text);
    text
}

pub(super) fn line(of: &impl Spanned) -> usize {
    of.span().start().line
}

/// Reads a file.
pub(crate) fn read(text: &str, literals: &Literals) -> Checked<Source> {
    let file = match syn::parse_file(text) {
        Ok(file) => file,
        Err(e) => return wrong(e.span().start().line, &e.to_string()),
    };
    let mut attributes = Attributes(Ok(()));
    syn::visit::Visit::visit_file(&mut attributes, &file);
    attributes.0?;
    let around = syn::parse_file(AROUND).map_or(Vec::new(), |file| file.items);
    let around = around.iter().map(plain).collect();
    let mut reader = Reader {
        literals,
        around,
        module: String::new(),
        in_batch: false,
        lanes: BTreeSet::new(),
        own: vec![names(&file.items)],
        place: String::new(),
        source: Source::default(),
    };
    reader.items(&file.items)?;
    Ok(reader.source)
}

/// The functions among some items.
fn names(items: &[syn::Item]) -> BTreeSet<String> {
    let name = |item: &syn::Item| match item {
        syn::Item::Fn(f) => Some(f.sig.ident.to_string()),
        _ => None,
    };
    items.iter().filter_map(name).collect()
}

pub(super) struct Reader<'a> {
    literals: &'a Literals,
    around: BTreeSet<String>,
    /// `name::` of the module that is read.
    pub(super) module: String,
    /// Whether its functions are those over blocks of samples.
    in_batch: bool,
    /// The arrays over the samples of such a function, each of one number.
    pub(super) lanes: BTreeSet<String>,
    /// The functions of the file and of that module.
    own: Vec<BTreeSet<String>>,
    /// Where literals stand: the function, then a space and the name in a `let`.
    pub(super) place: String,
    pub(super) source: Source,
}

impl Reader<'_> {
    fn items(&mut self, items: &[syn::Item]) -> Checked<()> {
        items.iter().try_for_each(|item| self.item(item))
    }

    fn item(&mut self, item: &syn::Item) -> Checked<()> {
        match item {
            syn::Item::Fn(f) => {
                let name = f.sig.ident.to_string();
                if [FUSED, "sign"].contains(&name.as_str()) && self.around.contains(&plain(item)) {
                    return Ok(());
                }
                let known = Function::parse(name.strip_suffix("_with").unwrap_or(&name)).is_some();
                let other = ["prepare", "friction_columns", "friction"].contains(&name.as_str());
                if !known && !other && !name.starts_with("angles_") {
                    return wrong(line(f), &format!("dyngen writes no function {name}"));
                }
                self.function(&f.sig, &f.block, name)
            }
            syn::Item::Const(item) => {
                if is_condition(item) {
                    return Ok(());
                }
                self.constant(item)
            }
            syn::Item::Impl(item) if plain(&item.self_ty) == "Trig < T > " && item.trait_.is_none() => {
                if plain(&item.generics) != SCALAR {
                    return wrong(line(item), "another scalar than dyngen writes");
                }
                item.items.iter().try_for_each(|f| match f {
                    syn::ImplItem::Fn(f) if f.sig.ident == "new" => {
                        self.function(&f.sig, &f.block, "Trig::new".into())
                    }
                    other => wrong(line(other), "Trig has no other function than new"),
                })
            }
            syn::Item::Mod(item) => self.module(item),
            other => {
                let text = plain(other);
                // The one number that is not the same in every file; its array is checked where it is built.
                let text = match text.strip_prefix("pub struct Prepared < T > ( [ T ; ") {
                    Some(_) => "pub struct Prepared < T > ( [ T ; N ] ) ; ".to_string(),
                    None => text,
                };
                match self.around.contains(&text) {
                    true => Ok(()),
                    false => wrong(line(other), "an item that dyngen does not write"),
                }
            }
        }
    }

    fn module(&mut self, item: &syn::ItemMod) -> Checked<()> {
        let name = item.ident.to_string();
        let Some((_, items)) = &item.content else { return wrong(line(item), "a module without its text") };
        match name.as_str() {
            "trigonometry" => {
                static WRITTEN: OnceLock<Vec<String>> = OnceLock::new();
                return as_written(items, WRITTEN.get_or_init(|| formatted_items(TRIGONOMETRY)), &name);
            }
            "discrete" if self.module.is_empty() => {
                let baked = self.source.constants.contains_key("PARAMETER_VALUES");
                return as_written(items, &formatted_items(&text::discrete(baked)), &name);
            }
            "tests" if is_tests(item) => {}
            "batch" => {
                self.in_batch = true;
                self.batch(items)?;
                self.in_batch = false;
                return Ok(());
            }
            _ if self.module.is_empty() => {
                self.module = format!("{name}::");
                self.own.push(names(items));
                self.source.modules.push((name, line(item)));
                self.items(items)?;
                self.own.pop();
                self.module = String::new();
                return Ok(());
            }
            _ => return wrong(line(item), "a module that dyngen does not write"),
        }
        self.source.not_checked.push(format!("{}{name}", self.module));
        Ok(())
    }

    fn constant(&mut self, item: &syn::ItemConst) -> Checked<()> {
        let name = item.ident.to_string();
        let known = [
            "FRICTION_TERMS",
            "MOTOR_VELOCITIES",
            "JOINTS",
            "JOINT_NAMES",
            "PARAMETERS",
            "PARAMETER_NAMES",
            "PARAMETER_VALUES",
            "ANGLES",
        ];
        let structure = name.strip_suffix("_NONZERO").and_then(|f| Function::parse(&f.to_lowercase()));
        let name = match structure {
            Some(function) => crate::structure_of(&format!("{}{function}", self.module)),
            None => name,
        };
        if structure.is_none() && (!known.contains(&name.as_str()) || !self.module.is_empty()) {
            return wrong(line(item), &format!("dyngen writes no constant {name}"));
        }
        let entries: Vec<String> = match &*item.expr {
            syn::Expr::Array(array) => array.elems.iter().map(constant_text).collect(),
            other => vec![constant_text(other)],
        };
        self.source.constants.insert(name, (line(item), entries));
        Ok(())
    }

    fn function(&mut self, signature: &syn::Signature, body: &syn::Block, name: String) -> Checked<()> {
        let at = line(signature);
        let odd = [signature.constness.is_some(), signature.asyncness.is_some(), signature.abi.is_some()];
        let scalar = if name == "Trig::new" { "" } else { SCALAR };
        if plain(&signature.generics) != scalar || odd.contains(&true) {
            return wrong(at, &format!("{name} has another signature than dyngen writes"));
        }
        let mut parameters = Vec::new();
        for input in &signature.inputs {
            let syn::FnArg::Typed(input) = input else { return wrong(at, "a method") };
            let parameter = plain(&input.pat).trim().to_string();
            let kind = plain(&input.ty);
            let right = match parameter.trim_start_matches('_') {
                "trig" => kind == "& Trig < T > ",
                "f" => kind == "& SVector < T , 6 > ",
                "payload" => kind == "& SVector < T , 10 > ",
                "coefficients" => kind == "& SMatrix < T , JOINTS , FRICTION_TERMS > ",
                "parameters" => kind == "& SVector < T , PARAMETERS > " || kind == "& impl Parameters < T > ",
                _ => kind == "& SVector < T , JOINTS > ",
            };
            if !right {
                return wrong(line(input), &format!("{parameter} has another type than dyngen writes"));
            }
            parameters.push(parameter);
        }
        let name = format!("{}{name}", self.module);
        self.place = name.clone();
        let routine = Routine { line: at, parameters, body: self.block(body)? };
        match self.source.routines.insert(name, routine) {
            None => Ok(()),
            Some(_) => wrong(at, "a second function of this name"),
        }
    }

    fn block(&mut self, block: &syn::Block) -> Checked<Expr> {
        let Some((syn::Stmt::Expr(result, None), lets)) = block.stmts.split_last() else {
            return wrong(line(block), "a block without a result");
        };
        let outside = self.place.clone();
        let function = outside.split(' ').next().unwrap_or_default().to_string();
        let mut statements = Vec::with_capacity(lets.len());
        for statement in lets {
            let syn::Stmt::Local(syn::Local { attrs, pat, init: Some(init), .. }) = statement else {
                return wrong(line(statement), "only 'let NAME = VALUE;' is read here");
            };
            if !attrs.is_empty() || init.diverge.is_some() {
                return wrong(line(statement), "only 'let NAME = VALUE;' is read here");
            }
            let pattern = pattern(pat)?;
            if let Pattern::Name(name) = &pattern {
                self.place = format!("{function} {name}");
            }
            statements.push(Let { pattern, value: self.expression(&init.expr)? });
        }
        self.place = outside;
        Ok(Expr { line: line(result), kind: Kind::Block(statements, Box::new(self.expression(result)?)) })
    }

    fn expressions<'e>(&mut self, of: impl IntoIterator<Item = &'e syn::Expr>) -> Checked<Vec<Expr>> {
        of.into_iter().map(|e| self.expression(e)).collect()
    }

    fn boxed(&mut self, e: &syn::Expr) -> Checked<Box<Expr>> {
        self.expression(e).map(Box::new)
    }

    pub(super) fn expression(&mut self, e: &syn::Expr) -> Checked<Expr> {
        let at = line(e);
        let unknown = || wrong(at, "an expression that dyngen does not write");
        let kind = match e {
            syn::Expr::Paren(inner) => return self.expression(&inner.expr),
            syn::Expr::Group(inner) => return self.expression(&inner.expr),
            syn::Expr::Reference(inner) if inner.mutability.is_none() => return self.expression(&inner.expr),
            syn::Expr::Block(inner) if inner.label.is_none() && inner.attrs.is_empty() => {
                return self.block(&inner.block);
            }
            syn::Expr::Path(path) => match path.path.get_ident() {
                Some(name) => Kind::Name(name.to_string()),
                None => return unknown(),
            },
            syn::Expr::Unary(syn::ExprUnary { op: syn::UnOp::Neg(_), expr, .. }) => {
                Kind::Negative(self.boxed(expr)?)
            }
            syn::Expr::Binary(binary) => {
                let operation = match binary.op {
                    syn::BinOp::Add(_) => '+',
                    syn::BinOp::Sub(_) => '-',
                    syn::BinOp::Mul(_) => '*',
                    syn::BinOp::Div(_) => '/',
                    _ => return unknown(),
                };
                Kind::Binary(operation, self.boxed(&binary.left)?, self.boxed(&binary.right)?)
            }
            syn::Expr::Array(array) => Kind::List(self.expressions(&array.elems)?),
            syn::Expr::Tuple(tuple) => Kind::List(self.expressions(&tuple.elems)?),
            syn::Expr::Struct(record) if record.path.is_ident("Trig") && record.rest.is_none() => {
                let mut fields = Vec::new();
                for field in &record.fields {
                    let name = plain(&field.member).trim().to_string();
                    if fields.iter().any(|(other, _)| *other == name) {
                        return wrong(at, "a record with a field twice");
                    }
                    fields.push((name, self.expression(&field.expr)?));
                }
                Kind::Record(fields)
            }
            syn::Expr::Field(field) => match (&field.member, &*field.base) {
                (syn::Member::Named(name), base) if name != "data" => {
                    Kind::Field(self.boxed(base)?, name.to_string())
                }
                // The storage of a matrix: its columns.
                (syn::Member::Unnamed(index), syn::Expr::Field(data))
                    if index.index == 0 && plain(&data.member) == "data " =>
                {
                    return self.expression(&data.base);
                }
                _ => return unknown(),
            },
            // One sample of a batch: its number among them is the same everywhere.
            syn::Expr::Index(index) if plain(&index.index) == "lane " => match plain(&index.expr).trim() {
                array if self.lanes.contains(array) => Kind::Name(array.to_string()),
                _ => return wrong(at, "a sample of what is no array over the samples"),
            },
            syn::Expr::Index(index) => match plain(&index.index).trim().parse() {
                Ok(number) => Kind::Index(self.boxed(&index.expr)?, number),
                Err(_) => return unknown(),
            },
            syn::Expr::MethodCall(call)
                if call.method == "prepared" && call.args.is_empty() && call.turbofish.is_none() =>
            {
                Kind::Prepared(self.boxed(&call.receiver)?)
            }
            syn::Expr::MethodCall(call) if call.turbofish.is_none() => {
                match (call.method.to_string().as_str(), &*call.receiver, call.args.is_empty()) {
                    ("simd_sqrt", of, true) => Kind::Root(self.boxed(of)?),
                    ("simd_tanh", of, true) => Kind::Free("tanh", self.boxed(of)?),
                    ("column_sum", syn::Expr::MethodCall(product), true)
                        if product.method == "component_mul" && product.args.len() == 1 =>
                    {
                        Kind::RowSums(self.boxed(&product.receiver)?, self.boxed(&product.args[0])?)
                    }
                    _ => return unknown(),
                }
            }
            syn::Expr::Call(call) => self.call(at, call)?,
            _ => return unknown(),
        };
        Ok(Expr { line: at, kind })
    }

    fn call(&mut self, at: usize, call: &syn::ExprCall) -> Checked<Kind> {
        let (function, arguments) = (plain(&call.func), &call.args);
        let function = function.trim_end();
        let number =
            |n: i64| Kind::Number(Exact::Number(dyngen_arm::exact::rational::integer(n), Zero::zero()));
        Ok(match (function, arguments.len()) {
            ("nalgebra :: convert" | "nalgebra :: convert :: < f64 , T >", 1) => {
                self.literal(at, &arguments[0])?
            }
            ("T :: zero", 0) => number(0),
            ("T :: one", 0) => number(1),
            ("SMatrix :: from_array_storage" | "SVector :: from_array_storage" | "ArrayStorage", 1) => {
                return Ok(self.expression(&arguments[0])?.kind);
            }
            ("Prepared", 1) => Kind::AsPrepared(self.boxed(&arguments[0])?),
            ("trigonometry :: sin_cos", 2) => {
                let of = vec![self.expression(&arguments[0])?];
                let angles = Kind::Call(self.called(at, plain(&arguments[1]).trim())?, of);
                Kind::SinCos(Box::new(Expr { line: at, kind: angles }))
            }
            ("sign", 1) => Kind::Free("sign", self.boxed(&arguments[0])?),
            (FUSED, 3) => match <[Expr; 3]>::try_from(self.expressions(arguments)?) {
                Ok(of) => return Ok(Expr::fused(at, of).kind),
                Err(_) => return wrong(at, "three numbers are expected here"),
            },
            ("Trig :: new", 1) => Kind::Call("Trig::new".to_string(), self.expressions(arguments)?),
            (name, _) => Kind::Call(self.called(at, name)?, self.expressions(arguments)?),
        })
    }

    /// The function that a name stands for in the module that is read.
    fn called(&self, at: usize, name: &str) -> Checked<String> {
        // Of a batch form the function of one sample is that of the module around it.
        let function = if self.in_batch { name.strip_prefix("super :: ") } else { Some(name) };
        let has = |own: Option<&BTreeSet<String>>| {
            own.zip(function).is_some_and(|(own, function)| own.contains(function))
        };
        match function {
            Some(function) if self.own.len() > 1 && has(self.own.last()) => {
                Ok(format!("{}{function}", self.module))
            }
            Some(function) if has(self.own.first()) => Ok(function.to_string()),
            _ => wrong(at, &format!("a call of {name}, which dyngen does not write")),
        }
    }

    /// A number as `0.5f64`.
    fn literal(&mut self, at: usize, e: &syn::Expr) -> Checked<Kind> {
        if let syn::Expr::Unary(syn::ExprUnary { op: syn::UnOp::Neg(_), expr, .. }) = e {
            return Ok(Kind::Negative(Box::new(Expr { line: at, kind: self.literal(at, expr)? })));
        }
        let text = plain(e);
        let digits = text.trim_end().strip_suffix("f64").unwrap_or_default();
        if self.literals.is_unexplained(digits) {
            self.source.unexplained.push((at, digits.to_string()));
        }
        match self.literals.exact(digits, &self.place) {
            Some(exact) => Ok(Kind::Number(exact)),
            None => wrong(at, &format!("{text}is no number that dyngen writes")),
        }
    }
}

/// What functions are generic over.
const SCALAR: &str = "< T : SimdRealField + Copy > ";

/// The entry of a constant: a string's text, or tokens.
fn constant_text(e: &syn::Expr) -> String {
    match e {
        syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) => text.value(),
        other => plain(other).replace(' ', "").trim_end_matches("f64").to_string(),
    }
}

pub(super) fn pattern(of: &syn::Pat) -> Checked<Pattern> {
    let list = |of: &syn::punctuated::Punctuated<syn::Pat, _>| of.iter().map(pattern).collect::<Checked<_>>();
    Ok(match of {
        syn::Pat::Wild(_) => Pattern::Ignored,
        syn::Pat::Ident(name)
            if name.by_ref.is_none() && name.mutability.is_none() && name.subpat.is_none() =>
        {
            Pattern::Name(name.ident.to_string())
        }
        syn::Pat::Type(typed) if plain(&typed.ty) == "T " => pattern(&typed.pat)?,
        syn::Pat::Slice(of) => Pattern::List(list(&of.elems)?),
        syn::Pat::Tuple(of) => Pattern::List(list(&of.elems)?),
        syn::Pat::TupleStruct(of) if of.path.is_ident("Prepared") && of.elems.len() == 1 => {
            Pattern::AsPrepared(Box::new(pattern(&of.elems[0])?))
        }
        other => return wrong(line(other), "a pattern that dyngen does not write"),
    })
}

/// Whether a constant says on which targets a file compiles: it has no name and no value.
fn is_condition(item: &syn::ItemConst) -> bool {
    let asserts = |of: &syn::ExprMacro| of.mac.path.is_ident("assert") && plain(&item.ty) == "( ) ";
    item.ident == "_" && matches!(&*item.expr, syn::Expr::Macro(of) if asserts(of))
}

/// Whether a module is that of the arm's own tests, which is not looked into.
fn is_tests(item: &syn::ItemMod) -> bool {
    item.ident == "tests" && item.attrs.first().is_some_and(|a| plain(&a.meta) == "cfg ( test ) ")
}

/// Refuses attributes that may change what is computed, wherever they stand outside the arm's own tests.
struct Attributes(Checked<()>);

impl<'ast> syn::visit::Visit<'ast> for Attributes {
    fn visit_attribute(&mut self, attribute: &'ast syn::Attribute) {
        let known = ["doc", "allow", "must_use", "inline"].iter().any(|name| attribute.path().is_ident(name));
        let text = plain(&attribute.meta);
        let known =
            known || ["derive ( Clone , Copy , Debug , PartialEq ) ", ALIGNED].contains(&text.as_str());
        if !known && self.0.is_ok() {
            self.0 = wrong(line(attribute), "an attribute that dyngen does not write");
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_tests(item) {
            syn::visit::visit_item_mod(self, item);
        }
    }
}

/// An item as a formatter leaves it, which adds braces.
pub(super) fn formatted(item: &syn::Item) -> String {
    let file = syn::File { shebang: None, frontmatter: None, attrs: Vec::new(), items: vec![item.clone()] };
    syn::parse_file(&prettyplease::unparse(&file)).map(plain).unwrap_or_default()
}

fn formatted_items(text: &str) -> Vec<String> {
    syn::parse_file(text).map_or(Vec::new(), |file| file.items.iter().map(formatted).collect())
}

/// A module whose text is the same in every file must be what this version of dyngen writes.
fn as_written(items: &[syn::Item], expected: &[String], name: &str) -> Checked<()> {
    for (k, item) in items.iter().enumerate() {
        if expected.get(k).is_none_or(|expected| *expected != plain(item) && *expected != formatted(item)) {
            let message = format!("the module {name} is not the one that this version of dyngen writes");
            return wrong(line(item), &message);
        }
    }
    match items.len() == expected.len() {
        true => Ok(()),
        false => wrong(items.last().map_or(1, line), &format!("the module {name} is not complete")),
    }
}
