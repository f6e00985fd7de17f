//! The texts that are the same in every generated file and are compared, not proven: sines and cosines,
//! tested with integers, and the module `discrete`. The generator prints them from here.

#[cfg(test)]
mod accuracy;
#[cfg(test)]
mod trigonometry;

/// Sines and cosines in Rust.
pub const TRIGONOMETRY: &str = include_str!("trigonometry.rs");
/// Sines and cosines in C, with the arm's name for NAME.
pub const TRIGONOMETRY_C: &str = include_str!("trigonometry.c");
/// Sines and cosines in WGSL.
pub const TRIGONOMETRY_WGSL: &str = include_str!("trigonometry.wgsl");
/// A step of time: the module of an arm whose parameters are passed.
pub const DISCRETE: &str = include_str!("discrete.rs");
/// The same where values are baked in: functions take no parameters.
#[must_use]
pub fn discrete(baked: bool) -> String {
    match baked {
        true => DISCRETE
            .replace("    parameters: &impl Parameters<T>,\n", "")
            .replace("    let parameters = &parameters.prepared();\n", "")
            .replace(", parameters", ""),
        false => DISCRETE.to_string(),
    }
}
