//! Logs of an arm into rows: even grid, derivatives, band, rest removed, blocks laid out.

use super::row_selection::{FEWEST_ROWS, inactive_joints, kept_samples, notes};
use super::{Block, Column, JointRows, Recording, RigidArm, Signals};
use crate::log::{Log, logs_of_motors};
use crate::parallel;
use crate::signal::resample::median_step;
use crate::signal::{BANDS, Band, motion};
use dyngen::arm::{Parameter, ParameterKind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// How logs are prepared.
#[derive(Clone, Debug)]
pub struct DataOptions {
    /// Band of the regression, Hz: torques and columns pass the same zero-phase low-pass. The noise of
    /// accelerations grows with its power 2.5.
    pub cutoff: f64,
    /// Smoothing of positions before they are differentiated, Hz. Torques pass it as well, so that what is
    /// linear in the motion is exact in any band. What is not (friction, which changes its sign with the
    /// velocity) is made of the smoothed motion before it passes the band, so this is far above the band.
    pub smoothing: f64,
    /// Length of a block, s: residuals further apart count as independent.
    pub block: f64,
}

impl Default for DataOptions {
    fn default() -> Self {
        DataOptions { cutoff: BANDS[0], smoothing: 24.0, block: 2.0 }
    }
}

/// Why logs cannot be analysed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DataError {
    /// No log has a stretch long enough.
    #[error("the logs hold no stretch of at least a second without gaps: record longer")]
    TooShort,
    /// No joint says anything: why, joint by joint.
    #[error("no joint moves enough in these logs, with torques that change: friction and inertia cannot \
                    be seen; record an \
                 exciting motion\n  {}", .0.join("\n  "))]
    NoMotion(Vec<String>),
}

/// Everything that regressions over some logs share.
///
/// Where a transmission couples joints, recordings and rows are of motors: see
/// [`Motors`](crate::log::Motors).
#[derive(Debug)]
pub struct Data<'a> {
    /// The arm's rigid-body functions.
    pub body: &'a RigidArm,
    /// The pieces of all logs.
    pub recordings: Arc<Vec<Recording>>,
    /// The band.
    pub band: Band,
    /// The rows by joint.
    pub joints: Vec<JointRows>,
    /// The blocks, in order of time and log.
    pub blocks: Vec<Block>,
    /// File names by log.
    pub logs: Vec<String>,
    /// The velocity below which a joint rests, by joint, rad/s.
    pub rest_velocity: Vec<f64>,
    /// By joint: the reason why its samples carry no information.
    pub inactive: Vec<Option<String>>,
    /// Pieces of logs, and joints of some logs, that were left out, in words.
    pub left_out: Vec<String>,
    /// Notes on samples that were left out and on corrections.
    pub notes: Vec<String>,
    /// Whether each joint has a fit of its own (see [`Data::per_joint_fit`]).
    pub per_joint: bool,
    top_velocity: Vec<f64>,
    links: Vec<OnceLock<Vec<Column>>>,
    force: OnceLock<Vec<Column>>,
    declared_zero: OnceLock<Vec<Column>>,
    pull: [OnceLock<Vec<Column>>; 3],
    levels: KeptLevels,
    viscous: Vec<OnceLock<Arc<Vec<f64>>>>,
}

/// Levels of friction by joint and steepness, those used last at the end: tanh(γ·q̇) and its tangent.
type KeptLevels = Mutex<Vec<(usize, f64, [Arc<Vec<f64>>; 2])>>;

/// Friction columns of a joint: two saturating levels, the viscous one, and the two tangents of the shapes.
pub const FRICTION: usize = 5;

/// Steepnesses of a joint whose columns are kept: a fit goes to and fro between a few.
const KEPT_LEVELS: usize = 8;

/// Mass and first moments: the parameters of a link that gravity pulls at.
pub const PULLED: usize = 4;

