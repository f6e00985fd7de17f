//! The context of an effect: the data, the model fitted so far, and its residual.

use super::made::{Made, OfModel};
use super::{Candidate, Placed};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_controller::correction::{Instant, Law, Memory};
use powerball_controller::friction::TanhFriction;
use powerball_identification::estimate::Fit;
use powerball_logs::regression::{Column, Data, Recording};
use powerball_logs::signal::{Butterworth, difference};
use std::sync::Arc;

/// Rows of a joint that moves, at least.
const LEAST_ROWS: usize = 50;

/// Data together with the model fitted so far, and the rule that judges.
#[derive(Debug)]
pub struct Context<'a> {
    /// The data; not always those that the model was fitted to.
    pub data: &'a Data<'a>,
    /// The model.
    pub fit: &'a Fit,
    /// Residual of the model on the data, by joint.
    pub residual: &'a [Vec<f64>],
    /// The thresholds of the rule.
    pub rule: &'a Rule,
    /// The data's columns that were made already.
    made: Option<&'a Made>,
    /// Columns of the model on the data, made at their first use.
    of_model: Arc<OfModel>,
}

impl<'a> Context<'a> {
    /// A model seen on some data.
    #[must_use]
    pub fn new(data: &'a Data<'a>, fit: &'a Fit, residual: &'a [Vec<f64>], rule: &'a Rule) -> Context<'a> {
        Context {
            data,
            fit,
            residual,
            rule,
            made: None,
            of_model: Arc::new(OfModel::new(&fit.theta, &fit.shapes)),
        }
    }

    /// Like [`Context::new`], for columns alone: the residual is not known.
    #[must_use]
    pub fn for_columns(data: &'a Data<'a>, fit: &'a Fit, rule: &'a Rule) -> Context<'a> {
        Context::new(data, fit, &[], rule)
    }

    /// This model on the same data, with another residual.
    #[must_use]
    pub(crate) fn seen_with<'b>(&'b self, residual: &'b [Vec<f64>]) -> Context<'b> {
        let of_model = Arc::clone(&self.of_model);
        Context { residual, of_model, ..*self }
    }

    /// Takes from columns of the same data what was made already, and adds to them.
    pub(crate) fn with(mut self, made: &'a Made) -> Context<'a> {
        self.made = Some(made);
        self.of_model = made.of_model(&self.fit.theta, &self.fit.shapes);
        self
    }

    /// The columns of a candidate: made once for this model on these data.
    #[must_use]
    pub fn columns(&self, candidate: &Candidate) -> Vec<Column> {
        self.of_model.columns(candidate, || candidate.effect().columns(self, candidate))
    }

    /// Joints that move.
    pub fn moving_joints(&self) -> impl Iterator<Item = JointNumber> + '_ {
        let moves = |j: &usize| self.data.joints[*j].len() >= LEAST_ROWS;
        (0..self.data.dof()).filter(moves).map(JointNumber::from_index)
    }

    /// Torque of the rigid arm by recording, n a sample, N·m.
    pub fn rigid(&self) -> &[Vec<f64>] {
        self.of_model.rigid.get_or_init(|| {
            let torque = |r: &Recording| self.fit.rigid_torque(self.data.body, &r.q, &r.v, &r.a);
            self.data.recordings.iter().map(torque).collect()
        })
    }

    /// Eq. 16 friction by recording, n a sample, N·m.
    pub fn friction(&self) -> &[Vec<f64>] {
        self.of_model.friction.get_or_init(|| {
            let n = self.data.dof();
            let friction: Vec<TanhFriction<f64>> =
                (0..n).map(|j| TanhFriction::new(self.fit.friction(j))).collect();
            let of =
                |r: &Recording| r.v.iter().enumerate().map(|(k, v)| friction[k % n].torque(*v)).collect();
            self.data.recordings.iter().map(of).collect()
        })
    }

