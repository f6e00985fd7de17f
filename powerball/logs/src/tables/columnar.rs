//! Columns of a log in Parquet. A list of k numbers is k columns; the fields of a struct are columns too.

#[cfg(feature = "parquet")]
use super::lerobot::Dataset;
#[cfg(feature = "parquet")]
use super::memory::{Memory, few_columns};
#[cfg(feature = "parquet")]
use super::numbers::{leaves, numbers, width};
use super::table::RowSink;
use super::{Finding, LogError};
#[cfg(feature = "parquet")]
use arrow_array::RecordBatch;
#[cfg(feature = "parquet")]
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
#[cfg(feature = "parquet")]
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
#[cfg(feature = "parquet")]
use parquet::file::reader::ChunkReader;
#[cfg(feature = "parquet")]
use parquet::schema::types::ColumnDescPtr;

/// A file that claims more rows does not have them.
#[cfg(feature = "parquet")]
const ROWS_A_BYTE: u64 = 64;
/// Rows that are in memory at a time.
#[cfg(feature = "parquet")]
const ROWS: usize = 8192;
/// Like [`ROWS`], for rows that hold texts or pictures.
#[cfg(feature = "parquet")]
const ROWS_OF_TEXTS: usize = 256;

/// Hands the rows of a Parquet file over, which stays on the disk. They take the place of lines in findings.
#[cfg(feature = "parquet")]
pub(crate) fn read(
    input: impl ChunkReader + 'static,
    file: &str,
    rows: &mut impl RowSink,
) -> Result<(), LogError> {
    let mut reader = Rows::new(rows);
    reader.read(input, file)?;
    reader.finish().map(|_| ())
}

/// The rows of one file or of several with the same columns, one after the other.
#[cfg(feature = "parquet")]
pub(super) struct Rows<'s, S> {
    sink: &'s mut S,
    count: usize,
    /// By the first rows.
    known: Option<Known>,
    /// Rows of the file that is read.
    expected: usize,
    /// Rows that it says are still to come.
    claimed: usize,
    memory: Memory,
    /// The columns of a file without rows.
    fields: Vec<String>,
}

/// The columns: how many numbers each one is, and the dataset that they are part of.
#[cfg(feature = "parquet")]
struct Known {
    columns: Vec<(String, usize)>,
    dataset: Dataset,
}

#[cfg(feature = "parquet")]
impl<'s, S: RowSink> Rows<'s, S> {
    pub(super) fn new(sink: &'s mut S) -> Self {
        let memory = Memory::of_a_log();
        Rows { sink, count: 0, known: None, expected: 0, claimed: 0, memory, fields: Vec::new() }
    }

    /// Hands the rows of a file over.
    pub(super) fn read(&mut self, input: impl ChunkReader + 'static, file: &str) -> Result<(), LogError> {
        let unreadable = |row: Option<usize>, e: &dyn std::fmt::Display| {
            LogError(vec![Finding {
                file: file.to_string(),
                line: row,
                quantity: "Parquet".into(),
                message: format!("cannot be read: {e}; write the log again, or as CSV"),
            }])
        };
        let length = input.len();
        // Arrow's notes on its own types, in addition to those of Parquet, add nothing about numbers.
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let builder = guarded(|| ParquetRecordBatchReaderBuilder::try_new_with_options(input, options))
            .map_err(|e| unreadable(None, &e))?;
        within(builder.metadata(), length).map_err(|e| unreadable(None, &e))?;
        self.fields = builder.schema().fields().iter().map(|field| field.name().clone()).collect();
        let refused = |reason: String| LogError::of_file(file, "Parquet", reason);
        few_columns(builder.parquet_schema().num_columns()).map_err(refused)?;
        self.memory.holds(lists(builder.metadata())).map_err(refused)?;
        let rows = u64::try_from(builder.metadata().file_metadata().num_rows()).unwrap_or(0);
        self.claimed = usize::try_from(rows).unwrap_or(usize::MAX);
        self.expected = usize::try_from(rows.min(length.saturating_mul(ROWS_A_BYTE))).unwrap_or(0);
        let texts = builder.parquet_schema().columns().iter().any(has_texts);
        let batch = if texts { ROWS_OF_TEXTS } else { ROWS };
        let mut reader =
            guarded(|| builder.with_batch_size(batch).build()).map_err(|e| unreadable(None, &e))?;
        let before = self.count;
        loop {
            let row = Some(self.count - before + 1);
            let next = guarded(|| reader.next().transpose()).map_err(|e| unreadable(row, &e))?;
            let Some(batch) = next else { return Ok(()) };
            self.batch(&batch, file)?;
        }
    }