impl<'a> Data<'a> {
    /// Prepares logs.
    ///
    /// # Errors
    /// [`DataError`] where nothing usable remains.
    pub fn new(body: &'a RigidArm, logs: &[Log], options: &DataOptions) -> Result<Data<'a>, DataError> {
        Data::corrected(body, logs, options, |_| {})
    }

    /// Prepares logs whose signals are corrected on the even grid before they pass the band.
    ///
    /// # Errors
    /// Those of [`Data::new`].
    pub fn corrected(
        body: &'a RigidArm,
        logs: &[Log],
        options: &DataOptions,
        correct: impl FnMut(&mut Recording),
    ) -> Result<Data<'a>, DataError> {
        Data::in_bands(body, logs, options, 1, correct)?.pop().unwrap_or(Err(DataError::TooShort))
    }

    /// Prepares logs in `count` bands: the band of the options (one of [`BANDS`] if `count` is more than
    /// one), and those that are made of it. Samples that suffice for a band may be too few for a narrower
    /// one.
    ///
    /// # Errors
    /// The errors of [`Data::new`], if nothing usable remains in any band.
    pub fn in_bands(
        body: &'a RigidArm,
        logs: &[Log],
        options: &DataOptions,
        count: usize,
        correct: impl FnMut(&mut Recording),
    ) -> Result<Vec<Result<Data<'a>, DataError>>, DataError> {
        let n = body.dof();
        let inactive = inactive_joints(body.arm(), logs);
        let logs = &*logs_of_motors(body.arm(), logs);
        let mut steps: Vec<f64> = logs.iter().filter_map(|log| median_step(&log.t)).collect();
        steps.sort_by(f64::total_cmp);
        let step = *steps.get(steps.len() / 2).ok_or(DataError::TooShort)?;
        let rate = 1.0 / step;
        let narrower = BANDS.iter().copied().filter(|cutoff| *cutoff < options.cutoff);
        let cutoffs = std::iter::once(options.cutoff).chain(narrower).take(count);
        let bands: Vec<Band> = cutoffs.map(|cutoff| Band::new(cutoff, rate)).collect();
        let mut left_out: Vec<String> = Vec::new();
        let mut recordings: Vec<Recording> = Vec::new();
        for (index, log) in logs.iter().enumerate() {
            for piece in &log.pieces {
                let span = log.t[piece.end - 1] - log.t[piece.start];
                if span < 1.0 {
                    left_out
                        .push(format!("{}: a piece of {span:.2} s is too short and was left out", log.file));
                    continue;
                }
                recordings.extend(Recording::new(log, index, piece.clone(), step, options.smoothing));
            }
        }
        if recordings.is_empty() {
            return Err(DataError::TooShort);
        }
        recordings.iter_mut().for_each(correct);
        let rest_velocity: Vec<f64> = (0..n)
            .map(|j| {
                let velocities = recordings.iter().flat_map(|r| r.velocity(j).map(f64::abs)).collect();
                motion::rest_velocity(velocities, body.velocity_limit(j))
            })
            .collect();
        let top_velocity: Vec<f64> = (0..n).map(|j| top_velocity(&recordings, j)).collect();
        let (kept, without) = kept_samples(logs, &recordings, &bands, &rest_velocity, &inactive);
        left_out.extend(without);
        let joints = joint_rows(body, &recordings, &bands, kept);
        let logs: Vec<String> = logs.iter().map(|log| log.file.clone()).collect();
        let recordings = Arc::new(recordings);
        let of_band = |(band, joints): (Band, Vec<JointRows>)| {
            if joints.iter().all(|j| j.len() < FEWEST_ROWS) {
                return Err(DataError::NoMotion(inactive.iter().flatten().cloned().collect()));
            }
            Ok(Data {
                body,
                notes: notes(&left_out, &recordings, &band, &joints, &inactive, &rest_velocity),
                blocks: blocks_of(&recordings, &joints, &band, options.block),
                recordings: Arc::clone(&recordings),
                band,
                joints,
                logs: logs.clone(),
                rest_velocity: rest_velocity.clone(),
                inactive: inactive.clone(),
                left_out: left_out.clone(),
                per_joint: false,
                top_velocity: top_velocity.clone(),
                links: vec![OnceLock::new(); body.arm().bodies()],
                force: OnceLock::new(),
                declared_zero: OnceLock::new(),
                pull: Default::default(),
                levels: KeptLevels::default(),
                viscous: vec![OnceLock::new(); n],
            })
        };
        Ok(bands.into_iter().zip(joints).map(of_band).collect())
    }

    /// Rows with other signals: samples, band and blocks are not changed.
    #[must_use]
    pub fn seen_otherwise(&self, correct: impl FnMut(&mut Recording)) -> Data<'a> {
        let mut recordings = self.recordings.to_vec();
        recordings.iter_mut().for_each(correct);
        let joints = self.rows_of(&recordings);
        self.with(Arc::new(recordings), joints)
    }

    /// Rows without a known torque, by joint and row, N·m.
    #[must_use]
    pub fn without_torque(&self, torque: &[Vec<f64>]) -> Data<'a> {
        let mut joints = self.joints.clone();
        for (joint, torque) in joints.iter_mut().zip(torque) {
            joint.torque.iter_mut().zip(torque).for_each(|(t, own)| *t -= own);
        }
        Data { per_joint: self.per_joint, ..self.with(Arc::clone(&self.recordings), joints) }
    }

    /// Rows that were recorded at other times: the common clock at the first sample of each recording, s.
    #[must_use]
    pub fn with_clocks(&self, clocks: &[f64]) -> Data<'a> {
        let mut recordings = self.recordings.to_vec();
        recordings.iter_mut().zip(clocks).for_each(|(recording, clock)| recording.clock = *clock);
        Data { per_joint: self.per_joint, ..self.with(Arc::new(recordings), self.joints.clone()) }
    }

    /// Rows with the columns of another arm: `count` parameters, and their columns along a recording,
    /// samples × n × parameters.
    #[must_use]
    pub fn of_other_columns(&self, count: usize, columns: impl Fn(&Recording) -> Vec<f64>) -> Data<'a> {
        let (n, mut joints) = (self.dof(), self.joints.clone());
        let all: Vec<Vec<f64>> = self.recordings.iter().map(columns).collect();
        for (joint, rows) in joints.iter_mut().enumerate() {
            let column = |c: usize| {
                rows.column(&self.recordings, |r, _| {
                    all[r].iter().skip(joint * count + c).step_by(n * count).copied().collect()
                })
            };
            rows.inertial = (0..count).map(column).collect();
        }
        self.with(Arc::clone(&self.recordings), joints)
    }

    /// This data with other recordings and rows.
    pub(super) fn with(&self, recordings: Arc<Vec<Recording>>, joints: Vec<JointRows>) -> Data<'a> {
        Data {
            body: self.body,
            recordings,
            band: self.band.clone(),
            joints,
            blocks: self.blocks.clone(),
            logs: self.logs.clone(),
            rest_velocity: self.rest_velocity.clone(),
            inactive: self.inactive.clone(),
            left_out: self.left_out.clone(),
            notes: self.notes.clone(),
            per_joint: false,
            top_velocity: self.top_velocity.clone(),
            links: vec![OnceLock::new(); self.body.arm().bodies()],
            force: OnceLock::new(),
            declared_zero: OnceLock::new(),
            pull: Default::default(),
            levels: KeptLevels::default(),
            viscous: vec![OnceLock::new(); self.dof()],
        }
    }

    /// The rows of other signals, every joint in its own band.
    fn rows_of(&self, recordings: &[Recording]) -> Vec<JointRows> {
        let mut joints: Vec<JointRows> = Vec::new();
        let mut done: Vec<f64> = Vec::new();
        for band in self.joints.iter().map(|joint| &joint.band) {
            if done.contains(&band.cutoff) {
                continue;
            }
            done.push(band.cutoff);
            let here = |joint: &JointRows| joint.band.cutoff == band.cutoff;
            let kept = |joint: &JointRows| match here(joint) {
                true => joint.kept.clone(),
                false => vec![Vec::new(); recordings.len()],
            };
            let kept = vec![self.joints.iter().map(kept).collect()];
            let rows =
                joint_rows(self.body, recordings, std::slice::from_ref(band), kept).pop().unwrap_or_default();
            if joints.is_empty() {
                joints = rows;
                continue;
            }
            for ((to, from), own) in joints.iter_mut().zip(rows).zip(&self.joints) {
                if here(own) {
                    *to = from;
                }
            }
        }
        joints
    }

    /// Logs with some joints in narrower bands: `narrower` are the bands after this one, each made of
    /// the one before, and `which` says by joint which of them, 0 for this one.
    #[must_use]
    pub fn with_narrower(mut self, narrower: &[Data<'_>], which: &[usize], block: f64) -> Data<'a> {
        for (j, which) in which.iter().enumerate() {
            if let Some(from) = which.checked_sub(1).and_then(|k| narrower.get(k)) {
                self.joints[j] = from.joints[j].clone();
            }
        }
        self.blocks = blocks_of(&self.recordings, &self.joints, &self.band, block);
        (self.pull, self.levels) = Default::default();
        self.viscous = vec![OnceLock::new(); self.dof()];
        self
    }

    /// Joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// The velocity that a joint exceeds in 5 % of its samples, rad/s, at least 1e-3.
    #[must_use]
    pub fn top_velocity(&self, joint: usize) -> f64 {
        self.top_velocity[joint]
    }

    /// Samples a second on the even grid.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.recordings.first().map_or(0.0, |r| r.rate)
    }

    /// Stretches of about `length` seconds, in order.
    #[must_use]
    pub fn blocks_of(&self, length: f64) -> Vec<Block> {
        blocks_of(&self.recordings, &self.joints, &self.band, length)
    }

    /// The ten inertial parameters of a link, or of a bar after them, as columns over all joints; empty where
    /// they cannot be had.
    pub fn link_columns(&self, link: usize) -> &[Column] {
        self.links[link].get_or_init(|| {
            let first = link * ParameterKind::ALL.len();
            let chosen: Vec<usize> = (first..first + 10).collect();
            self.columns_over_all(10, |r| self.body.parameter_columns(&chosen, &r.q, &r.v, &r.a))
        })
    }

    /// Torques for unit forces on the tool ([`RigidArm::force_point`]) along the base axes; empty where they
    /// cannot be had.
    pub fn force_columns(&self) -> &[Column] {
        self.force.get_or_init(|| {
            let all = self.recordings.iter().map(|r| self.body.force_columns(&r.q));
            let Some(all) = all.collect::<Option<Vec<[Vec<f64>; 3]>>>() else { return Vec::new() };
            let along = |axis: usize| -> Vec<Vec<f64>> { all.iter().map(|of| of[axis].clone()).collect() };
            (0..3).map(|axis| self.column_over_all(&along(axis))).collect()
        })
    }

    /// The static torque of every link's mass and first moments, [`PULLED`] a link, under unit gravity along
    /// a base axis, then of every bar's; empty where they cannot be had. A column has no part on a joint that
    /// does not feel it.
    pub fn pull_columns(&self, axis: usize) -> &[Column] {
        self.pull[axis].get_or_init(|| {
            let mut columns = Vec::new();
            // Link by link: of a long log all of them at full rate would be large.
            for link in 0..self.body.arm().bodies() {
                let first = link * ParameterKind::ALL.len();
                let chosen: Vec<usize> = (first..first + PULLED).collect();
                let of_link =
                    self.columns_over_all(PULLED, |r| self.body.gravity_columns(axis, &chosen, &r.q));
                if of_link.is_empty() {
                    return of_link;
                }
                columns.extend(of_link);
            }
            for column in &mut columns {
                column.parts.retain(|(_, values)| values.iter().any(|v| *v != 0.0));
            }
            columns
        })
    }

    /// A level of a joint's friction, tanh(γ·q̇), and its tangent; `make` makes them where they were not made
    /// lately.
    pub fn level_columns(
        &self,
        joint: usize,
        steepness: f64,
        make: impl FnOnce() -> [Vec<f64>; 2],
    ) -> [Arc<Vec<f64>>; 2] {
        let lock = || self.levels.lock().unwrap_or_else(PoisonError::into_inner);
        let known = |kept: &mut Vec<(usize, f64, _)>| {
            let place = kept.iter().position(|(j, g, _)| (*j, *g) == (joint, steepness))?;
            Some(kept.remove(place).2)
        };
        let found = known(&mut lock());
        let columns = found.unwrap_or_else(|| make().map(Arc::new));
        let mut kept = lock();
        if kept.iter().filter(|(j, ..)| *j == joint).count() >= KEPT_LEVELS {
            kept.iter().position(|(j, ..)| *j == joint).map(|oldest| kept.remove(oldest));
        }
        kept.push((joint, steepness, columns.clone()));
        columns
    }

    /// A joint's velocity as a column: its viscous friction.
    pub fn viscous_column(&self, joint: usize) -> Arc<Vec<f64>> {
        let make = || self.joints[joint].column(&self.recordings, |_, r| r.velocity(joint).collect());
        Arc::clone(self.viscous[joint].get_or_init(|| make().into()))
    }

    /// The parameters that the arm file declares zero.
    #[must_use]
    pub fn declared_zero(&self) -> Vec<Parameter> {
        let arm = self.body.arm();
        let declared = |p: &Parameter| p.kind != ParameterKind::Im && !arm.keeps(*p);
        arm.all_parameters().into_iter().filter(declared).collect()
    }

    /// Columns of the parameters that are declared zero, in the same order.
    pub fn declared_zero_columns(&self) -> &[Column] {
        self.declared_zero.get_or_init(|| {
            let chosen: Vec<usize> = self.declared_zero().iter().map(|p| p.index()).collect();
            self.columns_over_all(chosen.len(), |r| self.body.parameter_columns(&chosen, &r.q, &r.v, &r.a))
        })
    }

    /// Columns from a function that gives n × count values a sample.
    fn columns_over_all(&self, count: usize, of: impl Fn(&Recording) -> Option<Vec<f64>>) -> Vec<Column> {
        let Some(all) = self.recordings.iter().map(of).collect::<Option<Vec<Vec<f64>>>>() else {
            return Vec::new();
        };
        let one = |c: usize| -> Vec<Vec<f64>> {
            all.iter().map(|x| x.iter().skip(c).step_by(count).copied().collect()).collect()
        };
        (0..count).map(|c| self.column_over_all(&one(c))).collect()
    }

    /// A column from full-rate signals on one joint.
    pub fn column_on<'s>(
        &'s self,
        joint: usize,
        signal: impl FnMut(usize, &'s Recording) -> Vec<f64>,
    ) -> Column {
        Column::on(joint, self.joints[joint].column(&self.recordings, signal))
    }

    /// A column from full-rate signals with n values a sample, one for each joint.
    #[must_use]
    pub fn column_over_all(&self, signals: &[Vec<f64>]) -> Column {
        let n = self.dof();
        let part = |j: usize| {
            let signal = |r: usize, _: &Recording| -> Vec<f64> {
                signals[r].iter().skip(j).step_by(n).copied().collect()
            };
            (j, self.joints[j].column(&self.recordings, signal).into())
        };
        Column { parts: parallel::map(&(0..n).collect::<Vec<_>>(), |j| part(*j)) }
    }

    /// Measured less predicted torque by joint and row, from torques along the recordings, n a sample.
    #[must_use]
    pub fn residual(&self, predicted: &[Vec<f64>]) -> Signals {
        let of_joint = |(rows, (_, predicted)): (&JointRows, &(usize, Arc<Vec<f64>>))| {
            rows.torque.iter().zip(predicted.iter()).map(|(y, p)| y - p).collect()
        };
        self.joints.iter().zip(&self.column_over_all(predicted).parts).map(of_joint).collect()
    }
}