    /// Rigid torque and friction by recording, n a sample, N·m.
    pub fn prediction(&self) -> &[Vec<f64>] {
        self.of_model.prediction.get_or_init(|| {
            let sum = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a + b).collect();
            self.rigid().iter().zip(self.friction()).map(sum).collect()
        })
    }

    /// The steepest level of a joint's friction, s/rad: how fast its sign changes.
    #[must_use]
    pub fn steepness(&self, joint: JointNumber) -> f64 {
        let [g1, g2, g3, g4, _] = self.fit.friction(joint.index());
        match (g1 > 0.0, g3 > 0.0) {
            (true, true) => g2.max(g4),
            (true, false) => g2,
            (false, true) => g4,
            (false, false) => 20.0 / self.top_velocity(joint),
        }
    }

    /// The velocity that a joint exceeds in 5 % of the samples that were fitted, rad/s.
    #[must_use]
    pub fn top_velocity(&self, joint: JointNumber) -> f64 {
        self.fit.top_velocity[joint.index()]
    }

    /// The column of laws that share a coefficient, each at a joint of its own.
    pub fn placed_column(&self, laws: &[Placed]) -> Column {
        let mut parts = Vec::with_capacity(laws.len());
        for (joint, law, share) in laws {
            let mut column = self.law_column(*joint, *law);
            if *share != 1.0 {
                for (_, values) in &mut column.parts {
                    Arc::make_mut(values).iter_mut().for_each(|v| *v *= share);
                }
            }
            parts.extend(column.parts);
        }
        Column { parts }
    }

    /// The column of a law at a joint: the law along the recordings.
    pub fn law_column(&self, joint: JointNumber, law: Law<f64>) -> Column {
        if law.moves_link() {
            return self.moved_link_column(joint, law, None);
        }
        let make = || {
            let rows = &self.data.joints[joint.index()];
            rows.column(&self.data.recordings, |r, _| self.law_along(r, joint, law))
        };
        match self.made {
            Some(made) => {
                let rows = &self.data.joints[joint.index()];
                let pass = || {
                    let of = |r| rows.band.pass(&self.law_along(r, joint, law));
                    (0..self.data.recordings.len()).map(of).collect()
                };
                // What is the same on every joint passes a band once.
                let values = || match law.is_equal_on_all() {
                    true => rows.passed_rows(&made.passed.get((rows.band.cutoff, law), pass)),
                    false => make(),
                };
                Column::on(joint.index(), made.motion.get((joint, law), values))
            }
            None => Column::on(joint.index(), make()),
        }
    }

    /// A law that moves no link along a recording, one value a sample.
    pub(crate) fn law_along(&self, recording: usize, joint: JointNumber, law: Law<f64>) -> Vec<f64> {
        let none: &[f64] = &[];
        let (rigid, friction) = if law.needs_torque() {
            (self.rigid()[recording].as_slice(), self.friction()[recording].as_slice())
        } else {
            (none, none)
        };
        let mut memory = Memory::default();
        let recording = &self.data.recordings[recording];
        let mut values = Vec::with_capacity(recording.len());
        each_instant(recording, rigid, friction, |_, now| {
            values.push(law.value(joint.index(), now, &mut memory))
        });
        values
    }

    /// The change of rigid torque on all joints for a link that is moved, over the law's coefficient: to
    /// first order, or for a coefficient of about `about`.
    pub(super) fn moved_link_column(&self, joint: JointNumber, law: Law<f64>, about: Option<f64>) -> Column {
        let (joint, n) = (joint.index(), self.data.dof());
        let loads = || self.rigid().iter().flat_map(|t| t.iter().skip(joint).step_by(n));
        let first_order = MOVED / loads().fold(1e-9f64, |top, load| top.max(law.shift(*load).abs()));
        let (size, passes, smoothing) = match about {
            Some(size) if size > first_order => (size, PASSES, SOFT),
            _ => (first_order, 1, STIFF),
        };
        let difference: Vec<Vec<f64>> = (self.data.recordings.iter().zip(self.rigid()))
            .map(|(recording, rigid)| {
                let mut moved = rigid.clone();
                for _ in 0..passes {
                    let mut motion = [recording.q.clone(), recording.v.clone(), recording.a.clone()];
                    move_link(&mut motion, recording, &moved, joint, law, (size, smoothing));
                    let [q, v, a] = motion;
                    moved = self.fit.rigid_torque(self.data.body, &q, &v, &a);
                }
                moved.iter().zip(rigid).map(|(a, b)| (a - b) / size).collect()
            })
            .collect();
        self.data.column_over_all(&difference)
    }

    /// Times of a joint's rows in their log's own t, with the log: by row.
    #[must_use]
    pub fn row_times(&self, joint: usize) -> Vec<(usize, f64)> {
        let data = self.data;
        let rows = &data.joints[joint];
        let mut times = Vec::with_capacity(rows.len());
        for (r, recording) in data.recordings.iter().enumerate() {
            let kept = rows.band.kept(recording.len());
            times.extend(
                rows.kept[r]
                    .iter()
                    .map(|k| (recording.log, recording.start + kept[*k] as f64 / recording.rate)),
            );
        }
        times
    }
}

