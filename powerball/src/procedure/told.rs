//! What a person is told while the arm moves.

use std::fmt;

/// How far a motion has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Samples that were given, and all there are.
    pub samples: [usize; 2],
    /// Where the joints are, rad.
    pub position: Vec<f64>,
    /// The greatest distance of a joint from its set-point now, rad.
    pub error: f64,
    /// SYNCs that were late since the master began.
    pub late: u64,
    /// Joints' data that was missing since then, in cycles.
    pub missing: u64,
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [done, all] = self.samples;
        let share = 100 * done / all.max(1);
        write!(f, "{share:3} % of {all} samples, at (")?;
        for (j, q) in self.position.iter().enumerate() {
            write!(f, "{}{q:.3}", if j == 0 { "" } else { ", " })?;
        }
        let Told { error, late, missing, .. } = self;
        write!(f, ") rad, {:.1} mrad off, {late} cycles late, {missing} without data", 1e3 * error)
    }
}
