//! A sampled motion that an arm is to follow.

use std::fmt::Write as _;

/// Joint positions, velocities and accelerations at evenly spaced times, sample after sample.
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

    /// Time from the first to the last sample, s.
    pub fn duration(&self) -> f64 {
        self.len().saturating_sub(1) as f64 * self.period
    }

    /// Adds a sample: position, velocity and acceleration of each joint.
    pub fn push(&mut self, joints: impl IntoIterator<Item = [f64; 3]>) {
        for [q, dq, ddq] in joints {
            self.q.push(q);
            self.dq.push(dq);
            self.ddq.push(ddq);
        }
    }

    /// This motion's samples at `pace` of the velocities, 0 to 1: they take 1/`pace` times as long.
    #[must_use]
    pub fn slower(&self, pace: f64) -> Motion {
        let mut slow = self.clone();
        slow.period /= pace;
        slow.dq.iter_mut().for_each(|dq| *dq *= pace);
        slow.ddq.iter_mut().for_each(|ddq| *ddq *= pace * pace);
        slow
    }

    /// The samples: `[q, dq, ddq]`, each of n values.
    pub fn samples(&self) -> impl Iterator<Item = [&[f64]; 3]> {
        let n = self.dof.max(1);
        let parts = self.q.chunks_exact(n).zip(self.dq.chunks_exact(n)).zip(self.ddq.chunks_exact(n));
        parts.map(|((q, dq), ddq)| [q, dq, ddq])
    }

    /// Reads CSV with the columns `t` (s, evenly spaced) and `q1…qn`; `dq` and `ddq` are read if all of them
    /// are there, and are zero otherwise.
    ///
    /// # Errors
    /// The wrong line, and the reason.
    pub fn from_csv(text: &str, dof: usize) -> Result<Motion, String> {
        let mut lines = text.lines().enumerate();
        let header: Vec<&str> =
            lines.next().map_or(Vec::new(), |(_, l)| l.split(',').map(str::trim).collect());
        let column = |name: &str| header.iter().position(|h| *h == name);
        let columns =
            |name: &str| (1..=dof).map(|i| column(&format!("{name}{i}"))).collect::<Option<Vec<_>>>();
        let time = column("t").ok_or("line 1: a column t is needed")?;
        let q = columns("q").ok_or_else(|| format!("line 1: columns q1 to q{dof} are needed"))?;
        let (dq, ddq) = (columns("dq"), columns("ddq"));
        let mut motion = Motion::new(dof, 0.0);
        let mut times: Vec<f64> = Vec::new();
        for (at, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let value = |k: usize| -> Result<f64, String> {
                let cell = cells.get(k).copied().unwrap_or("");
                cell.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                    format!("line {}: \"{cell}\" in column {} is not a number", at + 1, header[k])
                })
            };
            times.push(value(time)?);
            for i in 0..dof {
                motion.q.push(value(q[i])?);
                motion.dq.push(dq.as_ref().map_or(Ok(0.0), |dq| value(dq[i]))?);
                motion.ddq.push(ddq.as_ref().map_or(Ok(0.0), |ddq| value(ddq[i]))?);
            }
        }
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Err("there are no samples".to_string());
        };
        motion.period = (last - first) / (times.len().saturating_sub(1).max(1)) as f64;
        // Times are written with six decimals.
        let uneven =
            |k: usize| (times[k] - first - k as f64 * motion.period).abs() > 0.02 * motion.period + 1e-6;
        match (1..times.len()).find(|k| uneven(*k)) {
            Some(k) => Err(format!("line {}: the times are not evenly spaced", k + 2)),
            None => Ok(motion),
        }
    }

    /// The motion as CSV with a header line: `t`, `q1…qn`, `dq1…dqn`, `ddq1…ddqn`.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_round_trips_and_faults_are_named() {
        let mut motion = Motion::new(2, 0.005);
        (0..10).for_each(|k| motion.push([[0.1 * f64::from(k), 1.0, 0.0], [-0.2, 0.0, 3.0]]));
        let read = Motion::from_csv(&motion.to_csv(), 2).unwrap();
        approx::assert_relative_eq!(read.period, 0.005, max_relative = 1e-9);
        assert_eq!((read.len(), &read.dq, &read.ddq), (10, &motion.dq, &motion.ddq));
        let fault = |text: &str| Motion::from_csv(text, 2).unwrap_err();
        assert!(fault("").contains("column t"));
        assert!(fault("t,q1\n0,0").contains("q1 to q2"));
        assert!(fault("t,q1,q2\n0,0,x").contains("line 2: \"x\" in column q2"));
        assert!(fault("t,q1,q2\n0,0,0\n0.005,0").contains("line 3"));
        assert!(fault("t,q1,q2\n0,0,0\n1,0,0\n3,0,0").contains("evenly"));
        assert!(fault("t,q1,q2\n").contains("no samples"));
    }
}
