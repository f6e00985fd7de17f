//! Functions over blocks of samples: loops that a compiler turns into vectors of whatever processor it
//! compiles for.

use super::angles::TrigOfLane;
use super::{docs, lanes, statement};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{format_ident, quote};

/// The module `batch` with every function.
pub(super) fn module(model: &Model, functions: &[FunctionGraph]) -> TokenStream {
    let items: Vec<TokenStream> = functions.iter().map(|built| function(model, built)).collect();
    let has_angles = functions.iter().any(|built| !TrigOfLane::new(model, built).turning.is_empty());
    // Sums of a few of them, with joints that turn faster than what they follow, are larger than q.
    let share = Literal::f64_unsuffixed(0.06 / model.angles().fastest());
    let are_near = has_angles.then(|| {
        quote! {
            /// Whether sums of a few of these angles are right without a branch.
            #[inline(always)]
            fn are_near<T: SimdRealField + Copy>(angles: &[T]) -> bool {
                let limit = trigonometry::limit::<T>() * nalgebra::convert(#share);
                // No early end: that would be a branch for each angle.
                angles
                    .iter()
                    .fold(true, |near, angle| near & nalgebra::SimdBool::all(angle.simd_abs().simd_le(limit)))
            }
        }
    });
    quote! {
        /// The functions over `LANES` samples at once, each quantity an array over the samples: for one
        /// sample they give what the function of the same name gives, to the bit.
        ///
        /// They are loops without branches, inlined into their caller so that they use the vectors that *it*
        /// is compiled for: `-C target-cpu`, or a dispatch at run time around the caller's loop. Eight
        /// samples suit every processor, and arrays in a struct of `#[repr(align(64))]` its cache.
        #[allow(clippy::needless_range_loop)]
        pub mod batch {
            use super::*;

            #(#items)*

            #are_near
        }
    }
}

/// A function over blocks: a loop of samples without a branch, and behind it the samples one by one where an
/// angle is too large for that.
fn function(model: &Model, built: &FunctionGraph) -> TokenStream {
    let name = Ident::new(built.function.name(), Span::call_site());
    let doc = docs::lines(&format!("[`{name}`](super::{name}) of `LANES` samples."));
    let arguments: Vec<Argument> = built.arguments().collect();
    let signature = arguments.iter().map(|argument| parameter(*argument));
    let trig = TrigOfLane::new(model, built);
    let moving = || arguments.iter().copied().filter(|a| *a != Argument::Parameters);
    let taken = moving().map(|argument| lanes_taken(built, argument, &trig));
    let prepared =
        arguments.contains(&Argument::Parameters).then(|| quote!(let parameters = &parameters.prepared();));
    let vectors: Vec<TokenStream> =
        moving().filter(|a| *a != Argument::Positions).map(|a| vector_of_lane(built, a)).collect();
    let one_by_one = one_by_one(built, &arguments, &trig, &vectors);
    let Output { shape, opened, result, stores } =
        Output::new(built, &call(built, &arguments, &quote!(&trig)));
    let order = (built.shape.1 > 1).then(|| {
        quote!(
            ///
            /// `out` holds columns of rows, as nalgebra does.
        )
    });
    let lines = &trig.lines;
    quote! {
        #(#[doc = #doc])*
        #order
        #[inline(always)]
        pub fn #name<T: SimdRealField + Copy, const LANES: usize>(#(#signature,)* out: &mut #shape) {
            #(#taken)*
            #prepared
            #opened
            for lane in 0..LANES {
                #lines
                #(#vectors)*
                #result
                #(#stores)*
            }
            #one_by_one
        }
    }
}

fn argument_name(argument: Argument) -> Ident {
    Ident::new(argument.name(), Span::call_site())
}

