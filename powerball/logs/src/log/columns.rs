//! A log's quantities found by the names of its columns.

use super::headers::{self, Headers};
use super::map::{ByJoint, ColumnMap};
use super::read::{Effort, Raw};
use super::{Finding, LogError};
use dyngen::Arm;
use dyngen::arm::JointKind;
use std::collections::HashMap;

/// Whose log it is, and what is known of it beforehand.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub arm: &'a Arm,
    pub map: &'a ColumnMap,
    pub file: &'a str,
    /// The line of the header, where the file has one.
    pub header: Option<usize>,
    /// Whether it is read for position servos: set-points take the place of torques.
    pub goals: bool,
}

impl Asked<'_> {
    /// What stands in the place of torques.
    pub(super) fn efforts(&self) -> &'static [&'static str] {
        if self.goals { &["goal"] } else { &["tau", "i"] }
    }
}

/// The column that says by how much the torques of a log are later than its positions, s: one value in all
/// lines. Who records knows it, where drives hold a torque for a cycle and report it at its end.
pub const TORQUE_LATE: &str = "tau_late";
/// What LeRobot calls an arm's positions.
const LEROBOT: &str = "observation.state";
/// The quantities with the names that columns have for them: those of this project's own logs, of ROS and of
/// LeRobot.
const NAMES: [(&str, &[&str]); 10] = [
    ("q", &["q", "position", LEROBOT]),
    ("dq", &["dq", "velocity", "observation.velocity"]),
    ("tau", &["tau", "effort", "observation.effort"]),
    ("i", &["i", "current", "observation.current"]),
    ("temp", &["temp", "temperature"]),
    ("motor", &["motor"]),
    ("goal", &["goal", "action"]),
    ("volts", &["volts", "voltage"]),
    ("load", &["load"]),
    ("torque_enable", &["torque_enable"]),
];
/// What the logs of position servos may hold in addition.
pub(super) const OF_SERVOS: [&str; 3] = ["volts", "load", "torque_enable"];
/// The names in recordings of Universal Robots' RTDE, which count joints from 0; the torques by current are
/// those that controllers from 5.23 on give.
const RTDE: [(&str, &str); 5] = [
    ("q", "actual_q_"),
    ("dq", "actual_qd_"),
    ("tau", "actual_current_as_torque_"),
    ("i", "actual_current_"),
    ("temp", "joint_temperatures_"),
];
/// Names of the time; the first is that of this project's own logs. Lines with a header have that one alone.
pub(super) const TIMES: [&str; 3] = ["t", "time", "timestamp"];

/// What LeRobot does not state about positions.
const UNIT_OF_LEROBOT: &str = "LeRobot does not say in which unit observation.state is: rad, degrees from \
    the middle of a servo's range, or a share of that range from -100 to 100. Say it with --map 'q.unit = \
    \"deg\"' (or \"rad\"); a share of the range is no angle before it is multiplied by the range ('q.scale = \
    […]')";
const TORQUE_OF_LEROBOT: &str = ". LeRobot records torques or currents only where the robot was made to give \
    them: name their column with --map 'tau.column = \"…\"' or 'i.column = \"…\"'; `action` is a set-point, \
    and without torques `identify` and `explain` take the joints for position servos";

/// The columns of one quantity by joint, and what each is to be multiplied with.
pub(super) struct Group {
    pub at: Vec<usize>,
    factor: Vec<f64>,
}

impl Group {
    fn values<'a>(
        &'a self,
        number: &'a impl Fn(usize) -> Option<f64>,
    ) -> impl Iterator<Item = Option<f64>> + 'a {
        self.at.iter().zip(&self.factor).map(move |(k, factor)| Some(number(*k)? * factor))
    }
}

impl Group {
    /// The group's columns, moved out of those of a table; the last use of one takes it.
    fn take(&self, values: &mut [Vec<f64>], uses: &mut [usize]) -> Vec<Vec<f64>> {
        let one = |(at, factor): (&usize, &f64)| {
            uses[*at] -= 1;
            let mut own = if uses[*at] == 0 { std::mem::take(&mut values[*at]) } else { values[*at].clone() };
            own.iter_mut().for_each(|v| *v = if v.is_finite() { *v * factor } else { f64::NAN });
            own
        };
        self.at.iter().zip(&self.factor).map(one).collect()
    }
}

