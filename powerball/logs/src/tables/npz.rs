//! Arrays of NumPy: archives of them (`.npz`, `numpy.savez` and `savez_compressed`, a ZIP of `.npy` files)
//! and a `.npy` alone.

use super::arrays::{Array, Values, one};
use super::memory::Memory;
use super::table::Table;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// The arrays of an archive as one table, and those that have no place in it.
pub(super) fn read(path: &Path) -> io::Result<(Vec<Table>, Vec<String>)> {
    let mut archive = zip::ZipArchive::new(BufReader::new(File::open(path)?)).map_err(torn)?;
    let (mut arrays, mut left_out, mut memory) = (Vec::new(), Vec::new(), Memory::of_a_log());
    for k in 0..archive.len() {
        let mut entry = archive.by_index(k).map_err(torn)?;
        let (name, size) = (entry.name().map_err(torn)?.into_owned(), entry.size());
        // As it is stored, and as numbers.
        memory.claim(size.saturating_mul(2)).map_err(io::Error::other)?;
        let mut npy = Vec::new();
        // The checksum is compared where the entry ends.
        entry.by_ref().take(size + 1).read_to_end(&mut npy).map_err(|e| torn(format!("{name}: {e}")))?;
        if npy.len() as u64 != size {
            return Err(torn(name));
        }
        add(name.trim_end_matches(".npy"), &npy, &mut arrays, &mut left_out, &mut memory);
    }
    one(arrays, left_out, memory)
}

/// A `.npy` file as a table: its fields, or columns named after the file.
pub(super) fn read_array(path: &Path) -> io::Result<(Vec<Table>, Vec<String>)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (mut arrays, mut left_out, mut memory) = (Vec::new(), Vec::new(), Memory::of_a_log());
    memory.claim(std::fs::metadata(path)?.len().saturating_mul(2)).map_err(io::Error::other)?;
    add(&stem, &std::fs::read(path)?, &mut arrays, &mut left_out, &mut memory);
    match arrays.is_empty() {
        true => Err(io::Error::other(left_out.join(", "))),
        false => one(arrays, left_out, memory),
    }
}

fn torn(what: impl std::fmt::Display) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the archive is torn: {what}"))
}

fn add(name: &str, npy: &[u8], arrays: &mut Vec<Array>, left_out: &mut Vec<String>, memory: &mut Memory) {
    match array(name, npy, memory) {
        Ok(parts) => {
            for part in parts {
                match part {
                    Ok(array) => arrays.push(array),
                    Err(reason) => left_out.push(reason),
                }
            }
        }
        Err(reason) => left_out.push(format!("{name} ({reason})")),
    }
}

/// One field of an array's elements, or all there is of them.
struct Part<'h> {
    /// Empty where the elements have no fields.
    name: &'h str,
    descr: &'h str,
    /// How many numbers an element has of it.
    width: usize,
}

/// The arrays in the bytes of a `.npy` file: one, or one a field where its elements are records.
fn array(name: &str, bytes: &[u8], memory: &mut Memory) -> Result<Vec<Result<Array, String>>, String> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("is no .npy")?;
    let byte = |at: usize| rest.get(at).copied().map(usize::from).ok_or("is torn");
    let (length, start) = match byte(0)? {
        1 => (byte(2)? | byte(3)? << 8, 4),
        2 | 3 => (byte(2)? | byte(3)? << 8 | byte(4)? << 16 | byte(5)? << 24, 6),
        _ => return Err("is a .npy of an unknown version".into()),
    };
    let header = rest.get(start..start + length).ok_or("is torn")?;
    let header = std::str::from_utf8(header).map_err(|_| "has a head that is not text")?;
    let after = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}'")).ok_or(format!("its head lacks {key}"))?;
        Ok::<&str, String>(rest.trim_start_matches([':', ' ']))
    };
    let columns_first = after("fortran_order")?.starts_with("True");
    let shape = after("shape")?.strip_prefix('(').and_then(|s| s.split(')').next()).ok_or("has no shape")?;
    let shape: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let parts = parts(after("descr")?)?;
    let size = |part: &Part<'_>| Some(part.width * self::size(part.descr)?);
    let stride = parts.iter().map(size).sum::<Option<usize>>().filter(|stride| *stride > 0);
    let stride = stride
        .ok_or_else(|| format!("its values are {}", parts.iter().map(|p| p.descr).collect::<String>()))?;
    let count = shape.iter().try_fold(1usize, |all, n| all.checked_mul(*n)).ok_or("is torn")?;
    let data = rest.get(start + length..).unwrap_or_default();
    if count.checked_mul(stride).is_none_or(|size| size > data.len()) {
        return Err("is torn".into());
    }
    // Numbers that are stored in fewer bytes than they take here.
    let numbers = count.saturating_mul(parts.iter().map(|part| part.width).sum());
    memory.claim_numbers(numbers.saturating_sub(data.len() / 8))?;
    let mut from = 0;
    let read = parts.iter().map(|part| {
        let own = part.width * self::size(part.descr).unwrap_or(0);
        let bytes = from..from + own;
        from += own;
        let elements = data.chunks_exact(stride).take(count).map(|element| &element[bytes.clone()]);
        let full = if part.name.is_empty() { name } else { part.name };
        let values = values(part.descr, elements).map_err(|reason| format!("{full} ({reason})"))?;
        let inner = (part.width > 1).then_some(part.width);
        let shape = shape.iter().copied().chain(inner).collect();
        Ok(Array { name: full.to_string(), shape, columns_first: columns_first && inner.is_none(), values })
    });
    Ok(read.collect())
}

