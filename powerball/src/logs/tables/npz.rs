//! Archives of NumPy arrays (`.npz`, `numpy.savez` and `savez_compressed`): a ZIP of `.npy` files.

use super::arrays::{Array, Values, table};
use super::table::Table;
use std::io::{self, Read};

/// An array that claims to be larger than this, bytes, is torn.
const LARGEST: u64 = 1 << 32;

/// The arrays of an archive as one table, and those that have no place in it.
pub(super) fn read(bytes: &[u8]) -> io::Result<(Table, Option<String>)> {
    let mut arrays = Vec::new();
    let mut left_out = Vec::new();
    for (name, npy) in entries(bytes)? {
        match array(name.trim_end_matches(".npy"), &npy) {
            Ok(array) => arrays.push(array),
            Err(reason) => left_out.push(format!("{name} ({reason})")),
        }
    }
    Ok(table(&arrays, left_out))
}

fn torn(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the archive is torn: {what}"))
}

fn le16(bytes: &[u8], at: usize) -> io::Result<usize> {
    let two = bytes.get(at..at + 2).ok_or_else(|| torn("its directory"))?;
    Ok(usize::from(u16::from_le_bytes([two[0], two[1]])))
}

fn le32(bytes: &[u8], at: usize) -> io::Result<usize> {
    let four = bytes.get(at..at + 4).ok_or_else(|| torn("its directory"))?;
    match u32::from_le_bytes([four[0], four[1], four[2], four[3]]) {
        u32::MAX => Err(io::Error::other("archives beyond 4 GB are not read: split it")),
        value => Ok(value as usize),
    }
}

/// The files of a ZIP with their names, by the directory at its end.
fn entries(bytes: &[u8]) -> io::Result<Vec<(String, Vec<u8>)>> {
    let from = bytes.len().saturating_sub(22 + 65_535);
    let end = bytes[from..].windows(4).rposition(|w| w == b"PK\x05\x06").map(|at| from + at);
    let end = end.ok_or_else(|| torn("it has no end"))?;
    let (count, mut at) = (le16(bytes, end + 10)?, le32(bytes, end + 16)?);
    let mut entries = Vec::new();
    for _ in 0..count {
        if bytes.get(at..at + 4) != Some(b"PK\x01\x02") {
            return Err(torn("its directory"));
        }
        let (method, packed, size) = (le16(bytes, at + 10)?, le32(bytes, at + 20)?, le32(bytes, at + 24)?);
        let (name, extra, comment) = (le16(bytes, at + 28)?, le16(bytes, at + 30)?, le16(bytes, at + 32)?);
        let local = le32(bytes, at + 42)?;
        let name_at = at + 46;
        let text = bytes.get(name_at..name_at + name).ok_or_else(|| torn("a name"))?;
        let start = local + 30 + le16(bytes, local + 26)? + le16(bytes, local + 28)?;
        let stored = bytes.get(start..start + packed).ok_or_else(|| torn("an array"))?;
        let content = match method {
            0 => stored.to_vec(),
            8 => {
                let mut out = Vec::new();
                flate2::read::DeflateDecoder::new(stored).take(size as u64 + 1).read_to_end(&mut out)?;
                out
            }
            other => {
                return Err(io::Error::other(format!("an array is compressed by method {other} of ZIP")));
            }
        };
        if content.len() != size || size as u64 > LARGEST {
            return Err(torn("an array"));
        }
        entries.push((String::from_utf8_lossy(text).into_owned(), content));
        at = name_at + name + extra + comment;
    }
    Ok(entries)
}

/// An array from the bytes of a `.npy` file.
fn array(name: &str, bytes: &[u8]) -> Result<Array, String> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("is no .npy")?;
    let (length, start) = match rest.first() {
        Some(1) => (le16(rest, 2), 4),
        Some(2 | 3) => (le32(rest, 2), 6),
        _ => return Err("is a .npy of an unknown version".into()),
    };
    let length = length.map_err(|e| e.to_string())?;
    let header = rest.get(start..start + length).ok_or("is torn")?;
    let header = String::from_utf8_lossy(header).into_owned();
    let after = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}'")).ok_or(format!("its head lacks {key}"))?;
        Ok::<&str, String>(rest.trim_start_matches([':', ' ']))
    };
    let descr = after("descr")?;
    let descr =
        descr.strip_prefix('\'').and_then(|d| d.split('\'').next()).ok_or("is an array of records")?;
    let columns_first = after("fortran_order")?.starts_with("True");
    let shape = after("shape")?.strip_prefix('(').and_then(|s| s.split(')').next()).ok_or("has no shape")?;
    let shape: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let data = &rest[start + length..];
    Ok(Array { name: name.into(), shape, columns_first, values: values(descr, data)? })
}

fn values(descr: &str, data: &[u8]) -> Result<Values, String> {
    let unknown = || format!("its values are {descr}");
    let order = descr.chars().next().ok_or_else(unknown)?;
    let (kind, size) = descr.get(1..).and_then(|d| Some((d.get(..1)?, d.get(1..)?))).ok_or_else(unknown)?;
    let size: usize = size.parse().map_err(|_| unknown())?;
    if kind == "U" {
        let text = |letters: &[u8]| {
            let letters = letters.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]));
            letters.take_while(|c| *c != 0).filter_map(char::from_u32).collect()
        };
        return Ok(Values::Texts(data.chunks_exact((4 * size).max(4)).map(text).collect()));
    }
    let number = |bytes: &[u8]| -> Option<f64> {
        let mut own = [0u8; 8];
        own[..size].copy_from_slice(bytes);
        if order == '>' {
            own[..size].reverse();
        }
        let unsigned = u64::from_le_bytes(own);
        let unused = 64 - 8 * size as u32;
        let signed = ((unsigned << unused) as i64) >> unused;
        match (kind, size) {
            ("f", 8) => Some(f64::from_bits(unsigned)),
            ("f", 4) => Some(f64::from(f32::from_bits(unsigned as u32))),
            ("i", _) => Some(signed as f64),
            ("u" | "b", _) => Some(unsigned as f64),
            _ => None,
        }
    };
    if !(1..=8).contains(&size) {
        return Err(unknown());
    }
    let numbers: Option<Vec<f64>> = data.chunks_exact(size).map(number).collect();
    numbers.map(Values::Numbers).ok_or_else(unknown)
}