/// The largest deflection that a difference is taken with, rad.
const MOVED: f64 = 1e-4;
/// A compliant joint's deflection is smoothed to this before it is differentiated twice, Hz: torques are
/// noisy derivatives already.
const STIFF: f64 = 5.0;
/// Like [`STIFF`], for a compliance as large as was found: above the frequency at which a soft arm swings on
/// its gear the deflection does not follow its load.
pub(crate) const SOFT: f64 = 2.0;
/// A link that gives way far carries another load there: the load is computed this many times.
pub(crate) const PASSES: usize = 2;
/// The load whose side a link hangs to is smoothed to this, Hz: going through the play is an impulse in the
/// rigid torque of the motor's motion, and would change the side that it follows from.
const SIDE: f64 = 3.0;

/// Adds to positions, velocities and accelerations how a law moves one link, `size` times: n values a sample,
/// `rigid` the torque of the rigid arm where the motors are. What gives way is smoothed, Hz.
pub(crate) fn move_link(
    motion: &mut [Vec<f64>; 3],
    recording: &Recording,
    rigid: &[f64],
    joint: usize,
    law: Law<f64>,
    (size, smoothing): (f64, f64),
) {
    let n = recording.dof;
    let rate = recording.rate;
    let smooth = |(order, cutoff): (usize, f64), signal: Vec<f64>| {
        let filter = Butterworth::low_pass(order, cutoff.min(0.3 * rate), rate);
        filter.map_or(signal.clone(), |f| f.zero_phase(&signal))
    };
    let load: Vec<f64> = rigid.iter().skip(joint).step_by(n).copied().collect();
    let shifts = |load: Vec<f64>| load.iter().map(|t| size * law.shift(*t)).collect();
    let shift = match law {
        Law::Compliance => smooth((2, smoothing), shifts(load)),
        // The way through the play is smoothed as positions are: both are differentiated alike.
        _ => smooth((4, recording.smoothing), shifts(smooth((2, SIDE), load))),
    };
    // What follows the load has velocity and acceleration.
    let (dv, da) =
        (difference::derivative(&shift, 1.0 / rate), difference::second_derivative(&shift, 1.0 / rate));
    let moves = [shift, dv, da];
    for (signal, by) in motion.iter_mut().zip(moves) {
        for (value, by) in signal.iter_mut().skip(joint).step_by(n).zip(by) {
            *value += by;
        }
    }
}

/// Goes through the instants of a recording in order; `rigid` and `friction` hold n values a sample, or
/// nothing.
pub(crate) fn each_instant(
    recording: &Recording,
    rigid: &[f64],
    friction: &[f64],
    mut at: impl FnMut(usize, &Instant<'_, f64>),
) {
    let n = recording.dof;
    let mut temperature = vec![0.0; recording.temperature.as_ref().map_or(0, Vec::len)];
    for k in 0..recording.len() {
        let joints = k * n..(k + 1) * n;
        for (now, logged) in temperature.iter_mut().zip(recording.temperature.iter().flatten()) {
            *now = logged[k];
        }
        let now = Instant {
            q: &recording.q[joints.clone()],
            dq: &recording.v[joints.clone()],
            ddq: &recording.a[joints.clone()],
            rigid: rigid.get(joints.clone()).unwrap_or_default(),
            friction: friction.get(joints).unwrap_or_default(),
            temperature: &temperature,
            running: recording.clock + k as f64 / recording.rate,
        };
        at(k, &now);
    }
}
