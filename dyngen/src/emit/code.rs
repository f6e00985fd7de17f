//! One function as tokens: straight-line code, one `let` for each node.

use super::docs;
use crate::arm::{Arm, JointKind};
use crate::dynamics::function::{Argument, Size, trig_offset};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Expr, Input, Node, operands};
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{ToTokens, format_ident, quote};
use std::collections::BTreeSet;

/// A function's items: one that takes q, and one that takes [`Trig`] in its place.
pub(super) fn function(model: &Model, built: &FunctionGraph) -> TokenStream {
    let arm = model.arm();
    let needed = built.graph.needed(&built.outputs);
    let used = used(built, &needed);
    let name = Ident::new(built.function.name(), Span::call_site());
    let name_with = format_ident!("{name}_with");
    let doc = docs::lines(&docs::function(built));
    let doc_with = docs::lines(&docs::function_with(built));
    let others: Vec<Argument> = built.arguments().filter(|a| *a != Argument::Positions).collect();
    let (signature, bindings): (Vec<_>, Vec<_>) = others.iter().map(|a| argument(built, *a, &used)).unzip();
    let passed = others.iter().map(|a| Ident::new(a.name(), Span::call_site()));
    let plain = others.iter().map(|a| parameter(*a, a.name()));
    let positions = positions(built, &used);
    let trig = trig_of(arm, &used);
    let (q, trig_name) = match uses_positions(&used) {
        true => (quote!(q), quote!(trig)),
        false => (quote!(_q), quote!(_trig)),
    };
    let statements = sections(model, built, &needed);
    let (result, value) = result(built);
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
    }
}

/// Whether the result is a number for every arm: where it is a vector, one joint makes it a vector of one.
pub(super) fn is_number(built: &FunctionGraph) -> bool {
    matches!(built.function, Function::KineticEnergy | Function::PotentialEnergy)
}

/// The struct of sines and cosines that functions share.
pub(super) fn trig_struct(arm: &Arm) -> TokenStream {
    let all: BTreeSet<Input> =
        (0..arm.dof()).flat_map(|i| [Input::Sin(i), Input::Cos(i), Input::Position(i)]).collect();
    let (bindings, fields) = trig_fields(arm, &all);
    let shifted: Vec<String> = (0..arm.dof())
        .filter(|i| trig_offset(arm, *i) != 0.0)
        .map(|i| format!(" Joint {}: of q + {} rad.", i + 1, trig_offset(arm, i)))
        .collect();
    quote! {
        /// Joint positions with their sines and cosines: computed once and shared between calls, or taken from
        /// wherever the caller has them.
        #(#[doc = #shifted])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Trig<T> {
            /// Sine of each revolute joint's angle; not read for prismatic joints.
            pub sin: [T; JOINTS],
            /// Cosine of each revolute joint's angle; not read for prismatic joints.
            pub cos: [T; JOINTS],
            /// Position of each prismatic joint, m; not read for revolute joints.
            pub position: [T; JOINTS],
        }

        impl<T: SimdRealField + Copy> Trig<T> {
            /// From joint positions, rad (m where prismatic).
            #[must_use]
            pub fn new(q: &SVector<T, JOINTS>) -> Self {
                #bindings
                #fields
            }
        }
    }
}

fn uses_positions(used: &BTreeSet<Input>) -> bool {
    used.iter().any(|i| matches!(i, Input::Sin(_) | Input::Cos(_) | Input::Position(_)))
}

