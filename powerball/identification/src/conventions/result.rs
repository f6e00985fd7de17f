//! The report on a log's columns: the `conventions` of identified.json and explained.json.
//!
//! The module also makes the column map that would correct the columns.

use super::arm_file::Reading;
use super::properties::{Common, Unit};
use powerball_controller::JointNumber;
use serde::Serialize;

/// A share of a joint's torque above this counts as large.
const MUCH: f64 = 0.5;

/// The meaning of the torque and position columns of some logs. Nothing was modified.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Conventions {
    /// The torque columns.
    pub torque: TorqueColumns,
    /// The position columns.
    pub positions: PositionColumns,
    /// Why, in words.
    pub evidence: String,
    /// The column map that would correct the columns, TOML for `--map`; `None` if they are correct, or if the
    /// correction is unknown.
    #[serde(rename = "mend")]
    pub suggested_map: Option<String>,
    /// The line of the arm file that would set it right; `None` where nothing speaks clearly against the
    /// file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_file: Option<String>,
    /// Held-out error by joint with all that was found set right, a share of the torque; not a number where a
    /// joint does not move. Not part of the JSON: see each answer.
    #[serde(skip)]
    pub left: Vec<f64>,
    /// The answers to all questions, in order.
    pub answers: Vec<Answer>,
}

/// Properties of the torque columns. `None` means that these logs cannot determine it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TorqueColumns {
    /// 1 where torques are positive in the direction of q, −1 where they are reversed; by joint where the
    /// joints differ.
    pub sign: Option<PerJoint<i8>>,
    /// The unit.
    pub unit: Option<String>,
    /// The side of the gear on which they are measured: with the friction of motor and gear, or without.
    pub side: Option<Side>,
    /// Whether they contain gravity.
    pub gravity: Option<GravityIs>,
    /// Whether they are measured or commanded.
    pub kind: Option<Kind>,
    /// How late they are, s.
    pub delay: Option<PerJoint<f64>>,
    /// By joint: the column that holds its torque, where that is not its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<Vec<JointNumber>>,
    /// By joint: the factor that its column needs compared with the others, where they differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factor: Option<Vec<f64>>,
}

/// Properties of the position columns. `None` means that these logs cannot determine it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PositionColumns {
    /// By joint: 1, or −1 where the column counts against the arm file's axis.
    pub sign: Option<Vec<i8>>,
    /// The unit of angles.
    pub unit: Option<String>,
    /// By joint: the column that holds its position, where that is not its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<Vec<JointNumber>>,
}

/// One value for all joints, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PerJoint<T> {
    /// One value for all joints.
    All(T),
    /// By joint.
    Each(Vec<T>),
}

/// A side of the gear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Behind gear and bearings: hardly any friction is in it.
    Link,
    /// The torque is at the motor: friction is included.
    Motor,
}

/// Whether torques contain gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum GravityIs {
    /// Torques contain gravity.
    #[serde(rename = "included")]
    Included,
    /// Gravity was taken out of the torques.
    #[serde(rename = "taken out")]
    TakenOut,
}

/// How torques came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Measured by a sensor or a current.
    Measured,
    /// A controller's output.
    Commanded,
}

/// One answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// The question.
    pub question: &'static str,
    /// Whether the columns are as they should be; `None` where these logs do not tell.
    pub as_said: Option<bool>,
    /// Held-out error by joint with the columns as declared, % of the torque; empty where that is not the
    /// evidence.
    pub as_it_is: Vec<Option<f64>>,
    /// Held-out error by joint with the columns as they are taken to be here.
    pub as_it_would_be: Vec<Option<f64>>,
    /// The answer with its evidence.
    pub sentence: String,
}

impl Conventions {
    /// Whether some column certainly differs from its declaration.
    #[must_use]
    pub fn differ(&self) -> bool {
        self.answers.iter().any(|answer| answer.as_said == Some(false))
    }

    /// The note about gravity if it may have been taken out of the torques: a balanced arm looks the same.
    fn doubt(&self) -> Option<&str> {
        let open = |a: &&Answer| a.question == "gravity" && a.as_said.is_none();
        let answer =
            self.answers.iter().find(open).filter(|_| self.torque.gravity == Some(GravityIs::TakenOut));
        answer.map(|a| a.sentence.as_str())
    }

    /// Whether the verdict says more than that nothing contradicts the columns.
    #[must_use]
    pub fn is_remarkable(&self) -> bool {
        self.differ() || self.is_unclear() || self.doubt().is_some()
    }

    /// Whether too much is left with everything set right to check the columns.
    #[must_use]
    pub fn is_unclear(&self) -> bool {
        self.left.iter().any(|left| *left > MUCH)
    }

    /// The joints of which more than half of the torque is left with all that was found set right, with that
    /// share.
    fn joints_with_much_left(&self) -> Option<String> {
        let much = |(j, left): (usize, &f64)| {
            (*left > MUCH).then(|| format!("{:.0} % of joint {}", 100.0 * left, JointNumber::from_index(j)))
        };
        let list: Vec<String> = self.left.iter().enumerate().filter_map(much).collect();
        (!list.is_empty()).then(|| format!("one rigid arm with textbook friction leaves {}", list.join(", ")))
    }

