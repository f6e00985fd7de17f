//! What an effect may look at: the data, the model fitted so far, and what it leaves.

use crate::estimate::Fit;
use crate::friction::TanhFriction;
use crate::regression::{Column, Data, Recording};
use std::sync::OnceLock;

/// Data together with the model fitted so far.
#[derive(Debug)]
pub struct Context<'a> {
    /// The data; not always those that the model was fitted to.
    pub data: &'a Data<'a>,
    /// The model.
    pub fit: &'a Fit,
    /// What the model leaves on the data, by joint.
    pub residual: &'a [Vec<f64>],
    rigid: OnceLock<Vec<Vec<f64>>>,
    prediction: OnceLock<Vec<Vec<f64>>>,
    top_speed: OnceLock<Vec<f64>>,
}

impl<'a> Context<'a> {
    /// A model seen on some data.
    #[must_use]
    pub fn new(data: &'a Data<'a>, fit: &'a Fit, residual: &'a [Vec<f64>]) -> Context<'a> {
        Context {
            data,
            fit,
            residual,
            rigid: OnceLock::new(),
            prediction: OnceLock::new(),
            top_speed: OnceLock::new(),
        }
    }

    /// Joints that move.
    pub fn moving_joints(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.data.dof()).filter(|j| self.data.joints[*j].len() >= 50)
    }

    /// Torque of the rigid arm by recording, n a sample, N·m.
    pub fn rigid(&self) -> &[Vec<f64>] {
        self.rigid.get_or_init(|| {
            let torque = |r: &Recording| self.data.body.torque(&r.q, &r.v, &r.a, self.fit.inertial());
            self.data.recordings.iter().map(torque).collect()
        })
    }

    /// Rigid torque and friction by recording, n a sample, N·m.
    pub fn prediction(&self) -> &[Vec<f64>] {
        self.prediction.get_or_init(|| {
            let n = self.data.dof();
            let friction: Vec<TanhFriction<f64>> =
                (0..n).map(|j| TanhFriction::new(self.fit.friction(j))).collect();
            let mut torque = self.rigid().to_vec();
            for (torque, recording) in torque.iter_mut().zip(&self.data.recordings) {
                for (k, value) in torque.iter_mut().enumerate() {
                    *value += friction[k % n].torque(recording.v[k]);
                }
            }
            torque
        })
    }

    /// The steepest level of a joint's friction, s/rad: how fast its sign changes.
    #[must_use]
    pub fn steepness(&self, joint: usize) -> f64 {
        let [g1, g2, g3, g4, _] = self.fit.friction(joint);
        match (g1 > 0.0, g3 > 0.0) {
            (true, true) => g2.max(g4),
            (true, false) => g2,
            (false, true) => g4,
            (false, false) => 20.0 / self.top_speed(joint),
        }
    }

    /// The speed that a joint exceeds in 5 % of its samples, rad/s.
    #[must_use]
    pub fn top_speed(&self, joint: usize) -> f64 {
        self.top_speed.get_or_init(|| (0..self.data.dof()).map(|j| self.data.top_speed(j)).collect())[joint]
    }

    /// A column on one joint that is a function of its position and speed.
    pub fn state_column(&self, joint: usize, f: impl Fn(f64, f64) -> f64) -> Column {
        self.data
            .column_on(joint, |_, r| r.position(joint).zip(r.speed(joint)).map(|(q, v)| f(q, v)).collect())
    }

    /// Times of a joint's rows in their log's own t, with the log: by row.
    #[must_use]
    pub fn row_times(&self, joint: usize) -> Vec<(usize, f64)> {
        let data = self.data;
        let rows = &data.joints[joint];
        let mut times = Vec::with_capacity(rows.len());
        for (r, recording) in data.recordings.iter().enumerate() {
            let kept = data.band.kept(recording.len());
            times.extend(
                rows.kept[r]
                    .iter()
                    .map(|k| (recording.log, recording.start + kept[*k] as f64 / recording.rate)),
            );
        }
        times
    }
}