/// `let trig = …` with what a function uses; the rest is zero, because nobody reads it.
fn trig_of(arm: &Arm, used: &BTreeSet<Input>) -> TokenStream {
    let (bindings, fields) = trig_fields(arm, used);
    if uses_positions(used) { quote!(#bindings let trig = #fields;) } else { quote!(let trig = #fields;) }
}

/// The inputs that a function reads.
fn used(built: &FunctionGraph, needed: &[usize]) -> BTreeSet<Input> {
    let inputs = needed.iter().filter_map(|n| match built.graph.nodes()[*n] {
        Node::Input(input) => Some(input),
        _ => None,
    });
    inputs.collect()
}

/// What a function takes of q: the positions that it reads, and the angles whose sine or cosine it needs.
struct Positions {
    /// A position's name, where it is read.
    names: Vec<Option<Ident>>,
    /// Each angle's joint, and the names of its sine and cosine where they are read.
    angles: Vec<(usize, TokenStream, TokenStream)>,
    /// A `Trig` of them; the rest is zero, because nobody reads it.
    trig: TokenStream,
}

impl Positions {
    /// `position` is how a joint's position is read once it has a name.
    fn new(arm: &Arm, used: &BTreeSet<Input>, position: impl Fn(&Ident) -> TokenStream) -> Positions {
        let zero = quote!(T::zero());
        let (mut names, mut angles) = (Vec::new(), Vec::new());
        let (mut sines, mut cosines, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for (i, joint) in arm.joints.iter().enumerate() {
            let [q, s, c] = ["q", "s", "c"].map(|letter| format_ident!("{letter}{}", i + 1));
            let revolute = joint.kind == JointKind::Revolute;
            let sin = (revolute && used.contains(&Input::Sin(i))).then(|| quote!(#s));
            let cos = (revolute && used.contains(&Input::Cos(i))).then(|| quote!(#c));
            let place = (!revolute && used.contains(&Input::Position(i))).then(|| position(&q));
            if sin.is_some() || cos.is_some() {
                let bound = |name: &Option<TokenStream>| name.clone().unwrap_or(quote!(_));
                angles.push((i, bound(&sin), bound(&cos)));
            }
            let read = sin.is_some() || cos.is_some() || place.is_some();
            names.push(read.then_some(q));
            sines.push(sin.unwrap_or(zero.clone()));
            cosines.push(cos.unwrap_or(zero.clone()));
            places.push(place.unwrap_or(zero.clone()));
        }
        let trig = quote!(Trig { sin: [#(#sines),*], cos: [#(#cosines),*], position: [#(#places),*] });
        Positions { names, angles, trig }
    }
}

/// The angle of a joint at a position.
fn angle(arm: &Arm, joint: usize, position: &TokenStream) -> TokenStream {
    match trig_offset(arm, joint) {
        0.0 => quote!(#position),
        offset => {
            let offset = Literal::f64_suffixed(offset);
            quote!(#position + nalgebra::convert::<f64, T>(#offset))
        }
    }
}

/// Takes q apart, computes all sines and cosines together, and builds a `Trig` of the inputs that are used. A pattern
/// over the storage needs no bounds check and cannot panic.
fn trig_fields(arm: &Arm, used: &BTreeSet<Input>) -> (TokenStream, TokenStream) {
    let Positions { names, angles, trig } = Positions::new(arm, used, |q| quote!(#q));
    let patterns = names.iter().map(|name| name.as_ref().map_or(quote!(_), |name| quote!(#name)));
    let computed = (!angles.is_empty()).then(|| {
        let (sines, cosines) = (angles.iter().map(|a| &a.1), angles.iter().map(|a| &a.2));
        let values = angles
            .iter()
            .map(|(i, ..)| angle(arm, *i, &lane_name(Argument::Positions, *i).into_token_stream()));
        quote!(let ([#(#sines),*], [#(#cosines),*]) = trigonometry::sin_cos([#(#values),*]);)
    });
    let bindings = quote! {
        let [[#(#patterns),*]] = q.data.0;
        #computed
    };
    (bindings, trig)
}

/// Of one sample in a block: the `Trig` that a function reads, whose lines are without a branch, and the joints whose angles
/// that is right for only where they are near.
pub(super) fn trig_of_lane(
    model: &Model,
    built: &FunctionGraph,
) -> (TokenStream, Vec<usize>, BTreeSet<usize>) {
    let arm = model.arm();
    let used = used(built, &built.graph.needed(&built.outputs));
    let Positions { names, angles, trig } = Positions::new(arm, &used, |q| quote!(#q[lane]));
    let lines = angles.iter().map(|(i, sine, cosine)| {
        let q = lane_name(Argument::Positions, *i);
        let angle = angle(arm, *i, &quote!(#q[lane]));
        quote!(let (#sine, #cosine) = trigonometry::near(#angle);)
    });
    let tokens = quote! {
        #(#lines)*
        let trig = #trig;
    };
    let read = (0..names.len()).filter(|i| names[*i].is_some()).collect();
    (tokens, angles.iter().map(|(i, ..)| *i).collect(), read)
}

/// The name of an argument's value at a joint.
pub(super) fn lane_name(argument: Argument, joint: usize) -> Ident {
    format_ident!("{}{}", argument.name(), joint + 1)
}

/// The module that computes sines and cosines, for an arm that has any.
pub(super) fn trigonometry(arm: &Arm) -> TokenStream {
    if arm.joints.iter().all(|joint| joint.kind != JointKind::Revolute) {
        return quote!();
    }
    // The module that this crate compiles too: it parses.
    let file = syn::parse_file(include_str!("trigonometry.rs"));
    let (docs, items) = file.map_or((Vec::new(), Vec::new()), |file| (file.attrs, file.items));
    quote! {
        mod trigonometry {
            #(#docs)*
            #(#items)*
        }
    }
}

/// Names for what is read of a `Trig`.
fn positions(built: &FunctionGraph, used: &BTreeSet<Input>) -> TokenStream {
    let take = |field: &str, letter: &str, input: fn(usize) -> Input| {
        let field = Ident::new(field, Span::call_site());
        let any = (0..built.joints).any(|i| used.contains(&input(i)));
        let names = (0..built.joints).map(|i| {
            let name = format_ident!("{letter}{}", i + 1);
            if used.contains(&input(i)) { quote!(#name) } else { quote!(_) }
        });
        any.then(|| quote!(let [#(#names),*] = trig.#field;))
    };
    let lines =
        [take("sin", "s", Input::Sin), take("cos", "c", Input::Cos), take("position", "q", Input::Position)];
    let lines = lines.iter().flatten();
    quote!(#(#lines)*)
}

/// The inputs that an argument other than q brings.
fn input_of(argument: Argument, i: usize) -> Input {
    match argument {
        Argument::Positions => Input::Position(i),
        Argument::Speeds => Input::Speed(i),
        Argument::Accelerations => Input::Acceleration(i),
        Argument::ReferenceSpeeds => Input::ReferenceSpeed(i),
        Argument::ReferenceAccelerations => Input::ReferenceAcceleration(i),
        Argument::Torques => Input::Torque(i),
        Argument::Errors => Input::Error(i),
        Argument::Parameters => Input::Parameter(i),
    }
}

/// `name: &SVector<T, …>`
fn parameter(argument: Argument, name: &str) -> TokenStream {
    let length = if argument == Argument::Parameters { quote!(PARAMETERS) } else { quote!(JOINTS) };
    let ident = Ident::new(name, Span::call_site());
    quote!(#ident: &SVector<T, #length>)
}

/// An argument in the signature, and the line that names what is used of it.
fn argument(built: &FunctionGraph, argument: Argument, used: &BTreeSet<Input>) -> (TokenStream, TokenStream) {
    let is_parameters = argument == Argument::Parameters;
    let length = if is_parameters { built.parameters } else { built.joints };
    let letter = if is_parameters { "p" } else { argument.name() };
    let is_used = |i: usize| used.contains(&input_of(argument, i));
    if !(0..length).any(is_used) {
        return (parameter(argument, &format!("_{}", argument.name())), quote!());
    }
    let names = (0..length).map(|i| {
        let name = format_ident!("{letter}{}", i + 1);
        if is_used(i) { quote!(#name) } else { quote!(_) }
    });
    let ident = Ident::new(argument.name(), Span::call_site());
    (parameter(argument, argument.name()), quote!(let [[#(#names),*]] = #ident.data.0;))
}

/// Nodes in one block of code.
const SECTION: usize = 256;

/// The body, in blocks that hand on only what later ones need. Every `let` opens a scope within the one before, and a
/// compiler that writes debug information goes through nested scopes by recursion: thousands of them in a row
/// exhaust its stack.
fn sections(model: &Model, built: &FunctionGraph, needed: &[usize]) -> Vec<TokenStream> {
    let computed: Vec<usize> =
        needed.iter().copied().filter(|n| !matches!(built.graph.nodes()[*n], Node::Input(_))).collect();
    let statement = |n: &usize| statement(model, built, *n);
    if computed.len() <= 2 * SECTION {
        return computed.iter().filter_map(statement).collect();
    }
    let mut last_use = vec![0; built.graph.nodes().len()];
    for (position, node) in computed.iter().enumerate() {
        for operand in operands(&built.graph.nodes()[*node]) {
            last_use[operand.node()] = position;
        }
    }
    for output in &built.outputs {
        last_use[output.node()] = usize::MAX;
    }
    let mut blocks = Vec::new();
    for (k, section) in computed.chunks(SECTION).enumerate() {
        let end = (k + 1) * SECTION;
        let handed_on = section.iter().filter(|n| last_use[**n] >= end).map(|n| value_name(built, *n));
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
        Node::Input(input) => format_ident!("{}", input.to_string()),
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
    if is_number(built) {
        let value = value(0, 0);
        return (quote!(T), value);
    }
    let size = |size: Size| match size {
        Size::Joints => quote!(JOINTS),
        Size::Parameters => quote!(PARAMETERS),
        Size::Fixed(length) => {
            let length = Literal::usize_unsuffixed(length);
            quote!(#length)
        }
    };
    let (n, m) = built.function.size();
    let (n, m) = (size(n), size(m));
    let result = if columns == 1 { quote!(SVector<T, #n>) } else { quote!(SMatrix<T, #n, #m>) };
    (result, quote!(SMatrix::from_array_storage(ArrayStorage([#(#columns_of),*]))))
}
