//! Whether the arm file belongs to this arm: the other convention, a sign of its table, a zero a quarter turn
//! off, gravity from another side.
//!
//! Each answer is an arm with one thing changed, judged like a reading of the columns: one rigid arm and
//! textbook friction, fitted to one part of the logs and judged by the other. Its columns are numeric
//! Newton–Euler: to derive every such arm would take half a minute. The arm that is reported is derived then,
//! and its columns are evaluated like those of any other arm.
//!
//! [`Change`] is one property of a log's columns that may differ from the declared one.

use super::asked::{Asked, Positions, Torques};
use super::fit::{Gravity, Judged, Rows, judge};
use super::search::{Found, POOR, falls, not_worse, shares};
use dyngen::Arm;
use dyngen::arm::{Convention, JointKind};
use dyngen::exact::angle::Angle;
use dyngen::exact::rational::{self, integer, to_f64};
use powerball_controller::JointNumber;
use powerball_logs::parallel;
use powerball_logs::regression::{Recording, newton_euler};

/// If no joint's held-out error is more than this share of its torque, the arm file belongs to this arm.
const NOTICED: f64 = 0.02;
/// If there are more changes than this, those that fit best on few rows are tested on more.
const LISTED: usize = 20;
/// A change is clear where squared errors fall to this share, as the geometric mean over joints, both ways
/// round. The files of eight measured arms have none that is; of the UR10e's the best comes to 0.95
/// (docs/conventions.md).
const CLEAR: f64 = 0.8;
/// Changes whose squared errors differ by less, as the mean over joints, are not distinguished.
const ALIKE: f64 = 1.1;
/// Gravity nearer to the filed direction than this is a tilt of the base: its cosine.
const TILT: f64 = 0.9;

/// One possible error of an arm file.
#[derive(Clone, Debug)]
pub(super) struct ArmChange {
    /// The arm with this change.
    pub(super) arm: Arm,
    /// The changed line, and its place.
    pub(super) line: String,
    /// The present value of this line.
    pub(super) now: String,
}

/// An arm file that fits clearly better, and those that fit as well.
#[derive(Debug)]
pub(super) struct Better {
    pub(super) change: ArmChange,
    pub(super) alike: Vec<ArmChange>,
    pub(super) before: Vec<f64>,
    pub(super) after: Vec<f64>,
}

/// The change of the arm file under which the logs fit best, if it is clear, and clearer than the findings
/// about the columns.
pub(super) fn better(asked: &Asked<'_>, found: &Found<'_>) -> Option<Better> {
    let arm = asked.body.arm();
    let worst = shares(&found.judged).into_iter().filter(|share| share.is_finite()).fold(0.0, f64::max);
    // Numeric columns are those of joints, and a part of the torques without weight carries no information
    // about gravity.
    if worst < NOTICED
        || asked.body.motors().is_some()
        // The numeric regressor knows no bars that turn on their own.
        || arm.linkages().next().is_some()
        || found.read.gravity == Gravity::TakenOut && found.steps.len() > 1
    {
        return None;
    }
    let plain = Reading::plain(arm.dof());
    let judged = |rows: &Rows<'_>, arm: &Arm| {
        let rows = rows.of_columns(arm.kept_parameters().len(), |r| columns(arm, r));
        judge(&rows, &plain.torques, found.ridge)
    };
    let mut changes = changes(arm, worst > POOR);
    if changes.len() > LISTED {
        let few = asked.few(&plain.positions, plain.gravity).ok()?;
        let old = judged(&few, arm);
        let fall = |change: &ArmChange| falls(&old, &judged(&few, &change.arm)).iter().sum::<f64>();
        let mut listed: Vec<(f64, ArmChange)> =
            parallel::map(&changes, fall).into_iter().zip(changes.iter().cloned()).collect();
        listed.sort_by(|a, b| a.0.total_cmp(&b.0));
        changes = listed.into_iter().take(LISTED).map(|(_, change)| change).collect();
    }
    let rows = asked.slow(&plain.positions, plain.gravity).ok()?;
    let old = judged(&rows, arm);
    let all: Vec<Judged> = parallel::map(&changes, |change| judged(&rows, &change.arm));
    let mut clear: Vec<(f64, ArmChange, Judged)> = changes
        .into_iter()
        .zip(all)
        .filter_map(|(change, new)| {
            let fall = falls(&old, &new);
            (fall.iter().all(|f| *f < CLEAR.ln()) && not_worse(&old, &new))
                .then(|| (0.5 * fall.iter().sum::<f64>(), change, new))
        })
        .collect();
    clear.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut clear = clear.into_iter();
    let (best, change, new) = clear.next()?;
    // Columns that were found to be wrong explain the logs as well.
    if !found.steps.is_empty() && 0.5 * falls(&old, &found.judged).iter().sum::<f64>() < best + ALIKE.ln() {
        return None;
    }
    let alike =
        clear.take_while(|(fall, ..)| *fall < best + ALIKE.ln()).map(|(_, change, _)| change).collect();
    Some(Better { change, alike, before: shares(&old), after: shares(&new) })
}

