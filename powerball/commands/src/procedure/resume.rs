//! The files that a step of the procedure left on disk, so that an interrupted step continues.

use std::fs::OpenOptions;
use std::io;
use std::path::Path;

/// The whole rows of a log that a step writes: lines with as many numbers as the header has names. What a
/// program that died did not finish is left out; a log that is not there has no rows.
#[must_use]
pub fn rows(path: &Path) -> Vec<Vec<f64>> {
    let Ok(text) = std::fs::read_to_string(path) else { return Vec::new() };
    let columns = text.lines().next().map_or(0, |header| header.split(',').count());
    let whole = |row: &Vec<f64>| row.len() == columns;
    text.split_inclusive('\n').skip(1).filter_map(row).filter(whole).collect()
}

/// The numbers of a line, where it is whole and there is nothing else in it.
#[must_use]
pub fn row(line: &str) -> Option<Vec<f64>> {
    line.strip_suffix('\n')?.split(',').map(|x| x.parse().ok()).collect()
}

/// The time of the last whole row, s.
#[must_use]
pub fn last_time(path: &Path) -> Option<f64> {
    rows(path).last().and_then(|row| row.first().copied())
}

/// How long ago a log was last written, s.
#[must_use]
pub fn silence(path: &Path) -> Option<f64> {
    let written = std::fs::metadata(path).ok()?.modified().ok()?;
    Some(written.elapsed().map_or(0.0, |time| time.as_secs_f64()))
}

/// Opens a log to continue it: an incomplete last line is removed.
///
/// # Errors
/// Errors of the file system.
pub fn append(path: &Path) -> io::Result<std::fs::File> {
    let text = std::fs::read(path)?;
    let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let file = OpenOptions::new().append(true).open(path)?;
    file.set_len(whole as u64)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_torn_log_goes_on_after_its_last_whole_line() {
        let path = std::env::temp_dir().join(format!("powerball_resume_{}.csv", std::process::id()));
        assert!(rows(&path).is_empty() && append(&path).is_err() && silence(&path).is_none());
        std::fs::write(&path, "t,q1,tau1\n0.0,1,2\n0.005,1,x\n0.01,1,3\n0.015,1,4").unwrap();
        assert_eq!(rows(&path), [[0.0, 1.0, 2.0], [0.01, 1.0, 3.0]]);
        assert_eq!(last_time(&path), Some(0.01));
        append(&path).unwrap().write_all(b"0.015,5,6\n").unwrap();
        assert_eq!(rows(&path).last().unwrap(), &[0.015, 5.0, 6.0]);
        assert!(silence(&path).unwrap() < 60.0);
        std::fs::remove_file(&path).unwrap();
    }
}
