//! Logs as CSV with a header line.

use super::columns::Columns;
use super::samples::Samples;
use super::{Finding, Log, LogError};
use dyngen::Arm;

/// Reads a log from the bytes of a CSV file.
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let error = |line: Option<usize>, quantity: &str, message: String| Finding {
        file: file.to_string(),
        line,
        quantity: quantity.to_string(),
        message,
    };
    let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let header = reader
        .byte_headers()
        .map_err(|e| LogError(vec![error(Some(1), "header", format!("cannot be read: {e}"))]))?
        .clone();
    let names: Vec<String> = header.iter().map(|h| String::from_utf8_lossy(h).into_owned()).collect();
    let mut samples = Samples::new(Columns::find(&names, arm, file, findings)?, arm, "line");
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
        samples.take(line, &names, |k| {
            // A torn line's last number may be cut off too.
            let field = record.get(k).filter(|_| !last_torn)?;
            std::str::from_utf8(field).ok()?.parse().ok()
        });
    }
    if last_torn && samples.total > 0 {
        let message =
            "the last line is torn (fewer or more fields than the header); it was left out".to_string();
        findings.push(error(None, "last line", message));
        samples.bad -= 1;
    }
    samples.finish(file, arm, findings)
}
