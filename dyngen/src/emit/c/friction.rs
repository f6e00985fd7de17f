//! Friction of the motors in C.

use super::{Item, Names, number};
use crate::arm::Arm;
use crate::emit::friction::{FRICTION_DOC, FrictionTerm, columns_doc, motor_velocities};

/// What the columns call: the sign of Coulomb's term, the hyperbolic tangent of the file's numbers.
pub(super) fn helpers(terms: &[FrictionTerm]) -> String {
    let mut text = String::new();
    if terms.contains(&FrictionTerm::Coulomb) {
        text += "/* -1, 0 or 1. */
static real sign(real x)
{
    return (x > (real)0.0) ? (real)1.0 : ((x < (real)0.0) ? (real)-1.0 : (real)0.0);
}
";
    }
    if terms.iter().any(|term| matches!(term, FrictionTerm::Tanh(_))) {
        text += "/* Of <math.h>. */
static real tangent(real x)
{
#ifdef NAME_FLOAT
    return tanhf(x);
#else
    return tanh(x);
#endif
}
";
    }
    text
}

/// The items for some terms; none where there are no terms.
pub(super) fn items(names: &Names, terms: &[FrictionTerm], arm: &Arm) -> Vec<Item> {
    if terms.is_empty() {
        return Vec::new();
    }
    let Names { upper, .. } = names;
    let count = Item::Declared(format!(
        "/** Number of friction terms of a joint. */\n#define {upper}_FRICTION_TERMS {}\n",
        terms.len()
    ));
    let coupled = (!arm.transmissions.is_empty()).then(|| motor_velocities(arm));
    let coupled = coupled.as_deref();
    let mut items = vec![count];
    items.extend(coupled.map(|motors| matrix(names, motors)));
    items.push(columns(names, terms, arm.dof(), coupled));
    items.push(friction(names, terms.len(), arm.dof(), coupled));
    items
}

/// The constant that says how coupled motors turn.
fn matrix(names: &Names, motors: &[Vec<f64>]) -> Item {
    let Names { prefix, upper } = names;
    let row = |row: &Vec<f64>| {
        let row: Vec<String> = row.iter().map(|x| format!("{x:?}")).collect();
        format!("{{ {} }}", row.join(", "))
    };
    Item::Constants {
        doc: format!(
            "Motor i turns at the sum over joints j of `{prefix}_motor_velocities[i][j]` times their \
            velocities, on the\n\
             joint's side of its gear."
        ),
        declared: format!("const double {prefix}_motor_velocities[{upper}_JOINTS][{upper}_JOINTS]"),
        values: motors.iter().map(row).collect(),
    }
}

/// Σ factor·name.
fn sum(terms: impl Iterator<Item = (f64, String)>) -> String {
    let terms = terms.filter(|(factor, _)| *factor != 0.0);
    let term = |(factor, name): (f64, String)| match factor {
        1.0 => name,
        _ => format!("({name} * {})", number(factor)),
    };
    terms.map(term).collect::<Vec<_>>().join(" + ")
}

/// The function of every motor's columns.
fn columns(names: &Names, terms: &[FrictionTerm], n: usize, coupled: Option<&[Vec<f64>]>) -> Item {
    let Names { prefix, upper } = names;
    let joint = |j: usize| format!("dq{}", j + 1);
    let mut body: Vec<String> = (0..n).map(|j| format!("const real {} = dq[{j}];", joint(j))).collect();
    for (i, row) in coupled.unwrap_or_default().iter().enumerate() {
        let velocity = sum(row.iter().enumerate().map(|(j, factor)| (*factor, joint(j))));
        body.push(format!("const real motor{} = {velocity};", i + 1));
    }
    for i in 0..n {
        let v = if coupled.is_some() { format!("motor{}", i + 1) } else { joint(i) };
        for (k, term) in terms.iter().enumerate() {
            let value = match term {
                FrictionTerm::Viscous => v.clone(),
                FrictionTerm::Coulomb => format!("sign({v})"),
                FrictionTerm::Tanh(shapes) => {
                    let shape = shapes.get(i).or(shapes.first()).copied().unwrap_or_default();
                    format!("tangent({v} * {})", number(shape))
                }
            };
            body.push(format!("result[{i}][{k}] = {value};"));
        }
    }
    let doc = names.words(&columns_doc(terms, coupled.is_some()));
    let doc = doc.replacen("\n\nReturns n × terms: ", "\n* `result`, row by row, n × terms: ", 1);
    let prototype = format!(
        "void {prefix}_friction_columns(\n    const {prefix}_real dq[{upper}_JOINTS],\n    \
         {prefix}_real result[{upper}_JOINTS][{upper}_FRICTION_TERMS])"
    );
    Item::Function { doc, prototype, body }
}

/// The function of the joints' friction torques, N·m; with coupled motors Mᵀ times theirs.
fn friction(names: &Names, terms: usize, n: usize, coupled: Option<&[Vec<f64>]>) -> Item {
    let Names { prefix, upper } = names;
    let torque = |i: usize| format!("f{}", i + 1);
    let mut body = vec![
        format!("{prefix}_real columns[{upper}_JOINTS][{upper}_FRICTION_TERMS];"),
        format!("{prefix}_friction_columns(dq, columns);"),
    ];
    for i in 0..n {
        let of: String =
            (0..terms).map(|k| format!(" + (columns[{i}][{k}] * coefficients[{i}][{k}])")).collect();
        body.push(format!("const real {} = (real)0.0{of};", torque(i)));
    }
    for j in 0..n {
        let spent = coupled
            .map_or(torque(j), |motors| sum(motors.iter().enumerate().map(|(i, row)| (row[j], torque(i)))));
        body.push(format!("result[{j}] = {spent};"));
    }
    let doc = names.words(FRICTION_DOC).replacen("\n\nReturns the", "\n* `result`: the", 1);
    let prototype = format!(
        "void {prefix}_friction(\n    const {prefix}_real dq[{upper}_JOINTS],\n    \
         const {prefix}_real coefficients[{upper}_JOINTS][{upper}_FRICTION_TERMS],\n    \
         {prefix}_real result[{upper}_JOINTS])"
    );
    Item::Function { doc, prototype, body }
}