/// The names of the arm's joints as its logs have them, in chain order.
fn joint_names(asked: Asked<'_>) -> Vec<String> {
    if !asked.map.joints.is_empty() {
        return asked.map.joints.clone();
    }
    // Names of some joints only do not say which columns the others have.
    asked.arm.joints.iter().map(|joint| joint.name.clone()).collect::<Option<_>>().unwrap_or_default()
}

/// Names of joints that columns carry: `a` of `q.a` or `position.a`.
fn logged_joints(names: &[String], map: &ColumnMap) -> Vec<String> {
    let mut stems: Vec<&str> = stems("q");
    if let Some(ByJoint::All(stem)) = &map.q.column {
        stems = vec![stem];
    }
    let joint = |name: &String| {
        stems.iter().find_map(|s| name.strip_prefix(s)?.strip_prefix('.').map(str::to_string))
    };
    names.iter().filter_map(joint).collect()
}

fn stems(key: &str) -> Vec<&'static str> {
    NAMES.iter().filter(|(own, _)| *own == key).flat_map(|(_, stems)| stems.iter().copied()).collect()
}

/// The name that RTDE has for a quantity of a joint, from 0.
fn rtde(key: &str, joint: usize) -> Option<String> {
    RTDE.iter().find(|(own, _)| *own == key).map(|(_, stem)| format!("{stem}{joint}"))
}

/// Whether columns are those of a recording by RTDE.
fn by_rtde(names: &[String]) -> bool {
    rtde("q", 0).is_some_and(|first| names.contains(&first))
}

/// Whether a column is one of LeRobot's positions.
fn by_lerobot(name: &str) -> bool {
    name.starts_with(LEROBOT)
}

/// What a column is taken to be by its name, and the joint that the name says.
pub(super) fn meaning(name: &str, map: &ColumnMap) -> Option<(&'static str, Option<String>)> {
    let own = map.t.column.as_ref().and_then(|by| by.of(0)).map(String::as_str);
    if own.map_or(TIMES.contains(&name), |own| own == name) {
        return Some(("t", None));
    }
    for (key, _) in NAMES {
        let stems = match &map.of(key).column {
            Some(ByJoint::Each(columns)) => match columns.iter().position(|own| own == name) {
                Some(j) => return Some((key, Some((j + 1).to_string()))),
                None => continue,
            },
            Some(ByJoint::All(stem)) => vec![stem.as_str()],
            None => stems(key),
        };
        for rest in stems.iter().filter_map(|stem| name.strip_prefix(stem)) {
            let number = !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit());
            let joint = rest.strip_prefix('.').or(number.then_some(rest));
            if let Some(joint) = joint {
                return Some((key, Some(joint.to_string())));
            }
        }
    }
    let unmapped = RTDE.iter().filter(|(key, _)| map.of(key).column.is_none());
    let number = |stem: &str| name.strip_prefix(stem)?.parse::<usize>().ok();
    unmapped.into_iter().find_map(|(key, stem)| Some((*key, Some((number(stem)? + 1).to_string()))))
}

