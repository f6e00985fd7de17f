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

/// Four digits are more than is known.
fn short(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// TOML for `--map`; `None` where nothing is to be changed, or where it is not known by how much.
pub(super) fn suggested_map(read: &Reading, sign: Common, unit: &Unit) -> Option<String> {
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
