//! Named columns of numbers.

#[cfg(feature = "topics")]
use super::memory::few_columns;

/// Who takes the rows of a file one after the other.
pub(crate) trait RowSink {
    /// The names of the columns, once and first.
    ///
    /// # Errors
    /// Why rows of these columns are of no use.
    fn begin(&mut self, names: &[String]) -> Result<(), super::LogError>;

    /// Announces about `rows` rows: memory for them is allocated at once, if there is enough.
    fn expect(&mut self, rows: usize);

    /// How many numbers are kept of a row, its line among them.
    fn kept(&self) -> usize;

    /// A row: its line in the file, from 1, and the number in a column, where there is one.
    fn row(&mut self, line: usize, number: &dyn Fn(usize) -> Option<f64>);
}

/// Allocates memory for `more` further values at once, so that no second copy is needed; a file that claims
/// more than the available memory gets none.
pub(crate) fn make_room<T>(values: &mut Vec<T>, more: usize) {
    let _ = values.try_reserve_exact(more);
}

/// One stream of samples in a file: all lines of a CSV, the messages of one topic, the arrays of an archive.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// The topic; empty where a file has one table only.
    pub name: String,
    /// The type of its messages, or what its samples are called: "lines", "rows", "arrays".
    pub kind: String,
    /// The position of each sample in the file, from 1: its line, or its number among the messages.
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
    /// The column's name: `q1`, `position.shoulder_pan_joint`.
    pub name: String,
    /// One value per sample; NaN if there is none.
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

    /// About how many numbers it holds.
    #[cfg(feature = "topics")]
    pub(super) fn numbers(&self) -> usize {
        self.line.len() * (3 + self.columns.len())
    }

    /// Begins a message that was received at a time, s; of about `expected` in all.
    #[cfg(feature = "topics")]
    pub(super) fn begin_row(&mut self, received: f64, expected: usize) -> Row<'_> {
        if self.line.is_empty() {
            make_room(&mut self.line, expected);
            make_room(&mut self.received, expected);
            make_room(&mut self.stamps, expected);
        }
        let row = self.line.len();
        self.line.push(row + 1);
        self.received.push(received);
        self.stamps.push(f64::NAN);
        let known = self.columns.len();
        Row { table: self, row, known, next: 0, name: String::new(), expected, refused: None }
    }

    /// Every column as long as there are samples.
    #[cfg(feature = "topics")]
    pub(crate) fn fill(&mut self) {
        let rows = self.line.len();
        self.columns.iter_mut().for_each(|c| c.values.resize(rows, f64::NAN));
    }
}

/// A message of a topic while it is read; its values may come in any order and may be of some columns only.
#[cfg(feature = "topics")]
pub(super) struct Row<'t> {
    table: &'t mut Table,
    row: usize,
    /// How many columns there were before it.
    known: usize,
    /// The column after the last one: nearly every message has its values where the one before had them.
    next: usize,
    /// The name of a value.
    name: String,
    /// How many messages are expected.
    expected: usize,
    /// Why there is no place for one of its values.
    refused: Option<String>,
}

#[cfg(feature = "topics")]
impl Row<'_> {
    /// A value whose name is these pieces.
    pub(super) fn put(&mut self, pieces: &[&str], value: f64) {
        if self.refused.is_some() {
            return;
        }
        let (columns, name) = (&mut self.table.columns, &mut self.name);
        name.clear();
        pieces.iter().for_each(|piece| name.push_str(piece));
        let here = columns.get(self.next).is_some_and(|c| c.name == *name);
        let at = if here { Some(self.next) } else { columns.iter().position(|c| c.name == *name) };
        if at.is_none() {
            self.refused = few_columns(columns.len() + 1).err();
            if self.refused.is_some() {
                return;
            }
        }
        let at = at.unwrap_or_else(|| {
            let mut values = Vec::new();
            make_room(&mut values, self.expected);
            columns.push(Column { name: name.clone(), values });
            columns.len() - 1
        });
        let column = &mut columns[at].values;
        column.resize(self.row, f64::NAN);
        column.push(value);
        self.next = at + 1;
    }

    /// Ends the message with its time stamp, s. One that could not be read keeps its number and has no value.
    pub(super) fn end(self, done: Result<Option<f64>, String>) {
        let table = self.table;
        match self.refused.map_or(done, Err) {
            Ok(stamp) => table.stamps[self.row] = stamp.unwrap_or(f64::NAN),
            Err(reason) => {
                table.columns.truncate(self.known);
                table.columns.iter_mut().for_each(|c| c.values.truncate(self.row));
                table.unreadable.get_or_insert((0, reason)).0 += 1;
            }
        }
    }
}

impl RowSink for Table {
    fn begin(&mut self, names: &[String]) -> Result<(), super::LogError> {
        let column = |name: &String| Column { name: name.clone(), values: Vec::new() };
        self.columns = names.iter().map(column).collect();
        Ok(())
    }

    fn expect(&mut self, rows: usize) {
        make_room(&mut self.line, rows);
        self.columns.iter_mut().for_each(|column| make_room(&mut column.values, rows));
    }

    fn kept(&self) -> usize {
        1 + self.columns.len()
    }

    fn row(&mut self, line: usize, number: &dyn Fn(usize) -> Option<f64>) {
        self.line.push(line);
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.values.push(number(k).unwrap_or(f64::NAN));
        }
    }
}