/// The columns of a quantity; an error is the names of those that are missing.
pub(super) fn group(names: &[String], key: &str, asked: Asked<'_>) -> Result<Group, Vec<String>> {
    let (n, mapped) = (asked.arm.dof(), asked.map.of(key));
    let joints = joint_names(asked);
    let named = !logged_joints(names, asked.map).is_empty();
    let stems = match &mapped.column {
        Some(ByJoint::All(stem)) => vec![stem.as_str()],
        _ => stems(key),
    };
    let at = |name: &str| names.iter().position(|own| own == name);
    let column = |j: usize| -> Result<usize, String> {
        if let Some(ByJoint::Each(columns)) = &mapped.column {
            let name = columns.get(j).cloned().unwrap_or_default();
            return at(&name).ok_or(name);
        }
        let one = |stem: &&str| {
            let by_name = match joints.get(j) {
                Some(joint) => at(&format!("{stem}.{joint}")),
                // Names that are numbers say which joint they mean.
                None => at(&format!("{stem}.joint{}", j + 1)).or_else(|| at(&format!("{stem}.{}", j + 1))),
            };
            let alone = if n == 1 { at(stem) } else { None };
            at(&format!("{stem}{}", j + 1)).or(by_name).or(alone)
        };
        let missing = || match joints.get(j).filter(|_| named) {
            Some(joint) => {
                let used = |stem: &&&str| names.iter().any(|name| name.starts_with(&format!("{stem}.")));
                format!("{}.{joint}", stems.iter().find(used).unwrap_or(&stems[0]))
            }
            None => format!("{}{}", stems[0], j + 1),
        };
        let by_rtde = || at(&rtde(key, j).filter(|_| mapped.column.is_none())?);
        stems.iter().find_map(one).or_else(by_rtde).ok_or_else(missing)
    };
    let found: Vec<Result<usize, String>> = (0..n).map(column).collect();
    let missing: Vec<String> = found.iter().filter_map(|c| c.clone().err()).collect();
    if !missing.is_empty() {
        return Err(missing);
    }
    let scaled = if key == "goal" && mapped.is_plain() { &asked.map.q } else { mapped };
    let factor =
        slides(asked.arm).iter().enumerate().map(|(j, slides)| scaled.factor(key, j, *slides)).collect();
    Ok(Group { at: found.into_iter().flatten().collect(), factor })
}

/// The columns of a log's torques, currents or goals; else the quantity that is missing and what to do.
fn effort(names: &[String], asked: Asked<'_>) -> Result<(Effort, Group), (&'static str, String)> {
    let n = asked.arm.dof();
    let goals = group(names, "goal", asked);
    if asked.goals {
        return match goals {
            Ok(goal) => Ok((Effort::Goal, goal)),
            Err(missing) => Err(("goal", missing_goals(&missing, n))),
        };
    }
    let torques = match group(names, "tau", asked) {
        Ok(torque) => return Ok((Effort::Torque, torque)),
        Err(missing) => missing,
    };
    let currents = match group(names, "i", asked) {
        Ok(current) => {
            let constants = constants(asked.arm).map_err(|reason| ("i", reason))?;
            return Ok((Effort::Current(constants), current));
        }
        Err(missing) => missing,
    };
    let missing = if torques.len() <= currents.len() { torques } else { currents };
    let hint = if names.iter().any(|name| by_lerobot(name)) { TORQUE_OF_LEROBOT } else { "" };
    let message = format!(
        "a log needs tau1 … tau{n} [N·m] or i1 … i{n} [A] for each of the {n} joints; missing: {}{hint}{}",
        missing.join(", "),
        if goals.is_ok() { GOALS_ALONE } else { "" }
    );
    Err(("tau", message))
}

/// Where a log's quantities stand among its columns.
pub(super) struct Columns {
    t: Group,
    q: Group,
    torque: Group,
    pub(super) effort: Effort,
    pub(super) temperature: Option<Group>,
    /// dq, used for checks alone.
    dq: Option<Group>,
    pub(super) motor: Option<Group>,
    /// Columns of [`OF_SERVOS`], where they are read.
    pub(super) of_servos: Vec<Option<Group>>,
}