/// The columns of an arm's kept parameters along a recording: samples × n × kept.
fn columns(arm: &Arm, recording: &Recording) -> Vec<f64> {
    let (n, gravity) = (arm.dof(), arm.gravity.each_ref().map(to_f64));
    let kept: Vec<usize> = arm.kept_parameters().iter().map(|p| p.index()).collect();
    let mut out = Vec::with_capacity(recording.q.len() * kept.len());
    let states =
        recording.q.chunks_exact(n).zip(recording.v.chunks_exact(n)).zip(recording.a.chunks_exact(n));
    for ((q, v), a) in states {
        let all = newton_euler::regressor(arm, q, v, a, gravity);
        all.chunks_exact(arm.all_parameters().len()).for_each(|row| out.extend(kept.iter().map(|k| row[*k])));
    }
    out
}

/// Everything that is checked in an arm file: where the fit is not poor, zeros are not a quarter turn off,
/// and gravity comes from the declared side.
fn changes(arm: &Arm, poor: bool) -> Vec<ArmChange> {
    let mut all = vec![other_convention(arm)];
    for column in [Table::A, Table::D, Table::Alpha] {
        let there: Vec<usize> = (0..arm.joints.len()).filter(|j| column.has_sign(arm, *j)).collect();
        all.extend(there.iter().map(|j| column.reversed(arm, &[*j])));
        if there.len() > 1 {
            all.push(column.reversed(arm, &there));
        }
    }
    if !poor {
        return all;
    }
    for joint in (0..arm.joints.len()).filter(|j| arm.joints[*j].kind == JointKind::Revolute) {
        all.extend([1, 2, 3].map(|quarters| turned_zero(arm, joint, quarters)));
    }
    all.extend(gravities(arm));
    all
}

fn other_convention(arm: &Arm) -> ArmChange {
    let (other, word, now) = match arm.convention {
        Convention::Standard => (Convention::Modified, "modified", "standard"),
        Convention::Modified => (Convention::Standard, "standard", "modified"),
    };
    ArmChange {
        arm: Arm { convention: other, ..arm.clone() },
        line: format!("convention = \"{word}\""),
        now: format!("\"{now}\""),
    }
}

/// A column of the DH table.
#[derive(Clone, Copy)]
enum Table {
    A,
    D,
    Alpha,
}

impl Table {
    /// Whether its sign at a joint makes another arm.
    fn has_sign(self, arm: &Arm, joint: usize) -> bool {
        let joint = &arm.joints[joint];
        match self {
            Table::A => to_f64(&joint.a) != 0.0,
            // What is added to the position of a sliding joint is its encoder's zero.
            Table::D => to_f64(&joint.d) != 0.0 && joint.kind == JointKind::Revolute,
            Table::Alpha => joint.alpha.sin_cos().0 != 0.0,
        }
    }

