//! Samples as they were read, before any doubt.

/// What the effort columns hold.
pub(super) enum Effort {
    /// N·m or N.
    Torque,
    /// A, with N·m/A (N/A) by joint.
    Current(Vec<f64>),
}

/// Samples as read: joint-major.
pub(super) struct Raw {
    pub(super) line: Vec<usize>,
    pub(super) t: Vec<f64>,
    pub(super) q: Vec<Vec<f64>>,
    pub(super) effort: Vec<Vec<f64>>,
    pub(super) temperature: Option<Vec<Vec<f64>>>,
    pub(super) dq: Vec<Vec<f64>>,
    pub(super) motor: Option<Vec<Vec<f64>>>,
}

impl Raw {
    pub(super) fn new(dof: usize, temperature: bool, motor: bool) -> Raw {
        let empty = || vec![Vec::new(); dof];
        Raw {
            line: Vec::new(),
            t: Vec::new(),
            q: empty(),
            effort: empty(),
            temperature: temperature.then(empty),
            dq: empty(),
            motor: motor.then(empty),
        }
    }

    pub(super) fn push(&mut self, line: usize, values: &[f64]) {
        let mut values = values.iter().copied();
        self.line.push(line);
        self.t.extend(values.next());
        for joint in self.q.iter_mut().chain(&mut self.effort) {
            joint.extend(values.next());
        }
        // Last what says by being empty that it is not there.
        let motor = self.motor.iter_mut().flatten();
        for joint in self.temperature.iter_mut().flatten().chain(motor).chain(&mut self.dq) {
            joint.extend(values.next());
        }
    }

    pub(super) fn retain(&mut self, keep: &[bool]) {
        let filter = |x: &mut Vec<f64>| {
            if x.len() == keep.len() {
                let mut k = keep.iter();
                x.retain(|_| *k.next().unwrap_or(&true));
            }
        };
        filter(&mut self.t);
        self.q.iter_mut().chain(&mut self.effort).for_each(filter);
        let motor = self.motor.iter_mut().flatten();
        self.temperature.iter_mut().flatten().chain(&mut self.dq).chain(motor).for_each(filter);
        let mut k = keep.iter();
        self.line.retain(|_| *k.next().unwrap_or(&true));
    }
}
