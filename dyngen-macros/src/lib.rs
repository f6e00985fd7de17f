//! An arm's dynamics in place, from its arm file: procedural macros over [`dyngen`], whose front page names
//! the paper that equations are cited from.
//!
//! ```
//! mod arm {
//!     dyngen_macros::arm! {
//!         toml = r#"
//!             name = "pendulum"
//!             convention = "standard"
//!             gravity = [0, -9.81, 0]
//!             [[joint]]
//!             kind = "revolute"
//!             a = 1
//!             alpha = 0
//!             d = 0
//!             theta = 0
//!         "#,
//!         functions = [gravity],
//!     }
//! }
//!
//! let torque = arm::gravity(&nalgebra::Vector1::new(0.0_f64), &nalgebra::Vector3::new(2.0, 0.0, 0.0));
//! assert!((torque[0] - 2.0 * 9.81).abs() < 1e-12, "{} of the sum {}", torque[0], arm::PARAMETER_NAMES[0]);
//! ```
//!
//! The code is that of `dyngen generate` and of `dyngen::Config`; the crate that uses it needs `nalgebra`
//! 0.35.

mod request;

use proc_macro2::TokenStream;
use quote::ToTokens;
use request::Request;
use syn::{ItemMod, parse_macro_input, parse_quote};

/// The constants and functions of an arm, as `dyngen generate` writes them.
///
/// Belongs into a module of its own, because it brings names such as `JOINTS` and `gravity`.
///
/// - `arm!("arm.toml")`: the minimal set, every function. The path is relative to the crate's `Cargo.toml`.
/// - `arm! { file = "arm.toml", parameters = full, functions = [regressor, gravity] }`: what is named, only.
/// - `arm! { toml = r#"…"#, … }`: the arm file's text in place.
/// - `friction = ["viscous", "tanh:216"]`, `tests = true`: friction columns, and the arm's own consistency
///   tests.
/// - `batch = true`: the module `batch` with the functions over blocks of samples.
/// - `values = "values.json"` in addition to either: parameter values to bake in; the functions then take
///   none.
///
/// Everything that is wrong with the arm is reported at once, as errors of the compiler. The crate is built
/// again when a file changes.
#[proc_macro]
pub fn arm(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let request = parse_macro_input!(input as Request);
    request.generate().unwrap_or_else(|e| e.to_compile_error()).into()
}

/// Fills a module with what [`arm!`](crate::arm) generates: `#[dyngen_macros::model("arm.toml")] mod arm {}`.
///
/// Takes the same arguments; what the module holds already stays.
#[proc_macro_attribute]
pub fn model(arguments: proc_macro::TokenStream, item: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let request = parse_macro_input!(arguments as Request);
    let module = parse_macro_input!(item as ItemMod);
    let filled = request.generate().and_then(|items| fill(module, items));
    filled.unwrap_or_else(|e| e.to_compile_error()).into()
}

/// A module with more items.
fn fill(mut module: ItemMod, items: TokenStream) -> syn::Result<TokenStream> {
    let Some((_, content)) = &mut module.content else {
        return Err(syn::Error::new_spanned(&module, "the module must have a body: write `mod arm {}`"));
    };
    let generated: syn::File = parse_quote!(#items);
    content.extend(generated.items);
    Ok(module.into_token_stream())
}
