//! The arm over one step of time, with its linearisation, for predictive controllers; composed of the file's
//! own functions.

use super::Options;
use crate::dynamics::Function;
use proc_macro2::TokenStream;
use quote::quote;

/// The functions that the module is composed of.
const NEEDED: [Function; 4] = [
    Function::ForwardDynamics,
    Function::MassMatrixInverse,
    Function::AccelerationByPosition,
    Function::AccelerationByVelocity,
];

/// The module `discrete`, where the file has what it needs: a text that is the same for every arm.
pub(super) fn module(options: &Options) -> Option<TokenStream> {
    if !NEEDED.iter().all(|f| options.functions.contains(f)) {
        return None;
    }
    let text = dyngen_verify::text::discrete(options.values.is_some());
    // The text parses: every file with the module is compiled in a test.
    let items = syn::parse_file(&text).map_or(Vec::new(), |file| file.items);
    Some(quote! {
        /// The state x = (q, q̇) after a step of time under torques that stay the same, and its linearisation
        /// x⁺ ≈ A·δx + B·δτ, without friction.
        pub mod discrete {
            #(#items)*
        }
    })
}
