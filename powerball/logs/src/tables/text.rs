//! Logs as CSV with a header line, between whose names stand commas, semicolons, tabs or blanks. Where no
//! commas stand there, numbers may have decimal commas. Times may be dates.

use super::memory::{Memory, few_columns};
use super::table::RowSink;
use super::{Finding, LogError};
use std::cell::Cell;
use std::io::{self, BufReader, Read};

/// The first bytes of this number show whether a file is text.
pub(super) const HEAD: usize = 4096;

/// The names of the columns are within this many bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// The first bytes of files that are not logs, and the kind of each.
const OTHERS: [(&[u8], &str); 7] = [
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"%PDF", "a PDF"),
    (b"\x1f\x8b", "compressed by gzip: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it first"),
    (b"\x7fELF", "a program"),
    (b"version https://git-lfs", "what Git leaves in place of a large file: fetch it by git lfs pull"),
];

/// Why a file that begins so is not text: in words, after its name.
pub(super) fn no_text(head: &[u8]) -> Option<String> {
    if head.trim_ascii().is_empty() {
        return Some("is empty".to_string());
    }
    if let Some((_, what)) = OTHERS.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(format!("is no log: it is {what}"));
    }
    if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
        return Some("is text of two bytes a letter (UTF-16): save it as UTF-8".to_string());
    }
    let is_control = |byte: &u8| matches!(byte, 0..=8 | 14..=31 | 127);
    head.iter().any(is_control).then(|| {
        "is no log: it holds bytes that are no text, and begins like no Parquet, MCAP, bag, npz, mat or \
        HDF5"
            .to_string()
    })
}

/// A number, or the time of a date in s.
pub fn number(text: &str) -> Option<f64> {
    let date = || {
        #[cfg(feature = "dates")]
        return super::dates::seconds(text);
        #[cfg(not(feature = "dates"))]
        None
    };
    text.parse().ok().or_else(date)
}

/// Hands the lines of a CSV file over, which stays on the disk; whether the last one is torn. Unreadable
/// lines are named in `findings`.
pub(crate) fn read(
    mut input: impl Read,
    file: &str,
    rows: &mut impl RowSink,
    findings: &mut Vec<Finding>,
) -> Result<bool, LogError> {
    let mut head = Vec::new();
    (&mut input)
        .take(LONGEST_HEADER)
        .read_to_end(&mut head)
        .map_err(|e| LogError::of_file(file, "file", format!("cannot be read: {e}")))?;
    if let Some(what) = no_text(&head[..head.len().min(HEAD)]) {
        return Err(LogError::of_file(file, "file", what));
    }
    let bytes = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&head);
    let delimiter = delimiter(bytes);
    let error = |line: Option<usize>, quantity: &str, message: String| Finding {
        file: file.to_string(),
        line,
        quantity: quantity.to_string(),
        message,
    };
    let mut reader =
        csv::ReaderBuilder::new().delimiter(delimiter).flexible(true).trim(csv::Trim::All).from_reader(
            match delimiter {
                b' ' => Box::new(SingleBlanks::new(bytes.chain(input))) as Box<dyn Read>,
                _ => Box::new(bytes.chain(input)),
            },
        );
    let header = reader
        .byte_headers()
        .map_err(|e| LogError(vec![error(Some(1), "header", format!("cannot be read: {e}"))]))?
        .clone();
    let names: Vec<String> = header.iter().map(|h| String::from_utf8_lossy(h).into_owned()).collect();
    few_columns(names.len()).map_err(|reason| LogError(vec![error(Some(1), "header", reason)]))?;
    rows.begin(&names)?;
    let (memory, kept, mut count) = (Memory::of_a_log(), rows.kept(), 0);
    let mut record = csv::ByteRecord::new();
    let mut last_torn = false;
    let decimal_commas = Cell::new(false);
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
        count += 1;
        memory
            .holds_rows(count, kept)
            .map_err(|reason| LogError(vec![error(Some(line), "memory", reason)]))?;
        if delimiter == b',' && names.len() > 1 && record.len() == 2 * names.len() {
            let message = format!(
                "has {} fields where the header names {} columns: decimal commas between commas; separate \
                 the fields by semicolons",
                record.len(),
                names.len()
            );
            return Err(LogError(vec![error(Some(line), "line", message)]));
        }
        rows.row(line, &|k| {
            // A torn line's last number may be cut off too.
            let field = record.get(k).filter(|_| !last_torn)?;
            let text = std::str::from_utf8(field).ok()?;
            number(text).or_else(|| {
                let value = text.replacen(',', ".", 1).parse().ok()?;
                decimal_commas.set(true);
                Some(value)
            })
        });
    }
    if decimal_commas.get() {
        findings.push(error(None, "numbers", "have decimal commas, and are read as such".to_string()));
    }
    Ok(last_torn)
}

/// A table of aligned columns as one with a single blank between fields, and none at either end of a line.
struct SingleBlanks<R> {
    bytes: io::Bytes<BufReader<R>>,
    /// Whether the last byte ended a line.
    begins: bool,
    /// The byte after a blank that was handed over.
    next: Option<u8>,
}

impl<R: Read> SingleBlanks<R> {
    fn new(input: R) -> SingleBlanks<R> {
        SingleBlanks { bytes: BufReader::new(input).bytes(), begins: true, next: None }
    }

    fn byte(&mut self) -> io::Result<Option<u8>> {
        if let Some(byte) = self.next.take() {
            return Ok(Some(byte));
        }
        let mut blank = false;
        loop {
            let Some(byte) = self.bytes.next().transpose()? else { return Ok(None) };
            if byte == b' ' {
                blank = true;
                continue;
            }
            let between = blank && !self.begins && !matches!(byte, b'\r' | b'\n');
            self.begins = byte == b'\n';
            if between {
                self.next = Some(byte);
                return Ok(Some(b' '));
            }
            return Ok(Some(byte));
        }
    }
}

impl<R: Read> Read for SingleBlanks<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        for (count, place) in buffer.iter_mut().enumerate() {
            match self.byte()? {
                Some(byte) => *place = byte,
                None => return Ok(count),
            }
        }
        Ok(buffer.len())
    }
}

/// The delimiter of the names in the first line: names may hold blanks if there are commas or other
/// delimiters.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes.split(|b| *b == b'\n').next().unwrap_or_default().trim_ascii();
    *b",;\t ".iter().find(|delimiter| header.contains(delimiter)).unwrap_or(&b',')
}