/// A signal at full rate, one vector a recording, as a column of a joint in each of some bands, as
/// [`Data::in_bands`] gives them.
#[must_use]
pub fn column_in_bands(
    bands: &[Data<'_>],
    joint: usize,
    mut signal: impl FnMut(&Recording) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> =
        bands.iter().map(|data| Vec::with_capacity(data.joints[joint].len())).collect();
    let Some(narrowest) = bands.last() else { return columns };
    for (r, recording) in narrowest.recordings.iter().enumerate() {
        if bands.iter().all(|data| data.joints[joint].kept[r].is_empty()) {
            continue;
        }
        let passed = narrowest.band.pass_bands(&signal(recording), bands.len());
        for ((column, passed), data) in columns.iter_mut().zip(passed).zip(bands) {
            column.extend(data.joints[joint].kept[r].iter().map(|k| passed[*k]));
        }
    }
    columns
}

/// The velocity that a joint exceeds in 5 % of its samples, rad/s, at least 1e-3.
pub fn top_velocity<'r>(recordings: impl IntoIterator<Item = &'r Recording>, joint: usize) -> f64 {
    let mut velocities: Vec<f64> =
        recordings.into_iter().flat_map(|r| r.velocity(joint).map(f64::abs)).collect();
    if velocities.is_empty() {
        return 1.0;
    }
    let at = (velocities.len() * 95 / 100).min(velocities.len() - 1);
    let (_, top, _) = velocities.select_nth_unstable_by(at, f64::total_cmp);
    top.max(1e-3)
}