/// The parts of an array's elements: `'<f8'`, or `[('t', '<f8'), ('q', '<f8', (6,))]`.
fn parts(descr: &str) -> Result<Vec<Part<'_>>, String> {
    let quoted = |text: &'_ str| -> Option<(usize, usize)> {
        let begin = text.find('\'')? + 1;
        Some((begin, begin + text[begin..].find('\'')?))
    };
    if !descr.starts_with('[') {
        let (begin, end) = quoted(descr).ok_or("has a head that is torn")?;
        return Ok(vec![Part { name: "", descr: &descr[begin..end], width: 1 }]);
    }
    let (mut parts, mut rest) = (Vec::new(), &descr[1..]);
    while let Some(field) = rest.trim_start_matches([',', ' ']).strip_prefix('(') {
        let (begin, end) = quoted(field).ok_or("has a head that is torn")?;
        let (name, after) = (&field[begin..end], field[end + 1..].trim_start_matches([',', ' ']));
        if !after.starts_with('\'') {
            return Err("has records within records".into());
        }
        let (begin, end) = quoted(after).ok_or("has a head that is torn")?;
        let (descr, after) = (&after[begin..end], &after[end + 1..]);
        let (shape, after) = after.split_once(')').ok_or("has a head that is torn")?;
        let numbers = shape.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse::<usize>().ok());
        let width = numbers.product();
        // A field with a shape has a bracket more.
        rest = if shape.contains('(') {
            after.split_once(')').ok_or("has a head that is torn")?.1
        } else {
            after
        };
        parts.push(Part { name, descr, width });
    }
    Ok(parts)
}

/// The kind of a value, `f`, and its bytes; its order of bytes and its unit, where it is a time.
fn kind(descr: &str) -> Option<(char, usize, bool, Option<&str>)> {
    let big = descr.starts_with('>');
    let mut letters = descr.chars();
    let kind = letters.nth(1)?;
    let (size, unit) = match letters.as_str().split_once('[') {
        Some((size, unit)) => (size, unit.strip_suffix(']')),
        None => (letters.as_str(), None),
    };
    Some((kind, size.parse().ok()?, big, unit))
}

/// Bytes of a value.
fn size(descr: &str) -> Option<usize> {
    let (kind, size, ..) = kind(descr)?;
    // Letters have four.
    Some(if kind == 'U' { 4 * size } else { size }).filter(|size| *size < 1 << 20)
}

fn values<'d>(descr: &str, elements: impl Iterator<Item = &'d [u8]>) -> Result<Values, String> {
    let unknown = || format!("its values are {descr}");
    let (kind, size, big, unit) = kind(descr).ok_or_else(unknown)?;
    if kind == 'U' {
        let letter = |four: &[u8]| {
            let four = four.try_into().unwrap_or_default();
            if big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) }
        };
        let text = |letters: &[u8]| {
            let letters = letters.chunks_exact(4).map(letter).take_while(|c| *c != 0);
            letters.filter_map(char::from_u32).collect()
        };
        return Ok(Values::Texts(elements.map(text).collect()));
    }
    let number: fn(u64, u32) -> f64 = match (kind, size) {
        ('f', 2) => |bits, _| f64::from(half::f16::from_bits(bits as u16)),
        ('f', 4) => |bits, _| f64::from(f32::from_bits(bits as u32)),
        ('f', 8) => |bits, _| f64::from_bits(bits),
        ('i' | 'm' | 'M', 1..=8) => |bits, unused| (((bits << unused) as i64) >> unused) as f64,
        ('u' | 'b', 1..=8) => |bits, _| bits as f64,
        _ => return Err(unknown()),
    };
    let of_second = if matches!(kind, 'm' | 'M') { Some(time_unit(unit).ok_or_else(unknown)?) } else { None };
    let unused = 64 - 8 * size as u32;
    let value = |bytes: &[u8]| {
        let mut own = [0u8; 8];
        own[..size].copy_from_slice(bytes);
        if big {
            own[..size].reverse();
        }
        let bits = u64::from_le_bytes(own);
        match of_second {
            // No time at all.
            Some(_) if bits as i64 == i64::MIN => f64::NAN,
            Some((parts, of)) => {
                let parts_of = i64::wrapping_mul(bits as i64, parts);
                parts_of.div_euclid(of) as f64 + parts_of.rem_euclid(of) as f64 / of as f64
            }
            None => number(bits, unused),
        }
    };
    Ok(Values::Numbers(elements.flat_map(|element| element.chunks_exact(size)).map(value).collect()))
}

/// A unit of time, `10ms`, as a number of parts and how many of these parts are a second.
fn time_unit(unit: Option<&str>) -> Option<(i64, i64)> {
    let unit = unit?;
    let letters = unit.trim_start_matches(|c: char| c.is_ascii_digit());
    let count = unit[..unit.len() - letters.len()].parse().unwrap_or(1);
    Some(match letters {
        "D" => (86_400 * count, 1),
        "h" => (3_600 * count, 1),
        "m" => (60 * count, 1),
        "s" => (count, 1),
        "ms" => (count, 1_000),
        "us" => (count, 1_000_000),
        "ns" => (count, 1_000_000_000),
        _ => return None,
    })
}