    /// The arm with its sign changed at some joints.
    fn reversed(self, arm: &Arm, joints: &[usize]) -> ArmChange {
        let minus = integer(-1);
        let mut other = arm.clone();
        for j in joints {
            let joint = &mut other.joints[*j];
            match self {
                Table::A => joint.a = &joint.a * &minus,
                Table::D => joint.d = &joint.d * &minus,
                Table::Alpha => joint.alpha = Angle::sum(&[(joint.alpha.clone(), minus.clone())]),
            }
        }
        let value = |arm: &Arm, joint: usize| match self {
            Table::A => format!("{}", to_f64(&arm.joints[joint].a)),
            Table::D => format!("{}", to_f64(&arm.joints[joint].d)),
            Table::Alpha => angle(&arm.joints[joint].alpha),
        };
        let name = match self {
            Table::A => "a",
            Table::D => "d",
            Table::Alpha => "alpha",
        };
        let (line, now) = match joints {
            [joint] => (
                format!("{name} = {} of joint {}", value(&other, *joint), JointNumber::from_index(*joint)),
                value(arm, *joint),
            ),
            _ => (format!("{name} of every joint with the other sign"), "as it stands".to_string()),
        };
        ArmChange { arm: other, line, now }
    }
}

/// An angle in the form of arm files.
fn angle(angle: &Angle) -> String {
    match angle {
        Angle::PiMultiple(multiple) if *multiple == integer(0) => "\"0\"".to_string(),
        Angle::PiMultiple(multiple) if *multiple == integer(1) => "\"pi\"".to_string(),
        Angle::PiMultiple(multiple) => format!("\"{multiple}*pi\""),
        Angle::Radians(radians) => format!("{}", to_f64(radians)),
    }
}

/// The arm with a joint's zero some quarter turns further.
fn turned_zero(arm: &Arm, joint: usize, quarters: i64) -> ArmChange {
    let mut other = arm.clone();
    let theta = &mut other.joints[joint].theta;
    let turn = Angle::PiMultiple(integer(quarters) / integer(2));
    *theta = Angle::sum(&[(theta.clone(), integer(1)), (turn, integer(1))]);
    if let Angle::PiMultiple(multiple) = theta
        && *multiple > integer(1)
    {
        *multiple -= integer(2);
    }
    ArmChange {
        line: format!(
            "theta = {} of joint {}",
            angle(&other.joints[joint].theta),
            JointNumber::from_index(joint)
        ),
        now: angle(&arm.joints[joint].theta),
        arm: other,
    }
}

/// The arm under gravity from the sides, edges and corners of a cube.
fn gravities(arm: &Arm) -> Vec<ArmChange> {
    let filed = arm.gravity.each_ref().map(to_f64);
    let size = filed.iter().map(|x| x * x).sum::<f64>().sqrt();
    if size == 0.0 {
        return Vec::new();
    }
    let text = |g: [f64; 3]| {
        let list: Vec<String> =
            g.iter().map(|x| format!("{}", (1000.0 * x).round() / 1000.0 + 0.0)).collect();
        format!("[{}]", list.join(", "))
    };
    let mut all = Vec::new();
    for k in (0..27).filter(|k| *k != 13) {
        let direction = [k / 9, k / 3 % 3, k % 3].map(|x| f64::from(x) - 1.0);
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        let g = direction.map(|x| size * x / length);
        let cosine = g.iter().zip(filed).map(|(a, b)| a * b).sum::<f64>() / size / size;
        if cosine > TILT {
            continue;
        }
        let exact = g.map(|x| rational::from_f64((1e6 * x).round() / 1e6).unwrap_or_default());
        all.push(ArmChange {
            arm: Arm { gravity: exact, ..arm.clone() },
            line: format!("gravity = {}", text(g)),
            now: text(filed),
        });
    }
    all
}

