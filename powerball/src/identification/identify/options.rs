//! How logs are identified.

use crate::identification::estimate::FrictionKind;
use crate::identification::known::KnownModel;
use crate::logs::Progress;
use crate::logs::regression::DataOptions;

/// All settings of [`identify`](super::identify).
#[derive(Clone, Debug, Default)]
pub struct IdentifyOptions<'a> {
    /// The friction of every joint.
    pub friction: FrictionKind,
    /// How samples are counted.
    pub estimator: Estimator,
    /// How logs are filtered and cut into blocks. Its band counts where the estimator looks at single
    /// samples; else every joint has its own.
    pub data: DataOptions,
    /// What is known already: taken out of the logs as it stands. Logs of one mounting alone, no summaries.
    pub known: Option<&'a dyn KnownModel>,
    /// Who is told what is being done.
    pub progress: Progress<'a>,
}

/// How samples are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Least squares, every joint weighted by its noise.
    #[default]
    Weighted,
    /// The same, and torque samples that the model cannot believe (knocks, spikes, brief collisions) count
    /// less or nothing.
    Robust,
    /// Instrumental variables: unbiased where positions are noisy. The regressor from every second sample of
    /// the positions, its instruments from those between.
    Instrumental,
}

impl Estimator {
    /// Whether it looks at single samples, which a summary does not hold.
    #[must_use]
    pub fn needs_samples(self) -> bool {
        self != Estimator::Weighted
    }
}
