//! What a file with contraction says of it and brings for it: a·b + c, rounded once.

use proc_macro2::TokenStream;
use quote::quote;

/// What the head of a file in Rust says.
pub(super) const RUST: [&str; 4] = [
    "Contracted: fused(x, y, z) is x·y + z, rounded once. Bits differ from those of a file without \
    --contract. The",
    "target must have it as an instruction (x86: -C target-cpu=native, or -C target-feature=+fma), and \
    nalgebra its",
    "feature std: otherwise each is a call, and the code takes five times as long. Where the processor is \
    asked at run time,",
    "--cfg dyngen_fma says that every call is made from code that is compiled for the instruction.",
];

/// What the head of a file in C says.
pub(super) const C: [&str; 3] = [
    "Contracted: fused(x, y, z) is x * y + z, rounded once. Bits differ from those of a file without \
    --contract. The",
    "target must have it as an instruction (x86: -march=native, or -mfma). -DNAME_FMA says that it has where \
    the",
    "compiler does not say so.",
];

/// What the head of a file in CUDA says.
pub(super) const CUDA: [&str; 2] = [
    "Contracted: fused(x, y, z) is x * y + z, rounded once, with --fmad=false too. Bits differ from those of \
    a file",
    "without --contract, and are those of the file in C with it.",
];

/// What the head of a file in WGSL says.
pub(super) const WGSL: [&str; 2] = [
    "Contracted: fma(x, y, z) is x * y + z. WGSL lets a compiler round it once or twice: bounds of rounding \
    without",
    "--contract hold for both.",
];

/// The function in Rust.
pub(super) fn in_rust() -> TokenStream {
    quote! {
        #[allow(unexpected_cfgs)]
        const _: () = assert!(
            cfg!(any(
                target_feature = "fma",
                target_arch = "aarch64",
                all(target_arch = "riscv64", target_feature = "d"),
                dyngen_fma
            )),
            "generated with --contract, and the target has no fused multiply-add: compile with -C \
             target-cpu=native or -C target-feature=+fma; the head of the file says more"
        );

        /// x·y + z, rounded once.
        #[inline(always)]
        fn fused<T: SimdRealField + Copy>(x: T, y: T, z: T) -> T {
            x.simd_mul_add(y, z)
        }
    }
}

/// On which targets a file in C compiles, with the arm's name for NAME.
pub(super) const CONDITION: &str = "#ifndef NAME_FMA
#ifdef NAME_FLOAT
#if !(defined(__FP_FAST_FMAF) || defined(__FMA__) || defined(__ARM_FEATURE_FMA))
#error \"generated with --contract, and the target has no fused multiply-add: compile with -march=native or \
-mfma\"
#endif
#elif !(defined(__FP_FAST_FMA) || defined(__FMA__) || defined(__aarch64__))
#error \"generated with --contract, and the target has no fused multiply-add: compile with -march=native or \
-mfma\"
#endif
#endif

";

/// The function in C and in CUDA.
pub(super) const IN_C: &str = "/* x * y + z, rounded once. */
#undef fused
#ifdef NAME_FLOAT
#define fused(x, y, z) fmaf(x, y, z)
#else
#define fused(x, y, z) fma(x, y, z)
#endif

";
