//! From graphs to source files: statements, docs, and their print in Rust, C, CUDA and WGSL.

mod angles;
mod batch;
mod c;
pub mod c_api;
mod code;
mod discrete;
mod docs;
mod friction;
mod fused;
mod lanes;
mod names;
mod rounded;
mod signs;
mod statement;
mod syntax;
mod tests;
#[cfg(test)]
#[path = "../../verify/src/text/trigonometry.rs"]
mod trigonometry;
mod wgsl;

pub use c::{CFiles, c_files, cuda_source};
pub use friction::FrictionTerm;
pub use wgsl::wgsl_source;

use crate::arm::{Arm, Frame};
use crate::dynamics::function::Argument;
use crate::dynamics::{Function, FunctionGraph};
use crate::graph::Preparation;
use crate::model::{Error, Model};
use crate::parameters::{ParameterSet, SetKind};
use proc_macro2::{Literal, TokenStream};
use quote::{ToTokens, format_ident, quote};

/// What a generated file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The parameter set of every function.
    pub parameters: SetKind,
    /// The functions, in any order.
    pub functions: Vec<Function>,
    /// Values of the set's parameters, in its order, to bake in; the functions then take none.
    pub values: Option<Vec<f64>>,
    /// Friction terms of every joint; none where empty.
    pub friction: Vec<FrictionTerm>,
    /// Whether the functions over blocks of samples are emitted too.
    pub batch: bool,
    /// Whether the arm's own consistency tests are emitted too.
    pub tests: bool,
    /// Whether sums take products in: a·b + c, rounded once.
    pub contract: bool,
}

impl Default for Options {
    /// The minimal set and every function.
    fn default() -> Self {
        Options {
            parameters: SetKind::Minimal,
            functions: Function::common().collect(),
            values: None,
            friction: Vec::new(),
            batch: false,
            tests: false,
            contract: false,
        }
    }
}

impl Options {
    /// The model that the wished functions need. Where all of them are kinematic no parameter set is derived,
    /// and the set of the file is `full`.
    ///
    /// # Errors
    /// As [`Model::derive`].
    pub fn model(&mut self, arm: Arm) -> Result<Model, Error> {
        let kinematic = !self.functions.is_empty() && self.functions.iter().all(|f| f.is_kinematic());
        if kinematic && self.values.is_none() && !self.tests {
            self.parameters = SetKind::Full;
            return Ok(Model::kinematic(arm));
        }
        Model::derive(arm)
    }
}

/// A generated file as formatted source text: every function in it is proven equal to the Lagrangian.
///
/// Equal arm and options give the same bytes.
///
/// # Errors
/// As [`Model::function`]: what cannot be proven is not emitted; friction terms that do not fit the arm.
pub fn source(model: &Model, options: &Options) -> Result<String, Error> {
    let parts = Parts::new(model, options)?;
    let tokens = items(model, options, &parts)?;
    // Tokens that quote made of whole items always parse.
    let body = match syn::parse2::<syn::File>(tokens.clone()) {
        Ok(file) => prettyplease::unparse(&file),
        Err(_) => tokens.to_string(),
    };
    Ok(format!("{}\n{body}", docs::head(model, options, rounded::lines(model, &parts))))
}

/// What a file holds, proven, before it is printed in a language.
struct Parts<'a> {
    set: &'a ParameterSet,
    functions: Vec<FunctionGraph>,
    /// The functions at each frame.
    frames: Vec<(String, Vec<FunctionGraph>)>,
    /// What all of them need of the parameters alone.
    preparation: Preparation,
}

