//! Which columns of a file are which quantities, in which unit and with which sign.

use serde::Deserialize;
use std::path::Path;

/// How the columns of a log are to be read where their names do not say it, as a TOML file has it:
///
/// ```toml
/// joints = ["shoulder_pan_joint", "shoulder_lift_joint"]   # the log's names of the joints, in chain order
/// topic = "/joint_states"          # of several
/// clock = "receipt"                # when messages were received, not what their headers say ("header")
/// q.unit = "deg"
/// tau = { column = "effort", sign = [1, -1], scale = 0.001 }
/// motor = { column = ["m_a", "m_b"], topic = "/drives" }
/// ```
///
/// What it does not name is found as everywhere: `q1` or `q.shoulder_pan_joint`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ColumnMap {
    /// The names that the log has for the arm's joints, in the order of the arm file; empty where they are
    /// those of the arm file.
    pub joints: Vec<String>,
    /// The topic with all columns for which no other topic is given.
    pub topic: Option<String>,
    /// Which time counts.
    pub clock: Clock,
    /// Time.
    pub t: Mapped,
    /// Positions.
    pub q: Mapped,
    /// Velocities.
    pub dq: Mapped,
    /// Torques.
    pub tau: Mapped,
    /// Motor currents.
    pub i: Mapped,
    /// Temperatures.
    pub temp: Mapped,
    /// Torques on the motors' side.
    pub motor: Mapped,
    /// Set-points of position servos; unit, sign and scale are those of `q` where it gives none.
    pub goal: Mapped,
    /// Voltages of position servos.
    pub volts: Mapped,
    /// Loads as position servos report them.
    pub load: Mapped,
    /// Whether a position servo is switched on: 0 or 1.
    pub torque_enable: Mapped,
}

/// Which time of a message counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// What the header says where that is plausible, else when it was received.
    #[default]
    Auto,
    /// What the header says.
    Header,
    /// When it was received.
    Receipt,
}

/// How one quantity is stored.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mapped {
    /// One name: the columns are `name1` … or `name.joint` …. A list: the column of each joint in chain
    /// order.
    pub column: Option<ByJoint<String>>,
    /// The topic that has it.
    pub topic: Option<String>,
    /// The column's unit; where none is given, that of docs/logs.md.
    pub unit: Option<ByJoint<String>>,
    /// 1 or −1.
    pub sign: Option<ByJoint<f64>>,
    /// What the column is to be multiplied with, in addition to unit and sign.
    pub scale: Option<ByJoint<f64>>,
    /// What is to be added to the column's time stamps, s: of torques and currents that are late it is
    /// negative.
    pub shift: Option<ByJoint<f64>>,
}

/// A value for all joints, or one for each in the order of the arm file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum ByJoint<T> {
    /// One value for all joints.
    All(T),
    /// One a joint.
    Each(Vec<T>),
}

impl<T> ByJoint<T> {
    /// The value of a joint, from 0.
    pub fn of(&self, joint: usize) -> Option<&T> {
        match self {
            ByJoint::All(value) => Some(value),
            ByJoint::Each(values) => values.get(joint),
        }
    }

    fn fits(&self, joints: usize) -> bool {
        matches!(self, ByJoint::All(_)) || matches!(self, ByJoint::Each(values) if values.len() == joints)
    }
}

/// A unit's names and how much of the log's own unit it is.
type Unit = (&'static [&'static str], f64);

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const TURN: f64 = 2.0 * std::f64::consts::PI;
const TIMES: &[Unit] = &[(&["s"], 1.0), (&["ms"], 1e-3), (&["us", "µs"], 1e-6), (&["ns"], 1e-9)];
const POSITIONS: &[Unit] =
    &[(&["rad", "m"], 1.0), (&["deg", "°"], DEGREE), (&["turn", "rev"], TURN), (&["mrad", "mm"], 1e-3)];
const VELOCITIES: &[Unit] = &[
    (&["rad/s", "m/s"], 1.0),
    (&["deg/s", "°/s"], DEGREE),
    (&["turn/s", "rev/s"], TURN),
    (&["rpm", "turn/min"], TURN / 60.0),
    (&["mrad/s", "mm/s"], 1e-3),
];
const TORQUES: &[Unit] = &[
    (&["N·m", "Nm", "N*m", "N"], 1.0),
    (&["mN·m", "mNm"], 1e-3),
    (&["N·cm", "Ncm"], 1e-2),
    (&["kN·m", "kN"], 1e3),
];
const CURRENTS: &[Unit] = &[(&["A"], 1.0), (&["mA"], 1e-3)];
const TEMPERATURES: &[Unit] = &[(&["°C", "C", "degC"], 1.0)];
const VOLTAGES: &[Unit] = &[(&["V"], 1.0), (&["mV"], 1e-3), (&["dV", "0.1 V"], 0.1)];

impl ColumnMap {
    /// The topics that the map names, where it names the one with all other columns.
    pub(super) fn topics(&self) -> Option<Vec<String>> {
        let main = self.topic.clone()?;
        let others = self.quantities().into_iter().filter_map(|(_, own)| own.topic.clone());
        Some(std::iter::once(main).chain(others).collect())
    }