/// The rows by band and joint; each band is made of the one before.
fn joint_rows(
    body: &RigidArm,
    recordings: &[Recording],
    bands: &[Band],
    kept: Vec<Vec<Vec<Vec<usize>>>>,
) -> Vec<Vec<JointRows>> {
    let (n, p) = (body.dof(), body.names().len());
    let empty = |band: &Band, kept: Vec<Vec<usize>>| {
        let mut rows = Vec::new();
        let mut end = 0;
        for k in &kept {
            rows.push(end..end + k.len());
            end += k.len();
        }
        JointRows {
            torque: Vec::with_capacity(end),
            inertial: vec![Vec::with_capacity(end); p],
            kept,
            rows,
            band: band.clone(),
        }
    };
    let mut all: Vec<Vec<JointRows>> = kept
        .into_iter()
        .zip(bands)
        .map(|(joints, band)| joints.into_iter().map(|k| empty(band, k)).collect())
        .collect();
    let Some(narrowest) = bands.last() else { return all };
    for (r, recording) in recordings.iter().enumerate() {
        // By joint, column and band.
        let mut per_joint: Vec<Vec<Vec<Vec<f64>>>> = Vec::new();
        let groups = (n * p * recording.len()).div_ceil(MOST_NUMBERS).max(1);
        let joints: Vec<usize> = (0..n).collect();
        for group in joints.chunks(n.div_ceil(groups).max(1)) {
            let own = regressor_of(body, recording, group, groups);
            let (first, width) = (group[0], group.len());
            per_joint.extend(parallel::map(group, |&j| {
                let pass = |signal: Vec<f64>| {
                    let passed = narrowest.pass_bands(&signal, bands.len());
                    let rows = |(passed, joints): (Vec<f64>, &Vec<JointRows>)| {
                        joints[j].kept[r].iter().map(|k| passed[*k]).collect()
                    };
                    passed.into_iter().zip(&all).map(rows).collect()
                };
                let column =
                    |c: usize| own.iter().skip((j - first) * p + c).step_by(width * p).copied().collect();
                let mut columns = vec![pass(recording.smooth_torque(j))];
                columns.extend((0..p).map(|c| pass(column(c))));
                columns
            }));
        }
        for (j, columns) in per_joint.into_iter().enumerate() {
            for (c, bands) in columns.into_iter().enumerate() {
                for (joints, from) in all.iter_mut().zip(bands) {
                    let joint = &mut joints[j];
                    match c.checked_sub(1) {
                        None => joint.torque.extend(from),
                        Some(c) => joint.inertial[c].extend(from),
                    }
                }
            }
        }
    }
    all
}

