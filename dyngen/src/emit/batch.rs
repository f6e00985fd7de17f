//! Functions over blocks of samples: loops that a compiler turns into vectors of whatever processor it
//! compiles for.

use super::angles::TrigOfLane;
use super::{code, docs, lanes};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::exact::rational::to_f64;
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{format_ident, quote};

/// The module `batch` with every function.
pub(super) fn module(model: &Model, functions: &[FunctionGraph]) -> TokenStream {
    let items: Vec<TokenStream> = functions.iter().map(|built| function(model, built)).collect();
    let has_angles = functions.iter().any(|built| !TrigOfLane::new(model, built).turning.is_empty());
    // With joints that turn faster than what they follow the angles are larger than q.
    let fastest = model.arm().drives().iter().fold(1.0f64, |m, drive| m.max(to_f64(&drive.ratio).abs()));
    let limit = Literal::f64_unsuffixed(6000.0 / fastest);
    let are_near = has_angles.then(|| {
        quote! {
            /// Whether sums of a few of these angles are right without a branch.
            #[inline(always)]
            fn are_near<T: SimdRealField + Copy>(angles: &[T]) -> bool {
                let limit = nalgebra::convert(#limit);
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

fn function(model: &Model, built: &FunctionGraph) -> TokenStream {
    let name = Ident::new(built.function.name(), Span::call_site());
    let name_with = format_ident!("{name}_with");
    let doc = docs::lines(&format!("[`{name}`](super::{name}) of `LANES` samples."));
    let arguments: Vec<Argument> = built.arguments().collect();
    let signature = arguments.iter().map(|argument| {
        let name = Ident::new(argument.name(), Span::call_site());
        match argument {
            Argument::Parameters => quote!(#name: &impl Parameters<T>),
            _ => quote!(#name: &[[T; LANES]; JOINTS]),
        }
    });
    let lanes =
        |argument: &Argument| (0..built.joints).map(|i| lanes::lane_name(*argument, i)).collect::<Vec<_>>();
    let moving: Vec<&Argument> = arguments.iter().filter(|a| **a != Argument::Parameters).collect();
    let TrigOfLane { lines, turning, read } = TrigOfLane::new(model, built);
    let angles: Vec<Ident> = turning.iter().map(|i| lanes::lane_name(Argument::Positions, *i)).collect();
    let prepared =
        arguments.contains(&Argument::Parameters).then(|| quote!(let parameters = &parameters.prepared();));
    let taken = moving.iter().map(|argument| {
        let name = Ident::new(argument.name(), Span::call_site());
        let lanes = lanes(argument).into_iter().enumerate().map(|(i, lane)| {
            // The way for angles that are not near reads all of q.
            let is_read = **argument != Argument::Positions || !angles.is_empty() || read[i];
            if is_read { quote!(#lane) } else { quote!(_) }
        });
        quote!(let [#(#lanes),*] = #name;)
    });
    let vector = |argument: &Argument| {
        let (name, lanes) = (Ident::new(argument.name(), Span::call_site()), lanes(argument));
        quote!(let #name = SVector::from_array_storage(ArrayStorage([[#(#lanes[lane]),*]]));)
    };
    let vectors =
        moving.iter().filter(|a| ***a != Argument::Positions).map(|a| vector(a)).collect::<Vec<_>>();
    let pass = |argument: &Argument| {
        let name = Ident::new(argument.name(), Span::call_site());
        if *argument == Argument::Parameters { quote!(#name) } else { quote!(&#name) }
    };
    let passed_with: Vec<_> = arguments.iter().filter(|a| **a != Argument::Positions).map(pass).collect();
    let slow = (!angles.is_empty()).then(|| {
        let q = vector(&Argument::Positions);
        let (flat, value) = match (code::is_number(built), built.shape.1) {
            (true, _) => (quote!(core::iter::once(&mut *out)), quote!(core::iter::once(&result))),
            (_, 1) => (quote!(out.iter_mut()), quote!(result.iter())),
            _ => (quote!(out.iter_mut().flatten()), quote!(result.iter())),
        };
        quote! {
            if ![#(#angles),*].into_iter().fold(true, |near, angles| near & are_near(angles)) {
                for lane in 0..LANES {
                    #q
                    #(#vectors)*
                    let result = super::#name_with(&Trig::new(&q), #(#passed_with),*);
                    for (cells, value) in #flat.zip(#value) {
                        cells[lane] = *value;
                    }
                }
            }
        }
    });
    let (rows, columns) = built.shape;
    let cell = |letter: &str, i: usize, j: usize| format_ident!("{letter}{}_{}", i + 1, j + 1);
    let nested = |letter: &str| {
        let column = |j: usize| {
            let cells = (0..rows).map(|i| cell(letter, i, j)).collect::<Vec<_>>();
            quote!([#(#cells),*])
        };
        (0..columns).map(column).collect::<Vec<_>>()
    };
    let (outs, results) = (nested("out"), nested("x"));
    let stores = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j))).map(|(i, j)| {
        let (out, x) = (cell("out", i, j), cell("x", i, j));
        quote!(#out[lane] = #x;)
    });
    let (n, m) = (Literal::usize_unsuffixed(rows), Literal::usize_unsuffixed(columns));
    let call = quote!(super::#name_with(&trig, #(#passed_with),*));
    let (shape, opened, result) = match (code::is_number(built), columns) {
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
    let order = (columns > 1).then(|| {
        quote!(
            ///
            /// `out` holds columns of rows, as nalgebra does.
        )
    });
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
            #slow
        }
    }
}