    /// Reads a map from TOML; `name` stands in messages where the file does.
    ///
    /// # Errors
    /// What is wrong with it and where.
    pub fn parse(text: &str, name: &str) -> Result<ColumnMap, String> {
        let map: ColumnMap =
            toml::from_str(text).map_err(|e| format!("{name}: {}", e.to_string().trim_end()))?;
        for (key, mapped) in map.quantities() {
            mapped.check(key).map_err(|reason| format!("{name}: {reason}"))?;
        }
        Ok(map)
    }

    /// The map of all that was given: files, and lines of one such as `tau.sign = -1`.
    ///
    /// # Errors
    /// As [`ColumnMap::parse`], and a file that cannot be read.
    pub fn said(said: &[String]) -> Result<ColumnMap, String> {
        // Lines first: in a file they might fall into a table that it opened.
        let (lines, files): (Vec<&String>, Vec<&String>) = said.iter().partition(|said| said.contains('='));
        let mut text = lines.iter().map(|line| format!("{line}\n")).collect::<String>();
        for file in &files {
            let read =
                dyngen::file::text(Path::new(file)).map_err(|e| format!("{file}: cannot be read: {e}"))?;
            text.push_str(&read);
        }
        let name = match (lines.as_slice(), files.as_slice()) {
            ([], [file]) => file.as_str(),
            _ => "--map",
        };
        ColumnMap::parse(&text, name)
    }

    /// Reads a map from a file.
    ///
    /// # Errors
    /// Where it cannot be read, and as [`ColumnMap::parse`].
    pub fn read(path: &Path) -> Result<ColumnMap, String> {
        let name = path.display().to_string();
        let text = dyngen::file::text(path).map_err(|e| format!("{name}: cannot be read: {e}"))?;
        ColumnMap::parse(&text, &name)
    }

    /// The quantities under their names.
    pub(super) fn quantities(&self) -> [(&'static str, &Mapped); 11] {
        [
            ("t", &self.t),
            ("q", &self.q),
            ("dq", &self.dq),
            ("tau", &self.tau),
            ("i", &self.i),
            ("temp", &self.temp),
            ("motor", &self.motor),
            ("goal", &self.goal),
            ("volts", &self.volts),
            ("load", &self.load),
            ("torque_enable", &self.torque_enable),
        ]
    }

    pub(super) fn of(&self, key: &str) -> &Mapped {
        self.quantities().into_iter().find(|(own, _)| *own == key).map_or(&self.t, |(_, mapped)| mapped)
    }

    pub(super) fn of_mut(&mut self, key: &str) -> &mut Mapped {
        match key {
            "q" => &mut self.q,
            "dq" => &mut self.dq,
            "tau" => &mut self.tau,
            "i" => &mut self.i,
            "temp" => &mut self.temp,
            "motor" => &mut self.motor,
            "goal" => &mut self.goal,
            "volts" => &mut self.volts,
            "load" => &mut self.load,
            "torque_enable" => &mut self.torque_enable,
            _ => &mut self.t,
        }
    }

    /// This map for columns that already have their plain names: units and signs alone.
    pub(super) fn without_columns(&self) -> ColumnMap {
        let mut map = self.clone();
        for (key, _) in self.quantities() {
            let mapped = map.of_mut(key);
            (mapped.column, mapped.topic) = (None, None);
        }
        map
    }
}

/// Units of velocities other than the log's own, with how much of that they are.
pub(super) fn velocity_units() -> impl Iterator<Item = (&'static str, f64)> {
    VELOCITIES.iter().filter(|(_, factor)| *factor != 1.0).map(|(names, factor)| (names[0], *factor))
}

/// The unit of time that the distance of samples implies.
pub(super) fn time_unit(step: f64) -> &'static str {
    match step {
        step if step < SLOWEST => "s",
        step if step < 1e3 * SLOWEST => "ms",
        step if step < 1e6 * SLOWEST => "us",
        _ => "ns",
    }
}

/// No log has samples further apart, s.
pub(super) const SLOWEST: f64 = 0.5;

fn units(key: &str) -> &'static [Unit] {
    match key {
        "t" => TIMES,
        "q" | "goal" => POSITIONS,
        "dq" => VELOCITIES,
        "tau" => TORQUES,
        "i" => CURRENTS,
        "temp" => TEMPERATURES,
        "volts" => VOLTAGES,
        // On the motors' side units are anybody's, and loads are shares of whatever the drive takes for the
        // most.
        _ => &[],
    }
}

