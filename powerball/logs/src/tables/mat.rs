//! MATLAB's files of version 5 to 7 (`save`, `save -v7`, `scipy.io.savemat`), as "MAT-File Format" of
//! MathWorks describes them (version 7.3 is HDF5): arrays of numbers, of letters, cells of letters, and the
//! fields of a struct of one element.

use super::arrays::{Array, Values, one};
use super::memory::Memory;
use super::table::Table;
use std::io::{self, Read};
use std::path::Path;

/// Structs within structs.
const DEEPEST: usize = 8;

// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
// Classes of arrays.
const CELL: u32 = 1;
const STRUCT: u32 = 2;
const LETTERS: u32 = 4;

/// The arrays of a file as one table, and those that have no place in it.
pub(super) fn read(path: &Path) -> io::Result<(Vec<Table>, Vec<String>)> {
    let mut memory = Memory::of_a_log();
    memory.claim(std::fs::metadata(path)?.len()).map_err(io::Error::other)?;
    let bytes = std::fs::read(path)?;
    let big = match bytes.get(126..128) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => return Err(torn()),
    };
    let mut found = Found { arrays: Vec::new(), left_out: Vec::new(), memory };
    let mut elements = Elements { rest: &bytes[128..], big };
    while let Some((kind, content)) = elements.next()? {
        if kind == COMPRESSED {
            let mut unpacked = Vec::new();
            // One byte more than there is room for is refused.
            let most = found.memory.left().saturating_add(1);
            flate2::read::ZlibDecoder::new(content).take(most).read_to_end(&mut unpacked)?;
            found.memory.claim(unpacked.len() as u64).map_err(io::Error::other)?;
            let mut inner = Elements { rest: &unpacked, big };
            if let Some((MATRIX, content)) = inner.next()? {
                found.variable(Elements { rest: content, big }, None, 0)?;
            }
        } else if kind == MATRIX {
            found.variable(Elements { rest: content, big }, None, 0)?;
        }
    }
    one(found.arrays, found.left_out, found.memory)
}

fn torn() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "the file is torn")
}

/// Elements that follow each other.
struct Elements<'a> {
    rest: &'a [u8],
    big: bool,
}

