//! Named arrays as a table: the content of archives of NumPy and MATLAB.
//!
//! An array of N numbers is a column of its name, one of N × k numbers is k columns `name1` … `namek`. An
//! array of k texts (`joints`, `names`) names the columns of N × k arrays: `q.shoulder`.

use super::memory::{Memory, few_columns};
use super::table::{Column, Table};

/// One array as it is stored.
pub(super) struct Array {
    pub name: String,
    pub shape: Vec<usize>,
    /// Whether neighbours in memory are of one column.
    pub columns_first: bool,
    pub values: Values,
}

pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

/// All arrays of a file as its one table, and those that have no place in it.
#[cfg(any(feature = "npz", feature = "mat"))]
pub(super) fn one(
    arrays: Vec<Array>,
    left_out: Vec<String>,
    mut memory: Memory,
) -> std::io::Result<(Vec<Table>, Vec<String>)> {
    let (table, note) = table(arrays, left_out, &mut memory).map_err(std::io::Error::other)?;
    memory.done()?;
    Ok((vec![table], note.into_iter().collect()))
}

/// The arrays as one table, and those that have no place in it. `left_out`: those that could not be read.
///
/// # Errors
/// The reason why the memory limit does not allow it.
pub(super) fn table(
    arrays: Vec<Array>,
    mut left_out: Vec<String>,
    memory: &mut Memory,
) -> Result<(Table, Option<String>), String> {
    // As many samples as the time has, or as most arrays have.
    let longest = |a: &Array| a.shape.iter().copied().max().unwrap_or(0);
    let time = arrays.iter().find(|a| ["t", "time", "times", "timestamp"].contains(&a.name.as_str()));
    let samples = time.map_or_else(|| arrays.iter().map(longest).max().unwrap_or(0), longest);
    let texts = |a: &Array| match &a.values {
        Values::Texts(texts) => Some(texts.clone()),
        Values::Numbers(_) => None,
    };
    let names: Vec<Vec<String>> = arrays.iter().filter_map(texts).collect();
    let mut table = Table::new("", "arrays");
    // An array of no columns can have as many rows as it likes.
    memory.claim_numbers(samples)?;
    table.line = (1..=samples).collect();
    for array in arrays {
        let Values::Numbers(mut values) = array.values else { continue };
        let (width, down) = match array.shape[..] {
            [n] if n == samples => (1, !array.columns_first),
            [n, k] if n == samples => (k, !array.columns_first),
            // Joint by joint: a row of the array is a column of the log.
            [k, n] if n == samples => (k, array.columns_first),
            _ => {
                left_out
                    .push(format!("{} (its shape is {:?}, of {samples} samples)", array.name, array.shape));
                continue;
            }
        };
        few_columns(table.columns.len() + width)?;
        let joints = names.iter().find(|names| names.len() == width && width > 1);
        for k in 0..width {
            let name = match (joints, array.shape.len()) {
                (_, 1) => array.name.clone(),
                (Some(joints), _) => format!("{}.{}", array.name, joints[k]),
                (None, _) => format!("{}{}", array.name, k + 1),
            };
            let at = |n: usize| if down { n * width + k } else { k * samples + n };
            let values = match width {
                1 => {
                    values.resize(samples, f64::NAN);
                    std::mem::take(&mut values)
                }
                _ => (0..samples).map(|n| values.get(at(n)).copied().unwrap_or(f64::NAN)).collect(),
            };
            table.columns.push(Column { name, values });
        }
    }
    let note = (!left_out.is_empty()).then(|| format!("kept out: {}", left_out.join(", ")));
    Ok((table, note))
}
