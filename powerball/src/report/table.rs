//! Tables.

use super::escape;
use std::fmt::Write as _;

/// A table: a header line and rows of text. Cells that read as numbers are set flush right.
#[derive(Clone, Debug, Default)]
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these column titles.
    pub fn new<T: Into<String>>(header: impl IntoIterator<Item = T>) -> Self {
        Table { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// The table with one more row; short rows end in empty cells.
    #[must_use]
    pub fn row<T: Into<String>>(mut self, cells: impl IntoIterator<Item = T>) -> Self {
        self.push(cells);
        self
    }

    /// Adds a row.
    pub fn push<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table as HTML.
    pub(super) fn to_html(&self) -> String {
        let mut out = String::from("<div class=\"table\"><table><thead><tr>");
        let numeric: Vec<bool> = (0..self.header.len())
            .map(|c| {
                !self.rows.is_empty() && self.rows.iter().all(|r| r.get(c).is_none_or(|t| is_numeric(t)))
            })
            .collect();
        let class = |column: usize| if numeric.get(column) == Some(&true) { " class=\"n\"" } else { "" };
        for (c, title) in self.header.iter().enumerate() {
            let _ = write!(out, "<th scope=\"col\"{}>{}</th>", class(c), escape(title));
        }
        out.push_str("</tr></thead><tbody>\n");
        for row in &self.rows {
            out.push_str("<tr>");
            for c in 0..self.header.len() {
                let text = row.get(c).map_or("", String::as_str);
                let _ = write!(out, "<td{}>{}</td>", class(c), escape(text));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</tbody></table></div>\n");
        out
    }
}

/// Whether a cell reads as a number, perhaps with a percent sign, or is empty.
fn is_numeric(text: &str) -> bool {
    let plain = text.trim().replace('\u{2212}', "-");
    let plain = plain.trim_end_matches('%').trim();
    plain.is_empty() || plain == "–" || plain.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_numbers_are_flush_right_and_short_rows_are_filled() {
        let html = Table::new(["name", "value"]).row(["a", "−1.5"]).row(["b", "12 %"]).row(["c"]).to_html();
        assert_eq!(html.matches("<td class=\"n\">").count(), 3);
        assert_eq!(html.matches("<td>").count(), 3);
    }
}
