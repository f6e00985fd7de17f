//! Many samples at once: a loop compiled for several kinds of processor, of which the best one that the
//! machine supports runs.
//!
//! The functions in a generated file's module `batch` are loops over blocks of samples. Compiled for any
//! x86-64 they use vectors of two; inside a [`Work`] they use the vectors that the processor has (AVX2,
//! AVX-512, NEON). The results stay the same, to the bit.
//!
//! ```
//! use powerball_logs::batch::{self, Work};
//! # /// A pendulum as a generated file has it.
//! # mod arm {
//! #     use nalgebra::SVector;
//! #     pub const JOINTS: usize = 1;
//! #     pub const PARAMETERS: usize = 2;
//! #     type Vector = SVector<f64, JOINTS>;
//! #     pub fn inverse_dynamics(q: &Vector, _: &Vector, ddq: &Vector, p: &SVector<f64, PARAMETERS>) -> Vector {
//! #         Vector::from([p[0] * ddq[0] + p[1] * q[0].cos()])
//! #     }
//! #     pub mod batch {
//! #         type Block = [[f64; 8]; super::JOINTS];
//! #         #[inline(always)]
//! #         pub fn inverse_dynamics(
//! #             q: &Block, _: &Block, ddq: &Block, p: &nalgebra::SVector<f64, 2>, out: &mut Block,
//! #         ) {
//! #             for k in 0..8 {
//! #                 out[0][k] = p[0] * ddq[0][k] + p[1] * q[0][k].cos();
//! #             }
//! #         }
//! #     }
//! # }
//! use arm::{JOINTS, PARAMETERS};
//! use nalgebra::SVector;
//!
//! /// Eight samples of each joint.
//! type Block = [[f64; 8]; JOINTS];
//!
//! struct Torques<'a> {
//!     /// q, q̇ and q̈ of each block.
//!     motion: &'a [[Block; 3]],
//!     parameters: &'a SVector<f64, PARAMETERS>,
//!     out: &'a mut [Block],
//! }
//!
//! impl Work for Torques<'_> {
//!     type Output = ();
//!     #[inline(always)]
//!     fn run(self) {
//!         for ([q, dq, ddq], out) in self.motion.iter().zip(self.out) {
//!             arm::batch::inverse_dynamics(q, dq, ddq, self.parameters, out);
//!         }
//!     }
//! }
//!
//! let motion = vec![[[[0.1; 8]; JOINTS]; 3]; 100];
//! let mut out = vec![[[0.0; 8]; JOINTS]; 100];
//! let parameters = SVector::repeat(0.5);
//! batch::run(Torques { motion: &motion, parameters: &parameters, out: &mut out });
//!
//! let [q, dq, ddq] = [0.1; 3].map(SVector::repeat);
//! assert_eq!(out[99][0][7], arm::inverse_dynamics(&q, &dq, &ddq, &parameters)[0]);
//! ```

/// Work on batches.
pub trait Work {
    /// The result of the work.
    type Output;

    /// Does the work. To be marked `#[inline(always)]`, and to call nothing large that is not: what is not
    /// inlined into it is compiled for any processor.
    fn run(self) -> Self::Output;
}

struct Dispatched<W>(W);

impl<W: Work> pulp::WithSimd for Dispatched<W> {
    type Output = W::Output;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> W::Output {
        self.0.run()
    }
}

/// Runs `work` as it was compiled for the best vectors that this processor has.
pub fn run<W: Work>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(Dispatched(work))
}
