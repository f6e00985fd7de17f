//! rosbag2 files of the storage `sqlite3` (`.db3`): the tables `topics` and `messages`.
//!
//! A bag whose program crashed has its last messages in a file next to it that ends in `-wal`, or half a
//! transaction to take back in one that ends in `-journal`. SQLite brings both in order by writing into them,
//! so it is given copies; any other bag is opened for reading alone, without a lock. Either way nothing in
//! the bag's folder is written or left behind.

use super::messages::Topics;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Reads the topics of a bag; returns a note about its fault.
pub(super) fn read(path: &Path, topics: &mut Topics) -> io::Result<Vec<String>> {
    let bag = opened(path)?;
    // Of a file that was cut off, what is left is read.
    bag.database.pragma_update(None, "writable_schema", true).map_err(failed)?;
    bag.read(topics)
}

/// An open bag, and the folder with its copy, which goes when it is closed.
struct Bag {
    database: Connection,
    _copy: Option<tempfile::TempDir>,
}

fn opened(path: &Path) -> io::Result<Bag> {
    let waiting = ["-wal", "-journal"].map(|ending| with_ending(path, ending));
    let there = |file: &PathBuf| std::fs::metadata(file).is_ok_and(|m| m.len() > 0);
    if !waiting.iter().any(there) {
        // A file that no program writes needs no lock, and neither does a folder without write permission.
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
        let database = Connection::open_with_flags(uri(path)?, flags).map_err(failed)?;
        return Ok(Bag { database, _copy: None });
    }
    let folder = tempfile::tempdir()?;
    let copy = folder.path().join("bag.db3");
    std::fs::copy(path, &copy)?;
    for (from, ending) in waiting.iter().zip(["-wal", "-journal"]).filter(|(from, _)| there(from)) {
        std::fs::copy(from, with_ending(&copy, ending))?;
    }
    let database = Connection::open(&copy).map_err(failed)?;
    Ok(Bag { database, _copy: Some(folder) })
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// The URI by which SQLite opens a file that does not change.
fn uri(path: &Path) -> io::Result<String> {
    let path = std::path::absolute(path)?;
    let path = path.to_str().ok_or_else(|| io::Error::other("its path is not Unicode: rename it"))?;
    let escaped = path.replace('%', "%25").replace('?', "%3f").replace('#', "%23").replace('\\', "/");
    let root = if escaped.starts_with('/') { "" } else { "/" };
    Ok(format!("file:{root}{escaped}?immutable=1"))
}

impl Bag {
    fn read(&self, topics: &mut Topics) -> io::Result<Vec<String>> {
        self.topics(topics).map_err(failed)?;
        let mut messages = 0u64;
        match self.messages(topics, &mut messages) {
            Ok(()) => Ok(Vec::new()),
            Err(e) if messages > 0 => Ok(vec![format!(
                "it is damaged after message {messages} ({e}): it was read up to there; `sqlite3 FILE \
                .recover` may find more"
            )]),
            Err(e) => Err(failed(e)),
        }
    }

    fn topics(&self, topics: &mut Topics) -> rusqlite::Result<()> {
        let definitions = self.definitions();
        let mut statement =
            self.database.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let (name, kind, encoding): (String, String, String) = (row.get(1)?, row.get(2)?, row.get(3)?);
            let definition = definitions.get(&kind);
            let (language, text) = definition.map_or(("", ""), |(language, text)| (language, text));
            topics.add(row.get(0)?, &name, (&kind, language, text.as_bytes()), &encoding);
        }
        Ok(())
    }

    /// The language and the text of what each type is made of, which bags have since ROS 2 Iron.
    fn definitions(&self) -> HashMap<String, (String, String)> {
        let text = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions";
        let Ok(mut statement) = self.database.prepare(text) else { return HashMap::new() };
        let read = statement.query_map([], |row| Ok((row.get(0)?, (row.get(1)?, row.get(2)?))));
        read.map(|rows| rows.flatten().collect()).unwrap_or_default()
    }

    fn messages(&self, topics: &mut Topics, taken: &mut u64) -> rusqlite::Result<()> {
        // A camera's pictures stay on the disk.
        let read = topics.ids_read().map(|id| id.to_string()).collect::<Vec<_>>().join(",");
        let text = format!(
            "SELECT topic_id, timestamp, CASE WHEN topic_id IN ({read}) THEN data END FROM messages ORDER BY \
            id"
        );
        let mut statement = self.database.prepare(&text)?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let message = row.get_ref(2)?.as_bytes_or_null()?.unwrap_or_default();
            topics.take(row.get(0)?, row.get(1)?, message);
            *taken += 1;
        }
        Ok(())
    }
}

fn failed(error: rusqlite::Error) -> io::Error {
    let text = error.to_string();
    if let Some((_, table)) = text.split_once("no such table: ") {
        let table = table.split_whitespace().next().unwrap_or_default();
        return io::Error::other(format!("an SQLite file without the table {table} is not a rosbag2"));
    }
    match error.sqlite_error_code() {
        Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => io::Error::other(format!(
            "the SQLite file is torn ({text}): `sqlite3 FILE .recover` may find what is left"
        )),
        _ => io::Error::other(text),
    }
}