impl Columns {
    /// Finds them by their names; columns that are not needed are named in `findings`.
    pub(super) fn find(
        names: &[String],
        asked: Asked<'_>,
        findings: &mut Vec<Finding>,
    ) -> Result<Columns, LogError> {
        let n = asked.arm.dof();
        let finding = |quantity: &str, message: String| Finding {
            file: asked.file.to_string(),
            line: asked.header,
            quantity: quantity.to_string(),
            message,
        };
        let headers = if asked.header.is_some() { headers::of(names, asked) } else { Headers::Plain };
        if let Headers::Clear(map, text) = &headers {
            findings.push(finding("columns", format!("read as {text}")));
            return Columns::find(names, Asked { map, ..asked }, findings);
        }
        let mut errors = misfits(asked).into_iter().map(|(key, m)| finding(&key, m)).collect::<Vec<_>>();
        let mut seen: HashMap<&str, usize> = HashMap::new();
        for (index, name) in names.iter().enumerate() {
            if seen.insert(name, index).is_some() {
                errors.push(finding(name, "the header names this column twice: remove one".into()));
            }
        }
        let t = time(names, asked);
        if t.is_none() {
            let message =
                "the header has no column t (time in s); if it has another name: --map 't.column = \"NAME\"'";
            errors.push(finding("t", message.into()));
        }
        let q = group(names, "q", asked);
        if let Some(more) = one_too_many(names, asked) {
            errors.push(finding(&more, one_too_many_message(&more, n)));
        }
        match &q {
            Ok(q) if asked.map.q.unit.is_none() && q.at.iter().any(|k| by_lerobot(&names[*k])) => {
                errors.push(finding("q", UNIT_OF_LEROBOT.into()));
            }
            Ok(_) => {}
            Err(missing) => errors.push(finding("q", missing_positions(names, missing, asked))),
        }
        let effort = match effort(names, asked) {
            Ok(effort) => Some(effort),
            // Where the joints' names are not the arm's, that was reported.
            Err(("tau", _)) if q.is_err() && !logged_joints(names, asked.map).is_empty() => None,
            Err((quantity, message)) => {
                errors.push(finding(quantity, message));
                None
            }
        };
        if let (Headers::Unclear(text), false) = (headers, errors.is_empty()) {
            errors.push(finding(
                "columns",
                format!("by their names they may be {text}: take of these what is right"),
            ));
        }
        let (Some(t), Ok(q), Some((effort, torque)), []) = (t, q, effort, errors.as_slice()) else {
            return Err(LogError(errors));
        };
        let optional = |key: &str| group(names, key, asked).ok();
        let columns = Columns {
            t,
            q,
            torque,
            effort,
            temperature: optional("temp"),
            dq: optional("dq"),
            motor: optional("motor").filter(|_| !asked.goals),
            of_servos: OF_SERVOS.map(|key| optional(key).filter(|_| asked.goals)).into(),
        };
        let unused = columns.unused(names);
        findings.extend(unused.into_iter().map(|(quantity, message)| finding(quantity, message)));
        Ok(columns)
    }

    /// Columns that are no part of the arm's fit, each as a quantity and a message.
    fn unused(&self, names: &[String]) -> Vec<(&'static str, String)> {
        let shown = |at: &[usize]| at.iter().map(|k| names[*k].as_str()).collect::<Vec<_>>().join(", ");
        let mut unused = Vec::new();
        if let Some(motor) = &self.motor {
            let message = format!(
                "kept in addition to the torques, for the transmission of each joint, and no part of the \
                 arm's fit: {}",
                shown(&motor.at)
            );
            unused.push(("motor", message));
        }
        let used: Vec<usize> = self.groups().flat_map(|group| group.at.iter().copied()).collect();
        let is_out = |k: &usize| !used.contains(k) && names[*k] != TORQUE_LATE;
        let out: Vec<usize> = (0..names.len()).filter(is_out).collect();
        if !out.is_empty() {
            unused.push(("columns", format!("kept out: {}", shown(&out))));
        }
        unused
    }

    fn groups(&self) -> impl Iterator<Item = &Group> {
        let optional =
            [&self.temperature, &self.dq, &self.motor].into_iter().chain(&self.of_servos).flatten();
        [&self.t, &self.q, &self.torque].into_iter().chain(optional)
    }

