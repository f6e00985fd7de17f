//! The texts that are the same in every generated file and are compared, not proven: sines and cosines,
//! tested with integers, the module `discrete`, and the head of a file in CUDA. The generator prints them
//! from here.

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
/// What stands before the code of a file in CUDA: what compilers must bring, as NVRTC has no headers.
pub const BEFORE_CUDA: &str = r#"#ifdef __CUDACC_RTC__
typedef unsigned int uint32_t;
typedef unsigned long long uint64_t;
#else
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#endif

#if defined(__FAST_MATH__) || (defined(__USE_FAST_MATH__) && (__USE_FAST_MATH__ + 0))
#error "sums must be rounded as they are written: compile without --use_fast_math"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
"#;
/// The square root in C, or in CUDA, rounded once, with the arm's name for NAME.
#[must_use]
pub fn root_in_c(is_cuda: bool) -> String {
    let [single, double] = if is_cuda { ["__fsqrt_rn", "__dsqrt_rn"] } else { ["sqrtf", "sqrt"] };
    format!(
        "/* The square root of x, rounded once. */
#undef root
#ifdef NAME_FLOAT
#define root(x) {single}(x)
#else
#define root(x) {double}(x)
#endif

"
    )
}
/// A step of time: the module of an arm whose parameters are passed.
pub const DISCRETE: &str = include_str!("discrete.rs");
/// The module `discrete`; where values are baked in, its functions take no parameters.
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
