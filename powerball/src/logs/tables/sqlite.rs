//! The tables of an SQLite file, read from beginning to end.
//!
//! rosbag2 writes such files. What is needed of them is a scan of two tables, which is a walk over a B-tree
//! of pages (<https://sqlite.org/fileformat2.html>, chapters 1.3, 1.6, 2.1 and 2.3): no query, no index, no
//! lock. That is this file; the library itself would bring a C compiler and a megabyte. One page is in memory
//! at a time, and a long value is read only where it is asked for.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// What the file begins with.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";
/// Interior pages on the way to a leaf; 2⁶⁴ rows need fewer.
const DEEPEST: usize = 32;

/// An open file.
pub(super) struct Database {
    file: File,
    page: usize,
    /// Bytes of a page that hold content.
    usable: usize,
    pages: u64,
}

/// One row of a table.
pub(super) struct Row<'a> {
    database: &'a Database,
    id: i64,
    /// How many bytes the row has.
    size: usize,
    /// Those on its own page.
    local: &'a [u8],
    /// Where the others begin.
    overflow: u32,
    /// By column: its kind, and where its bytes are in the row.
    columns: Vec<(u64, std::ops::Range<usize>)>,
}

fn torn(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the SQLite file is torn: {what}"))
}

impl Database {
    pub(super) fn open(file: File) -> io::Result<Database> {
        let mut head = [0; 100];
        (&file).seek(SeekFrom::Start(0))?;
        (&file).read_exact(&mut head)?;
        let page = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 65_536,
            size => usize::from(size),
        };
        if !head.starts_with(MAGIC) || !page.is_power_of_two() || page < 512 {
            return Err(torn("its head"));
        }
        if u32::from_be_bytes([head[56], head[57], head[58], head[59]]) > 1 {
            return Err(io::Error::other("its text is UTF-16, which rosbag2 does not write"));
        }
        let usable = page - usize::from(head[20]);
        let pages = file.metadata()?.len().div_ceil(page as u64);
        Ok(Database { file, page, usable, pages })
    }

    /// The tables' names with the number of their first page.
    pub(super) fn tables(&self) -> io::Result<Vec<(String, u32)>> {
        let mut tables = Vec::new();
        self.scan(1, &mut |row| {
            if row.text(0)? == "table" {
                tables.push((row.text(1)?, row.int(3)? as u32));
            }
            Ok(())
        })?;
        Ok(tables)
    }

    /// Every row of the table whose first page it is, in the order of the row numbers.
    pub(super) fn scan(&self, root: u32, each: &mut dyn FnMut(&Row<'_>) -> io::Result<()>) -> io::Result<()> {
        let mut left = self.pages;
        self.walk(root, 0, &mut left, each)
    }

    /// `left` bounds the pages that are looked at, so that torn links cannot lead in a circle.
    fn walk(
        &self,
        number: u32,
        depth: usize,
        left: &mut u64,
        each: &mut dyn FnMut(&Row<'_>) -> io::Result<()>,
    ) -> io::Result<()> {
        *left =
            left.checked_sub(1).filter(|_| depth < DEEPEST).ok_or_else(|| torn("its pages form a circle"))?;
        let page = self.read(number)?;
        // The first page begins with the file's own head.
        let head = if number == 1 { 100 } else { 0 };
        let kind = page[head];
        let cells = usize::from(be16(&page, head + 3)?);
        match kind {
            0x05 => {
                for k in 0..cells {
                    let at = usize::from(be16(&page, head + 12 + 2 * k)?);
                    self.walk(be32(&page, at)?, depth + 1, left, each)?;
                }
                self.walk(be32(&page, head + 8)?, depth + 1, left, each)
            }
            0x0d => {
                for k in 0..cells {
                    let at = usize::from(be16(&page, head + 8 + 2 * k)?);
                    each(&self.row(page.get(at..self.usable).ok_or_else(|| torn("a row"))?)?)?;
                }
                Ok(())
            }
            _ => Err(torn("a page of an unknown kind")),
        }
    }

    fn row<'a>(&'a self, cell: &'a [u8]) -> io::Result<Row<'a>> {
        let (size, at) = varint(cell, 0)?;
        let (id, at) = varint(cell, at)?;
        let size = usize::try_from(size).map_err(|_| torn("a row's size"))?;
        // How much of a long row is on its page (chapter 1.6).
        let most = self.usable - 35;
        let least = (self.usable - 12) * 32 / 255 - 23;
        let local = if size <= most {
            size
        } else {
            let some = least + (size - least) % (self.usable - 4);
            if some <= most { some } else { least }
        };
        let overflow = if local < size { be32(cell, at + local)? } else { 0 };
        let local = cell.get(at..at + local).ok_or_else(|| torn("a row"))?;
        let (head, mut at) = varint(local, 0)?;
        let (mut columns, mut body) = (Vec::new(), usize::try_from(head).map_err(|_| torn("a row's head"))?);
        while (at as u64) < head {
            let (kind, next) = varint(local, at)?;
            at = next;
            let length = match kind {
                0 | 8 | 9 => 0,
                1..=4 => kind as usize,
                5 => 6,
                6 | 7 => 8,
                10 | 11 => return Err(torn("a value's kind")),
                long => usize::try_from((long - 12) / 2).map_err(|_| torn("a value's size"))?,
            };
            let end = body.checked_add(length).filter(|end| *end <= size).ok_or_else(|| torn("a value"))?;
            columns.push((kind, body..end));
            body = end;
        }
        Ok(Row { database: self, id: id as i64, size, local, overflow, columns })
    }

    fn read(&self, number: u32) -> io::Result<Vec<u8>> {
        if number == 0 || u64::from(number) > self.pages {
            return Err(torn(&format!("it has {} pages and no page {number}", self.pages)));
        }
        let mut page = vec![0; self.page];
        (&self.file).seek(SeekFrom::Start((u64::from(number) - 1) * self.page as u64))?;
        (&self.file).read_exact(&mut page).map_err(|_| torn("its last page"))?;
        Ok(page)
    }
}

impl Row<'_> {
    /// A column's kind and bytes.
    fn value(&self, column: usize) -> io::Result<(u64, Vec<u8>)> {
        let (kind, at) = self.columns.get(column).cloned().ok_or_else(|| torn("a row lacks a column"))?;
        if let Some(bytes) = self.local.get(at.clone()) {
            return Ok((kind, bytes.to_vec()));
        }
        let (mut bytes, mut next) = (self.local.to_vec(), self.overflow);
        // Bytes come page after page, so a file's size bounds what a torn row can ask for.
        while bytes.len() < self.size {
            let page = self.database.read(next)?;
            next = be32(&page, 0)?;
            let more = (self.size - bytes.len()).min(self.database.usable - 4);
            bytes.extend_from_slice(&page[4..4 + more]);
            if bytes.len() as u64 > self.database.pages * self.database.page as u64 {
                return Err(torn("a value's pages form a circle"));
            }
        }
        Ok((kind, bytes[at].to_vec()))
    }

    /// An integer; a column that is the row's number is stored as nothing.
    pub(super) fn int(&self, column: usize) -> io::Result<i64> {
        let (kind, bytes) = self.value(column)?;
        match kind {
            0 => Ok(self.id),
            1..=6 => {
                let negative = bytes.first().is_some_and(|b| b & 0x80 != 0);
                let start = if negative { -1i64 } else { 0 };
                Ok(bytes.iter().fold(start, |value, b| value << 8 | i64::from(*b)))
            }
            8 => Ok(0),
            9 => Ok(1),
            _ => Err(torn("a number is none")),
        }
    }

    pub(super) fn text(&self, column: usize) -> io::Result<String> {
        Ok(String::from_utf8_lossy(&self.value(column)?.1).into_owned())
    }

    pub(super) fn blob(&self, column: usize) -> io::Result<Vec<u8>> {
        Ok(self.value(column)?.1)
    }
}

fn be16(bytes: &[u8], at: usize) -> io::Result<u16> {
    let two = bytes.get(at..at + 2).ok_or_else(|| torn("a pointer"))?;
    Ok(u16::from_be_bytes([two[0], two[1]]))
}

fn be32(bytes: &[u8], at: usize) -> io::Result<u32> {
    let four = bytes.get(at..at + 4).ok_or_else(|| torn("a pointer"))?;
    Ok(u32::from_be_bytes([four[0], four[1], four[2], four[3]]))
}

/// A number of one to nine bytes, the highest first, and where the next value begins.
fn varint(bytes: &[u8], at: usize) -> io::Result<(u64, usize)> {
    let mut value = 0;
    for k in 0..9 {
        let byte = *bytes.get(at + k).ok_or_else(|| torn("a number"))?;
        if k == 8 {
            return Ok((value << 8 | u64::from(byte), at + 9));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte < 0x80 {
            return Ok((value, at + k + 1));
        }
    }
    Err(torn("a number"))
}
