//! One function as tokens: straight-line code, one `let` for each node.

use super::angles::{positions, trig_of, uses_positions};
use super::docs;
use super::lanes::used;
use super::statement::{self, Form, Value, input_of, is_number};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::{Argument, Size};
use crate::graph::{Expr, Graph, Input, Node, Preparation};
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{ToTokens, format_ident, quote};
use std::collections::BTreeSet;

/// A function's items: one that takes q, and one that takes [`Trig`] in its place.
pub(super) fn function(model: &Model, built: &FunctionGraph, prepared: usize) -> TokenStream {
    let needed = built.graph.needed(&built.outputs);
    let used = used(built, &needed);
    let name = Ident::new(built.function.name(), Span::call_site());
    let name_with = format_ident!("{name}_with");
    let doc = docs::lines(&docs::function(built));
    let doc_with = docs::lines(&docs::function_with(built));
    let others: Vec<Argument> = built.arguments().filter(|a| *a != Argument::Positions).collect();
    let (signature, bindings): (Vec<_>, Vec<_>) =
        others.iter().map(|a| argument(built, prepared, *a, &used)).unzip();
    let passed = others.iter().map(|a| Ident::new(a.name(), Span::call_site()));
    let plain = others.iter().map(|a| parameter(*a, a.name()));
    let positions = positions(model, &used);
    let trig = trig_of(model, &used);
    let (q, trig_name) = match uses_positions(&used) {
        true => (quote!(q), quote!(trig)),
        false => (quote!(_q), quote!(_trig)),
    };
    let form = Form::of(built, &needed);
    let statements = sections(model, &built.graph, &built.outputs, &needed, &form);
    let (result, value) = result(built, &form);
    let structure = structure(built);
    // Where the result is a number, the last `let` is the result.
    let lint = is_number(built).then(|| quote!(#[allow(clippy::let_and_return)]));
    quote! {
        #(#[doc = #doc])*
        #[must_use]
        pub fn #name<T: SimdRealField + Copy>(#q: &SVector<T, JOINTS>, #(#plain),*) -> #result {
            #trig
            #name_with(&trig, #(#passed),*)
        }

        #(#[doc = #doc_with])*
        #lint
        #[inline(always)]
        #[must_use]
        pub fn #name_with<T: SimdRealField + Copy>(#trig_name: &Trig<T>, #(#signature),*) -> #result {
            #positions
            #(#bindings)*
            #(#statements)*
            #value
        }

        #structure
    }
}

