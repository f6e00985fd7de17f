//! HDF5: files of MATLAB's version 7.3 and of other programs, with one array for each quantity.
//!
//! The arrays of a group are a table, with those of the groups in it as `group.array`. Where a file has
//! several groups that have none above them, as a file of recorded demonstrations has, each is a table with
//! the group's path as its name.

use super::arrays::{Array, Values, table};
use super::memory::Memory;
use super::table::Table;
use hdf5_pure::{AttrValue, DType, Dataset, Error, File, Group, Object};
use std::collections::HashMap;
use std::io;
use std::path::Path;

/// Groups within groups.
const DEEPEST: usize = 16;

/// The tables of a file, and what has no place in them.
pub(super) fn read(path: &Path) -> io::Result<(Vec<Table>, Vec<String>)> {
    let file = File::open_streaming(path).map_err(failed)?;
    let (mut found, mut memory) = (Vec::new(), Memory::of_a_log());
    let read = tables(&file.root(), "", 0, &mut found, &mut memory);
    memory.done()?;
    read.map_err(failed)?;
    if found.is_empty() {
        return Err(io::Error::other("it holds no arrays"));
    }
    let several = found.len() > 1;
    let note = |(table, note): &(Table, Option<String>)| {
        note.as_ref().map(|note| if several { format!("{}: {note}", table.name) } else { note.clone() })
    };
    let left_out = found.iter().filter_map(note).collect();
    let mut tables: Vec<Table> = found.into_iter().map(|(table, _)| table).collect();
    if let [table] = tables.as_mut_slice() {
        table.name.clear();
    }
    Ok((tables, left_out))
}

fn failed(error: Error) -> io::Error {
    io::Error::other(format!("{error}; write it again (from MATLAB with '-v7')"))
}

fn tables(
    group: &Group,
    path: &str,
    depth: usize,
    found: &mut Vec<(Table, Option<String>)>,
    memory: &mut Memory,
) -> Result<(), Error> {
    let sets = group.datasets()?;
    let groups = group.groups()?;
    // MATLAB's own.
    let inner = groups.iter().filter(|name| !name.starts_with('#'));
    if sets.is_empty() {
        for name in inner.filter(|_| depth < DEEPEST) {
            let path = format!("{path}/{name}");
            tables(&group.group(name)?, &path, depth + 1, found, memory)?;
        }
        return Ok(());
    }
    let (mut arrays, mut left_out) = (Vec::new(), Vec::new());
    collect(group, "", depth, &mut arrays, &mut left_out, memory)?;
    let (mut table, note) =
        table(arrays, left_out, memory).map_err(|reason| Error::from(io::Error::other(reason)))?;
    table.name = path.to_string();
    found.push((table, note));
    Ok(())
}

/// The arrays of a group and of those in it.
fn collect(
    group: &Group,
    prefix: &str,
    depth: usize,
    arrays: &mut Vec<Array>,
    left_out: &mut Vec<String>,
    memory: &mut Memory,
) -> Result<(), Error> {
    for name in group.datasets()? {
        let full = format!("{prefix}{name}");
        match group.dataset(&name).map_err(|e| e.to_string()).and_then(|set| array(&full, &set, memory)) {
            Ok(array) => arrays.push(array),
            Err(reason) => left_out.push(format!("{full} ({reason})")),
        }
    }
    for name in group.groups()?.iter().filter(|name| !name.starts_with('#') && depth < DEEPEST) {
        let inner = group.group(name)?;
        // The fields of a struct of MATLAB's have their own names, as in its older versions.
        let prefix =
            if class(inner.attrs()).is_some() { prefix.to_string() } else { format!("{prefix}{name}.") };
        collect(&inner, &prefix, depth + 1, arrays, left_out, memory)?;
    }
    Ok(())
}

fn array(name: &str, set: &Dataset, memory: &mut Memory) -> Result<Array, String> {
    let said = |e: Error| e.to_string();
    let class = class(set.attrs());
    let shape: Vec<u64> = set.shape().map_err(said)?;
    let count = shape.iter().try_fold(1u64, |all, n| all.checked_mul(*n)).unwrap_or(u64::MAX);
    let long: Vec<usize> = shape.iter().filter(|n| **n != 1).map(|n| *n as usize).collect();
    if long.len() > 2 {
        return Err(format!("its shape is {shape:?}"));
    }
    // As they are stored, and as numbers.
    let stored = set.element_size().unwrap_or(8);
    memory.claim(count.saturating_mul(stored.saturating_add(8)))?;
    let mut shape = if long.is_empty() { vec![1] } else { long };
    // MATLAB writes its arrays column by column, and so their dimensions the other way round.
    let columns_first = class.is_some();
    if columns_first {
        shape.reverse();
    }
    let values = match (set.dtype().map_err(said)?, class.as_deref()) {
        (_, Some("char")) => return Err("is a text".into()),
        (DType::ObjectReference, Some("cell")) => Values::Texts(cells(set)?),
        (DType::String | DType::VariableLengthString, _) => Values::Texts(set.read_string().map_err(said)?),
        (DType::F32 | DType::F64 | DType::I8 | DType::I16 | DType::I32 | DType::I64, _)
        | (DType::U8 | DType::U16 | DType::U32 | DType::U64, _) => {
            Values::Numbers(set.read_f64().map_err(said)?)
        }
        (DType::Enum(_), _) => Values::Numbers(truths(set)?),
        (other, _) => return Err(format!("its values are {other}")),
    };
    Ok(Array { name: name.into(), shape, columns_first, values })
}

/// MATLAB's class of an array or a group, if MATLAB wrote it.
fn class(attributes: Result<HashMap<String, AttrValue>, Error>) -> Option<String> {
    match attributes.ok()?.remove("MATLAB_class")? {
        AttrValue::String(class) | AttrValue::AsciiString(class) => Some(class),
        _ => None,
    }
}

/// The texts of a cell array.
fn cells(set: &Dataset) -> Result<Vec<String>, String> {
    let text = |object: Object| match object {
        Object::Dataset(set) => {
            let letters = set.read_u16().map_err(|e| e.to_string())?;
            Ok(String::from_utf16_lossy(&letters).trim_end().to_string())
        }
        _ => Err("its cells are not text".to_string()),
    };
    set.dereference().map_err(|e| e.to_string())?.into_iter().map(text).collect()
}

/// Truths, which h5py stores as names of 0 and 1.
fn truths(set: &Dataset) -> Result<Vec<f64>, String> {
    let bytes = set.read_raw().map_err(|e| e.to_string())?;
    match set.element_size() {
        Ok(1) => Ok(bytes.into_iter().map(f64::from).collect()),
        _ => Err("its values are names".into()),
    }
}
