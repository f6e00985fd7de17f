//! Whether columns explain rows better than chance, and on rows that took no part in the fit.
//!
//! A question is a [`Base`] (rows, the columns that are in the model of them already, what these leave) and
//! some further columns. The answer is a [`Trial`]: their coefficients with the base refitted, the χ² that
//! they explain, and the score, which is less for each coefficient and for all that was searched. Whoever
//! asks decides what is enough, from:
//!
//! | | |
//! |---|---|
//! | `base` | the question and the answer; what columns add to a prediction of any rows |
//! | `blocks` | the probability of such coefficients, or of such a lead of one model over another, by chance: blocks that count as independent |
//! | `folds` | the held-out error, fold by fold |
//! | `held_out` | the error on other logs; whether two additions are the same |
//! | `surrogates` | the same search on columns, or on a residual, that are shifted in time: how often it finds as much where nothing is |

mod base;
mod blocks;
mod folds;
mod held_out;
mod surrogates;

pub use base::{Base, Rows, Trial, penalty};
pub use blocks::{Clusters, p_of_coefficients, p_of_sum};
pub use folds::FoldFits;
pub use held_out::{correlation, error_in_log, gain_on, log_change};
pub use surrogates::{Chance, Shift, Surrogate, draw, rotated, shifted};

#[cfg(test)]
mod tests;
