//! Motors that turn with several joints: motor positions = matrix · joint positions.

use super::MAX_JOINTS;
use super::table::{Reader, Table, Value, describe};
use crate::exact::rational::{self, Rational};
use num_traits::{One, Zero};
use toml::de::DeValue;

/// The most joints that all transmissions of an arm may have together.
pub const MAX_COUPLED: usize = 6;
const KEYS: [&str; 2] = ["joints", "matrix"];

/// A drive train that couples some joints: the motor of the block's k-th joint turns, on the joint's side of
/// its gear, by the sum over the block's joints of `matrix[k][j]`·q_j.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// The coupled joints, from 0, in the order of the matrix.
    pub joints: Vec<usize>,
    /// Motor positions = matrix · joint positions, by rows; regular.
    pub matrix: Vec<Vec<Rational>>,
}

/// Reads the blocks of an arm with `dof` joints.
pub(super) fn read(
    reader: &mut Reader<'_>,
    tables: &[Table<'_, '_>],
    dof: usize,
) -> Option<Vec<Transmission>> {
    let mut found: Vec<Transmission> = Vec::new();
    let mut sound = true;
    for t in tables {
        let Some(block) = block(reader, t, dof) else {
            sound = false;
            continue;
        };
        let taken = block.joints.iter().find(|j| found.iter().any(|other| other.joints.contains(*j)));
        if let Some(joint) = taken {
            let message = format!("{}: joint {} is already in another transmission", t.place, joint + 1);
            reader.errors.error(t.span.clone(), message);
            sound = false;
        }
        found.push(block);
    }
    if let Some(t) =
        tables.last().filter(|_| found.iter().map(|b| b.joints.len()).sum::<usize>() > MAX_COUPLED)
    {
        let message =
            format!("{}: all transmissions together may have at most {MAX_COUPLED} joints", t.place);
        reader.errors.error(t.span.clone(), message);
        sound = false;
    }
    sound.then_some(found)
}

fn block(reader: &mut Reader<'_>, t: &Table<'_, '_>, dof: usize) -> Option<Transmission> {
    reader.unknown_keys(t, &KEYS);
    let joints = reader.required(t, "joints").and_then(|v| joints(reader, v, &t.place, dof));
    let matrix = reader.required(t, "matrix").cloned();
    let (joints, matrix) = (joints?, matrix?);
    let rows = rows(reader, &matrix, &t.place, joints.len())?;
    if determinant(rows.clone()).is_zero() {
        let message = format!(
            "{}: the matrix is singular: a motion of the joints would turn no motor. Each row says how one \
             motor turns with the joints",
            t.place
        );
        reader.errors.error(matrix.span(), message);
        return None;
    }
    Some(Transmission { joints, matrix: rows })
}

fn joints(reader: &mut Reader<'_>, v: &Value<'_>, place: &str, dof: usize) -> Option<Vec<usize>> {
    let mut joints: Vec<usize> = Vec::new();
    for item in v.get_ref().as_array().map(|a| a.iter()).into_iter().flatten() {
        let number = match item.get_ref() {
            DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse::<usize>().ok(),
            _ => None,
        };
        let joint = number.filter(|n| (1..=dof.min(MAX_JOINTS)).contains(n)).map(|n| n - 1);
        match joint {
            Some(joint) if joints.contains(&joint) => {
                let message = format!("{place}: joints names joint {} twice", joint + 1);
                reader.errors.error(item.span(), message);
                return None;
            }
            Some(joint) => joints.push(joint),
            None => {
                let found = describe(item);
                let message =
                    format!("{place}: joints: {found} is no joint of this arm: they are 1 to {dof}");
                reader.errors.error(item.span(), message);
                return None;
            }
        }
    }
    if joints.len() < 2 {
        let found = describe(v);
        let message =
            format!("{place}: joints must be a list of two or more joints, as [5, 6], found {found}");
        reader.errors.error(v.span(), message);
        return None;
    }
    Some(joints)
}

fn rows(reader: &mut Reader<'_>, v: &Value<'_>, place: &str, count: usize) -> Option<Vec<Vec<Rational>>> {
    let lists: Vec<&Value<'_>> = v.get_ref().as_array().map(|a| a.iter().collect()).unwrap_or_default();
    let square = |row: &&Value<'_>| row.get_ref().as_array().is_some_and(|a| a.iter().count() == count);
    if lists.len() != count || !lists.iter().all(square) {
        let message = format!(
            "{place}: matrix must be {count} lists of {count} numbers, a row for each motor and a column \
             for each joint, found {}",
            describe(v)
        );
        reader.errors.error(v.span(), message);
        return None;
    }
    let quantity = format!("{place}: matrix");
    let mut entry = |item: &Value<'_>| match item.get_ref().as_str() {
        Some(text) => rational::parse_rational(text)
            .map_err(|e| reader.errors.error(item.span(), format!("{quantity}: {e}")))
            .ok(),
        None => reader.number(item, &quantity, "1, or text such as \"1/3\""),
    };
    let row = |list: &Value<'_>| -> Vec<Option<Rational>> {
        list.get_ref().as_array().map(|a| a.iter().map(&mut entry).collect()).unwrap_or_default()
    };
    // All of them are read, so that each that is wrong is reported.
    let read: Vec<Vec<Option<Rational>>> = lists.into_iter().map(row).collect();
    read.into_iter().map(|row| row.into_iter().collect()).collect()
}

/// By Gauss's elimination.
fn determinant(mut a: Vec<Vec<Rational>>) -> Rational {
    let n = a.len();
    let mut product = Rational::one();
    for k in 0..n {
        let Some(pivot) = (k..n).find(|r| !a[*r][k].is_zero()) else { return Rational::zero() };
        if pivot != k {
            a.swap(k, pivot);
            product = -product;
        }
        product *= a[k][k].clone();
        for r in k + 1..n {
            let factor = &a[r][k] / &a[k][k];
            for c in k..n {
                let change = &factor * &a[k][c];
                a[r][c] -= change;
            }
        }
    }
    product
}
