//! What varies from run to run: no residual's spread has it, and two parts of one log tell it.

use super::friction::Curves;
use super::side::Side;

impl Side {
    /// The same with errors so large that fits of two parts of its logs, which are of one arm, differ by no more than
    /// these: what varies from run to run and from path to path, and what the model lacks, is in no residual's spread.
    /// One factor for all errors, the mean over joints and velocities of squared differences of friction over their
    /// variance, 1 at least.
    #[must_use]
    pub fn repeated(mut self, [first, second]: [&Side; 2]) -> Side {
        let factor = Curves::of(first, second).iter().filter_map(Curves::surprise).collect::<Vec<f64>>();
        let factor = (factor.iter().sum::<f64>() / factor.len().max(1) as f64).max(1.0);
        if let Some(all) = &mut self.uncertainty {
            all.covariance.iter_mut().flatten().for_each(|c| *c *= factor);
        }
        let larger = |std: &mut Option<f64>| *std = std.map(|std| std * factor.sqrt());
        self.parameters.iter_mut().for_each(|p| larger(&mut p.std));
        self.friction.iter_mut().flat_map(|f| &mut f.std).for_each(larger);
        self
    }
}
