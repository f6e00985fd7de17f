//! rosbag2 files of the storage `sqlite3` (`.db3`): the tables `topics` and `messages`.

use super::messages::Topics;
use super::sqlite::Database;
use super::table::Table;
use std::fs::File;
use std::io;

/// The topics of a bag, each a table.
pub(super) fn read(file: File, only: Option<&[String]>) -> io::Result<Vec<Table>> {
    let database = Database::open(file)?;
    let tables = database.tables()?;
    let root = |name: &str| {
        let found = tables.iter().find(|(table, _)| table == name).map(|(_, root)| *root);
        found
            .ok_or_else(|| io::Error::other(format!("an SQLite file without the table {name} is no rosbag2")))
    };
    let mut topics = Topics::of(only);
    database.scan(root("topics")?, &mut |row| {
        topics.add(row.int(0)?, &row.text(1)?, (&row.text(2)?, "", &[]), &row.text(3)?);
        Ok(())
    })?;
    database.scan(root("messages")?, &mut |row| {
        let topic = row.int(1)?;
        // A camera's pictures stay on the disk.
        let message = if topics.reads(topic) { row.blob(3)? } else { Vec::new() };
        topics.take(topic, row.int(2)?, &message);
        Ok(())
    })?;
    Ok(topics.tables())
}