impl<'a> Elements<'a> {
    fn u32(&self, at: usize) -> io::Result<u32> {
        let four: [u8; 4] = self.rest.get(at..at + 4).and_then(|b| b.try_into().ok()).ok_or_else(torn)?;
        Ok(if self.big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// The next element: its type and its bytes.
    fn next(&mut self) -> io::Result<Option<(u32, &'a [u8])>> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        let first = self.u32(0)?;
        // Four bytes or fewer stand in the place of their length.
        if first >> 16 != 0 {
            let content = self.rest.get(4..4 + (first >> 16) as usize).ok_or_else(torn)?;
            self.rest = self.rest.get(8..).ok_or_else(torn)?;
            return Ok(Some((first & 0xffff, content)));
        }
        let length = self.u32(4)? as usize;
        let content = self.rest.get(8..).and_then(|rest| rest.get(..length)).ok_or_else(torn)?;
        // What follows begins at a multiple of eight bytes; compressed elements are not padded.
        let padded = if first == COMPRESSED { length } else { length.next_multiple_of(8) };
        self.rest = self.rest.get(8 + padded..).unwrap_or_default();
        Ok(Some((first, content)))
    }

    fn needed(&mut self) -> io::Result<(u32, &'a [u8])> {
        self.next()?.ok_or_else(torn)
    }

    fn text(&mut self) -> io::Result<String> {
        let (_, letters) = self.needed()?;
        Ok(String::from_utf8_lossy(letters).trim_end_matches('\0').to_string())
    }

    fn integers(&mut self) -> io::Result<Vec<u32>> {
        let (_, content) = self.needed()?;
        let inner = Elements { rest: content, big: self.big };
        (0..content.len() / 4).map(|k| inner.u32(4 * k)).collect()
    }

    /// Numbers, of whatever type they are stored in.
    fn numbers(&mut self) -> io::Result<Option<Vec<f64>>> {
        let (kind, content) = self.needed()?;
        let size = match kind {
            1 | 2 | 16 => 1,
            3 | 4 | 17 => 2,
            5..=7 | 18 => 4,
            9 | 12 | 13 => 8,
            _ => return Ok(None),
        };
        let number = |bytes: &[u8]| {
            let mut own = [0u8; 8];
            own[..size].copy_from_slice(bytes);
            if self.big {
                own[..size].reverse();
            }
            let unsigned = u64::from_le_bytes(own);
            let unused = 64 - 8 * size as u32;
            match kind {
                9 => f64::from_bits(unsigned),
                7 => f64::from(f32::from_bits(unsigned as u32)),
                1 | 3 | 5 | 12 => (((unsigned << unused) as i64) >> unused) as f64,
                _ => unsigned as f64,
            }
        };
        Ok(Some(content.chunks_exact(size).map(number).collect()))
    }
}

struct Found {
    arrays: Vec<Array>,
    left_out: Vec<String>,
    memory: Memory,
}

impl Found {
    /// A variable, or under the name of its field a part of one.
    fn variable(&mut self, mut own: Elements<'_>, field: Option<&str>, depth: usize) -> io::Result<()> {
        // MATLAB writes an empty field as an element of no length.
        if own.rest.is_empty() {
            return Ok(());
        }
        let flags = own.integers()?.first().copied().ok_or_else(torn)?;
        let shape: Vec<usize> = own.integers()?.into_iter().map(|n| n as usize).collect();
        let stored = own.text()?;
        let name = field.map_or(stored, str::to_string);
        let count = shape.iter().try_fold(1usize, |all, n| all.checked_mul(*n)).ok_or_else(torn)?;
        // Letters are read as numbers too, and of any kind there are no more than bytes.
        self.memory.claim_numbers(count.min(own.rest.len())).map_err(io::Error::other)?;
        // A vector is a row or a column there.
        let long: Vec<usize> = shape.iter().copied().filter(|n| *n != 1).collect();
        let shape = if long.is_empty() { vec![1] } else { long };
        let mut keep = |values: Values, shape: Vec<usize>| {
            self.arrays.push(Array { name: name.clone(), shape, columns_first: true, values });
        };
        match flags & 0xff {
            STRUCT if count == 1 && depth < DEEPEST => {
                let length = own.integers()?.first().copied().filter(|n| *n > 0).ok_or_else(torn)? as usize;
                let (_, names) = own.needed()?;
                for name in names.chunks_exact(length) {
                    let name = String::from_utf8_lossy(name);
                    let (_, content) = own.needed()?;
                    let inner = Elements { rest: content, big: own.big };
                    self.variable(inner, Some(name.trim_end_matches('\0')), depth + 1)?;
                }
            }
            CELL => match texts(&mut own, count)? {
                Some(texts) => keep(Values::Texts(texts), vec![count]),
                None => self.left_out.push(format!("{name} (its cells are not text)")),
            },
            // Rows of letters: a text each, letter by letter down the columns.
            LETTERS => match own.numbers()? {
                Some(letters) if shape.len() == 2 && letters.len() == count => {
                    let rows = shape[0];
                    let row = |k: usize| letters.iter().skip(k).step_by(rows).copied();
                    let texts = (0..rows).map(|k| letters_of(row(k))).collect();
                    keep(Values::Texts(texts), vec![rows]);
                }
                // One text names nothing.
                _ => self.left_out.push(format!("{name} (is a text)")),
            },
            6..=15 if flags & 0x800 != 0 => self.left_out.push(format!("{name} (is complex)")),
            6..=15 => match own.numbers()? {
                Some(numbers) if numbers.len() == count => keep(Values::Numbers(numbers), shape),
                _ => return Err(torn()),
            },
            STRUCT => self.left_out.push(format!("{name} (is a list of structs, or lies too deep)")),
            _ => self.left_out.push(format!("{name} (is neither numbers nor texts)")),
        }
        Ok(())
    }
}

/// Letters by their numbers.
fn letters_of(numbers: impl Iterator<Item = f64>) -> String {
    let text: String = numbers.filter_map(|x| char::from_u32(x as u32)).collect();
    text.trim_end().to_string()
}

/// The texts of a cell array; none where it holds anything else.
fn texts(own: &mut Elements<'_>, count: usize) -> io::Result<Option<Vec<String>>> {
    let mut texts = Vec::new();
    for _ in 0..count {
        let (_, content) = own.needed()?;
        let mut cell = Elements { rest: content, big: own.big };
        if cell.integers()?.first().is_none_or(|flags| flags & 0xff != LETTERS) {
            return Ok(None);
        }
        cell.integers()?;
        cell.text()?;
        match cell.numbers()? {
            Some(letters) => texts.push(letters_of(letters.into_iter())),
            None => return Ok(None),
        }
    }
    Ok(Some(texts))
}
