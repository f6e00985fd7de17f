//! Errors of an input with their positions: every error of a file at once.

use std::fmt;
use std::ops::Range;

/// One error of an input file: its position, its description, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The file's name as the caller gave it.
    pub file: String,
    /// Line, from 1. 0 where the whole file is meant.
    pub line: usize,
    /// Column in characters, from 1. 0 where the whole file is meant.
    pub column: usize,
    /// The quantity, what is wrong with it, and what would be right.
    pub message: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line == 0 {
            write!(f, "{}: {}", self.file, self.message)
        } else {
            write!(f, "{}:{}:{}: {}", self.file, self.line, self.column, self.message)
        }
    }
}

/// All that is wrong with an input, in the order of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostics {
    /// A single error about a file as a whole.
    pub fn whole_file(file: impl Into<String>, message: impl Into<String>) -> Self {
        Diagnostics(vec![Diagnostic { file: file.into(), line: 0, column: 0, message: message.into() }])
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, d) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{d}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

/// Whether a letter invisibly reverses the text around it or ends its line: a name with one is shown
/// differently from its text ("Trojan Source"), and compilers refuse it.
pub fn is_unseen(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The message about an invisible letter or a control character in a text.
pub(crate) fn unseen(c: char) -> String {
    let what = if is_unseen(c) { "which turns or breaks the text around it" } else { "a control character" };
    format!("U+{:04X}, {what}: remove it", u32::from(c))
}

/// Collects the diagnostics of one text while it is read.
#[derive(Debug)]
pub(crate) struct Collector<'t> {
    file: &'t str,
    text: &'t str,
    found: Vec<(usize, Diagnostic)>,
}

impl<'t> Collector<'t> {
    pub(crate) fn new(file: &'t str, text: &'t str) -> Self {
        Collector { file, text, found: Vec::new() }
    }

    /// Notes an error at a byte range of the text.
    pub(crate) fn error(&mut self, span: Range<usize>, message: impl Into<String>) {
        let start = span.start.min(self.text.len());
        let before = self.text.get(..start).unwrap_or("");
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        let d = Diagnostic { file: self.file.to_string(), line, column, message: message.into() };
        self.found.push((start, d));
    }

    /// The value if nothing was wrong, else everything that was, in the order of the file.
    pub(crate) fn finish<T>(mut self, value: Option<T>) -> Result<T, Diagnostics> {
        match value {
            Some(value) if self.found.is_empty() => Ok(value),
            _ => {
                self.found.sort_by_key(|(at, _)| *at);
                Err(Diagnostics(self.found.into_iter().map(|(_, d)| d).collect()))
            }
        }
    }
}