// One property of a log's columns that may differ from what is declared.

/// A change of the reading.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    /// The torque columns of some joints have the other sign.
    TorqueReversed(Vec<usize>),
    /// The torque columns of two joints were exchanged.
    TorquesExchanged(usize, usize),
    /// Each torque column is to be multiplied by a factor of its own.
    Factors(Vec<f64>),
    /// All torque columns are late, s.
    Late(f64),
    /// The torques do not contain gravity, which would act on these joints.
    GravityOut(Vec<usize>),
    /// The position column of a joint has the other sign.
    PositionReversed(usize),
    /// Position and torque of a joint have the other sign: its axis points the other way.
    AxisReversed(usize),
    /// The position columns of two joints were exchanged.
    PositionsExchanged(usize, usize),
    /// All columns of two joints were exchanged.
    JointsExchanged(usize, usize),
    /// Positions are in degrees.
    Degrees,
    /// Joints are counted from the tip.
    FromTip,
}

/// A reading of all columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) torques: Torques,
    pub(super) positions: Positions,
    pub(super) gravity: Gravity,
}

impl Reading {
    /// The columns as declared.
    pub(super) fn plain(dof: usize) -> Reading {
        Reading { torques: Torques::plain(dof), positions: Positions::plain(dof), gravity: Gravity::Included }
    }

    /// This reading with one change.
    pub(super) fn with(&self, change: &Change) -> Reading {
        let mut read = self.clone();
        match change {
            Change::TorqueReversed(joints) => {
                joints.iter().for_each(|j| read.torques = read.torques.reversed(*j));
            }
            Change::TorquesExchanged(a, b) => read.torques = read.torques.exchanged(*a, *b),
            Change::Factors(factors) => {
                read.torques.gain.iter_mut().zip(factors).for_each(|(gain, factor)| *gain *= factor);
            }
            Change::Late(by) => read.torques = read.torques.later(*by),
            Change::GravityOut(_) => read.gravity = Gravity::TakenOut,
            Change::PositionReversed(j) => read.positions = read.positions.reversed(*j),
            Change::AxisReversed(j) => {
                read.torques = read.torques.reversed(*j);
                read.positions = read.positions.reversed(*j);
            }
            Change::PositionsExchanged(a, b) => read.positions = read.positions.exchanged(*a, *b),
            Change::JointsExchanged(a, b) => {
                read.torques = read.torques.exchanged(*a, *b);
                read.positions = read.positions.exchanged(*a, *b);
            }
            Change::Degrees => read.positions.scale *= 1f64.to_radians(),
            Change::FromTip => {
                let n = read.positions.column.len();
                for k in 0..n / 2 {
                    read.torques = read.torques.exchanged(k, n - 1 - k);
                    read.positions = read.positions.exchanged(k, n - 1 - k);
                }
            }
        }
        read
    }
}

impl Change {
    /// The joint whose torque or position alone it reverses.
    pub(super) fn reverses(&self) -> Option<usize> {
        match self {
            Change::TorqueReversed(joints) if joints.len() == 1 => Some(joints[0]),
            Change::PositionReversed(j) => Some(*j),
            _ => None,
        }
    }

    /// The joints whose held-out error must fall; `None` where it must on a third of all.
    pub(super) fn concerned(&self) -> Option<Vec<usize>> {
        match self {
            Change::TorqueReversed(joints) | Change::GravityOut(joints) => Some(joints.clone()),
            Change::PositionReversed(j) | Change::AxisReversed(j) => Some(vec![*j]),
            Change::TorquesExchanged(a, b)
            | Change::PositionsExchanged(a, b)
            | Change::JointsExchanged(a, b) => Some(vec![*a, *b]),
            Change::Factors(_) | Change::Late(_) | Change::Degrees | Change::FromTip => None,
        }
    }
}

/// A factor nearer to one than this is no other unit.
pub(super) const FACTOR: f64 = 1.4;
