//! The column map that would set columns right.

use super::change::Reading;
use super::sign::Common;
use super::unit::Unit;

/// What one column needs.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    from: usize,
    reversed: bool,
    scale: f64,
    unit: Option<&'static str>,
    /// s, added to the column's time stamps.
    shift: f64,
}

impl Column {
    fn is_plain(&self, joint: usize) -> bool {
        self.from == joint && self.only_moved()
    }

    fn only_moved(&self) -> bool {
        !self.reversed && self.scale == 1.0 && self.unit.is_none() && self.shift == 0.0
    }

    /// `{ column = "tau2", sign = -1 }`.
    fn text(&self, name: &str) -> String {
        let mut parts = vec![format!("column = \"{name}\"")];
        if self.reversed {
            parts.push("sign = -1".into());
        }
        if self.scale != 1.0 {
            parts.push(format!("scale = {}", short(self.scale)));
        }
        parts.extend(self.unit.map(|unit| format!("unit = \"{unit}\"")));
        if self.shift != 0.0 {
            parts.push(format!("shift = {}", short(self.shift)));
        }
        format!("{{ {} }}", parts.join(", "))
    }
}

/// Four digits are more than is known.
fn short(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// TOML for `--map`; `None` where nothing is to be changed, or where it is not known by how much.
pub(super) fn mend(read: &Reading, sign: Common, unit: &Unit) -> Option<String> {
    let n = read.torques.column.len();
    let scales: Vec<f64> = match unit {
        Unit::NewtonMetre | Unit::Milli | Unit::NotTold => vec![1.0; n],
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
    let mut lines = block("tau", &(0..n).map(torque).collect::<Vec<Column>>());
    lines.extend(block("q", &(0..n).map(position).collect::<Vec<Column>>()));
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// One line for all columns where they are alike, else one for each that is to be changed.
fn block(name: &str, columns: &[Column]) -> Vec<String> {
    let alike =
        columns.iter().enumerate().all(|(joint, c)| Column { from: joint, ..columns[0].clone() } == *c);
    match columns.first().filter(|c| alike && !c.only_moved()) {
        Some(column) => vec![format!("{name} = {}", column.text(&format!("{name}*")))],
        None => {
            let line = |(joint, c): (usize, &Column)| {
                format!("{name}{} = {}", joint + 1, c.text(&format!("{name}{}", c.from + 1)))
            };
            columns.iter().enumerate().filter(|(joint, c)| !c.is_plain(*joint)).map(line).collect()
        }
    }
}