    fn batch(&mut self, batch: &RecordBatch, file: &str) -> Result<(), LogError> {
        let columns = leaves(batch);
        let known = match &mut self.known {
            Some(known) => known,
            None => {
                let widths: Vec<Option<usize>> = columns.iter().map(|(_, array)| width(array)).collect();
                let named = columns.iter().zip(&widths).map(|((name, _), width)| (name.as_str(), *width));
                let count = columns.len() + widths.iter().flatten().sum::<usize>();
                few_columns(count).map_err(|reason| LogError::of_file(file, "Parquet", reason))?;
                let (names, dataset) = Dataset::of(std::path::Path::new(file), named);
                self.sink.begin(&names)?;
                self.sink.expect(self.expected);
                let columns =
                    columns.iter().zip(&widths).map(|((name, _), w)| (name.clone(), w.unwrap_or(1)));
                self.known.insert(Known { columns: columns.collect(), dataset })
            }
        };
        let rows = self.count.saturating_add(self.claimed.max(batch.num_rows()));
        let held = self.memory.holds_rows(rows, self.sink.kept());
        held.map_err(|reason| LogError::of_file(file, "Parquet", reason))?;
        self.claimed = self.claimed.saturating_sub(batch.num_rows());
        if !columns.iter().map(|(name, _)| name).eq(known.columns.iter().map(|(name, _)| name)) {
            return Err(LogError::of_file(file, "Parquet", "has other columns than the files before it"));
        }
        let widths = known.columns.iter().map(|(_, width)| *width);
        let mut values: Vec<Vec<f64>> =
            columns.iter().zip(widths).flat_map(|((_, array), width)| numbers(array, width)).collect();
        known.dataset.follow(&mut values);
        for k in 0..batch.num_rows() {
            self.count += 1;
            let value = |column: usize| values.get(column)?.get(k).copied().filter(|value| !value.is_nan());
            self.sink.row(self.count, &value);
        }
        Ok(())
    }

    /// Ends them; the number of episodes.
    pub(super) fn finish(self) -> Result<usize, LogError> {
        match self.known {
            Some(known) => Ok(known.dataset.episodes),
            None => self.sink.begin(&self.fields).map(|()| 0),
        }
    }
}

/// A step of the library's, which panics at some of what is damaged within a page: that is an error like any
/// other, and prints nothing.
#[cfg(feature = "parquet")]
fn guarded<T, E: std::fmt::Display>(step: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    use std::cell::Cell;
    use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
    use std::sync::Once;
    thread_local! {
        static GUARDED: Cell<bool> = const { Cell::new(false) };
    }
    static HOOK: Once = Once::new();
    // Panics anywhere else go the way that they went before.
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                before(panic)
            }
        }));
    });
    GUARDED.set(true);
    let done = catch_unwind(AssertUnwindSafe(step));
    GUARDED.set(false);
    match done {
        Ok(done) => done.map_err(|e| e.to_string()),
        Err(_) => Err("a page is damaged".into()),
    }
}

/// Whether all columns lie within the file: `parquet` panics where one lies before it.
#[cfg(feature = "parquet")]
fn within(metadata: &ParquetMetaData, length: u64) -> Result<(), &'static str> {
    let mut columns = metadata.row_groups().iter().flat_map(|group| group.columns());
    let within = columns.all(|column| {
        let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
        let (start, size) = (u64::try_from(start), u64::try_from(column.compressed_size()));
        start
            .ok()
            .zip(size.ok())
            .and_then(|(start, size)| start.checked_add(size))
            .is_some_and(|end| end <= length)
    });
    if within { Ok(()) } else { Err("a column lies outside of the file, which is torn") }
}

