//! The same columns in Parquet. A list of k numbers is k columns.

#[cfg(feature = "parquet")]
use super::lists::Flattened;
use super::table::RowSink;
use super::{Finding, LogError};
#[cfg(feature = "parquet")]
use std::path::Path;

/// Hands the rows of a Parquet file over. They take the place of lines in findings.
#[cfg(feature = "parquet")]
pub(crate) fn read(bytes: &[u8], file: &str, rows: &mut impl RowSink) -> Result<(), LogError> {
    use super::zstd_pages::RowGroup;
    use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};

    let unreadable = |row: Option<usize>, e: &dyn std::fmt::Display| {
        LogError(vec![Finding {
            file: file.to_string(),
            line: row,
            quantity: "Parquet".into(),
            message: format!("cannot be read: {e}; write the log again, or as CSV"),
        }])
    };
    let bytes = bytes::Bytes::copy_from_slice(bytes);
    let reader = SerializedFileReader::new(bytes.clone()).map_err(|e| unreadable(None, &e))?;
    let schema = reader.metadata().file_metadata().schema();
    let names: Vec<String> = schema.get_fields().iter().map(|field| field.name().to_string()).collect();
    let mut flattened: Option<Flattened> = None;
    let mut count = 0;
    for group in 0..reader.num_row_groups() {
        let inner = reader.get_row_group(group).map_err(|e| unreadable(Some(count + 1), &e))?;
        let group = RowGroup::new(inner, &bytes).map_err(|e| unreadable(Some(count + 1), &e))?;
        for row in group.get_row_iter(None).map_err(|e| unreadable(Some(count + 1), &e))? {
            count += 1;
            let row = row.map_err(|e| unreadable(Some(count), &e))?;
            let flattened = match &mut flattened {
                Some(flattened) => flattened,
                None => {
                    let first = flattened.insert(Flattened::of(&names, &row, Path::new(file)));
                    rows.begin(first.names())?;
                    first
                }
            };
            let values = flattened.values(&row);
            rows.row(count, &|column| values.get(column).copied().flatten());
        }
    }
    if flattened.is_none() {
        rows.begin(&names)?;
    }
    Ok(())
}

/// Hands the rows of a Parquet file over.
#[cfg(not(feature = "parquet"))]
pub(crate) fn read(_: &[u8], file: &str, _: &mut impl RowSink) -> Result<(), LogError> {
    Err(LogError(vec![Finding {
        file: file.to_string(),
        line: None,
        quantity: "Parquet".into(),
        message: "this build reads CSV alone: enable the feature `parquet`".into(),
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
    Err(std::io::Error::other("this build writes CSV alone: enable the feature `parquet`"))
}
