//! The sines and cosines of joint positions for functions, for all angles of a function at once.

use super::lanes::{lane_name, used};
use crate::arm::{Arm, Joint, JointKind};
use crate::dynamics::FunctionGraph;
use crate::dynamics::angles::{Angles, JointAngle};
use crate::dynamics::function::Argument;
use crate::graph::{Input, JointSum};
use crate::model::Model;
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{ToTokens, format_ident, quote};
use std::collections::BTreeSet;

/// The struct of sines and cosines that functions share.
pub(super) fn trig_struct(model: &Model) -> TokenStream {
    let (bindings, fields) = trig_fields(model, &all_inputs(model));
    let count = Literal::usize_unsuffixed(model.angles().taken().len());
    let (shifted, sums) = (shifted_docs(model), sum_docs(model));
    quote! {
        /// Angles of a [`Trig`]: those of the joints, then sums across parallel axes.
        pub const ANGLES: usize = #count;

        /// Joint positions with their sines and cosines: computed once and shared between calls, or taken
        /// from wherever the caller has them.
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

/// Lines that name the joints whose angle is not q alone.
pub(super) fn shifted_docs(model: &Model) -> Vec<String> {
    let joints = model.arm().coordinates().into_iter().enumerate();
    let offsets = joints.map(|(i, joint)| (i, model.angles().joint(joint).offset));
    offsets
        .filter(|(_, offset)| *offset != 0.0)
        .map(|(i, offset)| format!(" Joint {}: of q + {offset} rad.", i + 1))
        .collect()
}

/// Lines that say what the angles behind those of the coordinates are.
pub(super) fn sum_docs(model: &Model) -> Vec<String> {
    let term = |joint: usize| {
        let JointAngle { coordinate, ratio, .. } = model.angles().joint(joint);
        ratio.map_or(String::new(), |ratio| format!("{ratio}·")) + &format!("q{}", coordinate + 1)
    };
    let sign = |k: usize, negative: bool| match (k, negative) {
        (0, _) => "",
        (_, true) => " − ",
        (_, false) => " + ",
    };
    let line = |(k, sum): (usize, &JointSum)| {
        let terms = sum.joints().enumerate();
        let text: String =
            terms.map(|(k, (joint, negative))| format!("{}{}", sign(k, negative), term(joint))).collect();
        format!(" Angle {}: {text}, across parallel axes.", k + 1)
    };
    model.angles().taken().iter().enumerate().skip(model.arm().dof()).map(line).collect()
}

/// Everything that is made of q.
pub(super) fn all_inputs(model: &Model) -> BTreeSet<Input> {
    let turning = model.angles().taken().iter().flat_map(|sum| [Input::Sin(*sum), Input::Cos(*sum)]);
    let read = (0..model.arm().dof()).filter(|i| is_read(model, *i));
    turning.chain(read.map(Input::Position)).collect()
}

/// Whether a coordinate may be read as it is: where it, or a joint that follows it, is prismatic.
fn is_read(model: &Model, coordinate: usize) -> bool {
    let slides = |(i, joint): (usize, &Joint)| {
        model.angles().joint(i).coordinate == coordinate && joint.kind == JointKind::Prismatic
    };
    model.arm().joints.iter().enumerate().any(slides)
}

/// Whether a function takes anything of q.
pub(super) fn uses_positions(used: &BTreeSet<Input>) -> bool {
    used.iter().any(|i| matches!(i, Input::Sin(_) | Input::Cos(_) | Input::Position(_)))
}

/// `let trig = …` with what a function uses; the rest is zero, because nobody reads it.
pub(super) fn trig_of(model: &Model, used: &BTreeSet<Input>) -> TokenStream {
    let (bindings, fields) = trig_fields(model, used);
    if uses_positions(used) { quote!(#bindings let trig = #fields;) } else { quote!(let trig = #fields;) }
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
    fn new(model: &Model, used: &BTreeSet<Input>, position: impl Fn(usize) -> TokenStream) -> Positions {
        let arm = model.arm();
        let zero = quote!(T::zero());
        let places: Vec<bool> = (0..arm.dof()).map(|i| used.contains(&Input::Position(i))).collect();
        let (mut found, mut sines, mut cosines) = (Vec::new(), Vec::new(), Vec::new());
        for sum in model.angles().taken().iter().copied() {
            let turns = turns(model, sum);
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

/// Whether the angle is one: of joints that turn.
pub(super) fn turns(model: &Model, sum: JointSum) -> bool {
    sum.joints().all(|(joint, _)| model.arm().joints[joint].kind == JointKind::Revolute)
}

/// A term of an angle: ± ratio·q of a coordinate.
pub(super) struct Term {
    pub(super) negative: bool,
    pub(super) ratio: Option<f64>,
    pub(super) coordinate: usize,
}

/// An angle as a sum of terms, in the order in which they are added, and what is added behind them where it
/// is not zero.
pub(super) fn terms(angles: &Angles, sum: JointSum) -> (Vec<Term>, Option<f64>) {
    let term = |(joint, negative)| {
        let JointAngle { coordinate, ratio, .. } = *angles.joint(joint);
        Term { negative, ratio, coordinate }
    };
    let offset = angles.offset(sum);
    (sum.joints().map(term).collect(), (offset != 0.0).then_some(offset))
}

/// An angle for the coordinates' positions.
fn angle(angles: &Angles, sum: JointSum, position: impl Fn(usize) -> TokenStream) -> TokenStream {
    let number = |x: f64| {
        let number = Literal::f64_suffixed(x);
        quote!(nalgebra::convert::<f64, T>(#number))
    };
    let (terms, offset) = terms(angles, sum);
    let terms = terms.into_iter().enumerate().map(|(k, Term { negative, ratio, coordinate })| {
        let ratio = ratio.map(number).map(|ratio| quote!(#ratio *));
        let q = position(coordinate);
        match (k, negative) {
            (0, _) => quote!(#ratio #q),
            (_, false) => quote!(+ #ratio #q),
            (_, true) => quote!(- #ratio #q),
        }
    });
    let offset = offset.map(number).map(|offset| quote!(+ #offset));
    quote!(#(#terms)* #offset)
}

/// Computes all sines and cosines together, and builds a `Trig` of the inputs that are used. A pattern over
/// the storage needs no bounds check and cannot panic.
fn trig_fields(model: &Model, used: &BTreeSet<Input>) -> (TokenStream, TokenStream) {
    let position = |i: usize| lane_name(Argument::Positions, i).into_token_stream();
    let Positions { places, angles, trig } = Positions::new(model, used, position);
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
pub(super) fn angle_functions<'a>(
    model: &Model,
    functions: impl Iterator<Item = &'a FunctionGraph>,
) -> TokenStream {
    let position = |i: usize| lane_name(Argument::Positions, i).into_token_stream();
    let used = functions.map(|built| used(built, &built.graph.needed(&built.outputs)));
    let sets: BTreeSet<Vec<JointSum>> = used
        .chain([all_inputs(model)])
        .map(|used| Positions::new(model, &used, position).angles.into_iter().map(|a| a.0).collect())
        .filter(|sums: &Vec<JointSum>| !sums.is_empty())
        .collect();
    let items = sets.iter().map(|sums| {
        let (name, count) = (angles_name(sums.iter().copied()), Literal::usize_unsuffixed(sums.len()));
        let read: BTreeSet<usize> = sums.iter().flat_map(|sum| model.angles().coordinates(*sum)).collect();
        let reads = |i: usize| read.contains(&i);
        let patterns = (0..model.arm().dof()).map(|i| if reads(i) { position(i) } else { quote!(_) });
        let values = sums.iter().map(|sum| angle(model.angles(), *sum, position));
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
    /// Coordinates for which that is right only where they are near.
    pub(super) turning: BTreeSet<usize>,
    /// Whether each joint's position is read.
    pub(super) read: Vec<bool>,
}

impl TrigOfLane {
    pub(super) fn new(model: &Model, built: &FunctionGraph) -> TrigOfLane {
        let used = used(built, &built.graph.needed(&built.outputs));
        let position = |i: usize| {
            let q = lane_name(Argument::Positions, i);
            quote!(#q[lane])
        };
        let Positions { places, angles, trig } = Positions::new(model, &used, position);
        let lines = angles.iter().map(|(sum, sine, cosine)| {
            let angle = angle(model.angles(), *sum, position);
            quote!(let (#sine, #cosine) = trigonometry::near(#angle);)
        });
        let lines = quote! {
            #(#lines)*
            let trig = #trig;
        };
        let turning: BTreeSet<usize> =
            angles.iter().flat_map(|(sum, ..)| model.angles().coordinates(*sum)).collect();
        let read = (0..model.arm().dof()).map(|i| places[i] || turning.contains(&i)).collect();
        TrigOfLane { lines, turning, read }
    }
}

/// The module that computes sines and cosines, for an arm that has any.
pub(super) fn trigonometry(arm: &Arm) -> TokenStream {
    if arm.joints.iter().all(|joint| joint.kind != JointKind::Revolute) {
        return quote!();
    }
    // The module that this crate compiles too: it parses.
    let file = syn::parse_file(dyngen_verify::text::TRIGONOMETRY);
    let (docs, items) = file.map_or((Vec::new(), Vec::new()), |file| (file.attrs, file.items));
    quote! {
        mod trigonometry {
            #(#docs)*
            #(#items)*
        }
    }
}

/// Names for what is read of a `Trig`.
pub(super) fn positions(model: &Model, used: &BTreeSet<Input>) -> TokenStream {
    let take = |field: &str, inputs: Vec<Input>| {
        let field = Ident::new(field, Span::call_site());
        let any = inputs.iter().any(|input| used.contains(input));
        let names = inputs.into_iter().map(|input| {
            let name = format_ident!("{}", input.to_string());
            if used.contains(&input) { quote!(#name) } else { quote!(_) }
        });
        any.then(|| quote!(let [#(#names),*] = trig.#field;))
    };
    let angles = model.angles().taken();
    let lines = [
        take("sin", angles.iter().copied().map(Input::Sin).collect()),
        take("cos", angles.iter().copied().map(Input::Cos).collect()),
        take("position", (0..model.arm().dof()).map(Input::Position).collect()),
    ];
    let lines = lines.iter().flatten();
    quote!(#(#lines)*)
}
