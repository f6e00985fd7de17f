//! One function as tokens: straight-line code, one `let` for each node.

use super::{docs, signs};
use crate::arm::{Arm, JointKind};
use crate::dynamics::chain;
use crate::dynamics::function::{Argument, Size, trig_offset};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Expr, Graph, Input, JointSum, Node, Preparation, operands};
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{ToTokens, format_ident, quote};
use std::collections::BTreeSet;

/// A function's items: one that takes q, and one that takes [`Trig`] in its place.
pub(super) fn function(model: &Model, built: &FunctionGraph, prepared: usize) -> TokenStream {
    let arm = model.arm();
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
    let positions = positions(arm, &used);
    let trig = trig_of(arm, &used);
    let (q, trig_name) = match uses_positions(&used) {
        true => (quote!(q), quote!(trig)),
        false => (quote!(_q), quote!(_trig)),
    };
    // Where it pays, by measurement.
    let signs = if built.function.size() == (Size::Joints, Size::Fixed(1)) {
        signs::held(&built.graph, &built.outputs, &needed)
    } else {
        vec![false; built.graph.nodes().len()]
    };
    let statements = sections(model, &built.graph, &built.outputs, &needed, &signs);
    let (result, value) = result(built, &signs);
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
    let (bindings, fields) = trig_fields(arm, &all_inputs(arm));
    let sums: Vec<String> = chain::sums(arm)
        .iter()
        .enumerate()
        .map(|(k, sum)| {
            let text: String = sum
                .joints()
                .enumerate()
                .map(|(k, (i, negative))| {
                    let sign = if k == 0 {
                        ""
                    } else if negative {
                        " − "
                    } else {
                        " + "
                    };
                    format!("{sign}q{}", i + 1)
                })
                .collect();
            format!(" Angle {}: {text}, across parallel axes.", arm.dof() + k + 1)
        })
        .collect();
    let count = Literal::usize_unsuffixed(angles(arm).len());
    let shifted: Vec<String> = (0..arm.dof())
        .filter(|i| trig_offset(arm, *i) != 0.0)
        .map(|i| format!(" Joint {}: of q + {} rad.", i + 1, trig_offset(arm, i)))
        .collect();
    quote! {
        /// Angles of a [`Trig`]: those of the joints, then sums across parallel axes.
        pub const ANGLES: usize = #count;

        /// Joint positions with their sines and cosines: computed once and shared between calls, or taken from
        /// wherever the caller has them.
        #(#[doc = #shifted])*
        #(#[doc = #sums])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Trig<T> {
            /// Sine of each angle; not read for prismatic joints.
            pub sin: [T; ANGLES],
            /// Cosine of each angle; not read for prismatic joints.
            pub cos: [T; ANGLES],
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

/// Everything that is made of q.
fn all_inputs(arm: &Arm) -> BTreeSet<Input> {
    let turning = angles(arm).into_iter().flat_map(|sum| [Input::Sin(sum), Input::Cos(sum)]);
    turning.chain((0..arm.dof()).map(Input::Position)).collect()
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
    /// Whether each joint's position is read as it is.
    places: Vec<bool>,
    /// Each angle, and the names of its sine and cosine where they are read.
    angles: Vec<(JointSum, TokenStream, TokenStream)>,
    /// A `Trig` of them; the rest is zero, because nobody reads it.
    trig: TokenStream,
}

impl Positions {
    /// `position` is how a joint's position is read.
    fn new(arm: &Arm, used: &BTreeSet<Input>, position: impl Fn(usize) -> TokenStream) -> Positions {
        let zero = quote!(T::zero());
        let revolute = |i: usize| arm.joints[i].kind == JointKind::Revolute;
        let places: Vec<bool> =
            (0..arm.dof()).map(|i| !revolute(i) && used.contains(&Input::Position(i))).collect();
        let (mut found, mut sines, mut cosines) = (Vec::new(), Vec::new(), Vec::new());
        for sum in angles(arm) {
            let turns = sum.joints().all(|(i, _)| revolute(i));
            let name = |input: Input| {
                (turns && used.contains(&input)).then(|| format_ident!("{}", input.to_string()))
            };
            let (sin, cos) = (name(Input::Sin(sum)), name(Input::Cos(sum)));
            let or =
                |name: &Option<Ident>, other: TokenStream| name.as_ref().map_or(other, |name| quote!(#name));
            if sin.is_some() || cos.is_some() {
                found.push((sum, or(&sin, quote!(_)), or(&cos, quote!(_))));
            }
            sines.push(or(&sin, zero.clone()));
            cosines.push(or(&cos, zero.clone()));
        }
        let values =
            places.iter().enumerate().map(|(i, read)| if *read { position(i) } else { zero.clone() });
        let trig = quote!(Trig { sin: [#(#sines),*], cos: [#(#cosines),*], position: [#(#values),*] });
        Positions { places, angles: found, trig }
    }
}

/// An angle of the joints at their positions.
fn angle(arm: &Arm, sum: JointSum, position: impl Fn(usize) -> TokenStream) -> TokenStream {
    let terms = sum.joints().enumerate().map(|(k, (i, negative))| {
        let q = position(i);
        match (k, negative) {
            (0, _) => q,
            (_, false) => quote!(+ #q),
            (_, true) => quote!(- #q),
        }
    });
    let offset = sum.value(|i| trig_offset(arm, i));
    let offset = (offset != 0.0).then(|| {
        let offset = Literal::f64_suffixed(offset);
        quote!(+ nalgebra::convert::<f64, T>(#offset))
    });
    quote!(#(#terms)* #offset)
}

/// Computes all sines and cosines together, and builds a `Trig` of the inputs that are used. A pattern over the storage
/// needs no bounds check and cannot panic.
fn trig_fields(arm: &Arm, used: &BTreeSet<Input>) -> (TokenStream, TokenStream) {
    let position = |i: usize| lane_name(Argument::Positions, i).into_token_stream();
    let Positions { places, angles, trig } = Positions::new(arm, used, position);
    let taken = places.contains(&true).then(|| {
        let patterns = places.iter().enumerate().map(|(i, read)| if *read { position(i) } else { quote!(_) });
        quote!(let [[#(#patterns),*]] = q.data.0;)
    });
    let computed = (!angles.is_empty()).then(|| {
        let (sines, cosines) = (angles.iter().map(|a| &a.1), angles.iter().map(|a| &a.2));
        let of = angles_name(angles.iter().map(|a| a.0));
        quote!(let ([#(#sines),*], [#(#cosines),*]) = trigonometry::sin_cos(q, #of);)
    });
    (quote!(#taken #computed), trig)
}

/// `angles_2_3_2m3`
fn angles_name(sums: impl Iterator<Item = JointSum>) -> Ident {
    Ident::new(&sums.fold("angles".to_string(), |name, sum| format!("{name}_{sum}")), Span::call_site())
}

/// The functions that make of q the angles whose sines and cosines are taken together, each once.
pub(super) fn angle_functions(arm: &Arm, functions: &[FunctionGraph]) -> TokenStream {
    let position = |i: usize| lane_name(Argument::Positions, i).into_token_stream();
    let used = functions.iter().map(|built| used(built, &built.graph.needed(&built.outputs)));
    let sets: BTreeSet<Vec<JointSum>> = used
        .chain([all_inputs(arm)])
        .map(|used| Positions::new(arm, &used, position).angles.into_iter().map(|a| a.0).collect())
        .filter(|sums: &Vec<JointSum>| !sums.is_empty())
        .collect();
    let items = sets.iter().map(|sums| {
        let (name, count) = (angles_name(sums.iter().copied()), Literal::usize_unsuffixed(sums.len()));
        let reads = |i: usize| sums.iter().any(|sum| sum.sign(i).is_some());
        let patterns = (0..arm.dof()).map(|i| if reads(i) { position(i) } else { quote!(_) });
        let values = sums.iter().map(|sum| angle(arm, *sum, position));
        quote! {
            #[inline(always)]
            fn #name<T: SimdRealField + Copy>(q: &SVector<T, JOINTS>) -> [T; #count] {
                let [[#(#patterns),*]] = q.data.0;
                [#(#values),*]
            }
        }
    });
    quote!(#(#items)*)
}

/// What a function takes of q at one sample in a block.
pub(super) struct TrigOfLane {
    /// Lines without a branch that make its `trig`.
    pub(super) lines: TokenStream,
    /// Joints whose angles that is right for only where they are near.
    pub(super) turning: BTreeSet<usize>,
    /// Whether each joint's position is read.
    pub(super) read: Vec<bool>,
}

impl TrigOfLane {
    pub(super) fn new(model: &Model, built: &FunctionGraph) -> TrigOfLane {
        let arm = model.arm();
        let used = used(built, &built.graph.needed(&built.outputs));
        let position = |i: usize| {
            let q = lane_name(Argument::Positions, i);
            quote!(#q[lane])
        };
        let Positions { places, angles, trig } = Positions::new(arm, &used, position);
        let lines = angles.iter().map(|(sum, sine, cosine)| {
            let angle = angle(arm, *sum, position);
            quote!(let (#sine, #cosine) = trigonometry::near(#angle);)
        });
        let lines = quote! {
            #(#lines)*
            let trig = #trig;
        };
        let turning: BTreeSet<usize> =
            angles.iter().flat_map(|(sum, ..)| sum.joints().map(|(i, _)| i)).collect();
        let read = (0..arm.dof()).map(|i| places[i] || turning.contains(&i)).collect();
        TrigOfLane { lines, turning, read }
    }
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

/// The angles of a `Trig`: those of the joints, then sums of parallel joints' angles.
fn angles(arm: &Arm) -> Vec<JointSum> {
    (0..arm.dof()).map(JointSum::joint).chain(chain::sums(arm)).collect()
}

/// Names for what is read of a `Trig`.
fn positions(arm: &Arm, used: &BTreeSet<Input>) -> TokenStream {
    let take = |field: &str, inputs: Vec<Input>| {
        let field = Ident::new(field, Span::call_site());
        let any = inputs.iter().any(|input| used.contains(input));
        let names = inputs.into_iter().map(|input| {
            let name = format_ident!("{}", input.to_string());
            if used.contains(&input) { quote!(#name) } else { quote!(_) }
        });
        any.then(|| quote!(let [#(#names),*] = trig.#field;))
    };
    let lines = [
        take("sin", angles(arm).into_iter().map(Input::Sin).collect()),
        take("cos", angles(arm).into_iter().map(Input::Cos).collect()),
        take("position", (0..arm.dof()).map(Input::Position).collect()),
    ];
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
        Argument::Parameters => Input::Prepared(i),
    }
}

/// `name: &SVector<T, …>`
fn parameter(argument: Argument, name: &str) -> TokenStream {
    let length = if argument == Argument::Parameters { quote!(PARAMETERS) } else { quote!(JOINTS) };
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
    let length = if is_parameters { prepared } else { built.joints };
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

/// What functions need of the parameters alone: the function that prepares it, and the trait by which they take it.
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
    let signs = vec![false; graph.nodes().len()];
    let statements = sections(model, &graph, preparation.values(), &needed, &signs);
    let values = preparation.values().iter().map(|e| value_name(&graph, e.node()));
    let operations = preparation.operations();
    let doc = format!(" Operations: {} multiplications, {} additions.", operations.mul, operations.add);
    quote! {
        /// Sums of the parameters as the functions use them; [`prepare`] makes them once for any number of calls.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Prepared<T>([T; #count]);

        /// What the functions need of the parameters alone: pass it to those that end in `_with`, in place of the parameters.
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

/// The body, in blocks that hand on only what later ones need. Every `let` opens a scope within the one before, and a
/// compiler that writes debug information goes through nested scopes by recursion: thousands of them in a row
/// exhaust its stack.
fn sections(
    model: &Model,
    graph: &Graph,
    outputs: &[Expr],
    needed: &[usize],
    signs: &[bool],
) -> Vec<TokenStream> {
    let computed: Vec<usize> =
        needed.iter().copied().filter(|n| !matches!(graph.nodes()[*n], Node::Input(_))).collect();
    let statement = |n: &usize| statement(model, graph, *n, signs);
    if computed.len() <= 2 * SECTION {
        return computed.iter().filter_map(statement).collect();
    }
    let mut last_use = vec![0; graph.nodes().len()];
    for (position, node) in computed.iter().enumerate() {
        for operand in operands(&graph.nodes()[*node]) {
            last_use[operand.node()] = position;
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

/// The `let` of a node; inputs are bound already. `signs` are those of [`signs::held`].
fn statement(model: &Model, graph: &Graph, node: usize, signs: &[bool]) -> Option<TokenStream> {
    let name = format_ident!("x{node}");
    let operand = |e: Expr| value_name(graph, e.node());
    Some(match graph.nodes()[node] {
        Node::Input(_) => return None,
        Node::Constant(index) => {
            let value = Literal::f64_suffixed(rational::to_f64(graph.constant(index)));
            quote!(let #name: T = nalgebra::convert(#value);)
        }
        Node::Symbol(index, sine) => {
            let (s, c) = model.symbols().angles[index as usize].sin_cos();
            let value = Literal::f64_suffixed(if sine { s } else { c });
            quote!(let #name: T = nalgebra::convert(#value);)
        }
        Node::Add(a, b) => {
            let (x, y) = (operand(a), operand(b));
            let [first, second] = [signs[a.node()], signs[b.node()] != b.is_negative()];
            match (first != signs[node], second != signs[node]) {
                (false, false) => quote!(let #name = #x + #y;),
                (false, true) => quote!(let #name = #x - #y;),
                (true, false) => quote!(let #name = #y - #x;),
                (true, true) => quote!(let #name = -#x - #y;),
            }
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

fn value_name(graph: &Graph, node: usize) -> Ident {
    match graph.nodes()[node] {
        Node::Input(input) => format_ident!("{}", input.to_string()),
        _ => format_ident!("x{node}"),
    }
}

/// The type of the result and the expression that makes it. nalgebra stores columns.
fn result(built: &FunctionGraph, signs: &[bool]) -> (TokenStream, TokenStream) {
    let (rows, columns) = built.shape;
    let value = |i: usize, j: usize| {
        let e = built.outputs[i * columns + j];
        let name = value_name(&built.graph, e.node());
        if e.is_negative() != signs[e.node()] { quote!(-#name) } else { quote!(#name) }
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