impl Mapped {
    fn check(&self, key: &str) -> Result<(), String> {
        let list = |unit: &ByJoint<String>| match unit {
            ByJoint::All(unit) => vec![unit.clone()],
            ByJoint::Each(units) => units.clone(),
        };
        for unit in self.unit.iter().flat_map(list) {
            if factor(key, &unit).is_none() {
                let known: Vec<&str> =
                    units(key).iter().flat_map(|(names, _)| names.iter().copied()).collect();
                return Err(match known.is_empty() {
                    true => format!("{key}.unit: its unit is not needed: leave it out"),
                    false => format!("{key}.unit: `{unit}` is unknown; known are {}", known.join(", ")),
                });
            }
        }
        let signs = self.sign.iter().flat_map(|sign| match sign {
            ByJoint::All(sign) => vec![*sign],
            ByJoint::Each(signs) => signs.clone(),
        });
        for sign in signs {
            if sign.abs() != 1.0 {
                return Err(format!("{key}.sign: {sign} is neither 1 nor -1; other factors are its `scale`"));
            }
        }
        if self.shift.is_some() && !["tau", "i"].contains(&key) {
            return Err(format!(
                "{key}.shift: only `tau` and `i` can be shifted in time, against the positions"
            ));
        }
        Ok(())
    }

    /// The shift of a joint's column, s.
    pub(super) fn shift_of(&self, joint: usize) -> f64 {
        self.shift.as_ref().and_then(|by| by.of(joint)).copied().unwrap_or(0.0)
    }

    /// Whether it gives neither unit nor sign nor scale.
    pub(super) fn is_plain(&self) -> bool {
        self.unit.is_none() && self.sign.is_none() && self.scale.is_none()
    }

    /// What the column of a joint is to be multiplied with. A unit that is given once is that of the joints
    /// that it can belong to: of angles, or of lengths where the joint `slides`.
    pub(super) fn factor(&self, key: &str, joint: usize, slides: bool) -> f64 {
        let unit =
            self.unit.as_ref().and_then(|unit| unit.of(joint)).filter(|unit| belongs(key, unit, slides));
        let unit = unit.and_then(|unit| factor(key, unit)).unwrap_or(1.0);
        let of = |by: &Option<ByJoint<f64>>| by.as_ref().and_then(|by| by.of(joint)).copied().unwrap_or(1.0);
        unit * of(&self.sign) * of(&self.scale)
    }

    /// What is wrong with a unit of angles where a joint slides, or of lengths where one turns. A unit that
    /// is given once needs one joint of its kind. Units that change no number pass.
    pub(super) fn foreign_unit(&self, key: &str, slides: &[bool]) -> Option<String> {
        let is_foreign = |unit: &String, slides: bool| {
            factor(key, unit).is_some_and(|factor| factor != 1.0) && !belongs(key, unit, slides)
        };
        let units: Vec<&String> = (0..slides.len()).map_while(|j| self.unit.as_ref()?.of(j)).collect();
        let mut foreign =
            units.iter().zip(slides).enumerate().filter(|(_, (unit, slides))| is_foreign(unit, **slides));
        let (j, (unit, slides)) = foreign.next()?;
        let alone = matches!(self.unit, Some(ByJoint::All(_)));
        let does = if *slides { "slides" } else { "turns" };
        (!alone || foreign.count() + 1 == units.len())
            .then(|| format!("joint {} {does}: `{unit}` cannot be its unit", j + 1))
    }

    /// The name of a list that is not of as many joints as the arm has.
    pub(super) fn misfit(&self, joints: usize) -> Option<&'static str> {
        let fits = |by: Option<bool>| by.unwrap_or(true);
        [
            ("column", fits(self.column.as_ref().map(|by| by.fits(joints)))),
            ("unit", fits(self.unit.as_ref().map(|by| by.fits(joints)))),
            ("sign", fits(self.sign.as_ref().map(|by| by.fits(joints)))),
            ("scale", fits(self.scale.as_ref().map(|by| by.fits(joints)))),
            ("shift", fits(self.shift.as_ref().map(|by| by.fits(joints)))),
        ]
        .into_iter()
        .find(|(_, fits)| !fits)
        .map(|(name, _)| name)
    }
}

/// Whether a unit can be that of a joint: of positions and velocities it is one of lengths or of angles.
fn belongs(key: &str, unit: &str, slides: bool) -> bool {
    let lengths = ["m", "mm", "m/s", "mm/s"];
    !["q", "goal", "dq"].contains(&key) || lengths.contains(&unit) == slides
}

fn factor(key: &str, unit: &str) -> Option<f64> {
    units(key).iter().find(|(names, _)| names.contains(&unit)).map(|(_, factor)| *factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_signs_and_scales_multiply_and_mistakes_are_named() {
        let map = ColumnMap::parse("q.unit = \"deg\"\ntau = { sign = [1, -1], scale = 2 }", "x").unwrap();
        assert_eq!(map.q.factor("q", 1, false) * 180.0, std::f64::consts::PI);
        assert_eq!((map.tau.factor("tau", 0, false), map.tau.factor("tau", 1, true)), (2.0, -2.0));
        assert_eq!((map.tau.misfit(2), map.tau.misfit(3)), (None, Some("sign")));
        let wrong = |text: &str| ColumnMap::parse(text, "m.toml").unwrap_err();
        assert!(wrong("q.unit = \"inch\"").contains("m.toml: q.unit: `inch` is unknown; known are rad"));
        assert!(wrong("tau.sign = 3").contains("neither 1 nor -1"));
        assert!(wrong("\n\ntorque.sign = 1").contains("line 3"), "{}", wrong("\n\ntorque.sign = 1"));
    }
}
