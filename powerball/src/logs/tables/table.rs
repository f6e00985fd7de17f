//! Named columns of numbers.

/// Who takes the rows of a file one after the other.
pub(crate) trait RowSink {
    /// The names of the columns, once and first.
    ///
    /// # Errors
    /// Why rows of these columns are of no use.
    fn begin(&mut self, names: &[String]) -> Result<(), super::LogError>;

    /// A row: its line in the file, from 1, and the number in a column, where there is one.
    fn row(&mut self, line: usize, number: &dyn Fn(usize) -> Option<f64>);
}

/// One stream of samples in a file: all lines of a CSV, the messages of one topic, the arrays of an archive.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// The topic; empty where a file has one table only.
    pub name: String,
    /// The type of its messages, or what its samples are called: "lines", "rows", "arrays".
    pub kind: String,
    /// Where each sample stands, from 1: its line, or its number among the messages.
    pub line: Vec<usize>,
    /// The columns, in the order in which their names came up.
    pub columns: Vec<Column>,
    /// When a message says that it was made, s; not a number where one does not say it.
    pub stamps: Vec<f64>,
    /// When it was received, s.
    pub received: Vec<f64>,
    /// Messages that could not be read, and why the first one could not.
    pub unreadable: Option<(usize, String)>,
}

/// One column of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name: `q1`, `position.shoulder_pan_joint`.
    pub name: String,
    /// One value a sample, not a number where there is none.
    pub values: Vec<f64>,
}

impl Table {
    pub(crate) fn new(name: impl Into<String>, kind: impl Into<String>) -> Table {
        Table { name: name.into(), kind: kind.into(), ..Table::default() }
    }

    /// The names of the columns.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.columns.iter().map(|c| c.name.clone()).collect()
    }

    /// The values of the column of a name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// Adds a message; its values may come in any order and may be of some columns only.
    #[cfg(any(feature = "mcap", feature = "rosbag"))]
    pub(crate) fn push(&mut self, received: f64, stamp: Option<f64>, values: &[(String, f64)]) {
        let row = self.line.len();
        self.line.push(row + 1);
        self.received.push(received);
        self.stamps.push(stamp.unwrap_or(f64::NAN));
        for (k, (name, value)) in values.iter().enumerate() {
            // Nearly every message has its values where the one before had them.
            let here = self.columns.get(k).is_some_and(|c| c.name == *name);
            let at = if here { Some(k) } else { self.columns.iter().position(|c| c.name == *name) };
            let at = at.unwrap_or_else(|| {
                self.columns.push(Column { name: name.clone(), values: Vec::new() });
                self.columns.len() - 1
            });
            let column = &mut self.columns[at].values;
            column.resize(row, f64::NAN);
            column.push(*value);
        }
    }

    /// Every column as long as there are samples.
    #[cfg(any(feature = "mcap", feature = "rosbag"))]
    pub(crate) fn fill(&mut self) {
        let rows = self.line.len();
        self.columns.iter_mut().for_each(|c| c.values.resize(rows, f64::NAN));
    }
}

impl RowSink for Table {
    fn begin(&mut self, names: &[String]) -> Result<(), super::LogError> {
        let column = |name: &String| Column { name: name.clone(), values: Vec::new() };
        self.columns = names.iter().map(column).collect();
        Ok(())
    }

    fn row(&mut self, line: usize, number: &dyn Fn(usize) -> Option<f64>) {
        self.line.push(line);
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.values.push(number(k).unwrap_or(f64::NAN));
        }
    }
}