/// Whether a column holds texts or other bytes, each of them of any length.
#[cfg(feature = "parquet")]
fn has_texts(column: &ColumnDescPtr) -> bool {
    column.physical_type() == parquet::basic::Type::BYTE_ARRAY
}

/// Bytes of the numbers in lists that one row group may bring at once: a single row can have them all.
#[cfg(feature = "parquet")]
fn lists(metadata: &ParquetMetaData) -> u64 {
    let of = |column: &ColumnChunkMetaData| match column.column_descr().max_rep_level() {
        0 => 0,
        _ => u64::try_from(column.num_values()).unwrap_or(0).saturating_mul(8),
    };
    let groups = metadata.row_groups().iter();
    groups.map(|group| group.columns().iter().map(of).fold(0, u64::saturating_add)).max().unwrap_or(0)
}

/// Hands the rows of a Parquet file over.
#[cfg(not(feature = "parquet"))]
pub(crate) fn read(_: std::fs::File, file: &str, _: &mut impl RowSink) -> Result<(), LogError> {
    Err(LogError(vec![Finding {
        file: file.to_string(),
        line: None,
        quantity: "Parquet".into(),
        message: super::NOT_READ.into(),
    }]))
}

/// Rows of a row group.
#[cfg(feature = "parquet")]
const GROUP: usize = 65_536;

/// CSV lines of numbers as Parquet columns of doubles, a row group at a time; the number of rows. Lines that
/// are torn or hold anything else are left out.
#[cfg(feature = "parquet")]
pub(crate) fn from_csv(csv: impl std::io::Read, out: impl std::io::Write + Send) -> std::io::Result<usize> {
    use parquet::data_type::DoubleType;
    use parquet::errors::ParquetError;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;
    use std::io::Error;
    use std::sync::Arc;

    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(csv);
    let names: Vec<String> = reader.headers()?.iter().map(str::to_string).collect();
    let column = |name: &String| {
        let double = Type::primitive_type_builder(name, parquet::basic::Type::DOUBLE);
        double.with_repetition(parquet::basic::Repetition::REQUIRED).build().map(Arc::new)
    };
    let schema = names
        .iter()
        .map(column)
        .collect::<Result<Vec<_>, _>>()
        .and_then(|fields| Type::group_type_builder("log").with_fields(fields).build());
    let properties = WriterProperties::builder().set_compression(parquet::basic::Compression::SNAPPY).build();
    let mut writer = schema
        .and_then(|schema| SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)))
        .map_err(Error::other)?;
    let mut write = |columns: &mut [Vec<f64>]| -> Result<(), ParquetError> {
        let mut group = writer.next_row_group()?;
        for values in columns {
            if let Some(mut column) = group.next_column()? {
                column.typed::<DoubleType>().write_batch(values, None, None)?;
                column.close()?;
            }
            values.clear();
        }
        group.close().map(|_| ())
    };
    let (mut columns, mut rows) = (vec![Vec::new(); names.len()], 0);
    for record in reader.records() {
        let Ok(record) = record else { continue };
        let values: Vec<f64> = record.iter().filter_map(|cell| cell.parse().ok()).collect();
        if values.len() != names.len() || record.len() != names.len() {
            continue;
        }
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        rows += 1;
        if rows % GROUP == 0 {
            write(&mut columns).map_err(Error::other)?;
        }
    }
    if rows % GROUP != 0 {
        write(&mut columns).map_err(Error::other)?;
    }
    writer.close().map_err(Error::other)?;
    Ok(rows)
}

/// CSV lines as Parquet columns.
#[cfg(not(feature = "parquet"))]
pub(crate) fn from_csv(_: impl std::io::Read, _: impl std::io::Write + Send) -> std::io::Result<usize> {
    Err(std::io::Error::other(super::NOT_WRITTEN))
}
