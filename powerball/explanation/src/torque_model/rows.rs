//! The residual of a model along a recording, and the columns of possible changes, which a watch tests.
//!
//! Rows are those of a band of [`BAND`]: wide enough that a change shows at once, and narrow enough that
//! neighbouring rows are nearly independent. A joint has no rows while it rests: friction is not determined
//! there.

use super::TorqueModel;
use dyngen::arm::ParameterKind;
use powerball_controller::friction::TanhFriction;
use powerball_logs::regression::{Recording, RigidArm};
use powerball_logs::signal::{Band, difference, motion};

/// The band of the rows, Hz.
pub const BAND: f64 = 20.0;
/// Rows begin and end this long inside a stretch, s: what its filters do not know of the time beyond has died
/// out by then.
const ENDS: f64 = 0.16;
/// A slower joint rests, rad/s or m/s: its residual there shows stiction.
const REST: f64 = motion::REST_SPEED;
/// Step of a joint's zero for its column, rad.
const MOVED: f64 = 1e-3;

/// Columns of a body in the hand (mass and first moments), of a force at the tool, and of a delay; those of
/// the joints' zeros follow.
pub(super) const PAYLOAD: usize = 4;
pub(super) const FORCE: usize = 3;
pub(super) const DELAY: usize = 1;

/// The residual and the columns of one joint at one row.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Measured less predicted torque, N·m.
    pub residual: f64,
    /// The model's friction, N·m.
    pub friction: f64,
    /// Torque by kg, kg·m (three), N (three), s of delay, and rad of each joint's zero.
    pub columns: Vec<f64>,
}

/// The rows of a stretch of time on an even grid.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// The rows' times in the log's own t, s.
    pub t: Vec<f64>,
    /// By joint and row; none while the joint rests.
    pub joints: Vec<Vec<Option<Shown>>>,
}

impl Rows {
    /// The rows of a recording for which a model of the arm `body` predicts a torque, n a sample.
    #[must_use]
    pub fn new(model: &TorqueModel, body: &RigidArm, recording: &Recording, predicted: &[f64]) -> Rows {
        let n = recording.dof;
        let band = Band::with_ends(BAND, recording.rate, ENDS);
        let kept = band.kept(recording.len());
        let laws: Vec<TanhFriction<f64>> = model.gammas().into_iter().map(TanhFriction::new).collect();
        let changes = columns(model, body, recording, predicted);
        let of_joint = |j: usize| {
            let measured = recording.smooth_torque(j);
            let left: Vec<f64> = measured.iter().zip(own(predicted, j, n)).map(|(m, p)| m - p).collect();
            let friction: Vec<f64> = recording.velocity(j).map(|v| laws[j].torque(v)).collect();
            let [left, friction] = [left, friction].map(|signal| band.pass(&signal));
            let columns: Vec<Vec<f64>> =
                changes.iter().map(|c| band.pass(&own(c, j, n).collect::<Vec<_>>())).collect();
            let speed: Vec<f64> = recording.velocity(j).collect();
            let row = |(row, k): (usize, &usize)| {
                (speed[*k].abs() > REST).then(|| Shown {
                    residual: left[row],
                    friction: friction[row],
                    columns: columns.iter().map(|column| column[row]).collect(),
                })
            };
            kept.iter().enumerate().map(row).collect()
        };
        let t = kept.iter().map(|k| recording.start + *k as f64 / recording.rate).collect();
        Rows { t, joints: (0..n).map(of_joint).collect() }
    }

    /// The residuals and the columns of all joints at one row.
    pub fn row(&self, k: usize) -> impl Iterator<Item = Option<&Shown>> {
        self.joints.iter().map(move |joint| joint.get(k)?.as_ref())
    }
}

/// Rows a second of logs with `rate` samples a second.
#[must_use]
pub fn rows_a_second(rate: f64) -> f64 {
    rate / Band::new(BAND, rate).decimation as f64
}

/// One joint's part of what is n a sample.
fn own(all: &[f64], j: usize, n: usize) -> impl Iterator<Item = f64> {
    all.iter().skip(j).step_by(n).copied()
}

/// The torque by each change, n a sample.
fn columns(model: &TorqueModel, body: &RigidArm, recording: &Recording, predicted: &[f64]) -> Vec<Vec<f64>> {
    let (n, Recording { q, v, a, .. }) = (recording.dof, recording);
    let zero = || vec![0.0; q.len()];
    let mass = (n - 1) * ParameterKind::ALL.len() + ParameterKind::M as usize;
    let held: [usize; PAYLOAD] = std::array::from_fn(|k| mass + k);
    let payload = body.parameter_columns(&held, q, v, a);
    let payload =
        (0..PAYLOAD).map(|k| payload.as_ref().map_or_else(zero, |all| own(all, k, PAYLOAD).collect()));
    // The static torque of a unit mass under unit gravity is that of a unit force.
    let force = (0..FORCE).map(|axis| body.gravity_columns(axis, &[mass], q).unwrap_or_else(zero));
    let rate: Vec<Vec<f64>> = (0..n)
        .map(|j| difference::derivative(&own(predicted, j, n).collect::<Vec<_>>(), 1.0 / recording.rate))
        .collect();
    let delay = (0..q.len()).map(|k| -rate[k % n][k / n]).collect();
    let rigid = body.torque(q, v, a, &model.inertial());
    let zeros = (0..n).map(|j| {
        let mut true_places = q.clone();
        true_places.iter_mut().skip(j).step_by(n).for_each(|q| *q -= MOVED);
        let moved = body.torque(&true_places, v, a, &model.inertial());
        moved.iter().zip(&rigid).map(|(moved, rigid)| (moved - rigid) / MOVED).collect()
    });
    payload.chain(force).chain(std::iter::once(delay)).chain(zeros).collect()
}