impl<'a> Parts<'a> {
    fn new(model: &'a Model, options: &Options) -> Result<Parts<'a>, Error> {
        for term in &options.friction {
            term.check(model.arm().dof()).map_err(Error::Friction)?;
        }
        let set = model.set(options.parameters)?;
        let mut preparation = Preparation::default();
        let functions = built(model, &options.functions, options, &mut preparation)?;
        let frames = frames(model, options, &mut preparation)?;
        Ok(Parts { set, functions, frames, preparation })
    }

    /// Every function, with its frame where it is not the file's own.
    fn all(&self) -> impl Iterator<Item = (Option<&str>, &FunctionGraph)> {
        let own = self.functions.iter().map(|built| (None, built));
        own.chain(
            self.frames.iter().flat_map(|(frame, functions)| {
                functions.iter().map(move |built| (Some(frame.as_str()), built))
            }),
        )
    }

    fn takes_parameters(&self) -> bool {
        self.all().any(|(_, f)| f.arguments().any(|a| a == Argument::Parameters))
    }
}

/// The items of a generated file.
///
/// # Errors
/// As [`Model::function`], and friction terms that do not fit the arm.
pub fn tokens(model: &Model, options: &Options) -> Result<TokenStream, Error> {
    items(model, options, &Parts::new(model, options)?)
}

fn items(model: &Model, options: &Options, parts: &Parts<'_>) -> Result<TokenStream, Error> {
    let prepared = parts.preparation.values().len();
    let functions = parts.functions.iter().map(|built| code::function(model, built, prepared));
    let frames =
        parts.frames.iter().map(|(frame, built)| frame_module(model, options, frame, built, prepared));
    let batch = options.batch.then(|| batch::module(model, &parts.functions));
    let preparation = parts.takes_parameters().then(|| code::preparation(model, &parts.preparation));
    let discrete = discrete::module(options);
    let constants = constants(model.arm(), parts.set, options);
    let trig = angles::trig_struct(model);
    let angle_functions = angles::angle_functions(model, parts.all().map(|(_, built)| built));
    let trigonometry = angles::trigonometry(model.arm());
    let fused = options.contract.then(fused::in_rust);
    let friction = friction::items(&options.friction, model.arm());
    let tests = if options.tests { tests::module(model, options)? } else { quote!() };
    Ok(allowed_unused(quote! {
        use nalgebra::{ArrayStorage, SMatrix, SVector, SimdRealField};

        #constants

        #fused

        #trig

        #angle_functions

        #preparation

        #(#functions)*

        #(#frames)*

        #discrete

        #friction

        #batch

        #trigonometry

        #tests
    }))
}

/// The items with leave to be of no use: nobody calls all functions of a file, and a file that is included
/// may have no such attribute of its own.
fn allowed_unused(tokens: TokenStream) -> TokenStream {
    let Ok(mut file) = syn::parse2::<syn::File>(tokens.clone()) else { return tokens };
    for item in &mut file.items {
        let attributes = match item {
            syn::Item::Fn(item) => &mut item.attrs,
            syn::Item::Const(item) => &mut item.attrs,
            syn::Item::Impl(item) if item.trait_.is_none() => &mut item.attrs,
            syn::Item::Struct(item) => &mut item.attrs,
            syn::Item::Trait(item) => &mut item.attrs,
            syn::Item::Mod(item) => &mut item.attrs,
            _ => continue,
        };
        let mut allowed: syn::Attribute = syn::parse_quote!(#[allow(dead_code)]);
        // Attributes of a module stand on one side of its brace.
        if let Some(inner) = attributes.iter().find(|a| matches!(a.style, syn::AttrStyle::Inner(_))) {
            allowed.style = inner.style;
        }
        attributes.push(allowed);
    }
    file.to_token_stream()
}

/// The functions that are wished, proven, without what `preparation` takes of them.
fn built(
    model: &Model,
    functions: &[Function],
    options: &Options,
    preparation: &mut Preparation,
) -> Result<Vec<FunctionGraph>, Error> {
    let functions = Function::ALL.into_iter().filter(|f| functions.contains(f));
    functions
        .map(|function| {
            let built = match &options.values {
                Some(values) => model.baked_function(function, options.parameters, values)?,
                None => model.function(function, options.parameters)?,
            };
            let built = FunctionGraph { contracted: options.contract, ..built };
            Ok(built.without_preparation(preparation))
        })
        .collect()
}

/// The wished functions that are the tool's, for each frame of the arm; a frame that cannot accelerate in
/// every direction has fewer.
fn frames(
    model: &Model,
    options: &Options,
    preparation: &mut Preparation,
) -> Result<Vec<(String, Vec<FunctionGraph>)>, Error> {
    let mut of = |frame: &Frame| {
        let Some(at) = model.at_frame(&frame.name) else { return Ok((frame.name.clone(), Vec::new())) };
        let wished =
            at.functions(options.parameters).filter(|f| f.is_of_tool() && options.functions.contains(f));
        let functions: Vec<Function> = wished.collect();
        Ok((frame.name.clone(), built(&at, &functions, options, preparation)?))
    };
    model.arm().frames.iter().map(&mut of).collect()
}

/// The module of a frame: the tool's functions at the frame, which share the file's angles and prepared
/// parameters.
fn frame_module(
    model: &Model,
    options: &Options,
    frame: &str,
    built: &[FunctionGraph],
    prepared: usize,
) -> TokenStream {
    if built.is_empty() {
        return TokenStream::new();
    }
    let name = format_ident!("{frame}");
    let doc = format!(" The functions of the tool's frame at the frame `{frame}` of the arm file.");
    let functions = built.iter().map(|built| code::function(model, built, prepared));
    let batch = options.batch.then(|| batch::module(model, built));
    quote! {
        #[doc = #doc]
        pub mod #name {
            #[allow(unused_imports)]
            use super::*;

            #(#functions)*

            #batch
        }
    }
}

/// How many joints and parameters there are, their names, and values that are baked in.
fn constants(arm: &Arm, set: &ParameterSet, options: &Options) -> TokenStream {
    let (n, p) = (Literal::usize_unsuffixed(arm.dof()), Literal::usize_unsuffixed(set.parameters.len()));
    let joint_names = arm.has_joint_names().then(|| {
        let names = arm.joint_names();
        quote! {
            /// The joints' names, in the order of q; where the arm file gives none, the joint's number from
            /// 1.
            pub const JOINT_NAMES: [&str; JOINTS] = [#(#names),*];
        }
    });
    let (names, names_doc) = (set.names(), docs::lines(&docs::parameters(set)));
    let values = options.values.as_ref().map(|values| {
        let values = values.iter().map(|x| Literal::f64_suffixed(*x));
        quote! {
            /// The parameters' values that are baked into the functions, SI units.
            pub const PARAMETER_VALUES: [f64; PARAMETERS] = [#(#values),*];
        }
    });
    quote! {
        /// Number of joints.
        pub const JOINTS: usize = #n;

        #joint_names

        /// Number of parameters.
        pub const PARAMETERS: usize = #p;

        #(#[doc = #names_doc])*
        pub const PARAMETER_NAMES: [&str; PARAMETERS] = [#(#names),*];

        #values
    }
}

/// The sine and cosine that emitted code takes.
#[cfg(test)]
pub(crate) fn emitted_sin_cos<T: nalgebra::SimdRealField + Copy>(angle: T) -> (T, T) {
    let ([sine], [cosine]) = trigonometry::sin_cos(&angle, |angle| [*angle]);
    (sine, cosine)
}