    /// t, q, effort, temperature, motor, those of servos, dq in a row; one of the last four that is no number
    /// does not spoil the sample.
    pub(super) fn sample(&self, number: &impl Fn(usize) -> Option<f64>) -> Option<Vec<f64>> {
        let mut values = Vec::new();
        for group in [&self.t, &self.q, &self.torque] {
            for value in group.values(number) {
                values.push(value?);
            }
        }
        let optional = [&self.temperature, &self.motor].into_iter().chain(&self.of_servos).chain([&self.dq]);
        for group in optional.flatten() {
            values.extend(group.values(number).map(|value| value.unwrap_or(f64::NAN)));
        }
        Some(values)
    }

    /// How often each column of a table is used; those that are not are dropped.
    pub(super) fn uses(&self, values: &mut [Vec<f64>]) -> Vec<usize> {
        let mut uses = vec![0; values.len()];
        self.groups().flat_map(|group| &group.at).for_each(|at| uses[*at] += 1);
        values.iter_mut().zip(&uses).filter(|(_, uses)| **uses == 0).for_each(|(own, _)| *own = Vec::new());
        uses
    }

    /// Moves the columns of a table into samples.
    pub(super) fn take(&self, values: &mut [Vec<f64>], uses: &mut [usize], raw: &mut Raw) {
        raw.t = self.t.take(values, uses).pop().unwrap_or_default();
        raw.q = self.q.take(values, uses);
        raw.effort = self.torque.take(values, uses);
        let mut optional = |group: &Option<Group>| group.as_ref().map(|group| group.take(values, uses));
        (raw.temperature, raw.motor) = (optional(&self.temperature), optional(&self.motor));
        raw.of_servos = self.of_servos.iter().map(&mut optional).collect();
        raw.dq = optional(&self.dq).unwrap_or_else(|| vec![Vec::new(); raw.q.len()]);
    }

    /// Whether a sample has a number for all that it needs.
    pub(super) fn are_whole(&self, number: &impl Fn(usize) -> Option<f64>) -> bool {
        [&self.t, &self.q, &self.torque].into_iter().flat_map(|group| &group.at).all(|k| number(*k).is_some())
    }

    /// Whether a sample holds anything of this arm.
    pub(super) fn touches(&self, number: &impl Fn(usize) -> Option<f64>) -> bool {
        [&self.q, &self.torque].into_iter().flat_map(|group| &group.at).any(|k| number(*k).is_some())
    }

    /// The first needed column that holds no number.
    pub(super) fn culprit(&self, number: &impl Fn(usize) -> Option<f64>, names: &[String]) -> String {
        [&self.t, &self.q, &self.torque]
            .into_iter()
            .flat_map(|group| &group.at)
            .find(|k| number(**k).is_none())
            .and_then(|k| names.get(*k).cloned())
            .unwrap_or_else(|| "line".into())
    }
}

/// What to do with set-points where torques are needed.
const GOALS_ALONE: &str =
    "; set-points (goal1 …) are there: `identify` and `explain` take such joints for position servos";

fn missing_goals(missing: &[String], n: usize) -> String {
    format!(
        "the log of position servos needs their set-points goal1 … goal{n} [rad or m] for each of the {n} \
         joints (or torques, tau1 … tau{n}); missing: {}",
        missing.join(", ")
    )
}

fn one_too_many_message(more: &str, n: usize) -> String {
    let Some(stem) = more.strip_suffix('0') else {
        return format!(
            "the header has {more}, the arm has {n} joints: another arm's log; where it holds more than this \
             arm, say which columns are its: --map 'q.column = [\"q1\", …]'"
        );
    };
    let first: Vec<String> = (0..n).map(|j| format!("\"{stem}{j}\"")).collect();
    format!(
        "the header has {stem}0 to {stem}{n}, which are {} columns, the arm has {n} joints: another arm's \
         log, or say which columns are its: --map 'q.column = [{}]' where joints count from 0, --map \
         'q.column = \"{stem}\"' where they count from 1 (and tau.column, dq.column likewise)",
        n + 1,
        first.join(", ")
    )
}

