//! Times that are written as dates: ISO 8601 and RFC 3339, `2024-05-01T12:00:00.005+02:00` or
//! `2024-05-01 12:00:00.005`.

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::Offset;

/// The time of a date, s since 1970 in UTC; one without a zone is taken to be in UTC.
pub(crate) fn seconds(text: &str) -> Option<f64> {
    // Most of what is not a number is no date either.
    if text.len() < "2024-5-1".len() || !text.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let zoned = || text.parse::<Timestamp>().ok();
    let plain = || Offset::UTC.to_timestamp(text.parse::<DateTime>().ok()?).ok();
    let time = zoned().or_else(plain)?;
    Some(time.as_second() as f64 + 1e-9 * f64::from(time.subsec_nanosecond()))
}

#[cfg(test)]
mod tests {
    use super::seconds;

    /// Times by `date -u -d TEXT +%s.%N`.
    #[test]
    fn dates_of_all_forms_are_seconds() {
        for (text, wanted) in [
            ("2024-05-01T12:00:00.005Z", 1_714_564_800.005),
            ("2024-05-01T14:00:00.005+02:00", 1_714_564_800.005),
            ("2024-05-01 14:00:00.005+0200", 1_714_564_800.005),
            ("2024-05-01 12:00:00.005", 1_714_564_800.005),
            ("2024-05-01 12:00:00,005", 1_714_564_800.005),
            ("2024-05-01T12:00:00", 1_714_564_800.0),
            ("20240501T120000Z", 1_714_564_800.0),
            ("2024-02-29", 1_709_164_800.0),
            ("1969-12-31T23:59:59.75Z", -0.25),
        ] {
            assert_eq!(seconds(text), Some(wanted), "{text}");
        }
        for text in ["2024-02-30 12:00:00", "2024", "12:00:00", "joint 1 of 2024-05-01", ""] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }
}