    /// Certain errors of the columns or the arm file, a sentence each; empty if there are none.
    #[must_use]
    pub fn wrong(&self) -> String {
        let wrong = self.answers.iter().filter(|answer| answer.as_said == Some(false));
        wrong.map(|answer| answer.sentence.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The first line: the errors of the columns or the arm file, or that they are correct.
    #[must_use]
    pub fn verdict(&self) -> String {
        let wrong = self.wrong();
        let left = self.joints_with_much_left();
        if !wrong.is_empty() {
            let suggested_map = self.suggested_map.as_ref().map_or(String::new(), |suggested_map| {
                format!(" A column map (--map) that corrects this:\n{suggested_map}")
            });
            let what = match (&self.arm_file, self.suggested_map.is_some()) {
                (Some(_), false) => "The arm file does not belong to this arm.",
                (Some(_), true) => "Neither the arm file nor the columns are right.",
                (None, _) => "The columns are not what they are declared to be.",
            };
            let left = left.map_or(String::new(), |left| format!(" Even so {left}."));
            return format!("{what} {wrong}{left} Nothing was changed.{suggested_map}");
        }
        let open: Vec<&str> =
            self.answers.iter().filter(|a| a.as_said.is_none()).map(|a| a.question).collect();
        let result = match left {
            Some(left) => format!(
                "What the columns are cannot be checked: {left}. Columns and arm file are used unchanged"
            ),
            None => {
                "The columns are taken as declared; nothing in these logs clearly contradicts it".to_string()
            }
        };
        if let Some(doubt) = self.doubt() {
            return format!("{result}. {doubt}");
        }
        match open.is_empty() {
            true => format!("{result}."),
            false => format!("{result}. Not shown by these logs: {}.", open.join(", ")),
        }
    }
}

// The column map that would set columns right.

/// The correction of one column.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    from: usize,
    reversed: bool,
    scale: f64,
    unit: Option<&'static str>,
    /// s, added to the column's time stamps.
    shift: f64,
}

/// Four digits are more than is known.
fn short(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// The correcting map as TOML for `--map`; `None` if nothing must be changed, or if the amount is unknown.
pub(super) fn suggested_map(read: &Reading, sign: Common, unit: &Unit) -> Option<String> {
    let n = read.torques.column.len();
    let scales: Vec<f64> = match unit {
        Unit::NewtonMetre | Unit::Milli | Unit::Unknown => vec![1.0; n],
        Unit::BeforeGear(factors) | Unit::Ampere(Some(factors)) | Unit::OfItsOwn(factors) => factors.clone(),
        Unit::Ampere(None) | Unit::GearOrAmpere => return None,
    };
    let torque = |joint: usize| Column {
        from: read.torques.column[joint],
        reversed: (read.torques.gain[joint] < 0.0) != (sign == Common::Reversed),
        scale: scales[joint],
        unit: (*unit == Unit::Milli).then_some("mN·m"),
        shift: if read.torques.late[joint] == 0.0 { 0.0 } else { -read.torques.late[joint] },
    };
    let position = |joint: usize| Column {
        from: read.positions.column[joint],
        reversed: read.positions.sign[joint] < 0.0,
        scale: 1.0,
        unit: (read.positions.scale != 1.0).then_some("deg"),
        shift: 0.0,
    };
    let lines = [
        block("tau", &(0..n).map(torque).collect::<Vec<Column>>()),
        block("q", &(0..n).map(position).collect::<Vec<Column>>()),
    ];
    let lines: Vec<String> = lines.into_iter().flatten().collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// One line for a quantity: what is the same for all joints once, else one value a joint; nothing where all
/// columns are as they should be.
fn block(name: &str, columns: &[Column]) -> Option<String> {
    let mut parts = Vec::new();
    let mut add = |key: &str, plain: &str, of: &dyn Fn(&Column) -> String| {
        let values: Vec<String> = columns.iter().map(of).collect();
        match values.first() {
            Some(first) if values.iter().all(|v| v == first) => {
                parts.extend((first != plain).then(|| format!("{key} = {first}")));
            }
            _ => parts.push(format!("{key} = [{}]", values.join(", "))),
        }
    };
    if columns.iter().enumerate().any(|(joint, c)| c.from != joint) {
        add("column", "", &|c| format!("\"{name}{}\"", c.from + 1));
    }
    add("sign", "1", &|c| if c.reversed { "-1".into() } else { "1".into() });
    add("scale", "1", &|c| short(c.scale).to_string());
    let own = if name == "q" { "rad" } else { "N·m" };
    add("unit", &format!("\"{own}\""), &|c| format!("\"{}\"", c.unit.unwrap_or(own)));
    add("shift", "0", &|c| short(c.shift).to_string());
    (!parts.is_empty()).then(|| format!("{name} = {{ {} }}", parts.join(", ")))
}
