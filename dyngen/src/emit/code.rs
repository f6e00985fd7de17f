//! One function as tokens: straight-line code, one `let` for each node.

use super::docs;
use crate::arm::{Arm, JointKind};
use crate::base::ParameterSet;
use crate::dynamics::function::trig_offset;
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Expr, Input, Node};
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{format_ident, quote};
use std::collections::BTreeSet;

/// A function's item.
pub(super) fn function(model: &Model, set: &ParameterSet, built: &FunctionGraph) -> TokenStream {
    let arm = model.arm();
    let function = built.function;
    let needed = built.graph.needed(&built.outputs);
    let used: BTreeSet<Input> = needed
        .iter()
        .filter_map(|n| match built.graph.nodes()[*n] {
            Node::Input(input) => Some(input),
            _ => None,
        })
        .collect();
    let name = Ident::new(function.name(), Span::call_site());
    let doc = docs::lines(&docs::function(arm, set, built));
    let (signature, bindings) = arguments(arm, set, function, &used);
    let trigonometry = trigonometry(arm, &used);
    let statements = needed.iter().filter_map(|n| statement(model, built, *n));
    let (result, value) = result(built);
    quote! {
        #(#[doc = #doc])*
        #[must_use]
        pub fn #name<T: SimdRealField + Copy>(#(#signature),*) -> #result {
            #(#bindings)*
            #(#trigonometry)*
            #(#statements)*
            #value
        }
    }
}

/// The arguments, and how those that are used get names.
fn arguments(
    arm: &Arm,
    set: &ParameterSet,
    function: Function,
    used: &BTreeSet<Input>,
) -> (Vec<TokenStream>, Vec<TokenStream>) {
    let n = arm.dof();
    type Wanted = fn(usize) -> Vec<Input>;
    let position: Wanted = |i| vec![Input::Sin(i), Input::Cos(i), Input::Position(i)];
    let mut given: Vec<(&str, usize, Wanted)> = vec![("q", n, position)];
    if function.takes_speeds() {
        given.push(("dq", n, |i| vec![Input::Speed(i)]));
    }
    if function.takes_accelerations() {
        given.push(("ddq", n, |i| vec![Input::Acceleration(i)]));
    }
    if function.takes_torques() {
        given.push(("tau", n, |i| vec![Input::Torque(i)]));
    }
    if function.takes_parameters() {
        given.push(("parameters", set.parameters.len(), |i| vec![Input::Parameter(i)]));
    }
    let (mut signature, mut bindings) = (Vec::new(), Vec::new());
    for (name, length, inputs) in given {
        let names: Vec<TokenStream> = (0..length)
            .map(|i| {
                let wanted = inputs(i);
                if wanted.iter().any(|input| used.contains(input)) {
                    let element = if name == "parameters" { "p" } else { name };
                    let ident = format_ident!("{element}{}", i + 1);
                    quote!(#ident)
                } else {
                    quote!(_)
                }
            })
            .collect();
        let length = if name == "parameters" { quote!(PARAMETERS) } else { quote!(JOINTS) };
        let any = names.iter().any(|n| n.to_string() != "_");
        let ident = Ident::new(&if any { name.to_string() } else { format!("_{name}") }, Span::call_site());
        signature.push(quote!(#ident: &SVector<T, #length>));
        if any {
            // Taking the storage apart needs no bounds check and cannot panic.
            bindings.push(quote!(let [[#(#names),*]] = #ident.data.0;));
        }
    }
    (signature, bindings)
}

/// Sines and cosines of the angles that are used.
fn trigonometry(arm: &Arm, used: &BTreeSet<Input>) -> Vec<TokenStream> {
    let mut lines = Vec::new();
    for (i, joint) in arm.joints.iter().enumerate() {
        if joint.kind == JointKind::Prismatic {
            continue;
        }
        let (sin, cos) = (used.contains(&Input::Sin(i)), used.contains(&Input::Cos(i)));
        let (q, s, c) =
            (format_ident!("q{}", i + 1), format_ident!("s{}", i + 1), format_ident!("c{}", i + 1));
        let offset = trig_offset(arm, i);
        let angle = if offset == 0.0 {
            quote!(#q)
        } else {
            let offset = Literal::f64_suffixed(offset);
            quote!((#q + nalgebra::convert::<f64, T>(#offset)))
        };
        match (sin, cos) {
            (true, true) => lines.push(quote!(let (#s, #c) = #angle.simd_sin_cos();)),
            (true, false) => lines.push(quote!(let #s = #angle.simd_sin();)),
            (false, true) => lines.push(quote!(let #c = #angle.simd_cos();)),
            (false, false) => {}
        }
    }
    lines
}

/// The `let` of a node; inputs are bound already.
fn statement(model: &Model, built: &FunctionGraph, node: usize) -> Option<TokenStream> {
    let name = format_ident!("x{node}");
    let operand = |e: Expr| value_name(built, e.node());
    Some(match built.graph.nodes()[node] {
        Node::Input(_) => return None,
        Node::Constant(index) => {
            let value = Literal::f64_suffixed(rational::to_f64(built.graph.constant(index)));
            quote!(let #name: T = nalgebra::convert(#value);)
        }
        Node::Symbol(index, sine) => {
            let (s, c) = model.symbols().angles[index as usize].sin_cos();
            let value = Literal::f64_suffixed(if sine { s } else { c });
            quote!(let #name: T = nalgebra::convert(#value);)
        }
        Node::Add(a, b) => {
            let (x, y) = (operand(a), operand(b));
            if b.is_negative() { quote!(let #name = #x - #y;) } else { quote!(let #name = #x + #y;) }
        }
        Node::Mul(a, b) => {
            let (x, y) = (operand(a), operand(b));
            quote!(let #name = #x * #y;)
        }
        Node::Div(a, b) => {
            let (x, y) = (operand(a), operand(b));
            quote!(let #name = #x / #y;)
        }
    })
}

fn value_name(built: &FunctionGraph, node: usize) -> Ident {
    match built.graph.nodes()[node] {
        Node::Input(input) => match input {
            Input::Sin(i) => format_ident!("s{}", i + 1),
            Input::Cos(i) => format_ident!("c{}", i + 1),
            Input::Position(i) => format_ident!("q{}", i + 1),
            Input::Speed(i) => format_ident!("dq{}", i + 1),
            Input::Acceleration(i) => format_ident!("ddq{}", i + 1),
            Input::Torque(i) => format_ident!("tau{}", i + 1),
            Input::Parameter(i) => format_ident!("p{}", i + 1),
        },
        _ => format_ident!("x{node}"),
    }
}

/// The type of the result and the expression that makes it. nalgebra stores columns.
fn result(built: &FunctionGraph) -> (TokenStream, TokenStream) {
    let (rows, columns) = built.shape;
    let value = |i: usize, j: usize| {
        let e = built.outputs[i * columns + j];
        let name = value_name(built, e.node());
        if e.is_negative() { quote!(-#name) } else { quote!(#name) }
    };
    let columns_of: Vec<TokenStream> = (0..columns)
        .map(|j| {
            let column = (0..rows).map(|i| value(i, j));
            quote!([#(#column),*])
        })
        .collect();
    let result = match built.function {
        Function::Regressor => quote!(SMatrix<T, JOINTS, PARAMETERS>),
        Function::ForwardKinematics => quote!(SMatrix<T, 4, 4>),
        _ if columns == 1 => quote!(SVector<T, JOINTS>),
        _ => quote!(SMatrix<T, JOINTS, JOINTS>),
    };
    (result, quote!(SMatrix::from_array_storage(ArrayStorage([#(#columns_of),*]))))
}
