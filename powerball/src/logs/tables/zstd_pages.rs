//! Pages of Parquet columns that are compressed with Zstandard, which polars and LeRobot write.
//!
//! The crate `parquet` can read them with a C library only, which takes as long to build as half of the rest
//! and stops builds for other systems. Its traits let the pages come from elsewhere: here their headers
//! (Thrift's compact protocol, parquet.thrift of the format's specification) are read, and `ruzstd` takes the
//! bytes out.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding};
use parquet::bloom_filter::Sbbf;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::RowGroupReader;
use parquet::record::reader::RowIter;
use parquet::schema::types::Type;
use std::io::Read;
use std::ops::Range;

/// A row group whose Zstandard columns are read here and whose other columns are read by `parquet`.
pub(super) struct RowGroup<'a> {
    inner: Box<dyn RowGroupReader + 'a>,
    /// The whole file.
    file: Bytes,
}

impl RowGroupReader for RowGroup<'_> {
    fn metadata(&self) -> &RowGroupMetaData {
        self.inner.metadata()
    }

    fn num_columns(&self) -> usize {
        self.inner.num_columns()
    }

    fn get_column_page_reader(&self, i: usize) -> Result<Box<dyn PageReader>> {
        let column = self.metadata().column(i);
        if !matches!(column.compression(), Compression::ZSTD(_)) {
            return self.inner.get_column_page_reader(i);
        }
        let bytes = self.file.slice(bytes_of(column, self.file.len())?);
        Ok(Box::new(Pages { rest: bytes, values: column.num_values(), ahead: None }))
    }

    fn get_column_bloom_filter(&self, _: usize) -> Option<&Sbbf> {
        None
    }

    fn get_row_iter(&self, projection: Option<Type>) -> Result<RowIter<'_>> {
        RowIter::from_row_group(projection, self)
    }
}

impl<'a> RowGroup<'a> {
    /// The row group, once it is sure that its columns lie within the file: `parquet` panics where they do
    /// not.
    pub(super) fn new(inner: Box<dyn RowGroupReader + 'a>, file: &Bytes) -> Result<Self> {
        for column in inner.metadata().columns() {
            bytes_of(column, file.len())?;
        }
        Ok(RowGroup { inner, file: file.clone() })
    }
}

/// Where a column's pages lie in a file of some length.
fn bytes_of(column: &ColumnChunkMetaData, length: usize) -> Result<Range<usize>> {
    let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
    let start = usize::try_from(start).map_err(|_| torn())?;
    let size = usize::try_from(column.compressed_size()).map_err(|_| torn())?;
    let end = start.checked_add(size).filter(|end| *end <= length).ok_or_else(torn)?;
    Ok(start..end)
}

/// The pages of one column of one row group.
struct Pages {
    rest: Bytes,
    /// Values that are still to come.
    values: i64,
    /// A page that was looked at and not taken: a row that is a list ends where the next page says so.
    ahead: Option<Page>,
}

