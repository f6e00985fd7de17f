//! What is told of a log's columns: the `conventions` of identified.json and explained.json.

use crate::controller::JointNumber;
use serde::Serialize;

/// Of a joint's torque more than this share is much.
const MUCH: f64 = 0.5;

/// What the torque and position columns of some logs are. Nothing was changed by it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Conventions {
    /// The torque columns.
    pub torque: TorqueColumns,
    /// The position columns.
    pub positions: PositionColumns,
    /// Why, in words.
    pub evidence: String,
    /// The column map that would set the columns right, TOML for `--map`; `None` where they are as they
    /// should be, or where it is not known how to.
    #[serde(rename = "mend")]
    pub suggested_map: Option<String>,
    /// The line of the arm file that would set it right; `None` where nothing speaks clearly against the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_file: Option<String>,
    /// Held-out error by joint with all that was found set right, a share of the torque; not a number where a joint
    /// does not move. Not part of the JSON: see each answer.
    #[serde(skip)]
    pub left: Vec<f64>,
    /// What was asked, one after another.
    pub answers: Vec<Answer>,
}

/// What torque columns are. `None` is: these logs do not tell.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TorqueColumns {
    /// 1 where torques are positive in the direction of q, −1 where they are reversed; by joint where the
    /// joints differ.
    pub sign: Option<PerJoint<i8>>,
    /// The unit.
    pub unit: Option<String>,
    /// The side of the gear on which they are measured: with the friction of motor and gear, or without.
    pub side: Option<Side>,
    /// Whether they hold what gravity asks for.
    pub gravity: Option<GravityIs>,
    /// Whether they are measured or commanded.
    pub kind: Option<Kind>,
    /// How late they are, s.
    pub delay: Option<PerJoint<f64>>,
    /// By joint: the column that holds its torque, where that is not its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<Vec<JointNumber>>,
    /// By joint: the factor that its column needs beside the others, where they differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factor: Option<Vec<f64>>,
}

/// What position columns are. `None` is: these logs do not tell.
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
    /// The same for all.
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
    /// At the motor: friction is in it.
    Motor,
}

/// Whether torques hold what gravity asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum GravityIs {
    /// They do.
    #[serde(rename = "included")]
    Included,
    /// It was taken out of them.
    #[serde(rename = "taken out")]
    TakenOut,
}

/// How torques came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// By a sensor or a current.
    Measured,
    /// A controller's output.
    Commanded,
}

/// One answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// What was asked.
    pub question: &'static str,
    /// Whether the columns are as they should be; `None` where these logs do not tell.
    pub as_said: Option<bool>,
    /// Held-out error by joint as the columns are said to be, % of the torque; empty where that is not the
    /// evidence.
    pub as_it_is: Vec<Option<f64>>,
    /// The same as they are taken to be here.
    pub as_it_would_be: Vec<Option<f64>>,
    /// The answer with its evidence.
    pub sentence: String,
}

impl Conventions {
    /// Whether some column is surely not what it is said to be.
    #[must_use]
    pub fn differ(&self) -> bool {
        self.answers.iter().any(|answer| answer.as_said == Some(false))
    }

    /// What is said of gravity where it may have been taken out of the torques: a balanced arm looks the same.
    fn doubt(&self) -> Option<&str> {
        let open = |a: &&Answer| a.question == "gravity" && a.as_said.is_none();
        let answer =
            self.answers.iter().find(open).filter(|_| self.torque.gravity == Some(GravityIs::TakenOut));
        answer.map(|a| a.sentence.as_str())
    }

    /// Whether the verdict says more than that nothing speaks against the columns.
    #[must_use]
    pub fn is_remarkable(&self) -> bool {
        self.differ() || self.is_unclear() || self.doubt().is_some()
    }

    /// Whether so much is left with everything set right that the columns cannot be checked.
    #[must_use]
    pub fn is_unclear(&self) -> bool {
        self.left.iter().any(|left| *left > MUCH)
    }

    /// The joints of which more than half of the torque is left with all that was found set right, with that share.
    fn much_left(&self) -> Option<String> {
        let much = |(j, left): (usize, &f64)| {
            (*left > MUCH).then(|| format!("{:.0} % of joint {}", 100.0 * left, JointNumber::from_index(j)))
        };
        let list: Vec<String> = self.left.iter().enumerate().filter_map(much).collect();
        (!list.is_empty()).then(|| format!("one rigid arm with textbook friction leaves {}", list.join(", ")))
    }

    /// The line that comes first: what is wrong with the columns or the arm file, or that they are as they should be.
    #[must_use]
    pub fn verdict(&self) -> String {
        let wrong: Vec<&str> =
            (self.answers.iter()).filter(|a| a.as_said == Some(false)).map(|a| a.sentence.as_str()).collect();
        let left = self.much_left();
        if !wrong.is_empty() {
            let suggested_map = self.suggested_map.as_ref().map_or(String::new(), |suggested_map| {
                format!(" A column map (--map) that sets this right:\n{suggested_map}")
            });
            let what = match (&self.arm_file, self.suggested_map.is_some()) {
                (Some(_), false) => "The arm file is not this arm's.",
                (Some(_), true) => "Neither the arm file nor the columns are right.",
                (None, _) => "The columns are not what they are said to be.",
            };
            let left = left.map_or(String::new(), |left| format!(" Even so {left}."));
            return format!("{what} {}{left} Nothing was changed.{suggested_map}", wrong.join(" "));
        }
        let open: Vec<&str> =
            self.answers.iter().filter(|a| a.as_said.is_none()).map(|a| a.question).collect();
        let result = match left {
            Some(left) => format!(
                "What the columns are cannot be checked: {left}. Columns and arm file are taken as they stand"
            ),
            None => "The columns are taken as they are said to be; nothing in these logs speaks clearly against it"
                .to_string(),
        };
        if let Some(doubt) = self.doubt() {
            return format!("{result}. {doubt}");
        }
        match open.is_empty() {
            true => format!("{result}."),
            false => format!("{result}. Not told by these logs: {}.", open.join(", ")),
        }
    }
}