/// Where the entries of a matrix are that are not zero for every state, if not all of them are.
fn structure(built: &FunctionGraph) -> Option<TokenStream> {
    let (rows, columns) = built.shape;
    let is_there = |(i, j): &(usize, usize)| built.outputs[i * columns + j] != Expr::ZERO;
    let all = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j)));
    let entries: Vec<(usize, usize)> = all.filter(is_there).collect();
    if rows == 1 || columns == 1 || entries.len() == rows * columns {
        return None;
    }
    let name = format_ident!("{}_NONZERO", built.function.name().to_uppercase());
    let doc = format!(
        " Row and column, from 0, of the {} entries of [`{}`] that are not always zero, column by column.",
        entries.len(),
        built.function
    );
    let count = Literal::usize_unsuffixed(entries.len());
    let entries = entries.into_iter().map(|(i, j)| {
        let (i, j) = (Literal::usize_unsuffixed(i), Literal::usize_unsuffixed(j));
        quote!((#i, #j))
    });
    Some(quote! {
        #[doc = #doc]
        pub const #name: [(usize, usize); #count] = [#(#entries),*];
    })
}

/// A length in the names of the file.
pub(super) fn length(size: Size) -> TokenStream {
    match size {
        Size::Joints => quote!(JOINTS),
        Size::Parameters => quote!(PARAMETERS),
        Size::Fixed(length) => Literal::usize_unsuffixed(length).to_token_stream(),
    }
}

/// `name: &SVector<T, …>`
fn parameter(argument: Argument, name: &str) -> TokenStream {
    let length = length(argument.size());
    let ident = Ident::new(name, Span::call_site());
    quote!(#ident: &SVector<T, #length>)
}

/// `name: &impl Parameters<T>` for parameters, which may be prepared.
fn shared_parameter(argument: Argument, name: &str) -> TokenStream {
    if argument != Argument::Parameters {
        return parameter(argument, name);
    }
    let ident = Ident::new(name, Span::call_site());
    quote!(#ident: &impl Parameters<T>)
}

/// An argument in the signature, and the line that names what is used of it.
fn argument(
    built: &FunctionGraph,
    prepared: usize,
    argument: Argument,
    used: &BTreeSet<Input>,
) -> (TokenStream, TokenStream) {
    let is_parameters = argument == Argument::Parameters;
    let length = argument.length(built.joints, prepared);
    let is_used = |i: usize| used.contains(&input_of(argument, i));
    if !(0..length).any(is_used) {
        return (shared_parameter(argument, &format!("_{}", argument.name())), quote!());
    }
    let names = (0..length).map(|i| {
        let name = format_ident!("{}", input_of(argument, i).to_string());
        if is_used(i) { quote!(#name) } else { quote!(_) }
    });
    let ident = Ident::new(argument.name(), Span::call_site());
    let parameter = shared_parameter(argument, argument.name());
    match is_parameters {
        true => (parameter, quote!(let Prepared([#(#names),*]) = #ident.prepared();)),
        false => (parameter, quote!(let [[#(#names),*]] = #ident.data.0;)),
    }
}

/// What functions need of the parameters alone: the function that prepares it, and the trait by which they
/// take it.
pub(super) fn preparation(model: &Model, preparation: &Preparation) -> TokenStream {
    let count = Literal::usize_unsuffixed(preparation.values().len());
    let graph = preparation.graph();
    let needed = graph.needed(preparation.values());
    let names: Vec<TokenStream> = needed
        .iter()
        .filter_map(|n| match graph.nodes()[*n] {
            Node::Input(Input::Parameter(i)) => Some(i),
            _ => None,
        })
        .map(|i| {
            let (name, i) = (format_ident!("p{}", i + 1), Literal::usize_unsuffixed(i));
            quote!(let #name = parameters[#i];)
        })
        .collect();
    let statements = sections(model, &graph, preparation.values(), &needed, &Form::plain(&graph));
    let values = preparation.values().iter().map(|e| value_name(&graph, e.node()));
    let operations = preparation.operations();
    let doc = format!(" Operations: {} multiplications, {} additions.", operations.mul, operations.add);
    quote! {
        /// Sums of the parameters as the functions use them; [`prepare`] makes them once for any number of
        /// calls.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Prepared<T>([T; #count]);

        /// What the functions need of the parameters alone: pass it to those that end in `_with`, in place of
        /// the parameters.
        ///
        #[doc = #doc]
        #[inline]
        #[must_use]
        pub fn prepare<T: SimdRealField + Copy>(parameters: &SVector<T, PARAMETERS>) -> Prepared<T> {
            let [parameters] = parameters.data.0;
            #(#names)*
            #(#statements)*
            Prepared([#(#values),*])
        }

        /// Parameters, or what was prepared of them.
        pub trait Parameters<T> {
            /// What the functions need of them.
            fn prepared(&self) -> Prepared<T>;
        }

        impl<T: SimdRealField + Copy> Parameters<T> for SVector<T, PARAMETERS> {
            #[inline]
            fn prepared(&self) -> Prepared<T> {
                prepare(self)
            }
        }

        impl<T: Copy> Parameters<T> for Prepared<T> {
            #[inline]
            fn prepared(&self) -> Prepared<T> {
                *self
            }
        }
    }
}

/// Nodes in one block of code.
const SECTION: usize = 256;

/// The body, in blocks that hand on only what later ones need. Every `let` opens a scope within the one
/// before, and a compiler that writes debug information goes through nested scopes by recursion: thousands of
/// them in a row exhaust its stack.
fn sections(
    model: &Model,
    graph: &Graph,
    outputs: &[Expr],
    needed: &[usize],
    form: &Form,
) -> Vec<TokenStream> {
    let computed: Vec<usize> = needed.iter().copied().filter(|n| form.is_computed(graph, *n)).collect();
    let statement = |n: &usize| statement(model, graph, *n, form);
    if computed.len() <= 2 * SECTION {
        return computed.iter().filter_map(statement).collect();
    }
    let mut last_use = vec![0; graph.nodes().len()];
    for (position, node) in computed.iter().enumerate() {
        for read in form.reads(graph, *node) {
            last_use[read] = position;
        }
    }
    for output in outputs {
        last_use[output.node()] = usize::MAX;
    }
    let mut blocks = Vec::new();
    for (k, section) in computed.chunks(SECTION).enumerate() {
        let end = (k + 1) * SECTION;
        let handed_on = section.iter().filter(|n| last_use[**n] >= end).map(|n| value_name(graph, *n));
        let names: Vec<Ident> = handed_on.collect();
        let statements = section.iter().filter_map(statement);
        blocks.push(quote! {
            let (#(#names,)*) = {
                #(#statements)*
                (#(#names,)*)
            };
        });
    }
    blocks
}

/// The `let` of a node; inputs are bound already.
fn statement(model: &Model, graph: &Graph, node: usize, form: &Form) -> Option<TokenStream> {
    let name = value_name(graph, node);
    let ident = |name: String| Ident::new(&name, Span::call_site());
    let two = |x: String, y: String| (ident(x), ident(y));
    Some(match statement::value(model, graph, node, form)? {
        Value::Number(x) => {
            let x = Literal::f64_suffixed(x);
            quote!(let #name: T = nalgebra::convert(#x);)
        }
        Value::Sum(x, y) => {
            let (x, y) = two(x, y);
            quote!(let #name = #x + #y;)
        }
        Value::Difference(x, y) => {
            let (x, y) = two(x, y);
            quote!(let #name = #x - #y;)
        }
        Value::NegativeSum(x, y) => {
            let (x, y) = two(x, y);
            quote!(let #name = -#x - #y;)
        }
        Value::Product(x, y) => {
            let (x, y) = two(x, y);
            quote!(let #name = #x * #y;)
        }
        Value::Quotient(x, y) => {
            let (x, y) = two(x, y);
            quote!(let #name = #x / #y;)
        }
        Value::Root { of, negative } => {
            let of = ident(of);
            let of = if negative { quote!((-#of)) } else { quote!(#of) };
            quote!(let #name = #of.simd_sqrt();)
        }
        Value::Fused { factors: [x, y], addend, negative: [product, other] } => {
            let (x, y) = two(x, y);
            let addend = ident(addend);
            let x = if product { quote!(-#x) } else { quote!(#x) };
            let addend = if other { quote!(-#addend) } else { quote!(#addend) };
            quote!(let #name = fused(#x, #y, #addend);)
        }
    })
}

fn value_name(graph: &Graph, node: usize) -> Ident {
    Ident::new(&statement::value_name(graph, node), Span::call_site())
}

/// The type of the result and the expression that makes it. nalgebra stores columns.
fn result(built: &FunctionGraph, form: &Form) -> (TokenStream, TokenStream) {
    let (rows, columns) = built.shape;
    let value = |i: usize, j: usize| {
        let (is_negative, name) = statement::result(built, form, i * columns + j);
        let name = Ident::new(&name, Span::call_site());
        if is_negative { quote!(-#name) } else { quote!(#name) }
    };
    let columns_of: Vec<TokenStream> = (0..columns)
        .map(|j| {
            let column = (0..rows).map(|i| value(i, j));
            quote!([#(#column),*])
        })
        .collect();
    if is_number(built) {
        let value = value(0, 0);
        return (quote!(T), value);
    }
    let (n, m) = built.function.size();
    let (n, m) = (length(n), length(m));
    let result = if columns == 1 { quote!(SVector<T, #n>) } else { quote!(SMatrix<T, #n, #m>) };
    (result, quote!(SMatrix::from_array_storage(ArrayStorage([#(#columns_of),*]))))
}