impl Pages {
    fn next_page(&mut self) -> Result<Option<Page>> {
        while self.values > 0 && !self.rest.is_empty() {
            let mut header = Header { bytes: &self.rest, at: 0 };
            let fields = header.structure(0)?;
            let at = header.at;
            let size = |id| fields.size(id);
            let (whole, stored) = (size(UNCOMPRESSED_SIZE)?, size(COMPRESSED_SIZE)?);
            if at.checked_add(stored).is_none_or(|end| end > self.rest.len()) {
                return Err(torn());
            }
            let body = self.rest.slice(at..at + stored);
            self.rest = self.rest.slice(at + stored..);
            let page = match fields.int(PAGE_TYPE)? {
                0 => data_page(fields.inner(DATA_PAGE)?, &body, whole)?,
                2 => dictionary_page(fields.inner(DICTIONARY_PAGE)?, &body, whole)?,
                3 => data_page_v2(fields.inner(DATA_PAGE_V2)?, &body, whole)?,
                _ => continue,
            };
            if page.is_data_page() {
                self.values -= i64::from(page.num_values());
            }
            return Ok(Some(page));
        }
        Ok(None)
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        match self.ahead.take() {
            Some(page) => Ok(Some(page)),
            None => self.next_page(),
        }
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        if self.ahead.is_none() {
            self.ahead = self.next_page()?;
        }
        Ok(self.ahead.as_ref().map(|page| PageMetadata {
            num_rows: match page {
                Page::DataPageV2 { num_rows, .. } => Some(*num_rows as usize),
                Page::DataPage { .. } | Page::DictionaryPage { .. } => None,
            },
            num_levels: Some(page.num_values() as usize),
            is_dict: page.is_dictionary_page(),
        }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.get_next_page().map(|_| ())
    }
}

// Fields of PageHeader and of the three headers inside it, as parquet.thrift numbers them.
const PAGE_TYPE: i16 = 1;
const UNCOMPRESSED_SIZE: i16 = 2;
const COMPRESSED_SIZE: i16 = 3;
const DATA_PAGE: i16 = 5;
const DICTIONARY_PAGE: i16 = 7;
const DATA_PAGE_V2: i16 = 8;

fn data_page(header: &Fields, body: &Bytes, whole: usize) -> Result<Page> {
    Ok(Page::DataPage {
        buf: decompress(body, whole)?,
        num_values: header.count(1)?,
        encoding: header.encoding(2)?,
        def_level_encoding: header.encoding(3)?,
        rep_level_encoding: header.encoding(4)?,
        statistics: None,
    })
}

fn dictionary_page(header: &Fields, body: &Bytes, whole: usize) -> Result<Page> {
    Ok(Page::DictionaryPage {
        buf: decompress(body, whole)?,
        num_values: header.count(1)?,
        encoding: header.encoding(2)?,
        is_sorted: header.truth(3).unwrap_or(false),
    })
}

/// In the second version the levels stand before the values and are never compressed.
fn data_page_v2(header: &Fields, body: &Bytes, whole: usize) -> Result<Page> {
    let (definition, repetition) = (header.count(5)?, header.count(6)?);
    let levels = definition as usize + repetition as usize;
    let values = whole.checked_sub(levels).filter(|_| levels <= body.len()).ok_or_else(torn)?;
    let mut buffer = body[..levels].to_vec();
    let packed = body.slice(levels..);
    if header.truth(7).unwrap_or(true) && !packed.is_empty() {
        buffer.extend_from_slice(&decompress(&packed, values)?);
    } else {
        buffer.extend_from_slice(&packed);
    }
    Ok(Page::DataPageV2 {
        buf: buffer.into(),
        num_values: header.count(1)?,
        num_nulls: header.count(2)?,
        num_rows: header.count(3)?,
        encoding: header.encoding(4)?,
        def_levels_byte_len: definition,
        rep_levels_byte_len: repetition,
        is_compressed: false,
        statistics: None,
    })
}

fn decompress(body: &[u8], size: usize) -> Result<Bytes> {
    let failed = |e: &dyn std::fmt::Display| ParquetError::General(format!("Zstandard: {e}"));
    let decoder = ruzstd::decoding::StreamingDecoder::new(body).map_err(|e| failed(&e))?;
    let mut out = Vec::new();
    // The header's word for the size is a bound, so that a torn file cannot ask for all memory.
    decoder.take(size as u64 + 1).read_to_end(&mut out).map_err(|e| failed(&e))?;
    if out.len() == size { Ok(out.into()) } else { Err(torn()) }
}

fn torn() -> ParquetError {
    ParquetError::EOF("a page is torn".into())
}

/// A field's value, as far as headers have them.
enum Value {
    Truth(bool),
    Int(i64),
    Structure(Fields),
    /// Of no use here.
    Other,
}

/// The fields of one structure, with their numbers.
struct Fields(Vec<(i16, Value)>);

impl Fields {
    fn get(&self, id: i16) -> Option<&Value> {
        self.0.iter().find(|(own, _)| *own == id).map(|(_, value)| value)
    }

    fn int(&self, id: i16) -> Result<i64> {
        match self.get(id) {
            Some(Value::Int(value)) => Ok(*value),
            _ => Err(ParquetError::General(format!("a page's header has no field {id}"))),
        }
    }

    fn size(&self, id: i16) -> Result<usize> {
        usize::try_from(self.int(id)?).map_err(|_| torn())
    }

    fn count(&self, id: i16) -> Result<u32> {
        u32::try_from(self.int(id)?).map_err(|_| torn())
    }

    fn truth(&self, id: i16) -> Option<bool> {
        match self.get(id) {
            Some(Value::Truth(value)) => Some(*value),
            _ => None,
        }
    }

    fn inner(&self, id: i16) -> Result<&Fields> {
        match self.get(id) {
            Some(Value::Structure(fields)) => Ok(fields),
            _ => Err(ParquetError::General(format!("a page's header has no structure {id}"))),
        }
    }

    fn encoding(&self, id: i16) -> Result<Encoding> {
        Ok(match self.int(id)? {
            0 => Encoding::PLAIN,
            2 => Encoding::PLAIN_DICTIONARY,
            3 => Encoding::RLE,
            5 => Encoding::DELTA_BINARY_PACKED,
            6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
            7 => Encoding::DELTA_BYTE_ARRAY,
            8 => Encoding::RLE_DICTIONARY,
            9 => Encoding::BYTE_STREAM_SPLIT,
            other => return Err(ParquetError::NYI(format!("encoding {other}"))),
        })
    }
}

/// Thrift's compact protocol.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Headers nest two deep; statistics within them one deeper.
const DEEPEST: usize = 8;

impl Header<'_> {
    fn byte(&mut self) -> Result<u8> {
        let byte = *self.bytes.get(self.at).ok_or_else(torn)?;
        self.at += 1;
        Ok(byte)
    }

    fn varint(&mut self) -> Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(torn())
    }

    /// Signed numbers alternate: 0, −1, 1, −2 …
    fn signed(&mut self) -> Result<i64> {
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn skip(&mut self, count: u64) -> Result<()> {
        let end = usize::try_from(count).ok().and_then(|count| self.at.checked_add(count));
        self.at = end.filter(|end| *end <= self.bytes.len()).ok_or_else(torn)?;
        Ok(())
    }

    fn structure(&mut self, depth: usize) -> Result<Fields> {
        let (mut fields, mut id) = (Vec::new(), 0i16);
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(Fields(fields));
            }
            let step = i16::from(head >> 4);
            id = match step {
                0 => i16::try_from(self.signed()?).map_err(|_| torn())?,
                step => id.checked_add(step).ok_or_else(torn)?,
            };
            let value = match head & 0xf {
                1 => Value::Truth(true),
                2 => Value::Truth(false),
                kind => self.value(kind, depth + 1)?,
            };
            fields.push((id, value));
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> Result<Value> {
        if depth > DEEPEST {
            return Err(torn());
        }
        match kind {
            // In a list a truth is a byte; fields carry theirs in their head.
            1..=3 => self.skip(1)?,
            4..=6 => return Ok(Value::Int(self.signed()?)),
            7 => self.skip(8)?,
            8 => {
                let length = self.varint()?;
                self.skip(length)?;
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                for _ in 0..count {
                    self.value(head & 0xf, depth + 1)?;
                }
            }
            12 => return Ok(Value::Structure(self.structure(depth)?)),
            _ => return Err(torn()),
        }
        Ok(Value::Other)
    }
}
