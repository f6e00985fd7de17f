//! Friction of the motors: the columns of each, functions of its velocity alone, and the torques of the
//! joints.

use crate::angles::{constant_angles, residue};
use crate::language::{Called, Exact, Expr, Kind, Routine, Stop, Value, World, by_rows, free};
use crate::point::Point;
use crate::{Difference, Source};
use dyngen_arm::Arm;
use dyngen_arm::exact::prime::{Draws, Fp};
use dyngen_arm::exact::rational::{Rational, parse_rational, to_f64};

/// Of the points.
const SEED: u64 = 0x6672_6963_7469_6f6e;

/// A term of a motor: the function of its velocity, none where that is the column itself, and the number that
/// the velocity is multiplied by before.
type Term = (Option<&'static str>, Rational);

/// Proves friction where the file has it; gives where it differs.
pub(crate) fn check(
    source: &Source,
    arm: &Arm,
    seed: u64,
    called: &Called,
    proven: &mut Vec<String>,
) -> Option<Difference> {
    let names = ["friction_columns", "friction"];
    let [columns, friction] = match names.map(|name| source.routines.get(name)) {
        [Some(columns), Some(friction)] => [columns, friction],
        [None, None] => {
            let there = ["FRICTION_TERMS", "MOTOR_VELOCITIES"].map(|name| (name, source.constants.get(name)));
            let (name, found) = there.into_iter().find(|(_, found)| found.is_some())?;
            return differs(name, found?.0, None, "stands without functions of friction");
        }
        [one, other] => {
            let line = one.or(other).map_or(1, |routine| routine.line);
            return differs("friction", line, None, "stands without the other function of friction");
        }
    };
    let motors = motors(arm);
    if let Some((line, rows)) = source.constants.get("MOTOR_VELOCITIES") {
        let entries = rows.iter().flat_map(|row| row.trim_matches(['[', ']']).split(','));
        let said = entries.map(|x| parse_rational(x.trim_end_matches("f64")).ok());
        if !said.eq(motors.iter().flatten().cloned().map(Some)) {
            return differs("MOTOR_VELOCITIES", *line, None, "is not what the arm says");
        }
    }
    let Some(terms) = terms(source, columns, arm.dof()) else {
        return differs("friction_columns", columns.line, None, "has terms that dyngen does not write");
    };
    let said = source.constants.get("FRICTION_TERMS");
    if let Some((line, _)) = said.filter(|(_, said)| *said != [terms.len().to_string()]) {
        return differs("FRICTION_TERMS", *line, None, "is another number of terms");
    }
    let mut draws = Draws::new(SEED ^ seed);
    for _ in 0..2 {
        let point = Point::draw(arm, &constant_angles(arm), &mut draws);
        let world = World { routines: &source.routines, point: &point, called };
        let n = point.dof();
        let mut vector = || (0..n).map(|_| draws.element()).collect::<Vec<Fp>>();
        let dq = vector();
        let coefficients: Vec<Vec<Fp>> = terms.iter().map(|_| vector()).collect();
        let list = |columns: &[Vec<Fp>]| {
            Value::list(columns.iter().map(|column| Value::numbers(column.iter().copied())).collect())
        };
        let dq_alone = list(std::slice::from_ref(&dq));
        let column = |term: &Vec<Term>| -> Vec<Fp> {
            let of = |((function, factor), row): (&Term, &Vec<Rational>)| {
                let velocity = row.iter().zip(&dq).fold(Fp::ZERO, |sum, (m, v)| sum + residue(m) * *v);
                function.map_or(velocity, |function| free(function, residue(factor) * velocity))
            };
            term.iter().zip(&motors).map(of).collect()
        };
        let right: Vec<Vec<Fp>> = terms.iter().map(column).collect();
        let rows = (0..n).flat_map(|i| right.iter().map(move |column| column[i])).collect::<Vec<Fp>>();
        let found = world.call(columns.line, names[0], vec![dq_alone.clone()], 0);
        if let Some(wrong) = compared(names[0], columns, found, &rows, (n, terms.len())) {
            return Some(wrong);
        }
        // Of each motor the sum of its columns times their coefficients; of each joint that of its motors.
        let spent =
            |i: usize| right.iter().zip(&coefficients).fold(Fp::ZERO, |sum, (x, c)| sum + x[i] * c[i]);
        let torque = |j: usize| (0..n).fold(Fp::ZERO, |sum, i| sum + residue(&motors[i][j]) * spent(i));
        let torques: Vec<Fp> = (0..n).map(torque).collect();
        let found = world.call(friction.line, names[1], vec![dq_alone, list(&coefficients)], 0);
        if let Some(wrong) = compared(names[1], friction, found, &torques, (n, 1)) {
            return Some(wrong);
        }
    }
    proven.extend(names.map(str::to_string));
    None
}

fn differs(function: &str, line: usize, entry: Option<(usize, usize)>, message: &str) -> Option<Difference> {
    Some(Difference { function: function.to_string(), entry, line, message: message.to_string() })
}

fn compared(
    name: &str,
    routine: &Routine,
    found: Result<Value, Stop>,
    right: &[Fp],
    (rows, columns): (usize, usize),
) -> Option<Difference> {
    let found = match found {
        Ok(value) => by_rows(&value, rows, columns),
        Err(Stop { line, message }) => return differs(name, line, None, &message),
    };
    let Some(found) = found else {
        return differs(name, routine.line, None, "has a result of another shape");
    };
    let wrong = (0..right.len()).find(|k| found[*k] != right[*k])?;
    let message = "is not what the terms and the arm's transmissions say";
    differs(name, routine.line, Some((wrong / columns, wrong % columns)), message)
}

/// How the motors turn with the coordinates, as the digits of the nearest numbers say it.
fn motors(arm: &Arm) -> Vec<Vec<Rational>> {
    let (matrix, drives) = (arm.motor_velocity_matrix(), arm.drives());
    let row = |motor: usize| {
        let mut row = vec![Rational::ZERO; arm.dof()];
        for (factor, drive) in matrix[motor].iter().zip(&drives) {
            row[drive.coordinate] += factor * &drive.ratio;
        }
        row.iter().map(|x| parse_rational(&to_f64(x).to_string()).unwrap_or_default()).collect()
    };
    arm.coordinates().into_iter().map(row).collect()
}

/// Each term for each motor: as the comments list them, in C, whose comments stand in the header, as the code
/// has them. A term is the same function for every motor.
fn terms(source: &Source, columns: &Routine, motors: usize) -> Option<Vec<Vec<Term>>> {
    if !source.terms.is_empty() {
        return source.terms.iter().map(|term| said(term, motors)).collect();
    }
    let Kind::Block(_, result) = &columns.body.kind else { return None };
    let Kind::List(columns) = &result.kind else { return None };
    let of_column = |column: &Expr| {
        let Kind::List(entries) = &column.kind else { return None };
        let terms = entries.iter().map(|e| in_code(&e.kind)).collect::<Option<Vec<Term>>>()?;
        let same = terms.iter().all(|term| Some(term.0) == terms.first().map(|first| first.0));
        (terms.len() == motors && same).then_some(terms)
    };
    columns.iter().map(of_column).collect()
}

/// `viscous`, `coulomb`, or `tanh:` and its shapes: one, or one for each motor.
fn said(term: &str, motors: usize) -> Option<Vec<Term>> {
    let one = |function| Some(vec![(function, Rational::ONE); motors]);
    match term.split_once(':') {
        None if term == "viscous" => one(None),
        None if term == "coulomb" => one(Some("sign")),
        Some(("tanh", shapes)) => {
            let shapes: Vec<Rational> =
                shapes.split(':').map(|shape| parse_rational(shape).ok()).collect::<Option<_>>()?;
            let of = |i: usize| Some((Some("tanh"), shapes.get(i).or(shapes.first())?.clone()));
            (0..motors).map(of).collect()
        }
        _ => None,
    }
}

/// v alone, sign v, or tanh of a multiple of v.
fn in_code(kind: &Kind) -> Option<Term> {
    match kind {
        Kind::Name(_) => Some((None, Rational::ONE)),
        Kind::Free("sign", _) => Some((Some("sign"), Rational::ONE)),
        Kind::Free(name, of) => {
            let Kind::Binary('*', _, factor) = &of.kind else { return None };
            let Kind::Number(Exact::Number(factor, turns)) = &factor.kind else { return None };
            (*turns == Rational::ZERO && *factor > Rational::ZERO).then(|| (Some(*name), factor.clone()))
        }
        _ => None,
    }
}
