//! A sampled motion: what an arm is to follow.

use std::fmt::Write as _;

/// Joint positions, speeds and accelerations at evenly spaced times, sample after sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    dof: usize,
    /// Time between samples, s.
    pub period: f64,
    /// n values a sample, rad (m for prismatic joints).
    pub q: Vec<f64>,
    /// n values a sample, rad/s.
    pub dq: Vec<f64>,
    /// n values a sample, rad/s².
    pub ddq: Vec<f64>,
}

impl Motion {
    /// A motion of `dof` joints without samples.
    pub fn new(dof: usize, period: f64) -> Self {
        Motion { dof, period, q: Vec::new(), dq: Vec::new(), ddq: Vec::new() }
    }

    /// The number of joints n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The number of samples.
    pub fn len(&self) -> usize {
        self.q.len().checked_div(self.dof).unwrap_or(0)
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.q.is_empty()
    }

    /// From the first to the last sample, s.
    pub fn duration(&self) -> f64 {
        self.len().saturating_sub(1) as f64 * self.period
    }

    /// Adds a sample: position, speed and acceleration of each joint.
    pub fn push(&mut self, joints: impl IntoIterator<Item = [f64; 3]>) {
        for [q, dq, ddq] in joints {
            self.q.push(q);
            self.dq.push(dq);
            self.ddq.push(ddq);
        }
    }

    /// The samples: `[q, dq, ddq]`, each of n values.
    pub fn samples(&self) -> impl Iterator<Item = [&[f64]; 3]> {
        let n = self.dof.max(1);
        let parts = self.q.chunks_exact(n).zip(self.dq.chunks_exact(n)).zip(self.ddq.chunks_exact(n));
        parts.map(|((q, dq), ddq)| [q, dq, ddq])
    }

    /// As CSV with a header line: `t`, `q1…qn`, `dq1…dqn`, `ddq1…ddqn`.
    pub fn to_csv(&self) -> String {
        let mut out = String::from("t");
        for name in ["q", "dq", "ddq"] {
            for joint in 1..=self.dof {
                let _ = write!(out, ",{name}{joint}");
            }
        }
        out.push('\n');
        for (k, sample) in self.samples().enumerate() {
            let _ = write!(out, "{:.6}", k as f64 * self.period);
            for value in sample.into_iter().flatten() {
                // Adding zero turns -0 into 0.
                let _ = write!(out, ",{:.9}", value + 0.0);
            }
            out.push('\n');
        }
        out
    }
}
