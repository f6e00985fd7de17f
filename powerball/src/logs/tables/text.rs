//! Logs as CSV with a header line, between whose names stand commas, semicolons, tabs or blanks.

use super::table::Rows;
use super::{Finding, LogError};

/// Hands the lines of a CSV file over; whether the last one is torn. Unreadable lines are named in
/// `findings`.
pub(crate) fn read(
    bytes: &[u8],
    file: &str,
    rows: &mut impl Rows,
    findings: &mut Vec<Finding>,
) -> Result<bool, LogError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let error = |line: Option<usize>, quantity: &str, message: String| Finding {
        file: file.to_string(),
        line,
        quantity: quantity.to_string(),
        message,
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter(bytes))
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let header = reader
        .byte_headers()
        .map_err(|e| LogError(vec![error(Some(1), "header", format!("cannot be read: {e}"))]))?
        .clone();
    let names: Vec<String> = header.iter().map(|h| String::from_utf8_lossy(h).into_owned()).collect();
    rows.begin(&names)?;
    let mut record = csv::ByteRecord::new();
    let mut last_torn = false;
    loop {
        let line = reader.position().line() as usize;
        match reader.read_byte_record(&mut record) {
            Ok(false) => break,
            Ok(true) => {}
            Err(e) => {
                findings.push(error(Some(line), "line", format!("unreadable, left out: {e}")));
                continue;
            }
        }
        let line = record.position().map_or(line, |p| p.line() as usize);
        last_torn = record.len() != names.len();
        rows.row(line, &|k| {
            // A torn line's last number may be cut off too.
            let field = record.get(k).filter(|_| !last_torn)?;
            std::str::from_utf8(field).ok()?.parse().ok()
        });
    }
    Ok(last_torn)
}

/// What stands between the names of the first line: names may hold blanks where commas or the like are there.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes.split(|b| *b == b'\n').next().unwrap_or_default().trim_ascii();
    *b",;\t ".iter().find(|delimiter| header.contains(delimiter)).unwrap_or(&b',')
}
