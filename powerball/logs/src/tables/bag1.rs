//! Bags of ROS 1 (`.bag`, version 2.0), their chunks stored or compressed by LZ4 or bzip2.

use super::messages::Topics;
use rosbag::{ChunkRecord, Error, IndexRecord, MessageRecord, RosBag};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// The first bytes of a bag.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// The first record of a bag fills this many bytes.
const HEAD: u64 = 4096;

/// Reads the topics of a bag; returns a note about its fault.
pub(super) fn read(path: &Path, topics: &mut Topics) -> io::Result<Vec<String>> {
    has_index(path)?;
    topics.holds(largest_chunk(path)?).map_err(io::Error::other)?;
    let bag = RosBag::new(path)?;
    for record in bag.index_records() {
        if let IndexRecord::Connection(of) = record.map_err(torn)? {
            let definition = (of.tp, "ros1msg", of.message_definition.as_bytes());
            topics.add(i64::from(of.id), of.storage_topic, definition, "ros1");
        }
    }
    let (mut chunks, mut lost, mut first) = (0, 0, None);
    for record in bag.chunk_records() {
        let taken = match record {
            Ok(ChunkRecord::Chunk(chunk)) => {
                chunks += 1;
                chunk.messages().try_for_each(|message| take(message?, topics))
            }
            Ok(ChunkRecord::IndexData(_)) => Ok(()),
            // Where a record's length is wrong, nothing after it can be found.
            Err(error @ (Error::OutOfBounds | Error::InvalidRecord | Error::InvalidHeader)) if lost > 0 => {
                first.get_or_insert(error);
                lost += 1;
                break;
            }
            Err(error) => {
                chunks += 1;
                Err(error)
            }
        };
        if let Err(error) = taken {
            lost += 1;
            first.get_or_insert(error);
        }
    }
    let message = first.map(|error| {
        format!(
            "{lost} of {chunks} chunks are damaged (the first: {error}): their messages are lost, the \
            others were read"
        )
    });
    Ok(message.into_iter().collect())
}

fn take(record: MessageRecord<'_>, topics: &mut Topics) -> Result<(), Error> {
    if let MessageRecord::MessageData(message) = record {
        topics.take(i64::from(message.conn_id), message.time as i64, message.data);
    }
    Ok(())
}

/// The crate panics where the index is not within the file.
fn has_index(path: &Path) -> io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut head = Vec::new();
    (&mut file).take(HEAD).read_to_end(&mut head)?;
    let field = b"index_pos=";
    let at = head.windows(field.len()).position(|w| w == field).map(|at| at + field.len());
    let position = at.and_then(|at| head.get(at..at + 8)?.try_into().ok()).map(u64::from_le_bytes);
    let start = MAGIC.len() as u64 + HEAD;
    match position {
        Some(0) => Err(io::Error::other("was not closed and has no index: `rosbag reindex FILE` makes one")),
        Some(position) if (start..=length).contains(&position) => Ok(()),
        Some(_) => {
            Err(io::Error::other("ends before its index: it was not copied whole; `rosbag reindex FILE`"))
        }
        None => Err(io::Error::other("its head is torn")),
    }
}

/// The unpacked size that the largest of a bag's chunks states, bytes; this memory is allocated. A truncated
/// bag ends early.
fn largest_chunk(path: &Path) -> io::Result<u64> {
    let mut file = BufReader::new(File::open(path)?);
    file.seek_relative(MAGIC.len() as i64)?;
    let mut largest = 0;
    loop {
        let Ok(length) = u32_of(&mut file) else { return Ok(largest) };
        let mut head = Vec::new();
        (&mut file).take(u64::from(length)).read_to_end(&mut head)?;
        // The fields of a head: their length, then name=value.
        let (mut rest, mut chunk, mut size) = (head.as_slice(), false, 0);
        while let Some((length, after)) = rest.split_first_chunk::<4>() {
            let Some((field, after)) = after.split_at_checked(u32::from_le_bytes(*length) as usize) else {
                break;
            };
            rest = after;
            chunk |= field == b"op=\x05";
            let number = field.strip_prefix(b"size=").and_then(|number| number.try_into().ok());
            size = number.map_or(size, u32::from_le_bytes);
        }
        if chunk {
            largest = largest.max(u64::from(size));
        }
        let Ok(length) = u32_of(&mut file) else { return Ok(largest) };
        file.seek_relative(i64::from(length))?;
    }
}

fn u32_of(file: &mut impl Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    file.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

fn torn(error: Error) -> io::Error {
    io::Error::other(format!("its index is torn ({error}): `rosbag reindex FILE`"))
}