/// Numbers of a regressor that are held at a time: that of a long recording is computed again for each few
/// joints.
const MOST_NUMBERS: usize = 12 << 20;
/// Samples of a regressor of which some joints are kept.
const AT_ONCE: usize = 8192;

/// The rows of some joints in the regressor along a recording, samples × joints × p; `groups`: of how many
/// such it is made.
fn regressor_of(body: &RigidArm, recording: &Recording, joints: &[usize], groups: usize) -> Vec<f64> {
    if groups == 1 {
        return body.regressor(&recording.q, &recording.v, &recording.a);
    }
    let (n, p) = (body.dof(), body.names().len());
    let mut own = Vec::with_capacity(recording.len() * joints.len() * p);
    for from in (0..recording.len()).step_by(AT_ONCE) {
        let at = from * n..recording.len().min(from + AT_ONCE) * n;
        let [q, v, a] = [&recording.q, &recording.v, &recording.a].map(|x| &x[at.clone()]);
        for sample in body.regressor(q, v, a).chunks_exact(n * p) {
            joints.iter().for_each(|j| own.extend_from_slice(&sample[j * p..(j + 1) * p]));
        }
    }
    own
}

fn blocks_of(recordings: &[Recording], joints: &[JointRows], band: &Band, length: f64) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (r, recording) in recordings.iter().enumerate() {
        let kept = band.kept(recording.len());
        let per_second = recording.rate / band.decimation as f64;
        // Blocks of equal length, as near to the wanted one as the recording allows.
        let count = ((kept.len() as f64 / per_second / length).round() as usize).max(1);
        for b in 0..count {
            let rows: Vec<_> = joints
                .iter()
                .map(|joint| {
                    let kept = joint.band.kept(recording.len()).len();
                    let (from, to) = (kept * b / count, kept * (b + 1) / count);
                    let base = joint.rows[r].start;
                    let below = |limit: usize| joint.kept[r].partition_point(|k| *k < limit);
                    base + below(from)..base + below(to)
                })
                .collect();
            if rows.iter().any(|r| !r.is_empty()) {
                blocks.push(Block { recording: r, log: recording.log, rows });
            }
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_by_joint_a_long_recording_has_the_same_regressor() {
        let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = \"pi/2\"\nd = 0.1\ntheta = 0\n";
        let head = "name = \"three\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n";
        let body =
            RigidArm::new(&dyngen::Arm::parse(&format!("{head}{}", joint.repeat(3)), "three.toml").unwrap())
                .unwrap();
        let count = 2 * AT_ONCE + 77;
        let wave = |by: f64| (0..3 * count).map(|k| (by * k as f64).sin()).collect::<Vec<f64>>();
        let recording = Recording {
            log: 0,
            start: 0.0,
            clock: 0.0,
            rate: 200.0,
            q: wave(0.01),
            v: wave(0.02),
            a: wave(0.03),
            torque: Vec::new(),
            temperature: None,
            smoothing: 20.0,
            dof: 3,
        };
        let (whole, p) = (regressor_of(&body, &recording, &[0, 1, 2], 1), body.names().len());
        for joints in [&[0, 1][..], &[2]] {
            let own = regressor_of(&body, &recording, joints, 2);
            let expected: Vec<f64> = whole
                .chunks_exact(3 * p)
                .flat_map(|sample| joints.iter().flat_map(|j| sample[j * p..(j + 1) * p].to_vec()))
                .collect();
            assert!(own == expected, "{joints:?}");
        }
    }
}
