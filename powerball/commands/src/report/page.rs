//! The page: a sequence of headings, paragraphs, notes, tables and figures.
//!
//! The module also has tables.

use super::{BarPairs, Figure, MADE_BY, escape, live};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

/// What stands at the foot of every page.
static SIGNATURE: OnceLock<String> = OnceLock::new();

/// Puts a line below every page that this process makes from now on: the program that made it, how and when.
/// A program sets it once; without it, pages have no such line.
pub fn sign(text: impl Into<String>) {
    let _ = SIGNATURE.set(text.into());
}

/// How a note is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Something to know.
    Plain,
    /// A good result.
    Good,
    /// A result to be careful with, or a bad one.
    Bad,
}

/// A page under construction. All text is escaped.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    body: String,
    /// Whether it has figures that a script can make charts of.
    live: bool,
}

impl Page {
    /// An empty page with a title.
    pub fn new(title: impl Into<String>) -> Self {
        Page { title: title.into(), body: String::new(), live: false }
    }

    /// The sentence below the title.
    pub fn lead(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p class=\"lead\">{}</p>", escape(text));
    }

    /// A heading of a section.
    pub fn heading(&mut self, text: &str) {
        let _ = writeln!(self.body, "<h2>{}</h2>", escape(text));
    }

    /// A heading within a section.
    pub fn subheading(&mut self, text: &str) {
        let _ = writeln!(self.body, "<h3>{}</h3>", escape(text));
    }

    /// A paragraph of text.
    pub fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escape(text));
    }

    /// A paragraph that stands out.
    pub fn note(&mut self, tone: Tone, text: &str) {
        let class = match tone {
            Tone::Plain => "note",
            Tone::Good => "note good",
            Tone::Bad => "note bad",
        };
        let _ = writeln!(self.body, "<p class=\"{class}\">{}</p>", escape(text));
    }

    /// A few figures that matter, each a label and a value.
    pub fn facts<L: AsRef<str>, V: AsRef<str>>(&mut self, facts: impl IntoIterator<Item = (L, V)>) {
        self.body.push_str("<dl class=\"facts\">");
        for (label, value) in facts {
            let (label, value) = (escape(label.as_ref()), escape(value.as_ref()));
            let _ = write!(self.body, "<div><dt>{label}</dt><dd>{value}</dd></div>");
        }
        self.body.push_str("</dl>\n");
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        self.body.push_str(&table.to_html());
    }

    /// Explanations of the words of a page, behind a line of text that opens them; printed pages show them.
    pub fn words(&mut self, words: &[(&str, &str)]) {
        self.body
            .push_str("<details class=\"words\"><summary>What the words of this page mean</summary><dl>");
        for (word, meaning) in words {
            let _ = write!(self.body, "<dt>{}</dt><dd>{}</dd>", escape(word), escape(meaning));
        }
        self.body.push_str("</dl></details>\n");
    }

    /// A table behind a line of text that opens it; printed pages show it.
    pub fn folded(&mut self, summary: &str, table: &Table) {
        let _ = writeln!(
            self.body,
            "<details><summary>{}</summary>{}</details>",
            escape(summary),
            table.to_html()
        );
    }

    /// A line or scatter figure with its caption.
    pub fn figure(&mut self, figure: &Figure, caption: &str) {
        self.captioned("", &(figure.to_svg() + &live::samples(figure)), caption);
        self.live = true;
    }

    /// A bar figure with its caption.
    pub fn bars(&mut self, bars: &BarPairs, caption: &str) {
        self.captioned(" class=\"bars\"", &bars.to_svg(), caption);
    }

    fn captioned(&mut self, class: &str, svg: &str, caption: &str) {
        let _ = write!(self.body, "<figure{class}>");
        self.body.push_str(svg);
        if !caption.is_empty() {
            let _ = write!(self.body, "<figcaption>{}</figcaption>", escape(caption));
        }
        self.body.push_str("</figure>\n");
    }

    /// The whole page.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        let foot =
            SIGNATURE.get().map_or(String::new(), |text| format!("<footer>{}</footer>\n", escape(text)));
        let (mut style, mut scripts) = (super::STYLE.to_string(), String::new());
        if self.live {
            style.insert_str(0, live::STYLE);
            scripts = format!("<!-- uPlot:\n{}-->\n", live::LICENCE);
            live::SCRIPTS.iter().for_each(|script| scripts += &format!("<script>{script}</script>\n"));
        }
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             {MADE_BY}<meta name=\"color-scheme\" content=\"light dark\"><title>{title}</title>\n\
             <style>\n{style}</style></head>\n<body><main>\n<h1>{title}</h1>\n{}{foot}</main>\n{scripts}</body></html>\n",
            self.body
        )
    }

    /// Writes the page to a file.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        std::fs::write(path, self.to_html())
    }
}

// Tables.

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

    /// The table as HTML, without columns of which no row says anything.
    pub(super) fn to_html(&self) -> String {
        let mut out = String::from("<div class=\"table\"><table><thead><tr>");
        let says = |c: &usize| {
            self.rows.is_empty() || self.rows.iter().any(|r| r.get(*c).is_some_and(|t| !t.is_empty()))
        };
        let columns: Vec<usize> = (0..self.header.len()).filter(says).collect();
        let numeric: Vec<bool> = (0..self.header.len())
            .map(|c| {
                !self.rows.is_empty() && self.rows.iter().all(|r| r.get(c).is_none_or(|t| is_numeric(t)))
            })
            .collect();
        let class = |column: usize| if numeric.get(column) == Some(&true) { " class=\"n\"" } else { "" };
        for c in columns.iter().copied() {
            let _ = write!(out, "<th scope=\"col\"{}>{}</th>", class(c), escape(&self.header[c]));
        }
        out.push_str("</tr></thead><tbody>\n");
        for row in &self.rows {
            out.push_str("<tr>");
            for c in columns.iter().copied() {
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
mod table_tests {
    use super::*;

    #[test]
    fn columns_of_numbers_are_flush_right_and_short_rows_are_filled() {
        let html = Table::new(["name", "value"]).row(["a", "−1.5"]).row(["b", "12 %"]).row(["c"]).to_html();
        assert_eq!(html.matches("<td class=\"n\">").count(), 3);
        assert_eq!(html.matches("<td>").count(), 3);
        let html = Table::new(["name", "logs"]).row(["a", ""]).row(["b", ""]).to_html();
        assert!(!html.contains("logs") && html.matches("<td").count() == 2, "{html}");
    }
}
