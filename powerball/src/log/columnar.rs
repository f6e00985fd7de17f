//! The same columns in Parquet.

use super::{Finding, Log, LogError};
use dyngen::Arm;

/// Reads a log from the bytes of a Parquet file. Rows take the place of lines in findings.
#[cfg(feature = "parquet")]
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    use super::read::{Columns, Samples};
    use parquet::file::reader::{FileReader, SerializedFileReader};

    let unreadable = |row: Option<usize>, e: &dyn std::fmt::Display| {
        LogError(vec![Finding {
            file: file.to_string(),
            line: row,
            quantity: "Parquet".into(),
            message: format!("cannot be read: {e}; write the log again, or as CSV"),
        }])
    };
    let reader =
        SerializedFileReader::new(bytes::Bytes::copy_from_slice(bytes)).map_err(|e| unreadable(None, &e))?;
    let schema = reader.metadata().file_metadata().schema();
    let names: Vec<String> = schema.get_fields().iter().map(|field| field.name().to_string()).collect();
    let mut samples = Samples::new(Columns::find(&names, arm, file, findings)?, arm);
    let rows = reader.get_row_iter(None).map_err(|e| unreadable(None, &e))?;
    for (k, row) in rows.enumerate() {
        let row = row.map_err(|e| unreadable(Some(k + 1), &e))?;
        let values: Vec<Option<f64>> = row.get_column_iter().map(|(_, field)| number(field)).collect();
        samples.take(k + 1, &names, |column| values.get(column).copied().flatten());
    }
    samples.finish(file, arm, findings)
}

/// Reads a log from the bytes of a Parquet file.
#[cfg(not(feature = "parquet"))]
pub(super) fn parse(_: &[u8], file: &str, _: &Arm, _: &mut Vec<Finding>) -> Result<Log, LogError> {
    Err(LogError(vec![Finding {
        file: file.to_string(),
        line: None,
        quantity: "Parquet".into(),
        message: "this build reads CSV alone: enable the feature `parquet`".into(),
    }]))
}

#[cfg(feature = "parquet")]
fn number(field: &parquet::record::Field) -> Option<f64> {
    use parquet::record::Field;
    match *field {
        Field::Double(x) => Some(x),
        Field::Float(x) => Some(f64::from(x)),
        Field::Int(x) => Some(f64::from(x)),
        Field::UInt(x) => Some(f64::from(x)),
        Field::Long(x) => Some(x as f64),
        Field::ULong(x) => Some(x as f64),
        Field::Short(x) => Some(f64::from(x)),
        Field::UShort(x) => Some(f64::from(x)),
        Field::Byte(x) => Some(f64::from(x)),
        Field::UByte(x) => Some(f64::from(x)),
        _ => None,
    }
}