/// The position column next to those of the arm's joints, where columns are numbered and no map says which
/// are meant: of a joint after the last one, or of a joint 0.
fn one_too_many(names: &[String], asked: Asked<'_>) -> Option<String> {
    let is_said = asked.map.q.column.is_some() || !asked.map.joints.is_empty();
    let next = |stem: &str| format!("{stem}{}", asked.arm.dof() + 1);
    let last = |stem: &str| format!("{stem}{}", asked.arm.dof());
    let has = |name: &String| names.contains(name);
    let numbered = stems("q").into_iter().find(|stem| has(&last(stem)) && has(&next(stem)));
    let zero = |stem: &&str| has(&format!("{stem}0")) && has(&format!("{stem}1")) && has(&last(stem));
    let from_zero = || stems("q").into_iter().find(zero).map(|stem| format!("{stem}0"));
    numbered.map(next).or_else(from_zero).filter(|_| !is_said)
}

fn time(names: &[String], asked: Asked<'_>) -> Option<Group> {
    let at = |name: &str| names.iter().position(|own| own == name);
    let others = by_rtde(names) || names.iter().any(|name| by_lerobot(name));
    let known = if asked.header.is_some() && !others { &TIMES[..1] } else { &TIMES[..] };
    let found = match asked.map.t.column.as_ref().and_then(|by| by.of(0)) {
        Some(name) => at(name),
        None => known.iter().find_map(|name| at(name)),
    };
    found.map(|at| Group { at: vec![at], factor: vec![asked.map.t.factor("t", 0, false)] })
}

/// N·m/A by joint.
pub(super) fn constants(arm: &Arm) -> Result<Vec<f64>, String> {
    let n = arm.dof();
    let lacks = |j: &usize| arm.joints[j - 1].torque_constant.is_none();
    let without: Vec<String> = (1..=n).filter(lacks).map(|j| j.to_string()).collect();
    if without.is_empty() {
        return Ok(arm.joints.iter().filter_map(|j| j.torque_constant).collect());
    }
    Err(format!(
        "the log holds currents, but the arm file gives no torque_constant (N·m/A at the joint) for joint \
            {}: add it \
            there, or log tau1 … tau{n}",
        without.join(", ")
    ))
}

/// Which joints slide, of those that move on their own.
fn slides(arm: &Arm) -> Vec<bool> {
    arm.moving_joints().map(|joint| joint.kind == JointKind::Prismatic).collect()
}

/// What of the map does not fit the arm's joints: lists of another length, units of the other kind.
fn misfits(asked: Asked<'_>) -> Vec<(String, String)> {
    let n = asked.arm.dof();
    let mut misfits = Vec::new();
    if !asked.map.joints.is_empty() && asked.map.joints.len() != n {
        let message = format!("the map names {} joints, the arm has {n}", asked.map.joints.len());
        misfits.push(("joints".to_string(), message));
    }
    for (key, mapped) in asked.map.quantities().into_iter().filter(|(key, _)| *key != "t") {
        if let Some(list) = mapped.misfit(n) {
            misfits.push((
                format!("{key}.{list}"),
                format!("the map's list must have one entry for each of {n} joints"),
            ));
        } else if let Some(message) = mapped.foreign_unit(key, &slides(asked.arm)) {
            misfits.push((format!("{key}.unit"), message));
        }
    }
    misfits
}

fn missing_positions(names: &[String], missing: &[String], asked: Asked<'_>) -> String {
    let (logged, own) = (logged_joints(names, asked.map), joint_names(asked));
    if logged.is_empty() {
        return format!("the arm has {} joints; missing: {}", asked.arm.dof(), missing.join(", "));
    }
    if own.is_empty() {
        return format!(
            "the log's joints are {}, and nothing says which of the arm's they are: give each [[joint]] of \
                the arm \
                file its name, or name them in chain order with --map 'joints = [\"…\", …]'",
            logged.join(", ")
        );
    }
    format!(
        "the log's joints are {}, the arm's are {}; missing: {}. Give the joints the names that the log has, \
            in the arm \
            file or with --map 'joints = [\"…\", …]' in chain order",
        logged.join(", "),
        own.join(", "),
        missing.join(", ")
    )
}