/// `name: …`
fn parameter(argument: Argument) -> TokenStream {
    let name = argument_name(argument);
    if argument == Argument::Parameters {
        return quote!(#name: &impl Parameters<T>);
    }
    let length = super::code::length(argument.size());
    quote!(#name: &[[T; LANES]; #length])
}

/// The names of an argument's arrays over the samples, one a joint.
fn lanes(built: &FunctionGraph, argument: Argument) -> Vec<Ident> {
    (0..argument.length(built.joints, built.parameters)).map(|i| lanes::lane_name(argument, i)).collect()
}

/// The line that names those of an argument's arrays that are read.
fn lanes_taken(built: &FunctionGraph, argument: Argument, trig: &TrigOfLane) -> TokenStream {
    let name = argument_name(argument);
    let lanes = lanes(built, argument).into_iter().enumerate().map(|(i, lane)| {
        // The way for angles that are not near reads all of q.
        let is_read = argument != Argument::Positions || !trig.turning.is_empty() || trig.read[i];
        if is_read { quote!(#lane) } else { quote!(_) }
    });
    quote!(let [#(#lanes),*] = #name;)
}

/// The line that makes an argument's vector of one sample.
fn vector_of_lane(built: &FunctionGraph, argument: Argument) -> TokenStream {
    let (name, lanes) = (argument_name(argument), lanes(built, argument));
    quote!(let #name = SVector::from_array_storage(ArrayStorage([[#(#lanes[lane]),*]]));)
}

/// The call of the function of one sample.
fn call(built: &FunctionGraph, arguments: &[Argument], trig: &TokenStream) -> TokenStream {
    let name_with = format_ident!("{}_with", built.function.name());
    let passed = arguments.iter().filter(|a| **a != Argument::Positions).map(|argument| {
        let name = argument_name(*argument);
        if *argument == Argument::Parameters { quote!(#name) } else { quote!(&#name) }
    });
    quote!(super::#name_with(#trig, #(#passed),*))
}

/// The samples one by one, where the angles of any are not near; nothing where no joint turns.
fn one_by_one(
    built: &FunctionGraph,
    arguments: &[Argument],
    trig: &TrigOfLane,
    vectors: &[TokenStream],
) -> Option<TokenStream> {
    if trig.turning.is_empty() {
        return None;
    }
    let angles = trig.turning.iter().map(|i| lanes::lane_name(Argument::Positions, *i));
    let q = vector_of_lane(built, Argument::Positions);
    let call = call(built, arguments, &quote!(&Trig::new(&q)));
    let (flat, value) = match (statement::is_number(built), built.shape.1) {
        (true, _) => (quote!(core::iter::once(&mut *out)), quote!(core::iter::once(&result))),
        (_, 1) => (quote!(out.iter_mut()), quote!(result.iter())),
        _ => (quote!(out.iter_mut().flatten()), quote!(result.iter())),
    };
    Some(quote! {
        if ![#(#angles),*].into_iter().fold(true, |near, angles| near & are_near(angles)) {
            for lane in 0..LANES {
                #q
                #(#vectors)*
                let result = #call;
                for (cells, value) in #flat.zip(#value) {
                    cells[lane] = *value;
                }
            }
        }
    })
}

/// Where results go.
struct Output {
    /// The type of `out`.
    shape: TokenStream,
    /// The line that names the arrays of `out`, one a cell.
    opened: TokenStream,
    /// The line that names the cells of one sample's result.
    result: TokenStream,
    /// The lines that store those.
    stores: Vec<TokenStream>,
}

impl Output {
    /// `call` gives one sample's result.
    fn new(built: &FunctionGraph, call: &TokenStream) -> Output {
        let (rows, columns) = built.shape;
        let cell = |letter: &str, i: usize, j: usize| format_ident!("{letter}{}_{}", i + 1, j + 1);
        let nested = |letter: &str| {
            let column = |j: usize| {
                let cells = (0..rows).map(|i| cell(letter, i, j));
                quote!([#(#cells),*])
            };
            (0..columns).map(column).collect::<Vec<_>>()
        };
        let (outs, results) = (nested("out"), nested("x"));
        let (n, m) = (Literal::usize_unsuffixed(rows), Literal::usize_unsuffixed(columns));
        let (shape, opened, result) = match (statement::is_number(built), columns) {
            (true, _) => (quote!([T; LANES]), quote!(let out1_1 = &mut *out;), quote!(let x1_1 = #call;)),
            (_, 1) => (
                quote!([[T; LANES]; #n]),
                quote!(let #(#outs)* = &mut *out;),
                quote!(let [#(#results)*] = #call.data.0;),
            ),
            _ => (
                quote!([[[T; LANES]; #n]; #m]),
                quote!(let [#(#outs),*] = &mut *out;),
                quote!(let [#(#results),*] = #call.data.0;),
            ),
        };
        let cells = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j)));
        let store = |(i, j)| {
            let (out, x) = (cell("out", i, j), cell("x", i, j));
            quote!(#out[lane] = #x;)
        };
        Output { shape, opened, result, stores: cells.map(store).collect() }
    }
}
